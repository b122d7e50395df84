"""The box that a piece of furniture fills, centred on the grid, and repeats that mirror parts within it."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from shapeprog.data.synthetic.dice import Dice, Number, Whole
from shapeprog.data.synthetic.draft import Rows, Triple
from shapeprog.space import SPAN


@dataclass(frozen=True)
class Room:
    """A box around the centre of the grid, one for each program.

    Parameters
    ----------
    up, depth, side
        Its extents in cells, even.
    """

    up: Whole
    depth: Whole
    side: Whole

    @property
    def floor(self) -> Whole:
        """Height of its lower face."""
        return -self.up / 2

    @property
    def front(self) -> Whole:
        """Depth of its front face."""
        return -self.depth / 2

    @property
    def rear(self) -> Whole:
        """Depth of its rear face."""
        return self.depth / 2

    @property
    def left(self) -> Whole:
        """Left-right position of its left face."""
        return -self.side / 2

    @property
    def ceiling(self) -> Whole:
        """Height of its upper face."""
        return self.up / 2


def make_room(dice: Dice, up: Whole, depth: Whole, side: Whole, small: float = 0.06) -> Room:
    """A room of even extents, stretched to the longest side that shapes have in the grid, but for a few.

    Parameters
    ----------
    up, depth, side
        Extents of which only the proportions count.
    small
        Share of rooms that are left smaller than the longest side of a shape.
    """
    longest = torch.maximum(torch.maximum(up, depth), side)
    span = torch.where(dice.chance(small), dice.even(SPAN - 6, SPAN), float(SPAN))
    scale = span / longest
    return Room(*((each * scale / 2).round().clamp(min=1) * 2 for each in (up, depth, side)))


def mirrored(low: Triple, size: Triple) -> Rows:
    """A second copy on the other side of the middle, left to right."""
    return 2, (0, 0, -2 * low[2] - size[2])


def opposite(low: Triple, size: Triple, front: Number, depth: Number) -> Rows:
    """A second copy at the other end of a stretch in depth."""
    return 2, (0, 2 * front + depth - 2 * low[1] - size[1], 0)


def row(count: Whole, room: Number, size: Number) -> Rows:
    """``count`` copies from end to end of a stretch left to right, or two where so many do not fit evenly."""
    between = (count - 1).clamp(min=1)
    many = torch.where(torch.remainder(room - size, between) == 0, count, 2.0)
    return many, (0, 0, spread(many, room, size))


def spread(count: Whole, room: Number, size: Number) -> Whole:
    """The step from one to the next of ``count`` equal parts that fill a stretch from end to end, in whole cells."""
    return torch.floor((room - size) / (count - 1).clamp(min=1))
