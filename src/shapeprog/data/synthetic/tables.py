"""Tables and desks."""

from __future__ import annotations

import torch

from shapeprog.data.synthetic.dice import Flag, Whole
from shapeprog.data.synthetic.draft import Draft
from shapeprog.data.synthetic.room import Room, make_room, mirrored, opposite, row


def table(draft: Draft) -> None:
    """Tables: a top on legs, panels, trestles, frames or a central column, with shelves, bars and drawers."""
    dice = draft.dice
    deep, side = dice.even(8, 24), draft.column(24)
    alike = dice.chance(0.3)
    room = make_room(dice, dice.even(6, 22), torch.where(alike, 24.0, deep), side)
    thick = dice.pick(1, 2, 3, weights=(0.4, 0.45, 0.15))
    legs, panels, trestles, central = dice.kind(0.62, 0.12, 0.1, 0.16)
    disc = (room.depth == room.side) & dice.chance(0.5)
    under = room.up - thick
    top = room.floor + under
    low, size = (top, room.front, room.left), (thick, room.depth, room.side)
    draft.box("top", low, size, keep=~disc)
    draft.add("top_circle", at=(top, 0.0, 0.0), thickness=thick, radius=room.side / 2, keep=disc)
    # A round top leaves no corners for legs: they stand within the circle.
    inset = torch.where(disc, (room.side * 0.2).floor(), dice.pick(0, 1, 2, 3, weights=(0.5, 0.25, 0.15, 0.1)))
    inset = torch.minimum(inset, torch.floor(room.depth / 4))
    _legs(draft, room, under, inset, legs)
    _panels(draft, room, under, torch.where(disc, inset, dice.pick(0, 1, 2, 4)), panels)
    _trestles(draft, room, under, trestles & ~disc)
    _column(draft, room, under, central | (trestles & disc))
    # What hangs or lies between the legs.
    wide = room.side - 2 * inset
    shelf = legs & ~disc & dice.chance(0.25)
    height = room.floor + (under * (0.15 + 0.5 * dice.uniform())).round()
    draft.box(
        "shelf", (height, room.front + inset, -wide / 2), (dice.pick(1, 2, weights=(0.7, 0.3)), room.depth - 2 * inset,
        wide), keep=shelf & (under > 5),
    )  # fmt: skip
    apron = (legs | panels) & ~disc & dice.chance(0.25)
    tall = torch.minimum(dice.whole(2, 5), under - 2)
    draft.box(
        "locker", (top - tall, room.front + inset + 1, -wide / 2 + 1), (tall, room.depth - 2 * inset - 2, wide - 2),
        keep=apron & (under > 5),
    )  # fmt: skip


