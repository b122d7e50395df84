"""Kernels that find exact nearest neighbours with a uniform grid.

The points of a cloud are sorted by cell, so that a run of cells along axis 2 is a run of points.  A query walks over
columns (cells along axes 0 and 1) in rings around its own, looks in each only at the stretch of axis 2 that can hold
something nearer, and stops at the first ring that is farther away than the best point so far.  Queries are taken in
the order of their cells: the neighbour of the one before is a good first guess.
"""

from __future__ import annotations

import math

import numpy as np

from shapeprog.kernels.compile import helper, kernel

PER_CELL = 6.0  # points aimed at in each cell that a surface passes through
MOST_CELLS = 48  # along an axis


@helper
def _cell(value, low, inverse, cells):
    """Cell of a coordinate, the nearest one if it is outside; the first one if it is no number."""
    position = (value - low) * inverse
    if not position > 0:
        return 0
    return cells - 1 if position >= cells else int(position)


@helper
def _layout(points, first, count, low, cells):
    """Low corner, number of cells along each axis, and side of the cells for a cloud."""
    high = np.empty(3)
    for axis in range(3):
        low[axis], high[axis] = np.inf, -np.inf
    for point in range(first, first + count):
        for axis in range(3):
            value = points[point, axis]
            if value < low[axis]:
                low[axis] = value
            if value > high[axis]:
                high[axis] = value
    x, y, z = high[0] - low[0], high[1] - low[1], high[2] - low[2]
    area = 2 * (x * y + y * z + x * z)
    side = max(math.sqrt(area * PER_CELL / count), max(x, max(y, z)) / MOST_CELLS)
    if not side > 0:
        side = 1.0
    for axis in range(3):
        cells[axis] = _cell(high[axis], low[axis], 1 / side, MOST_CELLS) + 1
    return side


@helper
def _sort(points, first, count, low, inverse, cells, key, position, starts, order):
    """Counting sort of points by cell: first place of each cell, and the points in that order."""
    every = cells[0] * cells[1] * cells[2]
    for cell in range(every + 1):
        starts[cell] = 0
    for point in range(count):
        i = _cell(points[first + point, 0], low[0], inverse, cells[0])
        j = _cell(points[first + point, 1], low[1], inverse, cells[1])
        k = _cell(points[first + point, 2], low[2], inverse, cells[2])
        key[point] = (i * cells[1] + j) * cells[2] + k
        starts[key[point] + 1] += 1
    for cell in range(every):
        position[cell] = starts[cell]
        starts[cell + 1] += starts[cell]
    for point in range(count):
        order[position[key[point]]] = first + point
        position[key[point]] += 1


@helper
def _column(x, y, z, ordered, starts, base, first, last, best, closest):
    """Best of the points in the cells ``first`` to ``last`` of the column that starts at cell ``base``."""
    for position in range(starts[base + first], starts[base + last + 1]):
        dx = ordered[position, 0] - x
        dy = ordered[position, 1] - y
        dz = ordered[position, 2] - z
        square = dx * dx + dy * dy + dz * dz
        if square < best:
            best, closest = square, position
    return best, closest


@helper
def _gap(value, low, side, cell):
    """Distance along one axis from a coordinate to a cell."""
    start = low + cell * side
    return max(max(start - value, value - start - side), 0.0)


@helper
def _search(x, y, z, ordered, starts, low, side, cells, best, closest):
    """Walk over the columns in rings."""
    inverse = 1 / side
    centre_i = _cell(x, low[0], inverse, cells[0])
    centre_j = _cell(y, low[1], inverse, cells[1])
    for ring in range(max(cells[0], cells[1])):
        if ((ring - 1) * side) ** 2 > best and ring > 0:  # all columns of this ring are farther away
            break
        for i in range(max(centre_i - ring, 0), min(centre_i + ring, cells[0] - 1) + 1):
            dx = _gap(x, low[0], side, i)
            step = 1 if abs(i - centre_i) == ring else 2 * ring
            for j in range(centre_j - ring, centre_j + ring + 1, max(step, 1)):
                if j < 0 or j >= cells[1]:
                    continue
                dy = _gap(y, low[1], side, j)
                remaining = best - dx * dx - dy * dy
                if remaining > 0:
                    reach, base = math.sqrt(remaining), (i * cells[1] + j) * cells[2]
                    first = _cell(z - reach, low[2], inverse, cells[2])
                    last = _cell(z + reach, low[2], inverse, cells[2])
                    best, closest = _column(x, y, z, ordered, starts, base, first, last, best, closest)
    return closest


@kernel("void(f8[:, ::1], i8, f8[:, ::1], i8, i8[::1], i8, i8)")
def neighbours(queries, query_count, points, count, index, begin, end):
    """Nearest of the ``count`` points to each of the ``query_count`` queries of the clouds ``begin`` to ``end``.

    Fills the row of ``points`` (B * count, 3) for each of ``queries`` (B * many, 3).
    """
    low, cells = np.empty(3), np.empty(3, np.int64)
    key, order, visit = (
        np.empty(max(count, query_count), np.int64), np.empty(count, np.int64), np.empty(query_count, np.int64)
    )  # fmt: skip
    starts, position = np.empty((MOST_CELLS + 1) ** 3, np.int64), np.empty((MOST_CELLS + 1) ** 3, np.int64)
    ordered = np.empty((count, 3))
    for cloud in range(begin, end):
        side = _layout(points, cloud * count, count, low, cells)
        _sort(queries, cloud * query_count, query_count, low, 1 / side, cells, key, position, starts, visit)
        _sort(points, cloud * count, count, low, 1 / side, cells, key, position, starts, order)
        for item in range(count):
            for axis in range(3):
                ordered[item, axis] = points[order[item], axis]
        closest = 0
        for turn in range(query_count):
            query = visit[turn]
            x, y, z = queries[query, 0], queries[query, 1], queries[query, 2]
            dx, dy, dz = ordered[closest, 0] - x, ordered[closest, 1] - y, ordered[closest, 2] - z
            closest = _search(x, y, z, ordered, starts, low, side, cells, dx * dx + dy * dy + dz * dz, closest)
            index[query] = order[closest]
