"""Naming parts by what they do: a leg stands under, a back rises behind, a top covers, a bar connects.

A part is measured among the others, in the grid frame, and the first rule of a table that fits gives its name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shapeprog.inference.block_layout import (
    BACK,
    BOX,
    COUNT1,
    COUNT2,
    CROSS,
    DISC,
    FIRST,
    FORM,
    LINE,
    ROTATE,
    SHIFT1,
    SHIFT2,
)  # fmt: skip
from shapeprog.space import DEPTH, SIDE, UP, FloatArray

THIN = 0.45
"""A board is thinner than this share of its other two sides: thicker ones read as bodies."""

WIDE = 0.3
"""A top or layer covers at least this share of the footprint of the shape: less is a bar or a drawer."""

BROAD = 0.4
"""A back is at least this share of the shape wide: less is one of several uprights."""

SLENDER = 0.3
"""A leg is at most this share of the longer horizontal side thick."""

SEAT = 0.6
"""The seat covers at least this share of what the widest part covers; the highest such part is the seat."""

NEAR = 2.0
"""Cells within which a part touches the ground, or starts at the height of the seat."""

PLATE = 3.0
"""Most cells that a plate is thick: a thicker one on the ground is a body, and a thinner back is a rail."""

REAR = 0.1
"""What is behind lies at least this share of the depth to the rear of the middle."""

BOARD = 4.0
"""Cells from which an upright that is thin the other way is a board and no post."""


@dataclass(frozen=True)
class Surroundings:
    """The bounding box of a shape and the height of its main horizontal surface, in cells."""

    low: FloatArray
    high: FloatArray
    seat: float

    @property
    def size(self) -> FloatArray:
        """Extents of the bounding box."""
        return self.high - self.low


class Part:
    """The measures of one block among its surroundings that the rules ask for.

    Parameters
    ----------
    block
        Its row of numbers.
    around
        The bounding box and seat of all blocks.
    """

    def __init__(self, block: FloatArray, around: Surroundings) -> None:
        low, high = (corner.tolist() for corner in bounds(block))
        ground, top, size = float(around.low[UP]), float(around.high[UP]), around.size.tolist()
        up, depth, side = (float(value) for value in extent(block))
        long, short = max(depth, side), min(depth, side)
        off = [
            abs(a + b - float(c) - float(d)) / 2 for a, b, c, d in zip(low, high, around.low, around.high, strict=True)
        ]
        board = long >= BOARD and short <= THIN * long
        backed = around.seat < top - NEAR
        self.up, self.depth, self.side = up, depth, side
        self.lying: bool = up <= THIN * short
        self.facing_front: bool = depth <= THIN * min(up, side)
        self.facing_side: bool = side <= min(up, depth) / 2
        self.wide: bool = depth * side >= WIDE * size[DEPTH] * size[SIDE]
        self.broad: bool = side >= BROAD * size[SIDE]
        self.square: bool = depth == side
        self.slender: bool = long <= SLENDER * max(size[DEPTH], size[SIDE])
        self.post: bool = self.slender and up >= 1.2 * long and not board
        self.bar: bool = PLATE <= long >= 2 * max(up, short) and not (self.wide and up > PLATE)
        self.stacked: bool = any(block[count] > 1 and block[shift] != 0 for count, shift in _LOOPS)
        self.central: bool = block[COUNT1] * block[COUNT2] == 1 and max(off[DEPTH], off[SIDE]) <= NEAR
        self.grounded: bool = low[UP] <= ground + NEAR
        self.at_seat: bool = high[UP] >= around.seat - 1
        self.rising: bool = backed and high[UP] >= around.seat + NEAR
        self.above: bool = self.rising and low[UP] >= around.seat - NEAR
        self.behind: bool = (
            low[DEPTH] + high[DEPTH] - float(around.low[DEPTH] + around.high[DEPTH])
        ) / 2 > REAR * size[DEPTH]


Rule = tuple[str, Callable[[Part], bool]]

BOXES: tuple[Rule, ...] = (
    # Wide lying boards: shelves are stacked or below the top, and what lies on the ground carries.
    ("layer", lambda part: part.lying and part.wide and part.stacked),
    ("top", lambda part: part.lying and part.wide and part.at_seat and not part.grounded),
    ("base_square", lambda part: part.lying and part.central and part.square and part.grounded and part.up <= PLATE),
    ("locker", lambda part: part.lying and part.wide and part.grounded and part.up > PLATE),
    ("layer", lambda part: part.lying and part.wide),
    # Posts: what stands on the ground is a leg even where it goes on as the post of a back.
    ("support_cuboid", lambda part: part.post and part.central and part.square and not part.above),
    ("back_support", lambda part: part.post and part.rising and part.behind and not part.grounded),
    ("leg", lambda part: part.post and not part.above),
    # What rises above a seat: boards behind, the uprights and rails of a back, arm rests.
    ("back", lambda part: part.rising and part.behind and part.broad and PLATE <= part.up >= part.depth < part.side),
    ("chair_beam", lambda part: part.above and part.bar),
    ("back_support", lambda part: part.above and part.behind),
    ("chair_beam", lambda part: part.above and (part.post or part.up < part.depth)),
    # What is left: boards by the way they face, bars, feet and bodies.
    ("sideboard", lambda part: part.facing_side and part.up > PLATE),
    ("vertical_board", lambda part: part.facing_front and part.up > PLATE),
    ("horizontal_bar", lambda part: part.bar or (part.lying and part.up < PLATE)),
    ("leg", lambda part: part.slender and part.grounded),
    ("locker", lambda part: True),
)
"""Names of boxes, the first that fits."""

DISCS: tuple[Rule, ...] = (
    ("support_cylinder", lambda part: not part.lying),
    ("base_circle", lambda part: part.grounded and not part.at_seat),
    ("top_circle", lambda part: True),
)
"""Names of upright cylinders, the first that fits."""

_LOOPS = ((COUNT1, SHIFT1), (COUNT2, SHIFT2))


def look_around(blocks: FloatArray) -> Surroundings:
    """The bounding box of all copies, and the top of the highest part among those that cover most of the floor."""
    lows, highs = zip(*(bounds(block) for block in blocks), strict=True)
    low, high = np.min(lows, 0), np.max(highs, 0)
    cover = []
    for block in blocks:
        up, depth, side = extent(block)
        beside = np.prod([block[count] for count, shift in _LOOPS if block[shift] == 0])
        cover.append(depth * side * beside if up <= min(depth, side) else 0.0)
    seats = [top[UP] for top, area in zip(highs, cover, strict=True) if 0 < SEAT * max(cover) <= area]
    return Surroundings(low, high, float(max(seats, default=high[UP])))


def name_of(block: FloatArray, around: Surroundings) -> str:
    """The statement that says what a block does."""
    form = int(block[FORM])
    if form in (BACK, LINE, CROSS):
        return {BACK: "back", LINE: "line", CROSS: "base_cross"}[form]
    part = Part(block, around)
    name = next(name for name, fits in (BOXES if form == BOX else DISCS) if fits(part))
    if name == "top":
        return "top_square" if part.square else "top_rectangle"
    return name


def extent(block: FloatArray) -> FloatArray:
    """Full extents (3,) of the bounding box of one copy."""
    low, high = _one(block)
    return high - low


def bounds(block: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Low and high corner of the bounding box of all copies of a block."""
    low, high = _one(block)
    for count, shift in _LOOPS:
        reach = (block[count] - 1) * block[shift : shift + 3]
        low, high = np.minimum(low, low + reach), np.maximum(high, high + reach)
    return low, high


def _one(block: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Low and high corner of one copy; of all turns of a block that is turned."""
    form, values = int(block[FORM]), block[FIRST : FIRST + 7]
    start, rest = values[:3], values[3:6]
    if form == BOX:
        return start, start + rest
    if form == BACK:
        lean = np.array([0, values[6], 0])
        return start + np.minimum(lean, 0), start + rest + np.maximum(lean, 0)
    if form == DISC:
        radius = np.array([0, values[4], values[4]])
        return start - radius, start + radius + [values[3], 0, 0]
    if form == CROSS:
        arm = np.array([0, values[4], values[4]])
        return start - arm, start + arm + [values[3], 0, 0]
    if block[ROTATE] > 0:
        arm = np.array([0, *2 * [np.hypot(*(rest - start)[1:])]])
        rise = np.array([rest[0] - start[0], 0, 0])
        return start - arm + np.minimum(rise, 0), start + arm + np.maximum(rise, 0) + 1
    return np.minimum(start, rest), np.maximum(start, rest) + 1
