"""Cases of several bodies: hutches, corner cabinets and racks of pigeonholes."""

from __future__ import annotations

import torch

from shapeprog.data.synthetic.draft import Draft
from shapeprog.data.synthetic.room import make_room, mirrored, row, spread


def hutch(draft: Draft) -> None:
    """A deep lower body that carries a shallow upper one, closed or with shelves, some with a gap between them."""
    dice = draft.dice
    room = make_room(dice, dice.even(20, 24), dice.even(8, 16), dice.even(10, 24))
    floor, front, left = room.floor, room.front, room.left
    raised = torch.where(dice.chance(0.4), dice.pick(1, 2), 0.0)
    lower = (room.up * (0.35 + 0.2 * dice.uniform())).round()
    draft.box("locker", (floor + raised, front, left), (lower - raised, room.depth, room.side))
    foot = dice.pick(1, 2)
    low, size = (floor, front, left), (raised, foot, foot)
    footed = (raised > 0) & dice.chance(0.6)
    draft.box("leg", low, size, keep=footed, repeat=[mirrored(low, size), (2, (0, room.depth - foot, 0))])
    draft.box(
        "locker", (floor, front + 1, left + 1), (raised, room.depth - 1, room.side - 2), keep=(raised > 0) & ~footed
    )
    # The upper part stands at the rear, as wide or a little narrower.
    inset = dice.pick(0, 1, 2, weights=(0.6, 0.25, 0.15))
    depth = (room.depth * (0.4 + 0.4 * dice.uniform()) / 2).round().clamp(min=1) * 2
    wide, start = room.side - 2 * inset, room.rear - depth
    gap = torch.where(dice.chance(0.35), dice.whole(2, 4), 0.0)
    base, tall = floor + lower + gap, room.up - lower - gap
    shelves, closed = dice.kind(0.55, 0.45)
    draft.box("locker", (base, start, -wide / 2), (tall, depth, wide), keep=closed)
    slab = dice.pick(1, 2)
    low, size = (base - gap, start, -wide / 2), (tall + gap, depth, slab)
    draft.box("side", low, size, keep=shelves | (gap > 0), repeat=[mirrored(low, size)])
    draft.box("vertical_board", (base - gap, room.rear - 1, -wide / 2), (tall + gap, 1, wide), keep=dice.chance(0.8))
    count = torch.minimum(dice.whole(1, 4), torch.floor(tall / 3).clamp(min=1))
    pitch = spread(count + 1, tall, 1)
    draft.box(
        "shelf", (room.ceiling - 1 - pitch * (count - 1), start, -wide / 2), (1, depth, wide), keep=shelves,
        repeat=[(count, (pitch, 0, 0))],
    )  # fmt: skip
    eaves = dice.chance(0.3) & (inset > 0)
    draft.box("top", (room.ceiling - 1, start - 1, -wide / 2 - 1), (1, depth + 1, wide + 2), keep=eaves)


def corner(draft: Draft) -> None:
    """Two bodies at a right angle along the rear and one side, with a worktop or open shelves."""
    dice = draft.dice
    tall = dice.chance(0.6)
    across = torch.where(tall, dice.even(12, 20), 24.0)
    room = make_room(dice, torch.where(tall, 24.0, dice.even(8, 20)), across, across)
    behind, beside = (torch.floor(across * (0.35 + 0.3 * dice.uniform())) for _ in range(2))
    lid = torch.where(dice.chance(0.3), 1.0, 0.0)
    base = torch.where(dice.chance(0.3), dice.pick(1, 2), 0.0)
    right = dice.chance(0.5)
    left = torch.where(right, -room.left - beside, room.left)
    up, shrink = room.up - lid - base, torch.where(lid > 0, 1.0, 0.0)
    low = (room.floor + base, room.rear - behind + shrink, room.left)
    draft.box("locker", low, (up, behind - shrink, room.side))
    edge = torch.where(right, left + shrink, left)
    draft.box("locker", (room.floor + base, room.front, edge), (up, room.depth, beside - shrink))
    draft.box("locker", (room.ceiling - lid, room.rear - behind, room.left), (lid, behind, room.side), keep=lid > 0)
    draft.box("locker", (room.ceiling - lid, room.front, left), (lid, room.depth, beside), keep=lid > 0)
    inner = (room.floor, room.rear - behind + 1, room.left)
    draft.box("locker", inner, (base, behind - 1, room.side), keep=base > 0)
    edge = torch.where(right, left + 1, left)
    draft.box("locker", (room.floor, room.front, edge), (base, room.depth, beside - 1), keep=base > 0)


def pigeonholes(draft: Draft) -> None:
    """A lattice of upright and lying boards, some with a back, drawers or a closed lower part."""
    dice = draft.dice
    tall = dice.chance(0.6)
    room = make_room(
        dice, torch.where(tall, 24.0, dice.even(8, 22)), dice.even(4, 12), torch.where(tall, dice.even(8, 24), 24.0)
    )
    slab = dice.pick(1, 2, weights=(0.8, 0.2))
    uprights = row(torch.minimum(dice.whole(2, 8), torch.floor(room.side / (slab + 2))), room.side, slab)
    draft.box("side", (room.floor, room.front, room.left), (room.up, room.depth, slab), repeat=[uprights])
    count = torch.minimum(dice.whole(2, 8), torch.floor(room.up / (slab + 2)))
    pitch = spread(count, room.up, slab)
    start = room.ceiling - slab - pitch * (count - 1)
    draft.box("shelf", (start, room.front, room.left), (slab, room.depth, room.side), repeat=[(count, (pitch, 0, 0))])
    draft.box("back", (start, room.rear - 1, room.left), (room.ceiling - start, 1, room.side), keep=dice.chance(0.75))
    rows = torch.minimum(dice.whole(1, 2), count - 1)
    deep = torch.where(dice.chance(0.7), room.depth, room.depth - 1)
    draft.box(
        "locker", (start, -room.front - deep, room.left), (pitch * rows + slab, deep, room.side), keep=dice.chance(0.4)
    )
