"""Cases: cabinets, dressers, wardrobes, night stands, television stands and bookshelves."""

from __future__ import annotations

import torch

from shapeprog.data.synthetic.dice import Flag, Whole
from shapeprog.data.synthetic.draft import Draft
from shapeprog.data.synthetic.room import Room, make_room, mirrored, opposite, spread


def cabinet(draft: Draft) -> None:
    """Cabinets of every proportion: a body or panels, with doors, drawers, shelves, handles, feet or a plinth."""
    dice = draft.dice
    tall = dice.chance(0.6)
    room = make_room(
        dice,
        torch.where(tall, 24.0, dice.even(10, 24)),
        dice.even(6, 18),
        torch.where(tall, dice.even(8, 24), 24.0),
    )  # fmt: skip
    _case(draft, room, *dice.kind(0.62, 0.28, 0.1))


def television_stand(draft: Draft) -> None:
    """Long low cases, mostly open at the front."""
    dice = draft.dice
    room = make_room(dice, dice.even(6, 14), dice.even(6, 16), draft.column(24))
    _case(draft, room, *dice.kind(0.35, 0.65, 0))


def night_stand(draft: Draft) -> None:
    """Small cases about as deep as wide."""
    dice = draft.dice
    room = make_room(dice, dice.even(18, 24), dice.even(14, 22), dice.even(14, 24))
    _case(draft, room, *dice.kind(0.5, 0.5, 0))


def bookshelf(draft: Draft) -> None:
    """Shelves between panels or posts, with or without a back and dividers."""
    dice = draft.dice
    room = make_room(dice, dice.even(18, 24), dice.even(4, 10), dice.even(8, 24))
    slab = dice.pick(1, 2, weights=(0.75, 0.25))
    posts = dice.chance(0.15)
    low, size = (room.floor, room.front, room.left), (room.up, room.depth, slab)
    draft.box("side", low, size, keep=~posts, repeat=[mirrored(low, size)])
    thick = torch.minimum(slab, room.depth / 2)
    low, size = (room.floor, room.front, room.left), (room.up, thick, slab)
    draft.box("leg", low, size, keep=posts, repeat=[mirrored(low, size), opposite(low, size, room.front, room.depth)])
    board = dice.pick(1, 2, weights=(0.75, 0.25))
    count = torch.minimum(dice.whole(2, 8), torch.floor(room.up / (board + 2)))
    raised = torch.where(dice.chance(0.5), 0.0, dice.whole(1, 3))
    pitch = spread(count, room.up - raised, board)
    start = room.ceiling - board - pitch * (count - 1)
    draft.box("shelf", (start, room.front, room.left), (board, room.depth, room.side), repeat=[(count, (pitch, 0, 0))])
    draft.box(
        "back", (start, room.rear - 1, room.left), (room.ceiling - start, draft.column(1), room.side),
        keep=dice.chance(0.6) & ~posts,
    )  # fmt: skip
    columns = dice.whole(1, 3)
    step = torch.floor((room.side - slab) / (columns + 1))
    middle = -torch.floor((step * (columns - 1) + slab) / 2)
    draft.box(
        "side", (start, room.front, middle), (room.ceiling - start, room.depth, slab),
        keep=dice.chance(0.35) & (step > 4), repeat=[(columns, (0, 0, step))],
    )  # fmt: skip
    filled = dice.chance(0.2)
    many = dice.whole(1, 2)
    draft.box(
        "locker", (start + board, room.front, room.left + slab), ((pitch * many - board).clamp(min=1), room.depth,
        room.side - 2 * slab), keep=filled & ~posts & (many < count),
    )  # fmt: skip


