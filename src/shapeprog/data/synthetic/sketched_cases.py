"""Sketches of tables, desks, cabinets, shelves and beds."""

from __future__ import annotations

from shapeprog.data.synthetic.sketch import Point, Sketch, between, tidy


def table(s: Sketch) -> None:
    """Tables: a round or rectangular top on legs, on trestles or on a column."""
    low = s.chance(0.35)
    height = s.cm(38, 48) if low else s.cm(72, 76)
    thick = s.cm(2, 4.5)
    under = tidy(height - thick)
    if s.chance(0.3):
        radius = s.cm(32, 48) if low else s.cm(40, 65)
        s.add("top", "cylinder", (under, 0, 0), thick, radius)
        if s.chance(0.45):
            _column(s, under, radius)
        else:
            _splayed(s, under, thick, tidy(0.62 * radius), tidy(0.62 * radius), turns=3 if s.chance(0.3) else 4)
        return
    half, deep = (s.cm(45, 65), s.cm(25, 35)) if low else (s.cm(60, 100), s.cm(36, 48))
    s.box("top", (under, height), (-deep, deep), (-half, half))
    kind = s.pick("splayed", "square", "square", "trestle")
    if kind == "splayed":
        _splayed(s, under, thick, tidy(deep - s.cm(7, 12)), tidy(half - s.cm(8, 16)))
        if low and s.chance(0.4):
            shelf = tidy(0.42 * under)
            s.box(
                "shelf", (shelf, shelf + s.cm(1.8)), (s.cm(5) - deep, deep - s.cm(5)), (s.cm(6) - half, half - s.cm(6))
            )
    elif kind == "square":
        _square(s, under, deep, half, low)
    else:
        _trestles(s, under, deep, half)


def desk(s: Sketch) -> None:
    """Desks: a top on splayed legs, or on legs at one end and drawers at the other."""
    half, deep, height, thick = s.cm(50, 75), s.cm(28, 38), s.cm(72, 76), s.cm(2, 4)
    under = tidy(height - thick)
    s.box("top", (under, height), (-deep, deep), (-half, half))
    wide = s.cm(34, 44)
    if s.chance(0.5):
        tall = s.cm(9, 13)
        low = tidy(under - tall)
        edge = s.cm(3, 5)
        s.box("body", (low, under), (edge - deep, deep - edge), (edge - half, half - edge))
        drawers = s.whole(2, 3)
        pitch = tidy((2 * half - 2 * edge) / drawers)
        gap = s.cm(0.6)
        s.box(
            "drawer", (low + gap, under - gap), (edge - deep - s.cm(1.6), edge - deep),
            (edge - half + gap, edge - half + pitch - gap), count=drawers, side_step=pitch,
        )  # fmt: skip
        _splayed(s, low, tall, tidy(deep - s.cm(8, 10)), tidy(half - s.cm(9, 14)))
        return
    left = (-half, tidy(wide - half))
    s.box("body", (0, under), (s.cm(3) - deep, deep), left)
    drawers = s.whole(3, 4)
    pitch = tidy((under - s.cm(4)) / drawers)
    gap = s.cm(0.8)
    s.box(
        "drawer", (s.cm(4) + gap, s.cm(4) + pitch - gap), (s.cm(1.2) - deep, s.cm(3) - deep),
        (left[0] + gap, left[1] - gap), count=drawers, up_step=pitch,
    )  # fmt: skip
    leg = s.cm(4, 6)
    if s.chance(0.5):
        s.box("leg", (0, under), (s.cm(2) - deep, deep - s.cm(2)), (half - leg, half))
    else:
        s.box("leg", (0, under), (deep - leg - s.cm(2), deep - s.cm(2)), (half - leg, half), mirror="depth")


def cabinet(s: Sketch) -> None:
    """Cabinets and sideboards: a case with doors or drawers in front, on feet, legs or a plinth."""
    half, deep = s.cm(30, 80), s.cm(18, 26)
    board, feet = s.cm(1.8, 3), s.cm(8, 20)
    height = tidy(feet + s.cm(45, 110))
    floor = tidy(feet + board)
    s.box("side", (feet, height), (-deep, deep), (half - board, half), mirror="side")
    inner = tidy(half - board)
    s.box("base", (feet, floor), (-deep, deep), (-inner, inner))
    s.box("top", (height - board, height), (-deep, deep), (-inner, inner))
    s.box("panel", (floor, height - board), (deep - s.cm(1), deep), (-inner, inner))
    gap, front = s.cm(0.4), s.cm(1.8)
    if s.chance(0.6):
        s.box("door", (floor, height - board), (-deep, front - deep), (gap, inner), mirror="side")
        middle = tidy((floor + height) / 2)
        grip = s.cm(5, 9)
        if s.chance(0.5):
            s.box("handle", (middle, middle + grip), (-deep - s.cm(2, 3), -deep), (s.cm(3), s.cm(4.4)), mirror="side")
        else:
            s.add(
                "handle",
                "rod",
                (middle, -deep - s.cm(2.5), s.cm(4)),
                (middle, -deep, s.cm(4)),
                s.cm(1, 1.5),
                mirror="side",
            )
    else:
        rows = s.whole(2, 4)
        pitch = tidy((height - board - floor) / rows)
        s.box(
            "drawer",
            (floor + gap, floor + pitch - gap),
            (-deep - s.cm(1), front - deep),
            (-inner, inner),
            count=rows,
            up_step=pitch,
        )
        at = tidy(floor + pitch / 2)
        grip = tidy(half * s.any(0.15, 0.3))
        s.add(
            "handle",
            "rod",
            (at, -deep - s.cm(1.8), -grip),
            (at, -deep - s.cm(1.8), grip),
            s.cm(0.9, 1.2),
            count=rows,
            up_step=pitch,
        )
    _feet(s, feet, half, deep)


