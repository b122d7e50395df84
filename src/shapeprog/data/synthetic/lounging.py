"""Sofas and beds."""

from __future__ import annotations

import torch

from shapeprog.data.synthetic.draft import Draft
from shapeprog.data.synthetic.room import make_room, mirrored, opposite, spread


def sofa(draft: Draft) -> None:
    """Sofas: a base with cushions, a back, arms and short legs, some with a chaise at one end."""
    dice = draft.dice
    room = make_room(
        dice, dice.even(6, 14), dice.even(8, 16), torch.where(dice.chance(0.9), 24.0, dice.even(12, 18))
    )  # fmt: skip
    raised = torch.where(dice.chance(0.5), dice.pick(1, 2, weights=(0.7, 0.3)), 0.0)
    height = (room.up * (0.35 + 0.2 * dice.uniform())).round()
    seat = torch.maximum(height, raised + 2)
    armed = dice.chance(0.85)
    arm = torch.where(armed, dice.pick(1, 2, 3, 4, weights=(0.2, 0.4, 0.25, 0.15)), 0.0)
    inner = room.side - 2 * arm
    floor, front = room.floor, room.front
    # The seat, deeper at the end with the chaise.
    chaise = dice.chance(0.15)
    short = torch.where(chaise, torch.floor(room.depth * 0.35), 0.0)
    low, size = (floor + raised, front + short, -inner / 2), (seat - raised, room.depth - short, inner)
    draft.box("locker", low, size)
    end = torch.floor(inner * 0.35)
    leftward = dice.chance(0.5)
    draft.box(
        "locker", (floor + raised, front, torch.where(leftward, -inner / 2, inner / 2 - end)),
        (seat - raised, short + 1, end), keep=chaise,
    )  # fmt: skip
    thick, tilt = dice.pick(1, 2, 3, 4, weights=(0.2, 0.35, 0.3, 0.15)), dice.pick(0, 1, 2, weights=(0.6, 0.2, 0.2))
    over = dice.chance(0.3)
    wide = torch.where(over, room.side, inner)
    draft.box("back", (floor + seat, room.rear - tilt - thick, -wide / 2), (room.up - seat, thick, wide), tilt=tilt)
    # Arms from the floor or from the legs up.
    rise = torch.minimum(dice.whole(1, 4), room.up - seat)
    base = floor + torch.where(dice.chance(0.5), raised, 0.0)
    back = torch.where(dice.chance(0.75) | (raised > 0), 0.0, dice.pick(1, 2))
    low, size = (base, front + short + back, room.left), (floor + seat + rise - base, room.depth - short - back, arm)
    draft.box("side", low, size, keep=armed, repeat=[mirrored(low, size)])
    # Cushions with a cell between them.
    count = dice.pick(1, 2, 3, 4, weights=(0.2, 0.35, 0.35, 0.1))
    step = torch.floor((inner + 1) / count)
    start = -torch.floor((step * count - 1) / 2)
    cushion = torch.minimum(dice.pick(1, 2, weights=(0.7, 0.3)), room.up - seat)
    deep = room.depth - short - tilt - thick
    draft.box(
        "locker", (floor + seat, front + short, start), (cushion, deep, step - 1), keep=dice.chance(0.4),
        repeat=[(count, (0, 0, step))],
    )  # fmt: skip
    soft = dice.chance(0.25) & (tilt == 0)
    high = torch.floor((room.up - seat) * (0.5 + 0.4 * dice.uniform())).clamp(min=2)
    draft.box(
        "back", (floor + seat, room.rear - thick - 2, start), (high, draft.column(2), step - 1), keep=soft,
        repeat=[(count, (0, 0, step))],
    )  # fmt: skip
    foot = dice.pick(1, 2)
    low, size = (floor, front + short, room.left), (raised, foot, foot)
    draft.box(
        "leg", low, size, keep=raised > 0,
        repeat=[mirrored(low, size), opposite(low, size, front + short, room.depth - short)],
    )  # fmt: skip


