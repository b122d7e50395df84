"""Kernels that find exact nearest neighbours with a uniform grid.

The points of a cloud are sorted by cell, so that a run of cells along axis 2 is a run of points.  A query walks over
columns (cells along axes 0 and 1) in rings around its own, looks in each only at the stretch of axis 2 that can hold
something nearer, and stops at the first ring that is farther away than the best point so far.  Queries are taken in
the order of their cells: the neighbour of the one before is a good first guess.
"""

from __future__ import annotations

import numpy as np
from numba import njit

PER_CELL = 4.0
"""Points aimed at in each cell that a surface passes through."""

MOST_CELLS = 48
"""Most cells along an axis."""


@njit(cache=True, nogil=True)
def _cell(value, low, inverse, cells):
    """Cell of a coordinate, the nearest one if it is outside; the first one if it is no number."""
    place = (value - low) * inverse
    if not place > 0:
        return 0
    return cells - 1 if place >= cells else int(place)


@njit(cache=True, nogil=True)
def _layout(points, low, cells):
    """Low corner, number of cells along each axis, and side of the cells for a cloud."""
    high = np.empty(3)
    for axis in range(3):
        low[axis], high[axis] = np.inf, -np.inf
    for point in range(points.shape[0]):
        for axis in range(3):
            value = float(points[point, axis])
            if value < low[axis]:
                low[axis] = value
            if value > high[axis]:
                high[axis] = value
    x, y, z = high[0] - low[0], high[1] - low[1], high[2] - low[2]
    area = 2 * (x * y + y * z + x * z)
    longest = max(x, max(y, z))
    side = max(np.sqrt(area * PER_CELL / points.shape[0]), longest / MOST_CELLS)
    if not side > 0:
        side = 1.0
    for axis in range(3):
        cells[axis] = _cell(high[axis], low[axis], 1 / side, MOST_CELLS) + 1
    return side


@njit(cache=True, nogil=True)
def _sort(points, low, inverse, cells, starts, order):
    """Counting sort of points by cell: first place of each cell, and the points in that order."""
    count = points.shape[0]
    key = np.empty(count, np.int32)
    starts[:] = 0
    for point in range(count):
        i = _cell(points[point, 0], low[0], inverse, cells[0])
        j = _cell(points[point, 1], low[1], inverse, cells[1])
        k = _cell(points[point, 2], low[2], inverse, cells[2])
        key[point] = (i * cells[1] + j) * cells[2] + k
        starts[key[point] + 1] += 1
    for cell in range(starts.shape[0] - 1):
        starts[cell + 1] += starts[cell]
    place = starts[:-1].copy()
    for point in range(count):
        order[place[key[point]]] = point
        place[key[point]] += 1


@njit(cache=True, nogil=True)
def _column(x, y, z, sorted_points, starts, base, first, last, best, found):
    """Best of the points in the cells ``first`` to ``last`` of the column that starts at cell ``base``."""
    for place in range(starts[base + first], starts[base + last + 1]):
        dx = sorted_points[place, 0] - x
        dy = sorted_points[place, 1] - y
        dz = sorted_points[place, 2] - z
        square = dx * dx + dy * dy + dz * dz
        if square < best:
            best, found = square, place
    return best, found


@njit(cache=True, nogil=True)
def _gap(value, low, side, cell):
    """Distance along one axis from a coordinate to a cell."""
    start = low + cell * side
    return max(max(start - value, value - start - side), 0.0)


@njit(cache=True, nogil=True)
def _search(x, y, z, sorted_points, starts, low, side, cells, best, found):
    """Walk over the columns in rings."""
    inverse = 1 / side
    centre_i = _cell(x, low[0], inverse, cells[0])
    centre_j = _cell(y, low[1], inverse, cells[1])
    for ring in range(max(cells[0], cells[1])):
        if ring > 0:
            # every column of this ring is at least this far away along axis 0 or axis 1
            near = np.inf
            if centre_i - ring >= 0:
                near = min(near, x - low[0] - (centre_i - ring + 1) * side)
            if centre_i + ring < cells[0]:
                near = min(near, low[0] + (centre_i + ring) * side - x)
            if centre_j - ring >= 0:
                near = min(near, y - low[1] - (centre_j - ring + 1) * side)
            if centre_j + ring < cells[1]:
                near = min(near, low[1] + (centre_j + ring) * side - y)
            if near > 0 and near * near > best:
                break
        for i in range(max(centre_i - ring, 0), min(centre_i + ring, cells[0] - 1) + 1):
            dx = _gap(x, low[0], side, i)
            if dx * dx > best:
                continue
            step = 1 if abs(i - centre_i) == ring else 2 * ring
            j = centre_j - ring
            while j <= centre_j + ring:
                if 0 <= j < cells[1]:
                    base = (i * cells[1] + j) * cells[2]
                    if starts[base] < starts[base + cells[2]]:
                        dy = _gap(y, low[1], side, j)
                        left = best - dx * dx - dy * dy
                        if left > 0:
                            reach = np.sqrt(left)
                            first = _cell(z - reach, low[2], inverse, cells[2])
                            last = _cell(z + reach, low[2], inverse, cells[2])
                            best, found = _column(x, y, z, sorted_points, starts, base, first, last, best, found)
                j += max(step, 1)
    return best, found


@njit(cache=True, nogil=True)
def neighbours(queries, points, index, squared, begin, end):
    """Index of the nearest of ``points`` (B, Q, 3) to each of ``queries`` (B, P, 3) and its squared distance."""
    count = points.shape[1]
    low, cells = np.empty(3), np.empty(3, np.int64)
    order, visit = np.empty(count, np.int32), np.empty(queries.shape[1], np.int32)
    sorted_points = np.empty((count, 3), points.dtype)
    for cloud in range(begin, end):
        side = _layout(points[cloud], low, cells)
        starts = np.empty(cells[0] * cells[1] * cells[2] + 1, np.int32)
        _sort(queries[cloud], low, 1 / side, cells, starts, visit)
        _sort(points[cloud], low, 1 / side, cells, starts, order)
        for place in range(count):
            for axis in range(3):
                sorted_points[place, axis] = points[cloud, order[place], axis]
        found = 0
        for turn in range(queries.shape[1]):
            x, y, z = queries[cloud, visit[turn], 0], queries[cloud, visit[turn], 1], queries[cloud, visit[turn], 2]
            dx, dy, dz = sorted_points[found, 0] - x, sorted_points[found, 1] - y, sorted_points[found, 2] - z
            best = dx * dx + dy * dy + dz * dz
            best, found = _search(x, y, z, sorted_points, starts, low, side, cells, best, found)
            index[cloud, visit[turn]] = order[found]
            squared[cloud, visit[turn]] = best


@njit(cache=True, nogil=True)
def pull(queries, points, index, slope, to_queries, to_points, begin, end):
    """Gradient of squared distances to known neighbours, given the gradient of a loss by each of them."""
    for cloud in range(begin, end):
        for query in range(queries.shape[1]):
            point = index[cloud, query]
            for axis in range(3):
                part = 2 * slope[cloud, query] * (queries[cloud, query, axis] - points[cloud, point, axis])
                to_queries[cloud, query, axis] = part
                to_points[cloud, point, axis] -= part