def bookshelf(s: Sketch) -> None:
    """Book shelves: boards between sides or on posts, with or without a back."""
    half, deep, height = s.cm(25, 55), s.cm(12, 18), s.cm(90, 200)
    board = s.cm(1.8, 3)
    shelves = s.whole(3, 6)
    if s.chance(0.35):
        post = s.cm(2.5, 4)
        low = s.cm(8, 20)
        lean = s.cm(0, 2.4)
        foot, head = (
            (0.0, tidy(deep - post / 2 + lean), tidy(half - post / 2)),
            (height, tidy(deep - post / 2), tidy(half - post / 2)),
        )
        s.stick("post", "bar", foot, head, (post, post), thick=post if lean else 0.0, mirror="side depth")
        pitch = tidy((height - board - low) / (shelves - 1))
        s.box("shelf", (low, low + board), (-deep, deep), (-half, half), count=shelves, up_step=pitch)
        return
    inner = tidy(half - board)
    s.box("side", (0, height), (-deep, deep), (inner, half), mirror="side")
    low = s.cm(4, 9)
    pitch = tidy((height - board - low) / shelves)
    s.box("shelf", (low, low + board), (-deep, deep), (-inner, inner), count=shelves, up_step=pitch)
    s.box("top", (height - board, height), (-deep, deep), (-inner, inner))
    if s.chance(0.7):
        s.box("panel", (low, height), (deep, deep + s.cm(0.8)), (-half, half))


def bed(s: Sketch) -> None:
    """Beds: a mattress on a frame, a head board that may lean, pillows."""
    half, deep = s.cm(45, 90), s.cm(98, 104)
    legs, beam, thick = s.cm(12, 22), s.cm(10, 16), s.cm(2.5, 4)
    frame = tidy(legs + beam)
    s.box("side", (legs, frame), (-deep, deep), (half - thick, half), mirror="side")
    inner = tidy(half - thick)
    s.box("footboard", (legs, frame + s.cm(0, 20)), (-deep - thick, -deep), (-half, half))
    slats = tidy(frame - s.cm(4, 7))
    s.box("base", (slats - s.cm(2.5), slats), (-deep, deep), (-inner, inner))
    mattress = tidy(slats + s.cm(18, 24))
    s.box("mattress", (slats, mattress), (-deep, deep), (-inner, inner), solid="cushion", more=[s.cm(2, 5)])
    high = tidy(mattress + s.cm(30, 55))
    if s.chance(0.5):
        s.box("headboard", (0, high), (deep, deep + thick), (-half, half))
    else:
        s.add("headboard", "board", (legs, deep, -half), (high - legs, thick, 2 * half), s.any(5, 12))
        s.box("leg", (0, legs), (deep, deep + thick), (half - 2 * thick, half), mirror="side")
    wide = s.cm(2.5, 4)
    s.add(
        "foot",
        "taper",
        (0, wide - deep, half - wide),
        (legs + thick, wide - deep, half - wide),
        (0.6 * wide, wide),
        mirror="side",
    )
    if s.chance(0.7):
        pillows = 2 if half > s.cm(60) else 1
        pillow_width = tidy(2 * inner / pillows)
        edge = s.cm(4, 7)
        s.box(
            "pillow", (mattress - s.cm(1), mattress + s.cm(9, 13)), (deep - s.cm(38, 45), deep - s.cm(2)),
            (edge - inner, pillow_width - edge - inner), solid="cushion", more=[s.cm(3.5, 4.4)],
            count=pillows, side_step=pillow_width,
        )  # fmt: skip


