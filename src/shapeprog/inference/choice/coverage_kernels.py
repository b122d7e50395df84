"""Kernels that compute which points the primitives of candidates explain or hold, and which samples are supported.

Points are sorted by the cells of a grid of ``CELLS`` along each side, row after row; ``starts`` has the index of the
first point of each cell.  A candidate has ``primitives`` rows of the table; the output is one row of bits for each.
"""

from __future__ import annotations

import numpy as np

from shapeprog.geometry.dispatch import bound, distance, slopes
from shapeprog.kernels.compile import helper, kernel
from shapeprog.kernels.table import CENTRE, KIND, ROTATION, local, turned
from shapeprog.space import HALF, RESOLUTION

CELLS = 32  # cells along each side of the grid that bins points
LIFT = 1e-3
"""Offset in cells above a point at which the gradient of the distance is evaluated: on a surface it is undefined."""

TURNED = 0.75  # share of the price for surface that coincides with the target's but faces the other way


@helper
def cell_of(value):
    """The cell that holds a coordinate, the nearest one if none does."""
    return min(max(int((min(max(value, -64.0), 64.0) + HALF) * CELLS / RESOLUTION), 0), CELLS - 1)


@helper
def ends_of(table, row, margin, ends):
    """The first and last cells along each axis that the box around a primitive, widened by a margin, reaches."""
    a, b, c = bound(table, row)
    for axis in range(3):
        column = ROTATION + 3 * axis
        reach = abs(table[row, column]) * a + abs(table[row, column + 1]) * b + abs(table[row, column + 2]) * c
        centre = table[row, CENTRE + axis]
        ends[axis], ends[3 + axis] = cell_of(centre - reach - margin), cell_of(centre + reach + margin)


@helper
def has(rows, row, bit):
    """Whether a bit of a row is set."""
    return (rows[row, bit >> 6] >> np.uint64(bit & 63)) & np.uint64(1)


@helper
def put(rows, row, bit):
    """Set a bit of a row."""
    rows[row, bit >> 6] |= np.uint64(1) << np.uint64(bit & 63)


@kernel("void(f8[:, ::1], i8, f8[:, ::1], f8[:, ::1], i8[::1], i8[::1], f8, f8, u8[:, ::1], u8[:, ::1], i8, i8)")
def cover(table, primitives, points, normals, bits, starts, tolerance, agreement, explained, interior, begin, end):
    """Set the bits of points deeper than a tolerance in a primitive, and of others within it of a fitting surface.

    The normal of the surface fits if it agrees with that of the point; zero normals fit all.
    """
    ends, part = np.empty(6, np.int64), np.empty(7)
    for row in range(begin * primitives, end * primitives):
        if table[row, KIND] < 0:
            continue
        candidate = row // primitives
        ends_of(table, row, tolerance, ends)
        for i in range(ends[0], ends[3] + 1):
            for j in range(ends[1], ends[4] + 1):
                line = (i * CELLS + j) * CELLS
                for item in range(starts[line + ends[2]], starts[line + ends[5] + 1]):
                    if has(interior, candidate, bits[item]):
                        continue
                    a, b, c = local(table, row, points[item, 0], points[item, 1], points[item, 2])
                    height = distance(table, row, a, b, c)
                    if height < -tolerance:
                        put(interior, candidate, bits[item])
                    if abs(height) > tolerance or has(explained, candidate, bits[item]):
                        continue
                    x, y, z = normals[item, 0], normals[item, 1], normals[item, 2]
                    a, b, c = local(
                        table, row, points[item, 0] + LIFT * x, points[item, 1] + LIFT * y, points[item, 2] + LIFT * z
                    )
                    slopes(table, row, a, b, c, part)
                    u, v, w = turned(table, row, part[0], part[1], part[2])
                    if abs(u * x + v * y + w * z) >= agreement or x * x + y * y + z * z < 0.25:
                        put(explained, candidate, bits[item])


@helper
def share_of(x, y, z, side, points, normals, outward, starts, reach, agreement):
    """The share that one sample at a place (x, y, z) pays, whose normal is ``side`` (3,)."""
    share = 1.0
    for i in range(cell_of(x - reach), cell_of(x + reach) + 1):
        for j in range(cell_of(y - reach), cell_of(y + reach) + 1):
            line = (i * CELLS + j) * CELLS
            for item in range(starts[line + cell_of(z - reach)], starts[line + cell_of(z + reach) + 1]):
                dx, dy, dz = points[item, 0] - x, points[item, 1] - y, points[item, 2] - z
                if dx * dx + dy * dy + dz * dz > reach * reach:
                    continue
                u, v, w = normals[item, 0], normals[item, 1], normals[item, 2]
                fit = side[0] * u + side[1] * v + side[2] * w
                if (fit if outward[item] else abs(fit)) >= agreement or u * u + v * v + w * w < 0.25:
                    return 0.0
                if -fit >= agreement:
                    share = TURNED
    return share


@kernel("void(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], b1[::1], i8[::1], f8, f8, f8[::1], i8, i8)")
def charged(samples, sides, points, normals, outward, starts, reach, agreement, share, begin, end):
    """Write the share of its price that each sample pays: zero where a point within reach has a normal that agrees, as
    zero normals do; ``TURNED`` where one faces the other way, such as behind the wall of a solid; else one."""
    for k in range(begin, end):
        x, y, z = samples[k, 0], samples[k, 1], samples[k, 2]
        share[k] = share_of(x, y, z, sides[k], points, normals, outward, starts, reach, agreement)
