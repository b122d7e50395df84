"""Kernels that compute which points the primitives of candidates explain or hold, and which samples are supported.

Points are sorted by the cells of a grid of ``cells`` along each side, row after row; ``starts`` has the index of the
first point of each cell.  A candidate has ``primitives`` rows of the table; the output is one row of bits for each.
"""

from __future__ import annotations

import numpy as np

from shapeprog.geometry.dispatch import bound, distance, slopes
from shapeprog.kernels.compile import helper, kernel
from shapeprog.kernels.table import CENTRE, KIND, ROTATION, local, turned
from shapeprog.space import HALF, RESOLUTION

LIFT = 1e-3
"""Offset in cells above a point at which the gradient of the distance is evaluated: on a surface it is undefined."""

TURNED = 0.75
"""Share of the price for surface that coincides with the target's but faces the other way."""


@helper
def cell_of(value, cells):
    """The cell that holds a coordinate, the nearest one if none does."""
    return min(max(int((min(max(value, -64.0), 64.0) + HALF) * cells / RESOLUTION), 0), cells - 1)


@helper
def box_of(table, row, margin, cells, ends, box):
    """The box around a primitive, widened by a margin, and the first and last cells along each axis in it."""
    a, b, c = bound(table, row)
    for axis in range(3):
        column = ROTATION + 3 * axis
        reach = abs(table[row, column]) * a + abs(table[row, column + 1]) * b + abs(table[row, column + 2]) * c
        centre = table[row, CENTRE + axis]
        box[axis], box[3 + axis] = centre - reach - margin, centre + reach + margin
        ends[axis], ends[3 + axis] = cell_of(box[axis], cells), cell_of(box[3 + axis], cells)


@helper
def outside(points, item, box):
    """Whether a point is outside a box."""
    x, y, z = points[item, 0], points[item, 1], points[item, 2]
    return x < box[0] or x > box[3] or y < box[1] or y > box[4] or z < box[2] or z > box[5]


@helper
def has(rows, row, bit):
    """Whether a bit of a row is set."""
    return (rows[row, bit >> 6] >> np.uint64(bit & 63)) & np.uint64(1)


@helper
def put(rows, row, bit):
    """Set a bit of a row."""
    rows[row, bit >> 6] |= np.uint64(1) << np.uint64(bit & 63)


@kernel("void(f8[:, ::1], i8, f8[:, ::1], f8[:, ::1], i8[::1], i8[::1], i8, f8, f8, u8[:, ::1], u8[:, ::1], i8, i8)")
def cover(
    table, primitives, points, normals, bits, starts, cells, tolerance, agreement, explained, interior, begin, end
):  # fmt: skip
    """Set the bits of points deeper than a tolerance in a primitive, and of others within it of a fitting surface.

    The normal of the surface fits if it agrees with that of the point; zero normals fit all.
    """
    ends, box, part = np.empty(6, np.int64), np.empty(6), np.empty(7)
    for row in range(begin * primitives, end * primitives):
        if table[row, KIND] < 0:
            continue
        candidate = row // primitives
        box_of(table, row, tolerance, cells, ends, box)
        for i in range(ends[0], ends[3] + 1):
            for j in range(ends[1], ends[4] + 1):
                line = (i * cells + j) * cells
                for item in range(starts[line + ends[2]], starts[line + ends[5] + 1]):
                    if outside(points, item, box) or has(interior, candidate, bits[item]):
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


@kernel("void(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], b1[::1], i8[::1], i8, f8, f8, f8[::1], i8, i8)")
def charged(samples, sides, points, normals, outward, starts, cells, reach, agreement, share, begin, end):
    """Write the share of its price that each sample pays: zero with a point within reach whose normal agrees.

    Zero normals agree with all.  Where a normal points outwards, a sample that faces the other way pays ``TURNED``.
    """
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for sample in range(begin, end):
        x, y, z = samples[sample, 0], samples[sample, 1], samples[sample, 2]
        for axis in range(3):
            low[axis] = cell_of(samples[sample, axis] - reach, cells)
            high[axis] = cell_of(samples[sample, axis] + reach, cells)
        share[sample] = 1.0
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                line = (i * cells + j) * cells
                for item in range(starts[line + low[2]], starts[line + high[2] + 1]):
                    dx, dy, dz = points[item, 0] - x, points[item, 1] - y, points[item, 2] - z
                    if dx * dx + dy * dy + dz * dz > reach * reach:
                        continue
                    u, v, w = normals[item, 0], normals[item, 1], normals[item, 2]
                    fit = sides[sample, 0] * u + sides[sample, 1] * v + sides[sample, 2] * w
                    if (fit if outward[item] else abs(fit)) >= agreement or u * u + v * v + w * w < 0.25:
                        share[sample] = 0.0
                        break
                    if -fit >= agreement:
                        share[sample] = TURNED
                if share[sample] == 0.0:
                    break
            if share[sample] == 0.0:
                break
