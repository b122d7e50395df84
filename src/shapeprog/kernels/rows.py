"""Rows of cells that kernels fill: planes of words (P, W, R, R), W of them for every row.

Positions are in cells from the low corner of the grid, so cell k covers [k, k + 1) and its centre is k + 0.5.
"""

from __future__ import annotations

import math

import numpy as np

from shapeprog.kernels.bits import span
from shapeprog.kernels.compile import helper
from shapeprog.kernels.table import CENTRE, ROTATION

REACH = 1.01  # radii from the axis of a cylinder up to which cells belong to it, as in the published executor
CAP = 1e-3  # slack in cells along that axis, so that a cap through the centre of a cell takes it


@helper
def clip(value, high):
    """A position as a cell boundary within the grid."""
    return int(min(max(value, 0.0), float(high)))


@helper
def fill_row(planes, plane, i, j, first, last):
    """Fill the cells ``first`` to ``last - 1`` of one row."""
    for word in range(first >> 5, (last + 31) >> 5):
        planes[plane, word, i, j] |= span(first - 32 * word, last - 32 * word)


@helper
def fill_box(planes, plane, low, high):
    """Fill the cells from ``low`` to ``high`` (excluded) along the three axes."""
    for word in range(low[2] >> 5, (high[2] + 31) >> 5):
        bits = span(low[2] - 32 * word, high[2] - 32 * word)
        for i in range(low[0], high[0]):
            for j in range(low[1], high[1]):
                planes[plane, word, i, j] |= bits


@helper
def enclose(table, row, half, resolution, low, high):
    """The cells that a turned box of these half extents reaches, into ``low`` and ``high`` (excluded).

    Returns how far it reaches along left-right; infinite or not a number if it is so along any axis.
    """
    reach = 0.0
    for axis in range(3):
        reach = 0.0
        for column in range(3):
            reach += abs(table[row, ROTATION + 3 * axis + column]) * half[column]
        if not math.isfinite(reach):
            return reach
        low[axis] = clip(np.floor(table[row, CENTRE + axis] - reach - 0.5), resolution)
        high[axis] = clip(np.ceil(table[row, CENTRE + axis] + reach + 0.5), resolution)
    return reach


@helper
def stretch(table, row, half, i, j, reach, resolution, low, high):
    """The cells of row (i, j), the last excluded, that can be inside a turned box; see :func:`enclose`."""
    x, y, side = i + 0.5 - table[row, CENTRE], j + 0.5 - table[row, CENTRE + 1], table[row, CENTRE + 2]
    start, stop = -reach - 1e-6, reach + 1e-6
    for axis in range(3):
        at = table[row, ROTATION + axis] * x + table[row, ROTATION + 3 + axis] * y
        slope = table[row, ROTATION + 6 + axis]
        if abs(slope) < 1e-12:
            if abs(at) > half[axis] + 1e-9:
                return 0, 0
        else:
            first, second = (-half[axis] - at) / slope, (half[axis] - at) / slope
            start, stop = max(start, min(first, second)), min(stop, max(first, second))
    if start > stop:
        return 0, 0
    near, far = np.floor(start + side - 0.5), np.ceil(stop + side + 0.5)
    return max(clip(near, resolution), low[2]), min(clip(far, resolution), high[2])
