"""Templates that follow the published synthetic data: ten kinds of table and four of chair (Tian et al., ICLR 2019).

Every translation repeats exactly twice.  Half extents of tops are 4 to 12 cells, their thickness 1 to 5; legs are 1 to
3 wide and 5 to 24 high; backs 1 to 3 thick and tilted by 0 to 4; supports have radii of 1 to 11, lines of 1; rotations
make 3 to 6 copies.
"""

from __future__ import annotations

import torch

from shapeprog.data.synthetic.dice import Flag, Whole
from shapeprog.data.synthetic.draft import Draft, Triple
from shapeprog.data.synthetic.room import Room, mirrored, opposite
from shapeprog.space import SPAN

LOWEST, HIGHEST = 5, 24
"""Least and greatest height of what carries a top."""


def rectangle_on_legs(draft: Draft) -> None:
    """A rectangular top on four legs."""
    room, under = _rectangle(draft)
    _legs(draft, room, under)


def square_on_legs(draft: Draft) -> None:
    """A square top on four legs."""
    room, under = _as_wide_as_deep(draft, disc=False)
    _legs(draft, room, under)


def circle_on_legs(draft: Draft) -> None:
    """A round top on four legs that stand within it."""
    room, under = _as_wide_as_deep(draft, disc=True)
    inset = torch.floor(room.side * 0.18)
    _legs(draft, room, under, inset)


def rectangle_on_legs_with_layer(draft: Draft) -> None:
    """A rectangular top on four legs with a layer between them."""
    room, under = _rectangle(draft)
    inset = _legs(draft, room, under)
    dice = draft.dice
    draft.add(
        "layer", at=(room.floor + dice.whole(1, under - 4), 0, 0), thickness=dice.whole(1, 2),
        half=(room.depth / 2 - inset, room.side / 2 - inset),
    )  # fmt: skip


def rectangle_on_legs_with_bars(draft: Draft) -> None:
    """A rectangular top on four legs that bars connect lengthwise, from front to rear, or both ways."""
    room, under = _rectangle(draft)
    inset = _legs(draft, room, under, thick=draft.dice.whole(2, 3))
    dice = draft.dice
    height = room.floor + dice.whole(0, under - 3)
    along, across, both = dice.kind(0.3, 0.3, 0.4)
    low: Triple = (height, room.front + inset, room.left + inset)
    size: Triple = (2, 2, room.side - 2 * inset)
    draft.box("horizontal_bar", low, size, keep=along | both, repeat=[opposite(low, size, room.front, room.depth)])
    size = (2, room.depth - 2 * inset, 2)
    draft.box("horizontal_bar", low, size, keep=across | both, repeat=[mirrored(low, size)])


def circle_on_column(draft: Draft) -> None:
    """A round top on a round support on a round base."""
    room, under = _as_wide_as_deep(draft, disc=True)
    radius = _column(draft, room, under)
    draft.add(
        "base_circle", at=(room.floor, 0, 0), thickness=draft.dice.whole(1, 3), radius=_wider(draft, room, radius)
    )


def square_on_column(draft: Draft) -> None:
    """A square top on a square support on a square base."""
    room, under = _as_wide_as_deep(draft, disc=False)
    dice = draft.dice
    half = dice.whole(1, torch.floor(room.side / 4))
    draft.add("support_cuboid", at=(room.floor, 0, 0), height=under, half=half)
    draft.add("base_square", at=(room.floor, 0, 0), thickness=dice.whole(1, 3), half=_wider(draft, room, half))


def circle_on_cross(draft: Draft) -> None:
    """A round top on a round support on a cross of four arms."""
    room, under = _as_wide_as_deep(draft, disc=True)
    radius = _column(draft, room, under)
    _cross(draft, room, radius)


def rectangle_on_boards(draft: Draft) -> None:
    """A rectangular top on two side boards, with a vertical board or a layer between them."""
    room, under = _rectangle(draft)
    dice = draft.dice
    thick, inset = dice.whole(1, 3), dice.whole(0, 3)
    short = dice.whole(0, 2)
    low: Triple = (room.floor, room.front + short, room.left + inset)
    size: Triple = (under, room.depth - 2 * short, thick)
    draft.box("sideboard", low, size, repeat=[mirrored(low, size)])
    _between(draft, room, under, room.side - 2 * inset)


def rectangle_on_lockers(draft: Draft) -> None:
    """A rectangular top on two lockers, with a vertical board or a layer between them."""
    room, under = _rectangle(draft)
    dice = draft.dice
    wide = torch.minimum(dice.whole(3, 8), torch.floor(room.side / 3))
    low: Triple = (room.floor, room.front + dice.whole(0, 1), room.left)
    size: Triple = (under, -room.front - low[1], wide)
    draft.box("locker", low, size, repeat=[mirrored(low, size)])
    _between(draft, room, under, room.side)


