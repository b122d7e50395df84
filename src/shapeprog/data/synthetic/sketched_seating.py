"""Sketches of chairs, stools, benches and sofas."""

from __future__ import annotations

from shapeprog.data.synthetic.sketch import Point, Sketch, Span, between, tidy


def chair(s: Sketch) -> None:
    """Chairs: a seat on four legs that stand or splay, a back that leans, some with arm rests."""
    half, deep = s.cm(19, 25), s.cm(19, 24)
    top, thick = s.cm(42, 47), s.cm(2.5, 5)
    height = tidy(top + s.cm(36, 50))
    seat = (tidy(top - thick), top)
    if s.chance(0.3):
        s.box("cushion", seat, (-deep, deep), (-half, half), solid="cushion", more=[thick / 2])
    else:
        s.box("seat", seat, (-deep, deep), (-half, half))
    square = s.chance(0.4)
    if square:
        _rising_frame(s, seat, half, deep, height)
        return
    foot, head = _four_legs(s, seat, half, deep)
    if s.chance(0.4):
        _stretchers(s, foot, head)
    _leaning_back(s, seat, half, deep, height)
    if s.chance(0.35):
        _arms(s, seat, half, deep)


def stool(s: Sketch) -> None:
    """Stools: a round or square seat on three or four splayed legs, or on a column."""
    height, thick, radius = s.cm(42, 76), s.cm(2.5, 5), s.cm(14, 20)
    seat = (tidy(height - thick), height)
    round_seat = s.chance(0.6)
    if round_seat:
        s.add("seat", "cylinder", (seat[0], 0, 0), thick, radius)
    else:
        s.box("seat", seat, (-radius, radius), (-radius, radius))
    kind = s.pick("three", "four", "four", "column")
    if kind == "column":
        base, plate, bore = s.cm(1.5, 3), tidy(radius * s.any(0.9, 1.2)), s.cm(1.8, 3.5)
        s.add("base", "cylinder", (0, 0, 0), base, plate)
        s.add("pedestal", "cylinder", (base, 0, 0), seat[0] - base, bore)
        return
    thin, wide = s.cm(1.1, 1.6), s.cm(1.8, 2.6)
    up = tidy(seat[0] + 0.5 * thick)
    if kind == "three" and round_seat:
        foot, head = (0.0, tidy(radius * s.any(0.95, 1.25)), 0.0), (up, tidy(radius * 0.6), 0.0)
        s.stick("leg", "taper", foot, head, (thin, wide), thick=2 * thin, turns=3)
        return
    spread, inset = tidy(radius * s.any(0.75, 1.05)), tidy(radius * (0.55 if round_seat else 0.75))
    foot, head = (0.0, spread, spread), (up, inset, inset)
    s.stick("leg", "taper", foot, head, (thin, wide), thick=2 * thin, mirror="side depth")
    if height > s.cm(55) or s.chance(0.4):
        a = between(foot, head, tidy(height * s.any(0.25, 0.45)))
        s.add("stretcher", "rod", (a[0], -a[1], a[2]), a, thin, mirror="side")
        b = between(foot, head, tidy(height * s.any(0.25, 0.45)))
        s.add("stretcher", "rod", (b[0], b[1], -b[2]), b, thin, mirror="depth")