def _case(draft: Draft, room: Room, solid: Flag, panels: Flag, tub: Flag) -> None:
    """A body that is solid, of panels around compartments, or open above, on its base and under its top."""
    dice = draft.dice
    plain = solid & dice.chance(0.22)
    footed, plinth, apron = (flag & ~plain for flag in dice.kind(0.3, 0.18, 0.12, 0.4)[:3])
    raised = torch.where(footed | plinth | apron, dice.pick(1, 2, 3, 4, weights=(0.35, 0.35, 0.2, 0.1)), 0.0)
    raised = torch.minimum(raised, torch.floor(room.up / 4))
    covered = ~plain & ~tub & dice.chance(0.35)
    lid = torch.where(covered, dice.pick(1, 2, weights=(0.7, 0.3)), 0.0)
    proud = covered & dice.chance(0.75)
    eaves = torch.where(proud, 1.0, 0.0)
    bottom = room.floor + raised
    fronted = solid & ~plain & dice.chance(0.62)
    ahead = torch.where(fronted, 1.0, 0.0)
    body = Room(room.up - raised - lid, room.depth - 2 * eaves - ahead, room.side - 2 * eaves)
    front, rear, left = room.front + eaves + ahead, room.rear - eaves, room.left + eaves
    framed = solid & ~plain & ~fronted & dice.chance(0.5)
    recess = torch.where(framed, dice.whole(1, 2), 0.0)
    draft.box("locker", (bottom, front + recess, left), (body.up, body.depth - recess, body.side), keep=solid)
    _frame(draft, body, bottom, front, left, framed)
    _panelled(draft, body, bottom, front, rear, left, panels)
    _tub(draft, body, bottom, front, rear, left, tub)
    # A top that may overhang, or only a rim around it.
    rim = covered & ~proud & dice.chance(0.5)
    draft.box("top", (room.ceiling - lid, room.front, room.left), (lid, room.depth, room.side), keep=covered & ~rim)
    draft.box("vertical_board", (room.ceiling - lid, room.rear - 1, room.left), (lid, 1, room.side), keep=rim)
    low, size = (room.ceiling - lid, front, room.left), (lid, body.depth, draft.column(1))
    draft.box("side", low, size, keep=rim & dice.chance(0.6), repeat=[mirrored(low, size)])
    _fronts(draft, body, bottom, front, left, fronted)
    # What it stands on.
    foot = dice.pick(1, 2, 3, weights=(0.3, 0.5, 0.2))
    low, size = (room.floor, front, left), (raised, foot, foot)
    draft.box("leg", low, size, keep=footed, repeat=[mirrored(low, size), (2, (0, body.depth - foot, 0))])
    shrink = torch.where(proud & dice.chance(0.6), -1.0, dice.pick(0, 1, 2, weights=(0.2, 0.5, 0.3)))
    draft.box(
        "locker", (room.floor, front + shrink, left + shrink), (raised, body.depth - shrink, body.side - 2 * shrink),
        keep=plinth,
    )  # fmt: skip
    slab = dice.pick(1, 2)
    low, size = (room.floor, front, left), (raised, body.depth, slab)
    draft.box("side", low, size, keep=apron, repeat=[mirrored(low, size)])


def _frame(draft: Draft, body: Room, bottom: Whole, front: Whole, left: Whole, here: Flag) -> None:
    """Sides and boards that stand proud of a front."""
    dice = draft.dice
    slab = dice.pick(1, 2, 3, weights=(0.5, 0.3, 0.2))
    low, size = (bottom, front, left), (body.up, body.depth, slab)
    draft.box("side", low, size, keep=here & dice.chance(0.85), repeat=[mirrored(low, size)])
    board = dice.pick(1, 2)
    count = dice.pick(1, 2, 3, 4, weights=(0.2, 0.5, 0.15, 0.15))
    pitch = spread(count, body.up, board)
    draft.box(
        "shelf", (bottom + body.up - board - pitch * (count - 1), front, left), (board, body.depth, body.side),
        keep=here & dice.chance(0.8), repeat=[(count, (pitch, 0, 0))],
    )  # fmt: skip
    thick = dice.pick(1, 2)
    draft.box(
        "side", (bottom, front, -torch.ceil(thick / 2)), (body.up, body.depth, thick), keep=here & dice.chance(0.3)
    )


def _panelled(
    draft: Draft, body: Room, bottom: Whole, front: Whole, rear: Whole, left: Whole, here: Flag
) -> None:  # fmt: skip
    """Sides, shelves, back, dividers and closed parts."""
    dice = draft.dice
    slab = dice.pick(1, 2, weights=(0.65, 0.35))
    low, size = (bottom, front, left), (body.up, body.depth, slab)
    draft.box("side", low, size, keep=here, repeat=[mirrored(low, size)])
    board = dice.pick(1, 2, weights=(0.7, 0.3))
    count = torch.minimum(dice.whole(2, 5), torch.floor(body.up / (board + 3)).clamp(min=2))
    pitch = spread(count, body.up, board)
    top = bottom + body.up
    draft.box(
        "shelf", (top - board - pitch * (count - 1), front, left), (board, body.depth, body.side), keep=here,
        repeat=[(count, (pitch, 0, 0))],
    )  # fmt: skip
    thick = dice.pick(1, 2, weights=(0.7, 0.3))
    draft.box(
        "vertical_board", (bottom, rear - thick, left), (body.up, thick, body.side), keep=here & dice.chance(0.85)
    )
    columns = torch.minimum(dice.whole(1, 3), torch.floor(body.side / 6))
    step = torch.floor((body.side - slab) / (columns + 1))
    draft.box(
        "side", (bottom, front, -torch.floor((step * (columns - 1) + slab) / 2)), (body.up, body.depth, slab),
        keep=here & dice.chance(0.4) & (columns > 0), repeat=[(columns, (0, 0, step))],
    )  # fmt: skip
    lower = torch.floor(body.up * (0.25 + 0.5 * dice.uniform()))
    half = dice.chance(0.35)
    wide = torch.where(half, torch.floor(body.side / 2), body.side)
    right = half & dice.chance(0.5)
    draft.box(
        "locker",
        (torch.where(dice.chance(0.3), top - lower, bottom), front, torch.where(right, left + body.side - wide, left)),
        (torch.where(half & dice.chance(0.5), body.up, lower), body.depth, wide), keep=here & dice.chance(0.5),
    )  # fmt: skip