def chair_on_legs(draft: Draft) -> None:
    """A chair on four legs, some with bars between them."""
    dice = draft.dice
    room, seat, high = _chair(draft)
    thick, deep = dice.whole(1, 3), dice.whole(1, 3)
    low: Triple = (room.floor, room.front, room.left)
    size: Triple = (high, deep, thick)
    together = dice.chance(0.5)
    rear = opposite(low, size, room.front, room.depth)
    draft.box("leg", low, size, keep=together, repeat=[mirrored(low, size), rear])
    draft.box("leg", low, size, keep=~together, repeat=[mirrored(low, size)])
    low = (room.floor, -room.front - deep, room.left)
    draft.box("leg", low, size, keep=~together, repeat=[mirrored(low, size)])
    level = room.floor + dice.whole(1, high - 2)
    bar = torch.minimum(thick, deep)
    low = (level, torch.where(dice.chance(0.5), room.front, -room.front - bar), room.left)
    draft.box("horizontal_bar", low, (bar, bar, room.side), keep=dice.chance(0.5))
    _back_and_arms(draft, room, seat)


def chair_on_cross(draft: Draft) -> None:
    """A chair on a central support on a cross."""
    room, seat, high = _chair(draft, disc=0.2)
    radius = _column(draft, room, high, most=3)
    _cross(draft, room, radius)
    _back_and_arms(draft, room, seat)


def chair_on_star(draft: Draft) -> None:
    """A chair on a central support on three to six lines that lead down and outwards."""
    dice = draft.dice
    room, seat, high = _chair(draft, disc=0.2)
    _column(draft, room, high, most=3)
    reach = torch.floor(torch.minimum(room.depth, room.side) / 2)
    draft.add(
        "line", start=(room.floor + dice.whole(0, 4), 0, 0), end=(room.floor, 1 - reach, 0), radius=1,
        turns=(dice.whole(3, 6), 0),
    )  # fmt: skip
    _back_and_arms(draft, room, seat)


def chair_on_boards(draft: Draft) -> None:
    """A chair on two side boards."""
    dice = draft.dice
    room, seat, high = _chair(draft)
    low: Triple = (room.floor, room.front, room.left)
    size: Triple = (high, room.depth, dice.whole(1, 3))
    draft.box("sideboard", low, size, repeat=[mirrored(low, size)])
    _back_and_arms(draft, room, seat)


def _heights(draft: Draft, longest: Flag) -> tuple[Whole, Whole]:
    """Thickness of a top and height of what carries it; the longest side of the shape where flagged."""
    dice = draft.dice
    thick = dice.whole(1, 5)
    under = torch.where(longest, SPAN - thick, dice.whole(LOWEST, HIGHEST - thick))
    return thick, under


def _rectangle(draft: Draft) -> tuple[Room, Whole]:
    dice = draft.dice
    tall, deep, wide = dice.kind(0.25, 0.15, 0.6)
    thick, under = _heights(draft, tall)
    depth = torch.where(deep, 12.0, dice.whole(4, 12))
    side = torch.where(wide, 12.0, dice.whole(4, 12))
    room = _stand(thick + under, 2 * depth, 2 * side)
    draft.add("top_rectangle", at=(room.floor + under, 0, 0), thickness=thick, half=(depth, side))
    return room, under


def _as_wide_as_deep(draft: Draft, *, disc: bool) -> tuple[Room, Whole]:
    dice = draft.dice
    tall = dice.chance(0.4)
    thick, under = _heights(draft, tall)
    reach = torch.where(tall, dice.whole(4, 12), 12.0)
    room = _stand(thick + under, 2 * reach, 2 * reach)
    if disc:
        draft.add("top_circle", at=(room.floor + under, 0, 0), thickness=thick, radius=reach)
    else:
        draft.add("top_square", at=(room.floor + under, 0, 0), thickness=thick, half=reach)
    return room, under


def _stand(up: Whole, depth: Whole, side: Whole) -> Room:
    """The room of that height, which need not be even, about the middle of the grid."""
    return Room(2 * torch.floor((up + 1) / 2), depth, side)


def _legs(draft: Draft, room: Room, under: Whole, inset: Whole | None = None, thick: Whole | None = None) -> Whole:
    dice = draft.dice
    inset = dice.whole(0, 2) if inset is None else inset
    thick = dice.whole(1, 3) if thick is None else thick
    low: Triple = (room.floor, room.front + inset, room.left + inset)
    size: Triple = (under, thick, thick)
    draft.box("leg", low, size, repeat=[mirrored(low, size), opposite(low, size, room.front, room.depth)])
    return inset