def bench(s: Sketch) -> None:
    """Benches: a board, planks or a padded seat on legs, frames or panels, some with a back of planks."""
    half, deep, top = s.cm(50, 90), s.cm(16, 26), s.cm(42, 47)
    thick = s.cm(2.5, 5)
    seat = (tidy(top - thick), top)
    planks = s.whole(3, 5) if s.chance(0.45) else 1
    pitch = tidy(2 * deep / planks)
    gap = s.cm(1, 2) if planks > 1 else 0.0
    first = (-deep, tidy(pitch - gap - deep))
    s.box("seat", seat, first, (-half, half), count=planks, depth_step=pitch)
    end = tidy(half - s.cm(8, 22))
    kind = s.pick("splayed", "frame", "panel") if planks == 1 else s.pick("frame", "panel")
    front, rear = tidy(s.cm(3) - deep), tidy(first[1] - first[0] - deep + pitch * (planks - 1) - s.cm(3))
    if kind == "splayed":
        thin, wide = s.cm(1.4, 2), s.cm(2.2, 3.2)
        foot, head = (0.0, deep, tidy(end + s.cm(3, 8))), (tidy(seat[0] + thick / 2), tidy(deep - s.cm(5, 8)), end)
        s.stick("leg", "taper", foot, head, (thin, wide), thick=2 * thin, mirror="side depth")
        return
    wide = s.cm(3, 6)
    if kind == "panel":
        s.box("leg", (0, seat[0]), (front, rear), (end, end + wide), mirror="side")
    else:
        beam = s.cm(4, 7)
        s.box("apron", (seat[0] - beam, seat[0]), (front, rear), (end, end + wide), mirror="side")
        foot = (0.0, front, tidy(end + wide / 2))
        middle = tidy((front + rear) / 2 - s.cm(2, 5))
        head = (tidy(seat[0] - beam / 2), middle, foot[2])
        s.stick("leg", "bar", foot, head, (wide, wide), thick=wide, mirror="side")
        rear_foot: Point = (0.0, rear, foot[2])
        s.stick(
            "leg", "bar", rear_foot, (head[0], front + rear - middle, foot[2]), (wide, wide), thick=wide, mirror="side"
        )
    if s.chance(0.6):
        tilt, tall = s.any(6, 14), s.cm(30, 42)
        board, post = s.cm(6, 11), s.cm(3, 5)
        rise = tidy(tall - board)
        start: Point = (tidy(top - thick / 2), tidy(rear - post), tidy(end + wide / 2))
        lean = tidy(rise * tilt / 60)
        s.add("post", "bar", start, (top + tall, start[1] + lean, start[2]), (post, wide), mirror="side")
        for share in (0.45, 0.95):
            at = between(start, (tidy(top + tall), tidy(start[1] + lean), start[2]), tidy(top + share * rise))
            s.add("rail", "board", (at[0], at[1] - post / 2 - s.cm(1), -half), (board, s.cm(2.2), 2 * half), tilt)


def sofa(s: Sketch) -> None:
    """Sofas and arm chairs: a body with cushions, arm rests and a back, on short feet."""
    seats = s.whole(1, 3)
    arm, deep = s.cm(9, 20), s.cm(38, 46)
    inner = tidy(seats * s.cm(28, 34))
    half = tidy(inner + arm)
    feet, body, cushion = s.cm(6, 15), s.cm(12, 18), s.cm(10, 15)
    floor = tidy(feet + body)
    back = s.cm(14, 20)
    rear = tidy(deep - back)
    s.box("base", (feet, floor), (-deep, deep), (-inner, inner))
    seat_width = tidy(2 * inner / seats)
    s.box(
        "cushion", (floor, floor + cushion), (-deep, rear), (-inner, seat_width - inner),
        solid="cushion", more=[s.cm(2.5, 4.5)], count=seats, side_step=seat_width,
    )  # fmt: skip
    high = tidy(floor + cushion + s.cm(30, 42))
    s.box("back", (feet, high), (rear, deep), (-half, half), solid="cushion", more=[s.cm(1.5, 4)])
    if seats > 1 and s.chance(0.5):
        low = tidy(floor + cushion)
        s.box(
            "pillow", (low, low + s.cm(24, 29)), (rear - s.cm(9, 12), rear), (-inner, seat_width - inner),
            solid="cushion", more=[s.cm(2.5, 4)], count=seats, side_step=seat_width,
        )  # fmt: skip
    arm_top = tidy(floor + cushion + s.cm(10, 18))
    s.box(
        "arm",
        (feet, arm_top),
        (-deep, rear),
        (inner, half),
        solid=s.pick("cushion", "cushion"),
        more=[s.cm(1.5, 4)],
        mirror="side",
    )
    wide = s.cm(1.8, 3)
    start = (0.0, tidy(deep - s.cm(3, 5)), tidy(half - s.cm(3, 5)))
    head = (tidy(feet + s.cm(1)), tidy(deep - s.cm(7)), tidy(half - s.cm(7)))
    if s.chance(0.6):
        s.stick("foot", "taper", start, head, (0.6 * wide, wide), thick=1.2 * wide, mirror="side depth")
    else:
        s.add("foot", "cylinder", (0, head[1], head[2]), feet, wide, mirror="side depth")


