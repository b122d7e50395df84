"""Naming parts by what they do: a leg stands under, a back rises behind, a top covers, a bar connects.

The rules read the place and the proportions of a part among the others, in the grid frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shapeprog.inference.raster_kernels import BACK, BOX, COUNT1, COUNT2, CROSS, DISC, FIRST, SHIFT1, SHIFT2
from shapeprog.space import DEPTH, SIDE, UP, FloatArray

THIN = 0.45
"""A board is thinner than this share of its other two sides."""

WIDE = 0.3
"""A top, layer or base covers at least this share of the footprint of the shape."""

NEAR = 2.0
"""Cells within which a part counts as touching the ground, the top or the rear."""


@dataclass(frozen=True)
class Surroundings:
    """The bounding box of a shape and the height of its main horizontal surface, in cells."""

    low: FloatArray
    high: FloatArray
    seat: float


def look_around(blocks: FloatArray) -> Surroundings:
    """The bounding box of all copies and the top of the largest horizontal board, the seat of a chair."""
    lows, highs = zip(*(_bounds(block) for block in blocks), strict=True)
    low, high = np.min(lows, 0), np.max(highs, 0)
    seat, largest = high[UP], 0.0
    for block, top in zip(blocks, highs, strict=True):
        extent = _extent(block)
        area = extent[DEPTH] * extent[SIDE]
        if area > 1.05 * largest and extent[UP] <= THIN * min(extent[DEPTH], extent[SIDE]):
            largest, seat = area, top[UP]
    return Surroundings(low, high, float(seat))


def name_of(block: FloatArray, around: Surroundings) -> str:
    """The statement that says what a block does."""
    form = int(block[0])
    if form == CROSS:
        return "base_cross"
    if form == BACK:
        return "back"
    if form not in (BOX, DISC):
        return "line"
    low, _ = _bounds(block)
    up, depth, side = _extent(block)
    size = around.high - around.low
    grounded = low[UP] <= around.low[UP] + NEAR
    top = low[UP] + up
    wide = depth * side >= WIDE * size[DEPTH] * size[SIDE]
    flat = up <= THIN * min(depth, side)
    if form == DISC:
        return _disc(flat, grounded, top, around)
    behind = low[DEPTH] + depth / 2 > (around.low[DEPTH] + around.high[DEPTH]) / 2 + 0.1 * size[DEPTH]
    above = low[UP] >= around.seat - NEAR and around.seat < around.high[UP] - NEAR
    square = abs(depth - side) < 0.5
    if flat and wide:
        if top >= around.seat - 1 and not grounded:
            return "top_square" if square else "top_rectangle"
        return "base_square" if square and grounded else "layer"
    upright = up >= 1.2 * max(depth, side)
    slender = max(depth, side) <= 0.35 * max(size[DEPTH], size[SIDE])
    if upright and slender and min(depth, side) > THIN * max(depth, side):
        if above:
            return "back_support" if behind else "chair_beam"
        central = block[COUNT1] * block[COUNT2] == 1
        return "support_cuboid" if central and square and not low[UP] > around.seat else "leg"
    if above and behind and depth <= THIN * max(up, side):
        return "back" if up >= 3 and side >= 0.4 * size[SIDE] else "back_support"
    if side <= THIN * min(up, depth) and up >= 4:
        return "sideboard"
    if depth <= THIN * min(up, side) and up >= 4:
        return "vertical_board"
    if above and not behind and depth >= 2 * up:
        return "chair_beam"
    if flat or max(depth, side) >= 2.5 * max(up, min(depth, side)):
        return "horizontal_bar"
    if grounded and upright:
        return "leg"
    return "locker"


def _disc(flat: bool, grounded: bool, top: float, around: Surroundings) -> str:
    if not flat:
        return "support_cylinder"
    return "base_circle" if grounded and top < around.seat - NEAR else "top_circle"


def _extent(block: FloatArray) -> FloatArray:
    """Full extents of one copy."""
    values = block[FIRST:]
    if int(block[0]) == DISC:
        return np.array([values[3], 2 * values[4], 2 * values[4]])
    if int(block[0]) in (BOX, BACK):
        return np.array(values[3:6])
    return np.ones(3)


def _bounds(block: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Low and high corner of all copies of a block."""
    values = block[FIRST : FIRST + 7]
    form = int(block[0])
    if form == DISC:
        low = values[:3] - np.array([0, values[4], values[4]])
    elif form in (BOX, BACK):
        low = values[:3].copy()
    elif form == CROSS:
        low = values[:3] - np.array([0, values[4], values[4]])
    else:
        low = np.minimum(values[:3], values[3:6])
    high = low + _extent(block) if form in (BOX, DISC, BACK) else np.maximum(low, values[:3]) + 1
    for count, shift in ((COUNT1, SHIFT1), (COUNT2, SHIFT2)):
        reach = (block[count] - 1) * block[shift : shift + 3]
        low, high = np.minimum(low, low + reach), np.maximum(high, high + reach)
    return low, high