def _tub(
    draft: Draft, body: Room, bottom: Whole, front: Whole, rear: Whole, left: Whole, here: Flag
) -> None:  # fmt: skip
    """A body that is open above: four walls around a filled lower part."""
    dice = draft.dice
    wall = dice.pick(1, 2)
    sunk = torch.where(dice.chance(0.6), dice.whole(1, 3), dice.whole(4, 10))
    sunk = torch.minimum(sunk, body.up - 2)
    draft.box("locker", (bottom, front, left), (body.up - sunk, body.depth, body.side), keep=here)
    low, size = (bottom, front, left), (body.up, body.depth, wall)
    draft.box("side", low, size, keep=here, repeat=[mirrored(low, size)])
    low, size = (bottom, front, left), (body.up, wall, body.side)
    draft.box("vertical_board", low, size, keep=here, repeat=[(2, (0, body.depth - wall, 0))])


def _fronts(
    draft: Draft, body: Room, bottom: Whole, front: Whole, left: Whole, here: Flag
) -> None:  # fmt: skip
    """Doors, drawers or handles that stand a cell proud of the front."""
    dice = draft.dice
    doors, drawers, handles, both = dice.kind(0.3, 0.25, 0.35, 0.1)
    one = draft.column(1)
    margin = dice.pick(0, 1, weights=(0.4, 0.6))
    wide, tall = body.side - 2 * margin, body.up - 2 * margin
    columns = dice.pick(1, 2, 3, 4, weights=(0.35, 0.45, 0.15, 0.05))
    columns = torch.minimum(columns, torch.floor(wide / 4).clamp(min=1))
    rows = torch.minimum(torch.where(drawers, dice.whole(2, 6), 1.0), torch.floor(tall / 3).clamp(min=1))
    step, rise = torch.floor((wide + 1) / columns), torch.floor((tall + 1) / rows)
    start = left + torch.floor((body.side - (step * columns - 1)) / 2)
    base = bottom + torch.floor((body.up - (rise * rows - 1)) / 2)
    proud = front - 1
    draft.box(
        "vertical_board", (base, proud, start), (rise - 1, one, step - 1), keep=here & (doors | drawers),
        repeat=[(rows, (rise, 0, 0)), (columns, (0, 0, step))],
    )  # fmt: skip
    # One door below a row of drawers.
    low = torch.floor(tall * (0.4 + 0.3 * dice.uniform()))
    draft.box(
        "vertical_board", (bottom + margin, proud, start), (low, one, step - 1), keep=here & both,
        repeat=[(columns, (0, 0, step))],
    )  # fmt: skip
    draft.box(
        "vertical_board", (bottom + margin + low + 1, proud, start), ((tall - low - 1).clamp(min=1), one, step - 1),
        keep=here & both, repeat=[(columns, (0, 0, step))],
    )  # fmt: skip
    # Handles: bars lying on drawers, or upright beside the middle of doors.
    lying = dice.chance(0.55)
    long = torch.minimum(dice.whole(1, 4), step - 2).clamp(min=1)
    many = torch.minimum(dice.whole(1, 5), torch.floor(body.up / 3).clamp(min=1))
    gap = torch.floor(body.up / many)
    offset = left + torch.floor((step - long) / 2) + torch.floor((body.side - step * columns) / 2)
    draft.box(
        "horizontal_bar", (bottom + torch.floor(gap / 2), proud, offset), (one, one, long), keep=here & handles & lying,
        repeat=[(many, (gap, 0, 0)), (columns, (0, 0, step))],
    )  # fmt: skip
    height = torch.floor(body.up * (0.3 + 0.4 * dice.uniform()))
    apart = dice.pick(2, 3, 4)
    grip = torch.minimum(dice.whole(2, 6), body.up - height)
    draft.box(
        "vertical_board", (bottom + height, proud, -torch.floor(apart / 2)), (grip, one, one),
        keep=here & handles & ~lying, repeat=[(2, (0, 0, apart - 1))],
    )  # fmt: skip
