"""Synthetic furniture of many kinds: seats, tables, cases and beds with small parts, and the published ones."""

from __future__ import annotations

from functools import partial

from shapeprog.liang2022 import narrow
from shapeprog.liang2022.draft import Draft, Rng, Template, Triple
from shapeprog.space import DEPTH, SIDE, UP

SMALL, THIN = {1: 0.4, 2: 0.45, 3: 0.15}, {1: 0.7, 2: 0.3}  # thicknesses in cells: of legs and panels, of boards


def seating(
    rng: Rng, draft: Draft, smallest: Triple, largest: Triple, *, backed: bool = True, armed: float = 0.4,
    body: float = 0.2, footed: float = 0.0,
) -> None:  # fmt: skip
    """Seats and beds, with a back or not; in shares with arms, on a closed body, and with a foot board."""
    (floor, front, left), (up, depth, side) = room(rng, smallest, largest)
    closed, arms = rng.chance(body), rng.pick({"panels": armed / 2, "rests": armed / 2, "": 1 - armed})
    seat = max(3, round(up * rng.uniform(0.35, 0.6))) if backed or arms else up
    tilt = min(rng.pick({0: 0.5, 1: 0.1, 2: 0.25, 4: 0.15}), depth // 3) if backed else 0
    thick, arm, length = min(rng.pick(SMALL), seat - 2), rng.pick(SMALL), depth - tilt
    wide, under = side - 2 * arm if arms else side, seat - thick
    if arms != "panels" or rng.chance(0.5):
        inset = min(max(rng.whole(-4, 3), 0), wide // 4)
        low, size = (floor, front, inset - wide // 2), (under, length, wide - 2 * inset)
        _supports(rng, draft, low, size, {"body": 1.0} if closed else {"legs": 0.75, "panels": 0.25})
    low, size = (floor + under, front, -wide // 2), (thick, length, wide)
    if not closed and rng.chance(0.3):
        draft.spread("horizontal_bar", low, size, DEPTH, rng.whole(2, 6))
    else:
        draft.box("top_rectangle", low, size)
    if rng.chance(footed):
        draft.box("vertical_board", (floor, front, left), (seat + rng.whole(0, 3), rng.pick(THIN), side))
    if backed:
        _back(rng, draft, (floor + seat, -front, -wide // 2), up - seat, wide, tilt, closed or rng.chance(0.5))
    top, bar = seat + min(max(up - seat, 2), rng.whole(3, 7)), rng.pick(THIN)
    if arms == "panels":
        draft.box("sideboard", (floor, front, left), (top, length, arm), sides=True)
    elif arms:
        bottom, rear = rng.choice((0, under)), None if backed else -front
        draft.box("chair_beam", (floor + top - bar, front, left), (bar, length, arm), sides=True)
        draft.box("leg", (floor + bottom, front, left), (top - bar - bottom, arm, arm), sides=True, rear=rear)


def _back(rng: Rng, draft: Draft, corner: Triple, rise: int, side: int, tilt: int, board: bool) -> None:
    """A board, or rails or spindles on posts, from the rear left corner of a seat."""
    (seat, rear, left), thick, post, high = corner, rng.pick(SMALL), rng.whole(1, 2), rng.whole(1, 2)
    front = rear - tilt - thick
    if board:
        gap = max(rng.whole(-3, min(rise - 2, 3)), 0)
        draft.box("back", (seat + gap, front, left), (rise - gap, thick, side), tilt=tilt)
        draft.box("back_support", (seat, front, left), (gap, thick, post), sides=True)
        return
    rails, posts = (rng.whole(2, 5), 2) if rng.chance(0.45) else (1, rng.whole(2, 8))
    rails = max(min(rails, rise // (high + 1)), 1)
    pitch, lean = rise // rails, tilt // rails
    lowest = (seat + rise - high - pitch * (rails - 1), front + tilt - lean * (rails - 1), left)
    draft.box("chair_beam", lowest, (high, thick, side), repeat=[(rails, (pitch, lean, 0))])
    draft.spread("back", (seat, front, left), (rise - high, thick, side), SIDE, posts, post, tilt=tilt)


def table(
    rng: Rng, draft: Draft, smallest: Triple, largest: Triple, supports: dict[str, float], shelved: float = 0.0
) -> None:
    """A top on supports of some kind; ``shelved`` is the share of those with shelves on the rear."""
    (floor, front, left), (up, depth, side) = room(rng, smallest, largest)
    height = round(up * rng.uniform(0.4, 0.6)) if rng.chance(shelved) else up
    thick, inset, shallow = rng.pick(SMALL), rng.pick({0: 0.5, 1: 0.3, 2: 0.2}), int(depth * rng.uniform(0.4, 0.8))
    low, size = (floor, front + inset, left + inset), (height - thick, depth - 2 * inset, side - 2 * inset)
    draft.box("top_rectangle", (floor + height - thick, front, left), (thick, depth, side))
    _supports(rng, draft, low, size, supports)
    if height > 8 and rng.chance(0.4):
        name, tall = rng.choice((("layer", rng.pick(THIN)), ("locker", rng.whole(2, 5))))
        draft.box(name, (floor + rng.whole(2, size[0] - tall), *low[1:]), (tall, *size[1:]))
    if height < up:
        _panelled_body(rng, draft, (floor + height, -front - shallow, left), (up - height, shallow, side))


def _supports(rng: Rng, draft: Draft, low: Triple, size: Triple, weights: dict[str, float]) -> None:
    """Supports that fill a box: legs with stretchers, panels with a board, a body, or lockers."""
    (floor, front, left), (up, depth, side), kind = low, size, rng.pick(weights)
    thick, bar, rear = rng.pick(SMALL), rng.pick(THIN), front + depth
    if kind == "legs":
        count, height = rng.pick({2: 0.85, 3: 0.12, 4: 0.03}), floor + round(up * max(rng.uniform(-0.2, 0.7), 0))
        draft.spread("leg", low, (up, rng.pick(SMALL), side), SIDE, count, thick, rear=rear)
        if rng.chance(0.35):
            draft.spread("horizontal_bar", (height, front, left), (bar, depth, side), SIDE, count, thick)
        if rng.chance(0.3):
            draft.box("horizontal_bar", (height, front, left), (bar, bar, side), rear=rear)
    elif kind == "panels":
        draft.box("sideboard", low, (up, depth, thick), sides=True)
        if rng.chance(0.4):
            draft.box("vertical_board", (floor + up // 2, front + depth // 2 - 1, left), (up - up // 2, 2, side))
    else:
        draft.box("locker", low, (up, depth, side if kind == "body" else min(rng.whole(4, 8), side // 2)), sides=True)


def case(rng: Rng, draft: Draft, smallest: Triple, largest: Triple, solid: float) -> None:
    """Cabinets, stands and bookshelves; ``solid`` is the share of those that are not made of panels."""
    (floor, front, left), (up, depth, side) = room(rng, smallest, largest)
    closed, lid, foot = rng.chance(solid), rng.pick({0: 0.7, 1: 0.2, 2: 0.1}), rng.whole(1, 3)
    base = rng.pick({"feet": 0.3, "plinth": 0.2, "": 0.5})
    raised, eaves, proud = rng.whole(1, up // 8) if base else 0, min(lid, 1), int(closed and rng.chance(0.5))
    low = (floor + raised, front + eaves + proud, left + eaves)
    size = (up - raised - lid, depth - 2 * eaves - proud, side - 2 * eaves)
    draft.box("top_rectangle", (floor + up - lid, front, left), (lid, depth, side))
    if closed:
        draft.box("locker", low, size)
    else:
        _panelled_body(rng, draft, low, size)
    if proud:
        _fronts(rng, draft, (low[0], low[1] - 1, low[2]), size[0], size[2])
    if base == "feet":
        draft.box("leg", (floor, *low[1:]), (raised, foot, foot), sides=True, rear=low[1] + size[1])
    else:
        draft.box("locker", (floor, low[1], low[2] + foot - 1), (raised, size[1], size[2] + 2 - 2 * foot))


def _fronts(rng: Rng, draft: Draft, low: Triple, up: int, side: int) -> None:
    """Doors side by side, or one or two columns of drawers or handles, a cell deep."""
    kind, wide = rng.pick({"doors": 0.4, "drawers": 0.3, "handles": 0.3}), rng.choice((side, (side - 1) // 2))
    if kind == "doors":
        draft.spread("vertical_board", low, (up, 1, side), SIDE, min(rng.whole(1, 4), side // 4))
    elif kind == "drawers":
        draft.spread("vertical_board", low, (up, 1, wide), UP, min(rng.whole(2, 6), up // 3), sides=True)
    else:
        at, long = (low[0] + 2, low[1], low[2] + wide // 2 - 1), rng.whole(1, 4)
        draft.spread("horizontal_bar", at, (up - 4, 1, long), UP, rng.whole(1, 6), 1, sides=True)


def _panelled_body(rng: Rng, draft: Draft, low: Triple, size: Triple) -> None:
    """Shelves between sides, some with a back, a divider and a closed part."""
    (floor, front, left), (up, depth, side), slab, back = low, size, rng.pick(THIN), rng.pick(THIN)
    draft.box("sideboard", low, (up, depth, slab), sides=True)
    draft.spread("layer", low, size, UP, rng.whole(2, max(up // 4, 2)), rng.pick(THIN))
    if rng.chance(0.75):
        draft.box("vertical_board", (floor, front + depth - back, left), (up, back, side))
    if rng.chance(0.3):
        draft.box("sideboard", (floor, front, -1), (up, depth, 2))
    if rng.chance(0.45):
        width = rng.choice((side, side // 2))
        low = (floor, front, left + rng.choice((0, side - width)))
        draft.box("locker", low, (int(up * rng.uniform(0.25, 0.75)), depth, width))


def details(rng: Rng, draft: Draft) -> None:
    """Up to four small boxes, such as rails, posts and boards, that touch a box and stay within the bounds of all."""
    boxes = list(draft.boxes)
    low = [min(low[axis] for low, _ in boxes) for axis in range(3)]
    high = [max(low[axis] + size[axis] for low, size in boxes) for axis in range(3)]
    low[SIDE], high[SIDE] = min(low[SIDE], -high[SIDE]), max(high[SIDE], -low[SIDE])  # boxes have mirrored copies
    for at, size in rng.choices(boxes, [up * depth * side for _, (up, depth, side) in boxes], k=rng.whole(1, 4)):
        thin, thick, long, tall = rng.pick(SMALL), rng.pick(THIN), rng.whole(3, 14), rng.whole(2, 6)
        name, desired = rng.choice([
            ("horizontal_bar", (thin, thick, long)), ("horizontal_bar", (thin, long, thick)),
            ("vertical_board", (tall, thin, long)), ("sideboard", (tall, long, thin)), ("leg", (long, thick, thin)),
        ])  # fmt: skip
        extents = tuple(min(desired[axis], high[axis] - low[axis]) for axis in range(3))
        start = (a + rng.whole(-extent, b - 1) for a, b, extent in zip(at, size, extents, strict=True))
        corner = tuple(min(max(a, b), c - d) for a, b, c, d in zip(start, low, high, extents, strict=True))
        draft.box(name, corner, extents, sides=rng.chance(0.9))


def room(rng: Rng, smallest: Triple, largest: Triple) -> tuple[Triple, Triple]:
    """The low corner and the extents, between two, of a box around the centre of the grid; all numbers are even."""
    up, depth, side = (2 * rng.whole(low // 2, high // 2) for low, high in zip(smallest, largest, strict=True))
    return (-up // 2, -depth // 2, -side // 2), (up, depth, side)


DESK = {"lockers": 0.45, "panels": 0.3, "legs": 0.25}
TEMPLATES: dict[Template, float] = {
    partial(seating, smallest=(4, 4, 24), largest=(14, 12, 24), backed=False): 0.09,  # benches
    partial(seating, smallest=(8, 6, 24), largest=(18, 14, 24)): 0.14,  # benches with a back
    partial(seating, smallest=(6, 8, 24), largest=(14, 16, 24), armed=0.85, body=1.0): 0.05,  # sofas
    partial(seating, smallest=(24, 12, 12), largest=(24, 20, 20)): 0.08,  # chairs
    partial(seating, smallest=(24, 12, 12), largest=(24, 20, 20), backed=False, armed=0.0): 0.03,  # stools
    partial(table, smallest=(6, 8, 24), largest=(22, 24, 24), supports={"legs": 0.8, "panels": 0.2}): 0.07,
    partial(table, smallest=(10, 10, 24), largest=(22, 18, 24), supports=DESK, shelved=0.2): 0.05,
    partial(table, smallest=(24, 8, 10), largest=(24, 16, 24), supports={"body": 1.0}, shelved=1.0): 0.05,  # hutches
    partial(case, smallest=(24, 6, 8), largest=(24, 18, 24), solid=0.7): 0.13,  # tall cabinets
    partial(case, smallest=(10, 6, 24), largest=(24, 18, 24), solid=0.7): 0.09,  # broad cabinets
    partial(case, smallest=(6, 6, 24), largest=(14, 16, 24), solid=0.35): 0.04,  # TV stands
    partial(case, smallest=(24, 16, 16), largest=(24, 22, 24), solid=0.5): 0.03,  # night stands
    partial(case, smallest=(24, 4, 8), largest=(24, 12, 24), solid=0.0): 0.06,  # bookshelves
    partial(seating, smallest=(6, 24, 12), largest=(16, 24, 24), armed=0.0, body=0.6, footed=0.6): 0.04,  # beds
    **{template: shapes / 2e6 for template, shapes in narrow.TEMPLATES.items()},
}  # and their weights, with the smallest and largest extents; the longest is that of all shapes in the grid