def _splayed(s: Sketch, under: float, thick: float, deep: float, half: float, turns: int = 0) -> None:
    """Splayed legs, tapered or square, that end inside the part above."""
    wide = s.cm(2, 3.2)
    out = tidy(under * s.any(0.05, 0.22))
    up = tidy(under + min(thick / 2, wide))
    if turns == 3:
        foot: Point = (0.0, tidy(1.2 * deep + out), 0.0)
        s.stick("leg", "taper", foot, (up, deep, 0.0), (0.6 * wide, wide), thick=1.2 * wide, turns=3)
        return
    foot, head = (0.0, tidy(deep + out), tidy(half + out)), (up, deep, half)
    if s.chance(0.7):
        thin = tidy(wide * s.any(0.55, 0.8))
        s.stick("leg", "taper", foot, head, (thin, wide), thick=2 * thin, mirror="side depth")
    else:
        s.stick("leg", "bar", foot, head, (2 * wide, 1.5 * wide), thick=2 * wide, mirror="side depth")


def _column(s: Sketch, under: float, radius: float) -> None:
    """A column on a round plate, or on feet that slope down from it."""
    bore = s.cm(3, 6)
    if s.chance(0.5):
        plate = s.cm(1.5, 3)
        s.add("base", "cylinder", (0, 0, 0), plate, radius * s.any(0.5, 0.65))
        s.add("pedestal", "taper", (plate, 0, 0), (under, 0, 0), (bore, bore * s.any(0.55, 1)))
        return
    low, wide = s.cm(10, 16), s.cm(3, 4)
    s.add("pedestal", "cylinder", (low, 0, 0), under - low, bore)
    foot = (0.0, tidy(radius * s.any(0.55, 0.75)), 0.0)
    s.stick("base", "bar", foot, (low + bore, 0.0, 0.0), (wide, wide), thick=wide, turns=s.whole(3, 4))


def _square(s: Sketch, under: float, deep: float, half: float, low: bool) -> None:
    """Upright square legs at the corners, with beams under the edge or between them."""
    leg, inset = s.cm(4, 8), s.cm(0, 6)
    d, w = tidy(deep - inset), tidy(half - inset)
    s.box("leg", (0, under), (d - leg, d), (w - leg, w), mirror="side depth")
    if s.chance(0.6):
        beam, thin = s.cm(6, 10), tidy(0.4 * leg)
        s.box("apron", (under - beam, under), (d - thin - 0.3 * leg, d - 0.3 * leg), (leg - w, w - leg), mirror="depth")
        s.box("apron", (under - beam, under), (leg - d, d - leg), (w - thin - 0.3 * leg, w - 0.3 * leg), mirror="side")
    if low and s.chance(0.5):
        shelf = tidy(under * s.any(0.25, 0.45))
        s.box("shelf", (shelf, shelf + s.cm(2)), (0.5 * leg - d, d - 0.5 * leg), (0.5 * leg - w, w - 0.5 * leg))


def _trestles(s: Sketch, under: float, deep: float, half: float) -> None:
    """A pair of legs that meet under the top at either end, a beam between them, and braces."""
    wide, end = s.cm(4, 6), tidy(half - s.cm(15, 25))
    foot, head = (0.0, tidy(deep - s.cm(4, 8)), end), (tidy(under + s.cm(1)), tidy(0.3 * deep), end)
    s.stick("leg", "bar", foot, head, (wide, wide), thick=wide, mirror="side depth")
    at = between(foot, head, tidy(under * s.any(0.3, 0.5)))
    s.add("stretcher", "bar", (at[0], -at[1], end), (at[0], at[1], end), (wide, 0.6 * wide), mirror="side")
    s.add("stretcher", "bar", (at[0], 0, -end), (at[0], 0, end), (wide, 0.6 * wide))
    if s.chance(0.5):
        run = tidy(0.75 * (under - at[0]))
        s.add("brace", "bar", (at[0], 0, end - run), (under, 0, 0.15 * end), (0.6 * wide, 0.6 * wide), mirror="side")


def _feet(s: Sketch, feet: float, half: float, deep: float) -> None:
    """The base of a case: tapered legs, splayed or upright, round feet, or a plinth."""
    kind = s.pick("splayed", "splayed", "round", "plinth")
    if kind == "plinth":
        s.box("base", (0, feet), (s.cm(3, 5) - deep, deep - s.cm(1)), (s.cm(2, 4) - half, half - s.cm(3)))
        return
    wide = s.cm(1.8, 2.8)
    d, w = tidy(deep - s.cm(4, 6)), tidy(half - s.cm(5, 9))
    if kind == "round":
        s.add("foot", "cylinder", (0, d, w), feet, wide, mirror="side depth")
        return
    out = tidy(feet * s.any(0.1, 0.3))
    thin = tidy(0.65 * wide)
    foot, head = (0.0, tidy(d + out), tidy(w + out)), (tidy(feet + s.cm(0.9)), d, w)
    s.stick("leg", "taper", foot, head, (thin, wide), thick=2 * thin, mirror="side depth")
