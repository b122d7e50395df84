"""Kernels that compute which points of a surface boxes explain."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import helper, kernel
from shapeprog.space import HALF, RESOLUTION

CELLS = 16
"""Cells along each side of the grid that bins points."""


@kernel("void(f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8, b1[:, ::1], f8[::1])")
def near_boxes(points, centre, rotation, half, tolerance, explained, fill):
    """Which points are near the surface of each box, and the share of the box's surface near which points lie.

    The surface is divided into squares of about two cells, at most eight along a side.  Points are visited in the order
    of the cells of a grid, of which a box needs those around it.

    Parameters
    ----------
    points
        Points (N, 3) of a surface.
    centre, rotation, half
        Boxes (B, 3), (B, 3, 3) with axes as columns, and (B, 3).
    tolerance
        Largest distance of a point from the surface that explains it.
    explained, fill
        Output (B, N) and (B,), initially false.
    """
    covered = np.empty((6, 8, 8), np.bool_)
    at, ends = np.empty(3), np.empty(6, np.int64)
    cells, order = np.empty(len(points), np.int64), np.empty(len(points), np.int64)
    starts = np.empty(CELLS**3 + 1, np.int64)
    starts[:] = 0
    for k in range(len(points)):
        cells[k] = (cell_of(points[k, 0]) * CELLS + cell_of(points[k, 1])) * CELLS + cell_of(points[k, 2])
        starts[cells[k]] += 1
    for cell in range(1, len(starts)):
        starts[cell] += starts[cell - 1]
    for k in range(len(points)):  # from the ends of the cells to their starts
        starts[cells[k]] -= 1
        order[starts[cells[k]]] = k
    for b in range(len(centre)):
        covered[:] = False
        for row in range(3):
            reach = tolerance
            for axis in range(3):
                reach += abs(rotation[b, row, axis]) * (half[b, axis] + tolerance)
            ends[row], ends[3 + row] = cell_of(centre[b, row] - reach), cell_of(centre[b, row] + reach)
        for i in range(ends[0], ends[3] + 1):
            for j in range(ends[1], ends[4] + 1):
                line = (i * CELLS + j) * CELLS
                for index in range(starts[line + ends[2]], starts[line + ends[5] + 1]):
                    k, outside = order[index], False
                    for axis in range(3):
                        at[axis] = 0.0
                        for row in range(3):
                            at[axis] += (points[k, row] - centre[b, row]) * rotation[b, row, axis]
                        if abs(at[axis]) > half[b, axis] + tolerance:
                            outside = True
                            break
                    if outside:
                        continue
                    for axis in range(3):
                        if abs(abs(at[axis]) - half[b, axis]) <= tolerance:
                            explained[b, k] = True
                            first, second = (axis + 1) % 3, (axis + 2) % 3
                            cells1, cells2 = squares(half[b, first]), squares(half[b, second])
                            u = int(cells1 * (at[first] / half[b, first] + 1) / 2) if half[b, first] > 0 else 0
                            v = int(cells2 * (at[second] / half[b, second] + 1) / 2) if half[b, second] > 0 else 0
                            face = 2 * axis + (1 if at[axis] > 0 else 0)
                            covered[face, min(max(u, 0), cells1 - 1), min(max(v, 0), cells2 - 1)] = True
        total, filled = 0.0, 0.0
        for face in range(6):
            axis = face // 2
            first, second = (axis + 1) % 3, (axis + 2) % 3
            cells1, cells2 = squares(half[b, first]), squares(half[b, second])
            square = half[b, first] * half[b, second] / (cells1 * cells2)
            for u in range(cells1):
                for v in range(cells2):
                    total += square
                    filled += square if covered[face, u, v] else 0.0
        fill[b] = filled / total if total > 0 else 0.0


@helper
def squares(half):
    """Into how many squares a side is divided."""
    return min(max(int(np.ceil(half)), 1), 8)


@helper
def cell_of(value):
    """The cell that holds a coordinate, the nearest one if none does."""
    return int(min(max((value + HALF) * CELLS / RESOLUTION, 0.0), CELLS - 1.0))
