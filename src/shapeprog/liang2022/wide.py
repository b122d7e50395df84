"""Synthetic furniture of many kinds: seating, tables, desks, cases, sofas and beds, with small parts beyond these."""

from __future__ import annotations

from functools import partial

from shapeprog.liang2022.draft import Draft, Repeat, Rng, Template, Triple
from shapeprog.space import SPAN

SMALL, THIN = {1: 0.4, 2: 0.45, 3: 0.15}, {1: 0.7, 2: 0.3}
"""Thicknesses in cells with their weights: of legs and panels, and of boards."""


def seating(rng: Rng, draft: Draft, kind: str) -> None:
    """Benches, chairs and stools: a seat on supports, some with back and arms."""
    long, backed = kind == "bench", kind == "chair" or (kind == "bench" and rng.chance(0.62))
    arms = rng.pick({"": 0.58, "panels": 0.14, "outside": 0.1, "inside": 0.18}) if kind != "stool" else ""
    tilt = rng.pick({0: 0.5, 1: 0.1, 2: 0.2, 3: 0.08, 4: 0.09, 6: 0.03}) if backed else 0
    if long:
        up, depth = (rng.even(8, 18), rng.even(6, 14)) if backed else (rng.even(4, 14), rng.even(4, 12))
        extents, share = (up, depth, SPAN), rng.uniform(0.3, 0.6) if backed else rng.uniform(0.5, 0.8)
    else:
        depth, side = rng.even(12, 20), rng.even(10, 20)
        extents = (SPAN, depth, side) if backed else (rng.even(18, 24), side, side)
        share = rng.uniform(0.35, 0.55)
    (floor, front, left_edge), (up, depth, side) = room(rng, *extents)
    top = max(3, round(up * share)) if backed or arms else up
    tilt = min(tilt, depth // 3)
    thick, arm, length = min(rng.pick(SMALL), top - 2), rng.pick(THIN), depth - tilt
    wide, under = side - 2 * arm if arms in ("panels", "outside") else side, top - thick
    low, share = (floor + under, front, -wide // 2), 0.35 if long else 0.12
    corner = wide // 6 if _top(rng, draft, low, (thick, length, wide), share) else 0  # a circle has no corners for legs
    rise, inset = up if tilt == 0 and backed and rng.chance(0.25) else 0, corner or max(rng.whole(-4, 3), 0)
    low, size = (floor, front + corner, inset - wide // 2), (under, length - 2 * corner, wide - 2 * inset)
    weights = {"legs": 0.6, "panels": 0.14, "trestles": 0.08, "body": 0.12, "column": 0 if long else 0.18}
    risers = arms != "panels" and _supports(rng, draft, low, size, weights, rise) == "legs" and rise > 0
    if backed:
        _back(rng, draft, (floor + top, -front, -wide // 2), up - top, wide, tilt, risers)
    above = min(max(up - top, 2), rng.whole(3, 7))
    if arms == "panels":
        draft.box("side", (floor, front, left_edge), (top + above, length, arm), sides=True)
    elif arms:
        bar, bottom, rear = rng.pick(THIN), 0 if arms == "outside" else top, None if backed else front + length
        draft.box("chair_beam", (floor + top + above - bar, front, left_edge), (bar, length, arm), sides=True)
        name, size = "chair_beam" if bottom else "leg", (top + above - bar - bottom, rng.whole(1, 2), arm)
        draft.box(name, (floor + bottom, front, left_edge), size, sides=True, rear=rear)


def table(rng: Rng, draft: Draft) -> None:
    """Tables: a top on legs, panels or a column, with shelves and drawers."""
    (floor, front, left_edge), (up, depth, side) = room(
        rng, rng.even(6, 22), rng.choice((SPAN, *range(8, 25, 2))), SPAN
    )
    thick = rng.pick(SMALL)
    under, inset = up - thick, min(rng.pick({0: 0.5, 1: 0.25, 2: 0.15, 3: 0.1}), depth // 4)
    circle = _top(rng, draft, (floor + under, front, left_edge), (thick, depth, side))
    inset = side // 5 if circle else inset
    low, (_, deep, wide) = (floor, front + inset, left_edge + inset), (0, depth - 2 * inset, side - 2 * inset)
    weights = {"legs": 0.62, "panels": 0.12, "trestles": 0.1, "column": 0.16}
    kind = _supports(rng, draft, low, (under, deep, wide), weights)
    if under > 5 and not circle and kind in ("legs", "panels"):
        if rng.chance(0.25):
            draft.box("shelf", (floor + under // rng.whole(2, 5), *low[1:]), (rng.pick(THIN), deep, wide))
        if rng.chance(0.25):
            tall = rng.whole(2, 5)
            draft.box("locker", (floor + under - tall, low[1] + 1, low[2] + 1), (tall, deep - 2, wide - 2))


def desk(rng: Rng, draft: Draft) -> None:
    """Desks: a top on lockers, panels or legs, some with a board at the rear and shelves above."""
    (floor, front, left_edge), (up, depth, side) = room(rng, rng.even(10, 22), rng.even(10, 18), SPAN)
    height = up if rng.chance(0.8) else round(up * rng.uniform(0.5, 0.65))
    thick, inset, drop = rng.pick(THIN), int(rng.chance(0.3)), rng.uniform(0.3, 1)
    low, size = (floor, front + inset, left_edge + inset), (height - thick, depth - 2 * inset, side - 2 * inset)
    draft.box("top", (floor + size[0], front, left_edge), (thick, depth, side))
    _supports(rng, draft, low, size, {"lockers": 0.45, "panels": 0.3, "legs": 0.25})
    if rng.chance(0.4):
        low, size = (floor + size[0] - int(size[0] * drop), -front - 2, low[2]), (int(size[0] * drop), 2, size[2])
        draft.box("vertical_board", low, size)
    if height < up:
        _upper(rng, draft, (floor + height, front, left_edge), (up - height, depth, side), closed=0)


def hutch(rng: Rng, draft: Draft) -> None:
    """Hutches: a deep lower body that carries a shallow upper one, closed or with shelves."""
    low, (up, depth, side) = room(rng, rng.even(20, 24), rng.even(8, 16), rng.even(10, 24))
    lower = round(up * rng.uniform(0.35, 0.55))
    draft.box("locker", low, (lower, depth, side))
    _upper(rng, draft, (low[0] + lower, *low[1:]), (up - lower, depth, side), closed=0.45)


def _upper(rng: Rng, draft: Draft, low: Triple, size: Triple, closed: float) -> None:
    """Shelves or, in a share, a closed body between side boards, in the rear of a box."""
    (up, depth, side), shallow = size, max(2, int(size[1] * rng.uniform(0.4, 0.8)))
    low, gap = (low[0], low[1] + depth - shallow, low[2]), rng.whole(0, 3)
    draft.box("side", low, (up, shallow, rng.whole(1, 2)), sides=True)
    if rng.chance(0.7):
        draft.box("vertical_board", (low[0], low[1] + shallow - 1, low[2]), (up, 1, side))
    if rng.chance(closed):
        draft.box("locker", (low[0] + gap, *low[1:]), (up - gap, shallow, side))
    else:
        _shelves(draft, (low[0] + 2, *low[1:]), (up - 2, shallow, side), 1, rng.whole(1, 4))


def _top(rng: Rng, draft: Draft, low: Triple, size: Triple, planks: float = 0) -> bool:
    """A board, a circle or, in a share, planks; whether it is a circle."""
    (thick, depth, side), plank = size, rng.whole(1, 3)
    circle = depth == side and rng.chance(0.4)
    if rng.chance(planks):
        repeat = [(min((depth + 1) // (plank + 1), 8), (0, plank + 1, 0))]
        draft.box("horizontal_bar", low, (thick, plank, side), repeat=repeat)
        return False
    if circle:
        draft.centred("top_circle", (low[0], low[1] + depth // 2, 0), thick, depth // 2)
    else:
        draft.box("top", low, size)
    return circle


def _supports(rng: Rng, draft: Draft, low: Triple, size: Triple, weights: dict[str, float], rise: int = 0) -> str:
    """Supports of a kind, which is returned, that fill a box; rear legs ``rise`` to carry a back unless it is zero."""
    (floor, front, left_edge), (under, depth, side), kind = low, size, rng.pick(weights)
    thick, deep, bar, middle, rear = rng.pick(SMALL), rng.pick(SMALL), rng.pick(THIN), front + depth // 2, front + depth
    height = floor + round(under * max(rng.uniform(-0.2, 0.7), 0))
    if kind == "legs":
        along = [row(rng.pick({2: 0.85, 3: 0.12, 4: 0.03}), side, thick)]
        draft.box("leg", low, (under, deep, thick), repeat=along, rear=None if rise else rear)
        draft.box("leg", (floor, rear - deep, left_edge), (rise, deep, thick), repeat=along)
        if rng.chance(0.35):
            draft.box("horizontal_bar", (height, front, left_edge), (bar, depth, bar), repeat=along)
        if rng.chance(0.3):
            draft.box("horizontal_bar", (height, front, left_edge), (bar, bar, side), rear=rear)
    elif kind in ("panels", "trestles"):
        narrow = depth if kind == "panels" else min(rng.even(2, 6), depth)
        at, name = (floor, middle - narrow // 2, left_edge), "leg" if narrow < 4 else "side"
        draft.box(name, at, (under, narrow, thick), sides=True)
        if kind == "trestles":
            draft.box("horizontal_bar", low, (bar, depth, thick), sides=True)
        if rng.chance(0.4):
            name, tall = rng.choice((("horizontal_bar", 2), ("vertical_board", under // 2)))
            draft.box(name, (floor + under - tall, middle - 1, left_edge), (tall, 2, side))
    elif kind in ("body", "lockers"):
        width = side if kind == "body" and rng.chance(0.75) else min(rng.whole(4, 8), side // 2)
        draft.box("locker", low, (under, depth, width), repeat=[row(rng.pick({2: 0.8, 3: 0.2}), side, width)])
    elif kind == "column":
        apart, radius = side // 4 * 2 if side > 1.4 * depth else 0, min(rng.whole(1, 3), depth // 2 - 1)
        at, repeat, square = (floor, middle, -apart // 2), [(2, (0, 0, apart))], rng.chance(0.25)
        draft.centred("support_cuboid" if square else "support_cylinder", at, under, radius, repeat)
        reach = max(int(depth / 2 * rng.uniform(0.4, 1)), radius + 1)
        foot = "plate" if apart else rng.pick({"cross": 0.35, "star": 0.3, "plate": 0.35})
        if foot == "cross":
            draft.add("base_cross", at, bar, reach, 0, turns=(4, 1))
        elif foot == "star":
            draft.star(at, rng.whole(0, 4), reach, rng.whole(3, 6))
        else:
            draft.centred("base_square" if square else "base_circle", at, bar, reach, repeat)
    return kind


def _back(rng: Rng, draft: Draft, corner: Triple, rise: int, side: int, tilt: int, risers: bool) -> None:
    """A board, rails, or spindles under a rail, that rise above the rear left corner of a seat."""
    seat, rear, left_edge = corner
    gap, thick, kind = 0 if rng.chance(0.55) else rng.whole(1, 3), rng.pick(SMALL), rng.random()
    tall, post, high, space = max(rise - gap, 2), rng.whole(1, 2), rng.whole(1, 2), rng.whole(1, 2)
    start, top = rear - tilt - thick, seat + rise
    if kind < 0.6 or tall < 5:
        draft.box("back", (top - tall, start, left_edge), (tall, thick, side), tilt=tilt)
        if not risers:
            draft.box("back_support", (seat, start, left_edge), (gap, thick, post), sides=True)
        return
    if kind < 0.78:  # rails lean by whole cells from one to the next
        count = min(max((tall + space) // (high + space), 2), 6)
        low, shift = (top - count * (high + space) + space, start, left_edge), (high + space, tilt // (count - 1), 0)
        draft.box("chair_beam", low, (high, thick, side), repeat=[(count, shift)])
    else:
        draft.box("chair_beam", (top - high, start + tilt, left_edge), (high, thick, side))
    if kind > 0.78 or not risers:
        posts = [row(rng.whole(3, 8) if kind > 0.88 else 2, side, post)]
        draft.box(
            "back" if tilt else "back_support",
            (seat, start, left_edge),
            (rise - high, thick, post),
            repeat=posts,
            tilt=tilt,
        )


CASES: dict[str, tuple[Triple, Triple, float]] = {
    "tall": ((24, 6, 8), (24, 18, 24), 0.7), "broad": ((10, 6, 24), (24, 18, 24), 0.7),
    "tv stand": ((6, 6, 24), (14, 16, 24), 0.35), "night stand": ((18, 14, 14), (24, 22, 24), 0.5),
    "bookshelf": ((18, 4, 8), (24, 12, 24), 0),
}  # fmt: skip
"""Least and greatest extents of cases, and the share of solid ones."""


def case(rng: Rng, draft: Draft, kind: str) -> None:
    """Cabinets, stands and bookshelves: a solid or panelled body on its base, under its top."""
    least, most, share = CASES[kind]
    (floor, front, left_edge), (up, depth, side) = room(rng, *map(rng.even, least, most))
    solid, plain, foot = rng.chance(share), rng.chance(0.17), rng.whole(1, 3)
    base = "" if plain else rng.pick({"feet": 0.36, "plinth": 0.22, "": 0.42})
    raised = min(rng.whole(1, 3), up // 4) if base else 0
    lid = rng.pick(THIN) if not plain and rng.chance(0.35) else 0
    eaves, proud = int(lid > 0 and rng.chance(0.75)), int(solid and not plain and rng.chance(0.62))
    low = (floor + raised, front + eaves + proud, left_edge + eaves)
    size = (up - raised - lid, depth - 2 * eaves - proud, side - 2 * eaves)
    draft.box("top", (floor + up - lid, front, left_edge), (lid, depth, side))
    if solid:
        recess = 0 if plain or proud or rng.chance(0.4) else rng.whole(1, 2)
        draft.box("locker", (low[0], low[1] + recess, low[2]), (size[0], size[1] - recess, size[2]))
        if proud:
            _fronts(rng, draft, low, size)
        elif recess:
            draft.box("side", low, (*size[:2], rng.whole(0, 3)), sides=True)
            _shelves(draft, low, size, rng.whole(0, 2), rng.whole(1, 4))
    else:
        _panelled_body(rng, draft, low, size, 8 if kind == "bookshelf" else 5)
    if base == "feet":
        draft.box("leg", (floor, *low[1:]), (raised, foot, foot), sides=True, rear=low[1] + size[1])
    else:
        size = (raised, size[1] + 1 - foot, size[2] + 2 - 2 * foot)
        draft.box("locker", (floor, low[1] - 1 + foot, low[2] - 1 + foot), size)


def _fronts(rng: Rng, draft: Draft, low: Triple, size: Triple) -> None:
    """Doors, drawers or handles that stand a cell proud of a body."""
    kind, margin = rng.pick({"doors": 0.4, "drawers": 0.3, "handles": 0.3}), rng.whole(0, 1)
    up, side = size[0] - 2 * margin, size[2] - 2 * margin
    columns = min(rng.pick({1: 0.35, 2: 0.45, 3: 0.15, 4: 0.05}), max(side // 4, 1))
    rows = min(rng.whole(2, 6) if kind != "doors" else 1, max(up // 3, 1))
    rise, step = (up + 1) // rows, (side + 1) // columns
    low = (low[0] + (size[0] - rise * rows + 1) // 2, low[1] - 1, low[2] + (size[2] - step * columns + 1) // 2)
    repeat = [(rows, (rise, 0, 0)), (columns, (0, 0, step))]
    if kind == "handles":
        long = max(min(rng.whole(1, 4), step - 2), 1)
        low = (low[0] + rise // 2, low[1], low[2] + (step - long) // 2)
        draft.box("horizontal_bar", low, (1, 1, long), repeat=repeat)
    else:
        draft.box("vertical_board", low, (rise - 1, 1, step - 1), repeat=repeat)


def _panelled_body(rng: Rng, draft: Draft, low: Triple, size: Triple, most: int) -> None:
    """Sides with at most so many shelves, and a back, dividers and a closed part."""
    (up, depth, side), slab, back, count = size, rng.pick(THIN), rng.pick(THIN), rng.whole(1, most - 2)
    draft.box("side", low, (up, depth, slab), sides=True)
    _shelves(draft, low, size, rng.pick(THIN), rng.whole(2, most))
    if rng.chance(0.75):
        name = "back" if most > 5 else "vertical_board"
        draft.box(name, (low[0], low[1] + depth - back, low[2]), (up, back, side))
    step, width = (side - slab) // (count + 1), rng.choice((side, side, side // 2))
    if step > 3 and rng.chance(0.4):
        at = (*low[:2], -((step * (count - 1) + slab) // 2))
        draft.box("side", at, (up, depth, slab), repeat=[(count, (0, 0, step))])
    if rng.chance(0.45):
        at = (*low[:2], low[2] + rng.choice((0, side - width)))
        draft.box("locker", at, (int(up * rng.uniform(0.25, 0.75)), depth, width))


def _shelves(draft: Draft, low: Triple, size: Triple, board: int, count: int) -> None:
    """Equally spaced boards within a box, from its top downwards, as many as there is room for."""
    count = max(min(count, size[0] // (board + 2)), 1)
    pitch = (size[0] - board) // max(count - 1, 1)
    start = low[0] + size[0] - board - pitch * (count - 1)
    draft.box("shelf", (start, *low[1:]), (board, *size[1:]), repeat=[(count, (pitch, 0, 0))])


def sofa(rng: Rng, draft: Draft) -> None:
    """Sofas: a base with cushions, a back, arms and short legs."""
    (floor, front, left_edge), (up, depth, side) = room(rng, rng.even(6, 14), rng.even(8, 16), SPAN)
    raised, arm = rng.pick(THIN) if rng.chance(0.5) else 0, rng.pick({0: 0.15, 1: 0.2, 2: 0.35, 3: 0.2, 4: 0.1})
    seat, inner, count = max(round(up * rng.uniform(0.35, 0.55)), raised + 2), side - 2 * arm, rng.whole(1, 4)
    above, thick, tilt, step = up - seat, rng.whole(1, 4), rng.pick({0: 0.6, 1: 0.2, 2: 0.2}), (inner + 1) // count
    draft.box("locker", (floor + raised, front, -inner // 2), (seat - raised, depth, inner))
    wide = side if rng.chance(0.3) else inner
    draft.box("back", (floor + seat, -front - tilt - thick, -wide // 2), (above, thick, wide), tilt=tilt)
    bottom, rise = rng.choice((0, raised)), min(rng.whole(1, 4), above)
    draft.box("side", (floor + bottom, front, left_edge), (seat + rise - bottom, depth, arm), sides=True)
    if rng.chance(0.5):
        at, size = (floor + seat, front, -((step * count - 1) // 2)), (rng.pick(THIN), depth - tilt - thick, step - 1)
        draft.box("locker", at, size, repeat=[(count, (0, 0, step))])
    draft.box("leg", (floor, front, left_edge), (raised, raised, raised), sides=True, rear=-front)


def bed(rng: Rng, draft: Draft) -> None:
    """Beds: a mattress with pillows on a frame between head and foot boards, on legs or posts."""
    (floor, front, left_edge), (up, depth, side) = room(rng, rng.even(6, 16), SPAN, rng.even(12, 24))
    raised, head, foot = rng.pick({0: 0.35, 1: 0.2, 2: 0.25, 3: 0.2}), rng.pick(THIN), rng.whole(0, 2)
    lying, slim = max(round(up * rng.uniform(0.4, 0.7)), raised + 2), rng.whole(0, 1)
    frame, length = min(rng.whole(1, 3), lying - raised - 1), depth - head - foot
    draft.box("locker", (floor + raised, front + foot, left_edge), (frame, length, side))
    low, size = (
        (floor + raised + frame, front + foot, left_edge + slim),
        (lying - raised - frame, length, side - 2 * slim),
    )
    draft.box("locker", low, size)
    if rng.chance(0.3):
        pillow = (1, 4, rng.choice((side - 2, side // 2 - 2)))
        draft.box("locker", (floor + lying, -front - head - 4, left_edge + 1), pillow, sides=True)
    draft.box("back", (floor, -front - head, left_edge), (up, head, side))
    draft.box("vertical_board", (floor, front, left_edge), (min(lying + rng.whole(0, 4), up), foot, side))
    thick, tall = rng.whole(1, 2), up if rng.chance(0.15) else raised
    draft.box("leg", (floor, front, left_edge), (tall, thick, thick), sides=True, rear=-front)


def details(rng: Rng, draft: Draft) -> None:
    """Up to four small boxes, such as rails, posts and boards, that touch a shape and stay within its bounds."""
    boxes = list(draft.boxes)
    floor = [min(low[axis] for low, _ in boxes) for axis in range(3)]
    bounds = [max(low[axis] + size[axis] for low, size in boxes) - floor[axis] for axis in range(3)]
    for low, size in rng.choices(boxes, [up * depth * side for _, (up, depth, side) in boxes], k=rng.whole(1, 4)):
        thin, thick, long, short = rng.pick(SMALL), rng.pick(THIN), rng.whole(3, 14), rng.whole(3, 10)
        weights: dict[tuple[str, Triple], float] = {
            ("horizontal_bar", (thin, thick, long)): 0.28, ("horizontal_bar", (thin, long, thick)): 0.18,
            ("leg", (long, thick, thin)): 0.17, ("vertical_board", (short, thin, long)): 0.16,
            ("side", (short, long, thin)): 0.13, ("locker", (rng.whole(2, 6), rng.whole(2, 6), short)): 0.08,
        }  # fmt: skip
        name, target_count = rng.pick(weights)
        up, depth, side = (min(a, b) for a, b in zip(target_count, bounds, strict=True))
        cell = [a + rng.whole(-b, extent - 1) for a, b, extent in zip(low, (up, depth, side), size, strict=True)]
        at, front, left_edge = (
            min(max(a, b), b + bound - extent)
            for a, b, bound, extent in zip(cell, floor, bounds, (up, depth, side), strict=True)
        )
        pair = rng.chance(0.9)
        if pair and (left_edge < 0 < left_edge + side or target_count[2] == long):
            side = min(2 * max(-left_edge, left_edge + side), bounds[2])
            left_edge = -side // 2
        elif pair:
            left_edge = min(left_edge, -left_edge - side)
        draft.box(name, (at, front, left_edge), (up, depth, side), sides=pair)


def room(rng: Rng, up: int, depth: int, side: int) -> tuple[Triple, Triple]:
    """The low corner and the even extents of a box of these proportions around the centre of the grid.

    Its longest side is that of all shapes in the grid, or smaller for a few.
    """
    span = rng.even(SPAN - 6, SPAN) if rng.chance(0.06) else SPAN
    up, depth, side = (max(1, round(extent * span / max(up, depth, side) / 2)) for extent in (up, depth, side))
    return (-up, -depth, -side), (2 * up, 2 * depth, 2 * side)


def row(count: int, length: int, size: int) -> Repeat:
    """``count`` copies from end to end of a stretch left to right, or two where so many do not fit evenly."""
    if count < 2 or (length - size) % (count - 1):
        count = 2
    return count, (0, 0, (length - size) // (count - 1))


TEMPLATES: dict[Template, float] = {
    partial(seating, kind="bench"): 0.23, partial(seating, kind="chair"): 0.12, partial(seating, kind="stool"): 0.03,
    table: 0.1, desk: 0.05, partial(case, kind="tall"): 0.13, partial(case, kind="broad"): 0.09,
    partial(case, kind="tv stand"): 0.04, partial(case, kind="night stand"): 0.03, hutch: 0.05,
    partial(case, kind="bookshelf"): 0.06, sofa: 0.05, bed: 0.04,
}  # fmt: skip
"""Templates and their weights."""