def desk(draft: Draft) -> None:
    """Desks: a top on panels, legs or lockers, with drawers, a modesty board and shelves above."""
    dice = draft.dice
    room = make_room(dice, dice.even(10, 22), dice.even(10, 18), draft.column(24))
    hutch = dice.chance(0.2)
    height = torch.where(hutch, (room.up * (0.5 + 0.15 * dice.uniform())).round(), room.up)
    thick = dice.pick(1, 2, weights=(0.6, 0.4))
    under, base = height - thick, room.floor
    draft.box("top", (base + under, room.front, room.left), (thick, room.depth, room.side))
    lockers, panels, legs = dice.kind(0.45, 0.3, 0.25)
    inset = dice.pick(0, 1, weights=(0.7, 0.3))
    body = dice.even(4, 8)
    raised = torch.where(dice.chance(0.3), dice.whole(1, 3), 0.0)
    low, size = (base + raised, room.front + inset, room.left + inset), (under - raised, room.depth - 2 * inset, body)
    draft.box("locker", low, size, keep=lockers, repeat=[mirrored(low, size)])
    one_sided = dice.chance(0.5)
    low = (base + torch.floor(under / 3), room.front + inset, -room.left - body - inset)
    size = (under - torch.floor(under / 3), room.depth - 2 * inset, body)
    draft.box("locker", low, size, keep=~lockers & one_sided & dice.chance(0.6))
    rows = torch.minimum(dice.whole(2, 4), torch.floor((under - raised) / 3))
    pitch = torch.floor((under - raised) / rows.clamp(min=1))
    inner = torch.where(inset > 0, room.left + inset + 1, room.left + 1)
    low = (base + raised + 1, room.front + inset - 1, inner)
    size = ((pitch - 1).clamp(min=1), draft.column(1), body - 2)
    proud = lockers & dice.chance(0.5) & (inset > 0)
    draft.box("vertical_board", low, size, keep=proud, repeat=[mirrored(low, size), (rows, (pitch, 0, 0))])
    slab = dice.pick(1, 2)
    low, size = (base, room.front, room.left), (under, room.depth, slab)
    draft.box("side", low, size, keep=panels, repeat=[mirrored(low, size)])
    _legs(draft, room, under, inset, legs)
    drop = (under * (0.3 + 0.7 * dice.uniform())).round()
    draft.box(
        "vertical_board", (base + under - drop, room.rear - slab - inset, room.left + 1), (drop, slab, room.side - 2),
        keep=dice.chance(0.4),
    )  # fmt: skip
    # Shelves above the top.
    rise, shallow = room.up - height, torch.minimum(dice.even(4, 6), room.depth)
    low, size = (base + height, room.rear - shallow, room.left), (rise, shallow, draft.column(1))
    draft.box("side", low, size, keep=hutch, repeat=[mirrored(low, size)])
    draft.box(
        "shelf", (base + height + torch.floor(rise / 2), room.rear - shallow, room.left),
        (draft.column(1), shallow, room.side), keep=hutch, repeat=[(2, (rise - torch.floor(rise / 2) - 1, 0, 0))],
    )  # fmt: skip
    draft.box(
        "back", (base + height, room.rear - 1, room.left), (rise, draft.column(1), room.side),
        keep=hutch & dice.chance(0.6),
    )  # fmt: skip


def _legs(draft: Draft, room: Room, under: Whole, inset: Whole, here: Flag) -> None:
    dice = draft.dice
    thick = dice.pick(1, 2, 3, weights=(0.35, 0.5, 0.15))
    low, size = (room.floor, room.front + inset, room.left + inset), (under, thick, thick)
    wide, deep = room.side - 2 * inset, room.depth - 2 * inset
    along = row(dice.pick(2, 3, weights=(0.9, 0.1)), wide, thick)
    draft.box("leg", low, size, keep=here, repeat=[along, opposite(low, size, room.front, room.depth)])
    # Frames: bars from front to rear, and lengthwise.
    height = room.floor + torch.where(dice.chance(0.4), 0.0, (under * 0.6 * dice.uniform()).round())
    bar = torch.minimum(thick, dice.pick(1, 2))
    low, size = (height, room.front + inset, room.left + inset), (bar, deep, bar)
    draft.box("horizontal_bar", low, size, keep=here & dice.chance(0.25), repeat=[mirrored(low, size)])
    low, size = (height, room.front + inset, room.left + inset), (bar, bar, wide)
    rear_only = dice.chance(0.3)
    rear = opposite(low, size, room.front, room.depth)
    long = here & dice.chance(0.25)
    draft.box("horizontal_bar", low, size, keep=long & ~rear_only, repeat=[rear])
    draft.box("horizontal_bar", (low[0], low[1] + rear[1][1], low[2]), size, keep=long & rear_only)