def bed(draft: Draft) -> None:
    """Beds: a mattress on a frame or slats between head and foot boards, on legs or posts; bunk beds; canopies."""
    dice = draft.dice
    bunk, plain = dice.chance(0.12), dice.chance(0.88)
    high = torch.where(plain, dice.even(6, 16), dice.even(4, 8))
    wide = torch.where(bunk, dice.even(10, 14), dice.even(12, 24))
    room = make_room(dice, torch.where(bunk, dice.even(16, 22), high), draft.column(24), wide)
    floor, front, left = room.floor, room.front, room.left
    raised = dice.pick(0, 1, 2, 3, weights=(0.35, 0.2, 0.25, 0.2))
    lying = torch.where(bunk, 3.0, (room.up * (0.4 + 0.3 * dice.uniform())).round())
    lying = torch.maximum(lying, raised + 2)
    lying = torch.where(plain | bunk, lying, room.up)
    head, foot = dice.pick(1, 2, weights=(0.6, 0.4)), torch.where(dice.chance(0.5), dice.pick(1, 2), 0.0)
    shift = torch.where(bunk, room.up - lying - dice.whole(2, 4), 0.0)
    levels = torch.where(bunk, 2.0, 1.0)
    up = (levels, (shift, 0, 0))
    # Mattress on a frame that is a cell wider, or on slats.
    frame = torch.minimum(dice.pick(1, 2, 3), lying - raised - 1)
    slim = dice.pick(0, 1, weights=(0.4, 0.6))
    slatted = dice.chance(0.12) & (raised > 0)
    ahead = torch.where(bunk, 0.0, foot)
    low, size = (floor + raised, front + ahead, left), (frame, room.depth - ahead - head, room.side)
    draft.box("locker", low, size, keep=~slatted, repeat=[up])
    count = dice.whole(5, 8)
    step = torch.floor(room.depth / count)
    draft.box(
        "horizontal_bar", (floor + raised, front, left), (torch.minimum(frame, draft.column(2)),
        (step - dice.whole(1, 2)).clamp(min=1), room.side), keep=slatted & ~bunk, repeat=[(count, (0, step, 0))],
    )  # fmt: skip
    side_rail = dice.pick(1, 2)
    rail_low, rail_size = (floor + raised, front, left), (frame, room.depth, side_rail)
    draft.box("horizontal_bar", rail_low, rail_size, keep=slatted & ~bunk, repeat=[mirrored(rail_low, rail_size)])
    low = (floor + raised + frame, front + foot, left + slim)
    size = (lying - raised - frame, room.depth - head - foot, room.side - 2 * slim)
    draft.box("locker", low, size, keep=~slatted | bunk, repeat=[up])
    # Head and foot.
    tall = torch.where(plain | bunk, room.up, lying)
    draft.box("back", (floor, room.rear - head, left), (tall, head, room.side))
    low_foot = torch.minimum(lying + dice.whole(0, 4), room.up)
    draft.box("vertical_board", (floor, front, left), (low_foot, foot, room.side), keep=(foot > 0) & ~bunk & plain)
    # Pillows lie at the head.
    pillows = dice.whole(1, 2)
    long = torch.floor((room.side - 2) / pillows) - 1
    draft.box(
        "locker", (floor + lying, room.rear - head - dice.whole(4, 5), left + 1), (1.0, 4.0, long),
        keep=dice.chance(0.3) & ~bunk & ~slatted & (room.up > lying), repeat=[(pillows, (0, 0, long + 2))],
    )  # fmt: skip
    # Legs, or posts to the top.
    thick = dice.pick(1, 2, weights=(0.5, 0.5))
    posts = bunk | dice.chance(0.08)
    low, size = (floor, front, left), (torch.where(posts, room.up, raised), thick, thick)
    draft.box(
        "leg", low, size, keep=(raised > 0) | posts,
        repeat=[mirrored(low, size), opposite(low, size, front, room.depth)],
    )  # fmt: skip
    rungs = dice.whole(3, 6)
    pitch = spread(rungs, room.up - 4, 1)
    draft.box(
        "horizontal_bar", (floor + 2, front, -2.0), (1.0, 1.0, 4.0),
        keep=bunk & dice.chance(0.6), repeat=[(rungs, (pitch, 0, 0))],
    )  # fmt: skip
