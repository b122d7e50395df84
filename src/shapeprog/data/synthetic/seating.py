"""Things to sit on: benches, chairs and stools."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from shapeprog.data.synthetic.dice import Flag, Whole
from shapeprog.data.synthetic.draft import Draft
from shapeprog.data.synthetic.room import Room, make_room, mirrored, opposite, row, spread


@dataclass(frozen=True)
class Seat:
    """Where the seat is: its top above the floor, its thickness, and how deep and wide it is from the front."""

    top: Whole
    thickness: Whole
    depth: Whole
    side: Whole

    @property
    def under(self) -> Whole:
        """Height of its underside above the floor."""
        return self.top - self.thickness


def bench(draft: Draft) -> None:
    """Benches: long seats of boards or planks on legs, panels, trestles or a body, with or without back and arms."""
    dice = draft.dice
    backed = dice.chance(0.62)
    tilt = torch.where(backed, dice.pick(0, 1, 2, 3, 4, weights=(0.6, 0.1, 0.17, 0.05, 0.08)), 0.0)
    room = make_room(
        dice,
        torch.where(backed, dice.even(8, 18), dice.even(4, 14)),
        torch.where(backed, dice.even(6, 14) + 2 * (tilt > 2), dice.even(4, 12)),
        torch.where(dice.chance(0.94), 24.0, dice.even(14, 22)),
    )
    arms = dice.chance(0.4)
    share = torch.where(backed, 0.3 + 0.3 * dice.uniform(), 0.5 + 0.3 * dice.uniform())
    top = torch.where(backed | arms, (room.up * share).round(), room.up).clamp(min=3)
    _seat_and_all(draft, room, top, backed, arms, tilt, long=True)


def chair(draft: Draft) -> None:
    """Chairs and arm chairs: as tall as the grid allows."""
    dice = draft.dice
    tilt = dice.pick(0, 1, 2, 3, 4, 5, 6, weights=(0.4, 0.1, 0.2, 0.1, 0.1, 0.05, 0.05))
    room = make_room(dice, dice.even(22, 24), dice.even(12, 20) + (tilt > 3) * 2, dice.even(10, 20))
    top = (room.up * (0.35 + 0.2 * dice.uniform())).round()
    _seat_and_all(draft, room, top, dice.chance(1), dice.chance(0.45), tilt, long=False)


def stool(draft: Draft) -> None:
    """Stools: a seat on legs or on a central support, taller than wide."""
    dice = draft.dice
    across = dice.even(8, 20)
    room = make_room(dice, dice.even(18, 24), torch.where(dice.chance(0.75), across, dice.even(8, 16)), across)
    never = dice.chance(0)
    _seat_and_all(draft, room, room.up, never, never, torch.zeros_like(across), long=False)


def _seat_and_all(
    draft: Draft, room: Room, top: Whole, backed: Flag, arms: Flag, tilt: Whole, *, long: bool
) -> None:  # fmt: skip
    dice = draft.dice
    panels = arms & dice.chance(0.3)
    arm = torch.where(arms, dice.pick(1, 2, weights=(0.6, 0.4)), 0.0)
    outside = arms & (panels | dice.chance(0.4))
    seat = Seat(
        top,
        torch.minimum(dice.pick(1, 2, 3, weights=(0.4, 0.4, 0.2)), top - 2),
        room.depth - tilt,
        room.side - 2 * torch.where(outside, arm, dice.pick(0, 1, weights=(0.85, 0.15))),
    )
    _surface(draft, room, seat, long=long)
    risers = _supports(draft, room, seat, panels, backed & (tilt == 0) & dice.chance(0.25), long=long)
    _back(draft, room, seat, backed, tilt, risers)
    _arms(draft, room, seat, arms, backed, panels, outside, arm, long=long)


def _surface(draft: Draft, room: Room, seat: Seat, *, long: bool) -> None:
    dice = draft.dice
    board, planks, slats, disc = dice.kind(*((0.62, 0.3, 0.08, 0) if long else (0.78, 0.07, 0.05, 0.1)))
    base = room.floor + seat.under
    # Only where it is as deep as wide is a seat round.
    round_seat = disc & (seat.depth == seat.side)
    draft.box(
        "top", (base, room.front, -seat.side / 2), (seat.thickness, seat.depth, seat.side),
        keep=board | (disc & ~round_seat),
    )  # fmt: skip
    if not long:
        draft.add(
            "top_circle", at=(base, room.front + seat.depth / 2, 0.0), thickness=seat.thickness,
            radius=seat.depth / 2, keep=round_seat,
        )  # fmt: skip
    gap, plank = 1.0, dice.pick(1, 2, 3, weights=(0.35, 0.45, 0.2))
    many = torch.floor((seat.depth + gap) / (plank + gap)).clamp(1, 8)
    draft.box(
        "horizontal_bar", (base, room.front, -seat.side / 2), (seat.thickness, plank, seat.side), keep=planks,
        repeat=[(many, (0, plank + gap, 0))],
    )  # fmt: skip
    count = dice.whole(5, 8)
    step = torch.floor(seat.side / count)
    draft.box(
        "horizontal_bar", (base, room.front, -torch.floor((step * count - 1) / 2)),
        (seat.thickness, seat.depth, (step - 1).clamp(min=1)), keep=slats, repeat=[(count, (0, 0, step))],
    )  # fmt: skip


def _supports(draft: Draft, room: Room, seat: Seat, panels: Flag, risers: Flag, *, long: bool) -> Flag:
    """What the seat stands on; where asked for, and there are legs, those at the rear rise to carry the back."""
    dice = draft.dice
    legs, sides, trestles, sled, body, central = dice.kind(
        *((0.44, 0.2, 0.1, 0.1, 0.16, 0) if long else (0.55, 0.08, 0, 0.12, 0.07, 0.18))
    )
    floor, front = room.floor, room.front
    inset = torch.where(dice.chance(0.55), 0.0, dice.whole(1, 4 if long else 2))
    left = -seat.side / 2 + inset
    # Legs at the corners, in rows of up to four along the side.
    wide, deep = dice.pick(1, 2, 3, weights=(0.35, 0.5, 0.15)), dice.pick(1, 2, 3, weights=(0.4, 0.45, 0.15))
    start = front + torch.where(seat.depth > 8, dice.pick(0, 1, weights=(0.7, 0.3)), 0.0)
    low, size = (floor, start, left), (seat.under, deep, wide)
    along = row(
        dice.pick(2, 3, 4, weights=(0.75, 0.17, 0.08)) if long else draft.column(2), seat.side - 2 * inset, wide
    )
    standing = (legs | sled) & ~panels
    risers = risers & standing
    behind = opposite(low, size, front, seat.depth)
    pairs = (torch.where(risers, 1.0, 2.0), behind[1])
    draft.box("leg", low, size, keep=standing, repeat=[along, pairs])
    low, size = (floor, start + behind[1][1], left), (room.up, deep, wide)
    draft.box("leg", low, size, keep=risers, repeat=[along])
    runner = dice.pick(1, 2)
    foot_low, foot_size = (floor, start, left), (runner, seat.depth - 2 * (start - front), wide)
    draft.box("horizontal_bar", foot_low, foot_size, keep=sled & ~panels, repeat=[along])
    # Bars between the legs, lengthwise and from front to rear.
    height = floor + (seat.under * (0.2 + 0.5 * dice.uniform())).round()
    bar = torch.minimum(dice.pick(1, 2, weights=(0.75, 0.25)), wide)
    lengthwise, crosswise = dice.chance(0.25), dice.chance(0.3)
    middle = crosswise & dice.chance(0.5)
    low = (height, torch.where(middle, front + torch.floor((seat.depth - bar) / 2), start), left)
    size = (bar, bar, seat.side - 2 * inset)
    across = opposite(low, size, front, seat.depth)
    twice = (torch.where(middle, 1.0, 2.0), across[1])
    draft.box("horizontal_bar", low, size, keep=standing & lengthwise, repeat=[twice])
    low, size = (height, start, left), (bar, seat.depth - 2 * (start - front), bar)
    draft.box("horizontal_bar", low, size, keep=standing & crosswise, repeat=[along])
    # Panels at the sides, boards, or a body.
    thick = dice.pick(1, 2, 3, weights=(0.4, 0.45, 0.15))
    low, size = (floor, front, left), (seat.under, seat.depth, thick)
    draft.box("side", low, size, keep=sides & ~panels, repeat=[mirrored(low, size)])
    narrow = torch.minimum(dice.even(2, 6), seat.depth)
    low = (floor, front + torch.floor((seat.depth - narrow) / 2), left)
    size = (seat.under, narrow, thick)
    if long:
        draft.box("leg", low, size, keep=trestles & ~panels & (narrow <= 3), repeat=[mirrored(low, size)])
        draft.box("side", low, size, keep=trestles & ~panels & (narrow > 3), repeat=[mirrored(low, size)])
    shrink = dice.pick(0, 1, weights=(0.6, 0.4))
    parts = dice.pick(1, 2, 3, weights=(0.75, 0.15, 0.1)) if long else draft.column(1)
    share = torch.where(parts > 1, dice.whole(4, 6), seat.side - 2 * inset)
    many, step = row(parts, seat.side - 2 * inset, share)
    draft.box(
        "locker", (floor, front + shrink, left), (seat.under, seat.depth - 2 * shrink, share), keep=body,
        repeat=[(torch.where(parts > 1, many, 1.0), step)],
    )  # fmt: skip
    # A rim under the edges of the seat.
    tall = torch.minimum(dice.whole(1, 2), (seat.under - 2).clamp(min=1))
    low, size = (floor + seat.under - tall, start, left), (tall, draft.column(1), seat.side - 2 * inset)
    rim = opposite(low, size, front, seat.depth)
    draft.box("horizontal_bar", low, size, keep=(standing | sides) & ~panels & dice.chance(0.15), repeat=[rim])
    if not long:
        _central(draft, room, seat, central & ~panels)
    return risers


def _central(draft: Draft, room: Room, seat: Seat, here: Flag) -> None:
    """A column under the middle of the seat, on a plate, a cross or a star."""
    dice = draft.dice
    middle = torch.floor(room.front + seat.depth / 2)
    radius = dice.pick(1, 2)
    draft.add(
        "support_cylinder", at=(room.floor, middle, 0.0), height=seat.under, radius=radius,
        keep=here,
    )  # fmt: skip
    cross, star, plate = dice.kind(0.4, 0.3, 0.3)
    reach = torch.floor(torch.minimum(seat.depth, seat.side) / 2) - dice.pick(0, 1)
    thick = dice.pick(1, 2, weights=(0.7, 0.3))
    draft.add(
        "base_cross", at=(room.floor, middle, 0.0), thickness=thick, length=reach, turn=0.0, keep=here & cross,
        turns=(4, 1),
    )  # fmt: skip
    draft.add(
        "line", start=(room.floor + dice.whole(0, 4), middle, 0.0), end=(room.floor, middle - reach + 1, 0.0),
        radius=1.0, keep=here & star, turns=(dice.pick(3, 4, 5, 6, weights=(0.15, 0.2, 0.5, 0.15)), 0),
    )  # fmt: skip
    draft.add(
        "base_circle", at=(room.floor, middle, 0.0), thickness=thick, radius=reach, keep=here & plate,
    )  # fmt: skip


def _back(draft: Draft, room: Room, seat: Seat, backed: Flag, tilt: Whole, risers: Flag) -> None:
    dice = draft.dice
    gap = torch.where(dice.chance(0.55), 0.0, dice.whole(1, 3))
    tall = (room.up - seat.top - gap).clamp(min=2)
    thick = dice.pick(1, 2, 3, weights=(0.5, 0.4, 0.1))
    start = room.rear - tilt - thick
    bottom = room.ceiling - tall
    inset = dice.pick(0, 1, 2, weights=(0.7, 0.2, 0.1))
    left, wide = -seat.side / 2 + inset, seat.side - 2 * inset
    board, rails, spindles, rail = dice.kind(0.5, 0.22, 0.14, 0.14)
    framed = rails | spindles | rail
    # Boards lean; what is made of rails and posts leans by whole steps from rail to rail.
    solid = backed & (board | (tall < 5))
    draft.box("back", (bottom, start, left), (tall, thick, wide), keep=solid, tilt=tilt)
    post = dice.pick(1, 2)
    low, size = (room.floor + seat.top, start, left + dice.whole(0, 2)), (gap, thick, post)
    draft.box("back_support", low, size, keep=solid & ~risers & (gap > 0), repeat=[mirrored(low, size)])
    framed = backed & framed & (tall >= 5)
    high = dice.pick(1, 2, weights=(0.4, 0.6))
    space = dice.pick(1, 2)
    many = torch.floor((tall + space) / (high + space)).clamp(2, 6)
    step = torch.floor(tilt / (many - 1).clamp(min=1))
    draft.box(
        "chair_beam", (room.ceiling - many * (high + space) + space, start, left), (high, thick, wide),
        keep=framed & rails, repeat=[(many, (high + space, step, 0))],
    )  # fmt: skip
    draft.box(
        "chair_beam", (room.ceiling - high - 1, start + tilt, left), (high + 1, thick, wide), keep=framed & ~rails
    )
    count = torch.where(spindles, dice.whole(3, 8), dice.pick(2, 3, weights=(0.8, 0.2)))
    count = torch.minimum(count, torch.floor(wide / (post + 1)))
    pitch = spread(count, wide - 2 * inset, post)
    width = pitch * (count - 1) + post
    base = room.floor + seat.top
    leaning = tilt > 0
    draft.box(
        "back_support", (base, room.rear - thick, -torch.floor(width / 2)), (room.up - seat.top - high, thick, post),
        keep=framed & ~leaning & (spindles | ~risers), repeat=[(count, (0, 0, pitch))],
    )  # fmt: skip
    draft.box(
        "back", (base, start, -torch.floor(width / 2)), (room.up - seat.top - high, thick, post),
        keep=framed & leaning, repeat=[(count, (0, 0, pitch))], tilt=tilt,
    )  # fmt: skip


def _arms(
    draft: Draft, room: Room, seat: Seat, arms: Flag, backed: Flag, panels: Flag, outside: Flag, width: Whole, *,
    long: bool,
) -> None:  # fmt: skip
    dice = draft.dice
    above = torch.minimum((room.up - seat.top).clamp(min=2), dice.whole(3, 7))
    thick = dice.pick(1, 2, weights=(0.7, 0.3))
    short = dice.pick(0, 1, 2, weights=(0.6, 0.2, 0.2))
    front, left = room.front + short, room.left
    low, size = (room.floor, room.front, left), (seat.top + above, seat.depth, width)
    draft.box("side", low, size, keep=arms & panels, repeat=[mirrored(low, size)])
    beams = arms & ~panels
    low, size = (room.floor + seat.top + above - thick, front, left), (thick, seat.depth - short, width)
    block = beams & dice.chance(0.2)
    count = torch.where(outside, 2.0, dice.pick(2, 3, weights=(0.8, 0.2))) if long else draft.column(2)
    along = row(count, room.side, width)
    draft.box("chair_beam", low, size, keep=beams & ~block, repeat=[along])
    # Posts carry them in front, at both ends where there is no back, and down to the floor beside the seat.
    posts = beams & ~block & (dice.chance(0.85) | ~backed | outside)
    deep = dice.pick(1, 2)
    low, size = (room.floor + seat.top, front, left), (above - thick, deep, width)
    ends = (torch.where(backed, 1.0, 2.0), (0, seat.depth - short - deep, 0))
    draft.box("chair_beam", low, size, keep=posts & ~outside, repeat=[along, ends])
    low, size = (room.floor, front, left), (seat.top + above - thick, deep, width)
    draft.box("leg", low, size, keep=posts & outside, repeat=[mirrored(low, size), ends])
    low, size = (room.floor + seat.under, front, left), (above + seat.thickness, seat.depth - short, width)
    draft.box("side", low, size, keep=block, repeat=[mirrored(low, size)])
