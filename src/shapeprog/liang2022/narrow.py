"""The published synthetic tables and chairs: ten kinds and four (Tian et al., ICLR 2019); translations repeat twice."""

from __future__ import annotations

from functools import partial

from shapeprog.liang2022.draft import Draft, Rng, Template
from shapeprog.space import SPAN


def table(rng: Rng, draft: Draft, top: str, support: str) -> None:
    """A rectangular, square or round top on four legs, a central support, side boards or lockers."""
    longest = rng.pick({"up": 0.25, "depth": 0.15, "side": 0.6} if top == "rectangle" else {"up": 0.4, "both": 0.6})
    thick = rng.whole(1, 5)
    under = SPAN - thick if longest == "up" else rng.whole(5, SPAN - thick)
    half_depth, half_side = (12 if longest in (axis, "both") else rng.whole(4, 12) for axis in ("depth", "side"))
    floor = -((thick + under + 1) // 2)
    halves = (half_depth, half_side) if top == "rectangle" else (half_side,)
    draft.add(f"top_{top}", (floor + under, 0, 0), thick, *halves)
    half_depth = halves[0]
    if support in ("column", "cross"):
        _pedestal(rng, draft, floor, under, half_side, half_side // 2, top if support == "column" else support)
    elif support.startswith("legs"):
        inset = int(half_side * 0.36) if top == "circle" else rng.whole(0, 2)
        thick = rng.whole(2 if support == "legs with bars" else 1, 3)
        front, left = inset - half_depth, inset - half_side
        draft.box("leg", (floor, front, left), (under, thick, thick), sides=True, rear=-front)
        if support == "legs with layer":
            draft.add("layer", (floor + rng.whole(1, under - 4), 0, 0), rng.whole(1, 2), -front, -left)
        if support == "legs with bars":
            low = (floor + rng.whole(0, under - 3), front, left)
            bars = rng.pick({"lengthwise": 0.3, "crosswise": 0.3, "both": 0.4})
            if bars != "crosswise":
                draft.box("horizontal_bar", low, (2, 2, -2 * left), rear=-front)
            if bars != "lengthwise":
                draft.box("horizontal_bar", low, (2, -2 * front, 2), sides=True)
    else:
        boards = support == "boards"
        inset, short = (rng.whole(0, 3), rng.whole(0, 2)) if boards else (0, rng.whole(0, 1))
        width = rng.whole(1, 3) if boards else min(rng.whole(3, 8), 2 * half_side // 3)
        low, deep = (floor, short - half_depth, inset - half_side), 2 * half_depth - short * (1 + boards)
        draft.box("sideboard" if boards else "locker", low, (under, deep, width), sides=True)
        between = rng.pick({"board": 0.4, "layer": 0.4, "nothing": 0.2})
        if between == "board":
            tall, deep = rng.whole(3, under), rng.whole(1, 2)
            low = (floor + under - tall, half_depth - deep - rng.whole(0, 4), inset - half_side)
            draft.box("vertical_board", low, (tall, deep, -2 * low[2]))
        elif between == "layer":
            draft.add("layer", (floor + rng.whole(1, under - 3), 0, 0), 1, half_depth - 1, half_side - inset)


def chair(rng: Rng, draft: Draft, support: str) -> None:
    """A seat on four legs, a central support on a cross or on lines, or side boards; with a back, some with arms."""
    circle = 0.2 if support in ("cross", "star") else 0
    seat = rng.pick({"rectangle": 0.6, "square": 0.4 - circle, "circle": circle})
    floor, under, thick = -SPAN // 2, rng.whole(6, 11), rng.whole(1, 3)
    half_depth, half_side = rng.whole(5, 10), rng.whole(5, 10)
    halves = (half_depth, half_side) if seat == "rectangle" else (half_side,)
    draft.add(f"top_{seat}", (floor + under, 0, 0), thick, *halves)
    half_depth = halves[0]
    low = (floor, -half_depth, -half_side)
    if support == "legs":
        size = (under, rng.whole(1, 3), rng.whole(1, 3))
        if rng.chance(0.5):
            draft.box("leg", low, size, sides=True, rear=half_depth)
        else:
            draft.box("leg", low, size, sides=True)
            draft.box("leg", (floor, half_depth - size[1], -half_side), size, sides=True)
        if rng.chance(0.5):
            bar = min(size[1:])
            low = (floor + rng.whole(1, under - 2), rng.choice((-half_depth, half_depth - bar)), -half_side)
            draft.box("horizontal_bar", low, (bar, bar, 2 * half_side))
    elif support == "boards":
        draft.box("sideboard", low, (under, 2 * half_depth, rng.whole(1, 3)), sides=True)
    else:
        _pedestal(rng, draft, floor, under, min(half_depth, half_side), min(half_side // 2, 3), support)
    _back_and_arms(rng, draft, floor + under + thick, -half_depth, -half_side)


def _pedestal(rng: Rng, draft: Draft, floor: int, under: int, half: int, widest: int, foot: str) -> None:
    """A central support on a cross, on a star of lines, or on a square or round base."""
    radius = rng.whole(1, widest)
    draft.add("support_cuboid" if foot == "square" else "support_cylinder", (floor, 0, 0), under, radius)
    if foot == "star":
        draft.add("line", (floor + rng.whole(0, 4), 0, 0), (floor, 1 - half, 0), 1, turns=(rng.whole(3, 6), 0))
    elif foot == "cross":
        reach = max(radius + 2, half - rng.whole(0, 3))
        draft.add("base_cross", (floor, 0, 0), rng.whole(1, 2), reach, 0, turns=(4, 1))
    else:
        reach = max(radius + 1, rng.whole(2, half - 1))
        draft.add(f"base_{foot}", (floor, 0, 0), rng.whole(1, 3), reach)


def _back_and_arms(rng: Rng, draft: Draft, seat: int, front: int, left: int) -> None:
    """A back that is one board, or beams with bars; some have arm rests of bars on beams.  ``seat`` is its top."""
    thick, narrow, rise, armed = rng.whole(1, 3), rng.whole(0, 1), SPAN // 2 - seat, rng.chance(0.28)
    low, width = (seat, -front - thick, left + narrow), -2 * (left + narrow)
    if rng.chance(0.5):
        draft.box("back", low, (rise, thick, width), tilt=rng.whole(1, 4) if rng.chance(0.5) else 0)
    else:
        draft.box("chair_beam", low, (rise, thick, rng.whole(1, 2)), sides=True)
        count, bar = min(2, 6 - len(draft.nodes)) if armed else rng.whole(2, 3), rng.whole(1, 2)
        for k in range(count):
            draft.box("horizontal_bar", (SPAN // 2 - bar - k * rise // count, *low[1:]), (bar, thick, width))
    if armed:
        tall, width = rng.whole(3, 6), rng.whole(1, 2)
        draft.box("chair_beam", (seat, front, left), (tall, rng.whole(1, 2), width), sides=True)
        draft.box("horizontal_bar", (seat + tall, front, left), (rng.whole(1, 2), -2 * front, width), sides=True)


TABLES = (
    ("rectangle", "legs"), ("square", "legs"), ("circle", "legs"), ("rectangle", "legs with layer"),
    ("rectangle", "legs with bars"), ("circle", "column"), ("square", "column"), ("circle", "cross"),
    ("rectangle", "boards"), ("rectangle", "lockers"),
)  # fmt: skip
CHAIRS = {"legs": 50000, "cross": 20000, "star": 5000, "boards": 5000}
TEMPLATES: dict[Template, float] = {
    **{partial(table, top=top, support=support): 4000 for top, support in TABLES},
    **{partial(chair, support=support): count for support, count in CHAIRS.items()},
}  # and the number of shapes that the published data has of each