def _four_legs(s: Sketch, seat: Span, half: float, deep: float) -> tuple[Point, Point]:
    """Four splayed legs, tapered or square; the foot and the head of one at the rear."""
    out, back = s.cm(0, 5), s.cm(1, 7)
    inset = s.cm(3.5, 6)
    foot = (0.0, tidy(deep - inset + back), tidy(half - inset + out))
    head = (tidy((seat[0] + seat[1]) / 2), tidy(deep - inset), tidy(half - inset))
    wide = s.cm(1.6, 2.4)
    if s.chance(0.65):
        thin = tidy(wide * s.any(0.55, 0.8))
        s.stick("leg", "taper", foot, head, (thin, wide), thick=2 * thin, mirror="side depth")
    else:
        s.stick("leg", "bar", foot, head, (2 * wide, 1.6 * wide), thick=2 * wide, mirror="side depth")
    return foot, head


def _stretchers(s: Sketch, foot: Point, head: Point) -> None:
    a = between(foot, head, tidy(head[0] * s.any(0.3, 0.5)))
    radius = s.cm(0.9, 1.3)
    s.add("stretcher", "rod", (a[0], -a[1], a[2]), a, radius, mirror="side")
    if s.chance(0.6):
        s.add("stretcher", "rod", (a[0], 0, -a[2]), (a[0], 0, a[2]), radius)


def _leaning_back(s: Sketch, seat: Span, half: float, deep: float, height: float) -> None:
    """A back of one board, of slats, of spindles under a rail, or of a bent hoop."""
    tilt, thick = s.any(6, 14), s.cm(1.8, 3)
    kind = s.pick("board", "posts", "spindles", "hoop")
    middle = tidy((seat[0] + seat[1]) / 2)
    run = tidy((height - middle) * tilt / 57)
    side = tidy(half - s.cm(3, 5))
    start: Point = (middle, tidy(deep - s.cm(3, 4)), side)
    head: Point = (height, tidy(start[1] + run), side)
    if kind == "board":
        s.add("back", "board", (seat[1] - s.cm(1), start[1], -side), (height - seat[1], thick, 2 * side), tilt)
        return
    radius = s.cm(1, 1.6)
    if kind == "hoop":
        top: Point = (tidy(height + s.cm(4, 8)), tidy(head[1] + 0.1 * run), 0.0)
        s.add("back", "bent_rod", start, top, (*start[:2], -side), radius)
        s.add("slat", "bar", (*start[:2], 0.0), top, (radius, s.cm(7, 12)))
        return
    s.add("post", "rod", start, head, radius, mirror="side")
    if kind == "posts":
        rails, tall = s.whole(2, 3), s.cm(5, 9)
        low = tidy(seat[1] + s.cm(9, 13))
        pitch = tidy((height - tall - low) / (rails - 1))
        at = between(start, head, low)
        step = tidy(pitch * (head[1] - start[1]) / (head[0] - start[0]))
        s.add(
            "slat" if rails > 2 else "rail", "board", (low, at[1] - thick / 2, -side), (tall, thick, 2 * side),
            tilt, count=rails, up_step=pitch, depth_step=step,
        )  # fmt: skip
        return
    rail, spindles = s.cm(5, 8), s.whole(4, 6)
    at = between(start, head, tidy(height - rail))
    s.add("rail", "board", (at[0], at[1] - thick / 2, -half), (rail, thick, 2 * half), tilt)
    inner = tidy(0.7 * side)
    end: Point = (tidy(at[0] + rail / 2), tidy(at[1] + 0.5 * rail * tilt / 57), -inner)
    s.add(
        "slat",
        "rod",
        (middle, start[1], -inner),
        end,
        s.cm(0.6, 0.9),
        count=spindles,
        side_step=2 * inner / (spindles - 1),
    )


