"""Kernels on packed cells: filling them, spreading their bits over bytes, counting what two grids share."""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry.dispatch import bound, cells, excess
from shapeprog.kernels.bits import ones
from shapeprog.kernels.compile import helper, kernel
from shapeprog.kernels.rows import clip, fill_row
from shapeprog.kernels.table import CENTRE, KIND, ROTATION, SIZE, WIDTH

SQUARE = 1e-6
"""How far an entry of a rotation may be from 0 or 1 and still count as a right angle."""


@helper
def _excess(row, x, y, z):
    """How far a place relative to the centre is outside of the primitive."""
    return excess(
        row, 0,
        row[0, ROTATION] * x + row[0, ROTATION + 3] * y + row[0, ROTATION + 6] * z,
        row[0, ROTATION + 1] * x + row[0, ROTATION + 4] * y + row[0, ROTATION + 7] * z,
        row[0, ROTATION + 2] * x + row[0, ROTATION + 5] * y + row[0, ROTATION + 8] * z,
    )  # fmt: skip


@helper
def _stretch(row, half, x, y, reach):
    """Where along left-right the row of cells through (x, y) can be inside the local box, relative to the centre."""
    near, far = -reach - 1e-6, reach + 1e-6
    for axis in range(3):
        start = row[0, ROTATION + axis] * x + row[0, ROTATION + 3 + axis] * y
        slope = row[0, ROTATION + 6 + axis]
        if abs(slope) < 1e-12:
            if abs(start) > half[axis] + 1e-9:
                return 1.0, -1.0
        else:
            one, two = (-half[axis] - start) / slope, (half[axis] - start) / slope
            near, far = max(near, min(one, two)), min(far, max(one, two))
    return near, far


@helper
def _fill_turned(planes, plane, row, half, low, high):
    """Any primitive in any pose: cells whose centre is inside.

    Primitives are convex, so the cells of a row are a stretch: it is found for the box and its ends are tested.
    """
    resolution, reach = planes.shape[1], 0.0
    half[0], half[1], half[2] = bound(row, 0)
    for axis in range(3):
        reach = 0.0
        for other in range(3):
            reach += abs(row[0, ROTATION + 3 * axis + other]) * half[other]
        low[axis] = clip(np.floor(row[0, CENTRE + axis] - reach - 0.5), resolution)
        high[axis] = clip(np.ceil(row[0, CENTRE + axis] + reach + 0.5), resolution)
    side = row[0, CENTRE + 2]
    for i in range(low[0], high[0]):
        x = i + 0.5 - row[0, CENTRE]
        for j in range(low[1], high[1]):
            y = j + 0.5 - row[0, CENTRE + 1]
            near, far = _stretch(row, half, x, y, reach)
            if near > far:
                continue
            first = max(clip(np.floor(near + side - 0.5), resolution), low[2])
            last = min(clip(np.ceil(far + side + 0.5), resolution), high[2])
            while first < last and _excess(row, x, y, first + 0.5 - side) > 0:
                first += 1
            while first < last and _excess(row, x, y, last - 0.5 - side) > 0:
                last -= 1
            fill_row(planes, plane, i, j, first, last)


@kernel("void(f8[:, ::1], i8[::1], i8, u4[:, :, ::1], i8, i8)")
def fill(table, owner, many, planes, begin, end):
    """Fill planes of words (P, R, R * W) with the cells of scenes ``begin`` to ``end``, of ``many`` rows each.

    Each row of the table has its owner: the plane that its cells go to.
    """
    resolution = planes.shape[1]
    row, half = np.empty((1, WIDTH)), np.empty(3)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for item in range(begin * many, end * many):
        if table[item, KIND] < 0:
            continue
        total, square = 0.0, True
        for column in range(WIDTH):
            value = table[item, column]
            if column >= ROTATION:
                square = square and abs(value - np.rint(value)) <= SQUARE
            elif column >= CENTRE:
                value = value * (resolution / 32) + resolution / 2
            elif column >= SIZE:
                value *= resolution / 32
            row[0, column] = value
            total += value
        if math.isfinite(total) and not cells(row, 0, square, planes, owner[item], low, high):
            _fill_turned(planes, owner[item], row, half, low, high)


@kernel("void(u4[::1], u8[::1], u8[:, ::1], i8, i8)")
def unpack(words, table, cells, begin, end):
    """Words of 32 cells as bits (M,) to bytes, given as eights (M, 4); the table spreads 8 bits over 8 bytes."""
    for k in range(begin, end):
        bits = words[k]
        for part in range(4):
            cells[k, part] = table[(bits >> np.uint32(8 * part)) & np.uint32(255)] if bits != 0 else np.uint64(0)


@kernel("void(u4[:, ::1], u4[:, ::1], i8[:, ::1])")
def shared(one, two, counts):
    """Number of cells in both and in either of pairs of packed grids (B, words)."""
    for pair in range(one.shape[0]):
        both, either = 0, 0
        for word in range(one.shape[1]):
            both += ones(np.uint64(one[pair, word] & two[pair, word]))
            either += ones(np.uint64(one[pair, word] | two[pair, word]))
        counts[pair, 0], counts[pair, 1] = both, either