def _column(draft: Draft, room: Room, under: Whole, most: float = 11) -> Whole:
    radius = draft.dice.whole(1, torch.floor(room.side / 4).clamp(1, most))
    draft.add("support_cylinder", at=(room.floor, 0, 0), height=under, radius=radius)
    return radius


def _wider(draft: Draft, room: Room, radius: Whole) -> Whole:
    """Half the extent of a base under a support of that radius."""
    return torch.maximum(radius + 1, draft.dice.whole(2, room.side / 2 - 1))


def _cross(draft: Draft, room: Room, radius: Whole) -> None:
    dice = draft.dice
    half = torch.minimum(room.depth, room.side) / 2
    length = torch.maximum(radius + 2, torch.floor(half) - dice.whole(0, 3))
    draft.add("base_cross", at=(room.floor, 0, 0), thickness=dice.whole(1, 2), length=length, turn=0, turns=(4, 1))


def _between(draft: Draft, room: Room, under: Whole, wide: Whole) -> None:
    dice = draft.dice
    board, layer, _ = dice.kind(0.4, 0.4, 0.2)
    tall, thick = dice.whole(3, under), dice.whole(1, 2)
    draft.box(
        "vertical_board", (room.floor + under - tall, -room.front - thick - dice.whole(0, 4), -wide / 2),
        (tall, thick, wide), keep=board,
    )  # fmt: skip
    draft.add(
        "layer", at=(room.floor + dice.whole(1, under - 3), 0, 0), thickness=1, half=(room.depth / 2 - 1, wide / 2),
        keep=layer,
    )  # fmt: skip


def _chair(draft: Draft, *, disc: float = 0) -> tuple[Room, Whole, Whole]:
    """The seat; the room below it, the height of its top in the grid, and the height of what carries it."""
    dice = draft.dice
    high, thick = dice.whole(6, 11), dice.whole(1, 3)
    half_depth, half_side = dice.whole(5, 10), dice.whole(5, 10)
    rectangle, square, circle = dice.kind(0.6, 0.4 - disc, disc)
    half_depth = torch.where(rectangle, half_depth, half_side)
    room = Room(draft.column(SPAN), 2 * half_depth, 2 * half_side)
    at: Triple = (room.floor + high, 0, 0)
    draft.add("top_rectangle", at=at, thickness=thick, half=(half_depth, half_side), keep=rectangle)
    draft.add("top_square", at=at, thickness=thick, half=half_side, keep=square)
    draft.add("top_circle", at=at, thickness=thick, radius=half_side, keep=circle)
    return room, room.floor + high + thick, high


def _back_and_arms(draft: Draft, room: Room, seat: Whole) -> None:
    """A back that is one board or beams with bars, and arm rests of bars on beams."""
    dice = draft.dice
    tilt = torch.where(dice.chance(0.5), 0.0, dice.whole(1, 4))
    thick = dice.whole(1, 3)
    board, rise = dice.chance(0.5), room.ceiling - seat
    narrow = dice.whole(0, 1)
    low: Triple = (seat, -room.front - thick, room.left + narrow)
    draft.box("back", low, (rise, thick, room.side - 2 * narrow), tilt=tilt, keep=board)
    post = dice.whole(1, 2)
    low = (seat, -room.front - thick, room.left + narrow)
    size: Triple = (rise, thick, post)
    draft.box("chair_beam", low, size, keep=~board, repeat=[mirrored(low, size)])
    # The bars share the height among them, the topmost at the top.
    armed = dice.chance(0.28)
    many = torch.where(armed, 2.0, dice.whole(2, 3))
    bar = dice.whole(1, 2)
    for place in range(3):
        height = room.ceiling - bar - torch.floor(place * rise / many)
        draft.box(
            "horizontal_bar", (height, -room.front - thick, room.left + narrow),
            (bar, thick, room.side - 2 * narrow), keep=~board & (place < many),
        )  # fmt: skip
    tall, wide = dice.whole(3, 6), dice.whole(1, 2)
    low = (seat, room.front, room.left)
    size = (tall, dice.whole(1, 2), wide)
    draft.box("chair_beam", low, size, keep=armed, repeat=[mirrored(low, size)])
    low = (seat + tall, room.front, room.left)
    size = (dice.whole(1, 2), room.depth, wide)
    draft.box("horizontal_bar", low, size, keep=armed, repeat=[mirrored(low, size)])