def _arms(s: Sketch, seat: Span, half: float, deep: float) -> None:
    """Arm rests on posts: straight bars, or rods that are bent."""
    high, radius = tidy(seat[1] + s.cm(18, 23)), s.cm(1.2, 1.8)
    side, front = tidy(half - s.cm(2, 3)), tidy(s.cm(4, 9) - deep)
    rear = tidy(deep - s.cm(0, 2))
    if s.chance(0.5):
        s.add(
            "arm",
            "bent_rod",
            (seat[0], front, side),
            (high + s.cm(2), (front + rear) / 2, side + s.cm(2, 4)),
            (seat[1] - 0.1, rear, side),
            radius,
            mirror="side",
        )
        return
    s.box(
        "arm",
        (high, high + s.cm(2, 3)),
        (front - s.cm(3), rear + s.cm(3, 4)),
        (side - radius, side + 2 * radius),
        mirror="side",
    )
    s.add("arm_post", "rod", (seat[0], front, side), (high, front, side), radius, mirror="side")


def _rising_frame(s: Sketch, seat: Span, half: float, deep: float, height: float) -> None:
    """Square legs, those at the rear going on as leaning posts with a back between them."""
    wide, run = s.cm(2.8, 4.5), s.cm(2, 8)
    side = (tidy(half - wide), half)
    s.box("leg", (0, seat[0]), (-deep, wide - deep), side, mirror="side")
    foot, knee = (
        (0.0, tidy(deep + wide / 2 + 0.4 * run), tidy(half - wide / 2)),
        (tidy((seat[0] + seat[1]) / 2), tidy(deep - wide / 2), tidy(half - wide / 2)),
    )
    s.stick("leg", "bar", foot, knee, (wide, wide), thick=wide, mirror="side")
    head = (height, tidy(knee[1] + run), knee[2])
    s.add("post", "bar", knee, head, (wide, wide), mirror="side")
    inner, thick = side[0], tidy(0.5 * wide)
    tilt = 57.3 * run / (height - knee[0])
    if s.chance(0.5):
        tall = s.cm(5, 8)
        at = between(knee, head, tidy(height - tall - s.cm(1, 3)))
        s.add("rail", "board", (at[0], at[1] - thick / 2, -side[1]), (tall, thick, 2 * half), tilt)
        slats, low = s.whole(3, 5), knee
        pitch = tidy(1.5 * inner / (slats - 1))
        end = (tidy(at[0] + tall / 2), tidy(at[1] + tall / 2 * run / (height - knee[0])), tidy(-0.75 * inner))
        s.add(
            "slat", "bar", (low[0], low[1], -0.75 * inner), end, (0.4 * thick, s.cm(2, 4)), count=slats, side_step=pitch
        )
    else:
        at = between(knee, head, tidy(seat[1] + s.cm(8, 14)))
        s.add(
            "back", "board", (at[0], at[1] - thick / 2, -side[1]), (height - at[0] - s.cm(0, 2), thick, 2 * half), tilt
        )
    apron = s.cm(4, 7)
    if s.chance(0.6):
        s.box("apron", (seat[0] - apron, seat[0]), (0.3 * wide - deep, 0.7 * wide - deep), (-side[0], side[0]))
    if s.chance(0.3):
        height = tidy(seat[0] * s.any(0.25, 0.5))
        behind = between(foot, knee, height)
        s.add("stretcher", "bar", (height, wide / 2 - deep, behind[2]), behind, (0.5 * wide, 0.5 * wide), mirror="side")