def _panels(draft: Draft, room: Room, under: Whole, inset: Whole, here: Flag) -> None:
    dice = draft.dice
    slab = dice.pick(1, 2, 3, weights=(0.4, 0.4, 0.2))
    low, size = (room.floor, room.front, room.left + inset), (under, room.depth, slab)
    narrow = torch.where(dice.chance(0.6), 0.0, dice.whole(1, 3))
    narrow = torch.where(inset > 3, inset, narrow)
    low, size = (low[0], low[1] + narrow, low[2]), (size[0], (size[1] - 2 * narrow).clamp(min=2), size[2])
    draft.box("side", low, size, keep=here, repeat=[mirrored(low, size)])
    board, shelf = dice.chance(0.3), dice.chance(0.4)
    drop = (under * (0.3 + 0.7 * dice.uniform())).round()
    draft.box(
        "vertical_board", (room.floor + under - drop, torch.where(dice.chance(0.5), -1.0, room.rear - narrow - 2),
        room.left + inset), (drop, dice.pick(1, 2), room.side - 2 * inset), keep=here & board,
    )  # fmt: skip
    draft.box(
        "shelf", (room.floor + torch.floor(under / 2), low[1], low[2]), (1.0, size[1], room.side - 2 * inset),
        keep=here & shelf & ~board,
    )  # fmt: skip


def _trestles(draft: Draft, room: Room, under: Whole, here: Flag) -> None:
    dice = draft.dice
    inset, thick = dice.whole(1, 5), dice.pick(1, 2, 3)
    post = torch.minimum(dice.even(2, 6), room.depth - 2)
    low, size = (room.floor, -post / 2, room.left + inset), (under, post, thick)
    draft.box("leg", low, size, keep=here & (post < 4), repeat=[mirrored(low, size)])
    draft.box("side", low, size, keep=here & (post >= 4), repeat=[mirrored(low, size)])
    foot = torch.maximum(post, room.depth - dice.pick(0, 2, 4))
    low, size = (room.floor, -foot / 2, room.left + inset), (dice.pick(1, 2), foot, thick)
    draft.box("horizontal_bar", low, size, keep=here, repeat=[mirrored(low, size)])
    high = room.floor + (under * (0.2 + 0.6 * dice.uniform())).round()
    draft.box(
        "horizontal_bar", (high, draft.column(-1), room.left + inset), (dice.pick(1, 2), draft.column(2),
        room.side - 2 * inset), keep=here & dice.chance(0.6),
    )  # fmt: skip


def _column(draft: Draft, room: Room, under: Whole, here: Flag) -> None:
    """A central support on a plate, a cross or nothing."""
    dice = draft.dice
    most = torch.floor(room.depth / 2)
    radius = torch.minimum(dice.pick(1, 2, 3, 4, weights=(0.35, 0.35, 0.2, 0.1)), most - 1)
    square = dice.chance(0.35)
    # Long tables stand on two.
    two = room.side > 1.4 * room.depth
    apart = torch.where(two, torch.floor(room.side / 2) - torch.remainder(torch.floor(room.side / 2), 2), 0.0)
    at = (room.floor, 0.0, -apart / 2)
    pair = [(torch.where(two, 2.0, 1.0), (0, 0, apart))]
    draft.add("support_cylinder", at=at, height=under, radius=radius, keep=here & ~square, repeat=pair)
    draft.add("support_cuboid", at=at, height=under, half=radius, keep=here & square, repeat=pair)
    reach = torch.maximum((most * (0.4 + 0.5 * dice.uniform())).floor(), radius + 1)
    thick = dice.pick(1, 2, weights=(0.7, 0.3))
    disc, plate, cross, star, _ = dice.kind(0.3, 0.2, 0.25, 0.15, 0.1)
    draft.add("base_circle", at=at, thickness=thick, radius=reach, keep=here & disc, repeat=pair)
    draft.add("base_square", at=at, thickness=thick, half=reach, keep=here & plate, repeat=pair)
    draft.add("base_cross", at=at, thickness=thick, length=reach, turn=0.0, turns=(4, 1), keep=here & cross & ~two)
    spokes = dice.pick(3, 4, 5, 6)
    draft.add(
        "line", start=(room.floor + dice.whole(0, 3), 0.0, 0.0), end=(room.floor, 1 - reach, 0.0), radius=1.0,
        turns=(spokes, 0), keep=here & star & ~two,
    )  # fmt: skip
