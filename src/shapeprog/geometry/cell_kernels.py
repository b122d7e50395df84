"""The kernel that fills packed cells."""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry.dispatch import bound, cells, excess
from shapeprog.kernels.compile import helper, kernel
from shapeprog.kernels.rows import enclose, fill_row, stretch
from shapeprog.kernels.table import CENTRE, KIND, ROTATION, SIZE, WIDTH, in_axes

SQUARE = 1e-6  # how far an entry of a rotation may be from 0 or 1 and still count as a right angle


@helper
def _excess(table, row, x, y, z):
    """How far a place relative to the centre is outside of the primitive."""
    a, b, c = in_axes(table, row, x, y, z)
    return excess(table, row, a, b, c)


@helper
def _fill_turned(table, row, planes, plane, low, high):
    """Any primitive in any pose: cells whose centre is inside.

    For convex primitives, the others have a rule of their own: the cells of a row are a stretch, which is computed for
    the box and its ends are tested.
    """
    resolution, half = planes.shape[2], bound(table, row)
    reach = enclose(table, row, half, resolution, low, high)
    if not math.isfinite(reach):
        return
    side = table[row, CENTRE + 2]
    for i in range(low[0], high[0]):
        x = i + 0.5 - table[row, CENTRE]
        for j in range(low[1], high[1]):
            y = j + 0.5 - table[row, CENTRE + 1]
            first, last = stretch(table, row, half, i, j, reach, resolution, low, high)
            while first < last and _excess(table, row, x, y, first + 0.5 - side) > 0:
                first += 1
            while first < last and _excess(table, row, x, y, last - 0.5 - side) > 0:
                last -= 1
            fill_row(planes, plane, i, j, first, last)


@kernel("void(f8[:, ::1], i8[::1], i8, u4[:, :, :, ::1], i8, i8)")
def fill(table, owner, per_scene, planes, begin, end):
    """Fill planes of words (P, W, R, R) with the cells of scenes ``begin`` to ``end``, of ``per_scene`` rows each.

    Each row of the table, which is scaled to cells and used up, has its owner: the plane that its cells go to.
    """
    resolution = planes.shape[2]
    scale, origin = resolution / 32, resolution / 2
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for row in range(begin * per_scene, end * per_scene):
        if table[row, KIND] < 0:
            continue
        total, square = 0.0, True
        for column in range(SIZE, CENTRE):
            table[row, column] *= scale
            total += table[row, column]
        for column in range(CENTRE, ROTATION):
            table[row, column] = table[row, column] * scale + origin
            total += table[row, column]
        for column in range(ROTATION, WIDTH):
            square = square and abs(table[row, column] - np.rint(table[row, column])) <= SQUARE
        if math.isfinite(total) and not cells(table, row, square, planes, owner[row], low, high):
            _fill_turned(table, row, planes, owner[row], low, high)
