"""Kernels that find the nearest primitive of a point, and take the gradient of the distance to it."""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry.dispatch import bound, distance, slopes
from shapeprog.kernels.compile import helper, kernel
from shapeprog.kernels.table import CENTRE, KIND, ROTATION, SIZE, local, turned

ROUNDING = 2e-6  # error of a bound in single precision against the size of the coordinates, generously
FARTHEST = 1e18  # coordinates whose squares fit into single precision, in which bounds are taken and points drawn


@helper
def _boxes(table, first, per_scene, listed, box):
    """Fill the columns of ``box`` with the primitives that are there; returns how many, and how far they reach.

    Of each: centre, local axes and half extents of the turned box around it.
    """
    used, extent = 0, 0.0
    for slot in range(per_scene):
        row = first + slot
        if table[row, KIND] < 0:
            continue
        for axis in range(3):
            box[axis, used] = table[row, CENTRE + axis]
            for column in range(3):
                box[3 + 3 * axis + column, used] = table[row, ROTATION + 3 * column + axis]
        box[12, used], box[13, used], box[14, used] = bound(table, row)
        for entry in range(3):
            reach = abs(box[entry, used]) + box[12 + entry, used]
            extent = max(extent, reach if reach < FARTHEST else np.inf)
        listed[used] = slot
        used += 1
    return used, extent


@helper(forceinline=True)
def _over(box, axis, count, x, y, z, over):
    """How far a point is beyond the faces of each box along one of its axes."""
    for n in range(count):
        dx, dy, dz = x - box[0, n], y - box[1, n], z - box[2, n]
        along = box[3 + 3 * axis, n] * dx + box[4 + 3 * axis, n] * dy + box[5 + 3 * axis, n] * dz
        over[n] = abs(along) - box[12 + axis, n]


@helper(forceinline=True)
def _bounds(box, count, x, y, z, extent, up, depth, lower):
    """Lower bounds of the signed distances of a point: those to the turned boxes around the primitives.

    One short loop after another, because the compiler makes vectors of loops over few arrays only; in single
    precision, lowered by more than its rounding.
    """
    slack, zero = np.float32(ROUNDING * (abs(x) + abs(y) + abs(z) + extent)), np.float32(0)
    x, y, z = np.float32(x), np.float32(y), np.float32(z)
    _over(box, 0, count, x, y, z, up)
    _over(box, 1, count, x, y, z, depth)
    _over(box, 2, count, x, y, z, lower)
    for n in range(count):
        u, v, w = up[n], depth[n], lower[n]
        p, q, r = max(u, zero), max(v, zero), max(w, zero)
        lower[n] = math.sqrt(p * p + q * q + r * r) + min(max(u, max(v, w)), zero) - slack


@helper(forceinline=True)
def _best(table, first, listed, lower, count, x, y, z):
    """The best primitive by its exact distance, looking only at those whose bound is below the best so far."""
    closest, lowest = 0, lower[0]
    for n in range(count):
        value = lower[n]
        if value < lowest:
            lowest, closest = value, n
    best, start = np.inf, closest
    for turn in range(-1, count):
        n = start if turn < 0 else turn
        if (turn >= 0 and n == start) or lower[n] > best:
            continue
        a, b, c = local(table, first + listed[n], x, y, z)
        closer = distance(table, first + listed[n], a, b, c)
        if closer < best or (closer == best and n < closest):
            best, closest = closer, n
    return best, closest


@kernel("void(f8[:, ::1], i8, f8[:, ::1], i8, i8[::1], f8[::1], i8, i8)")
def nearest(table, per_scene, points, count, slots, values, begin, end):
    """Nearest primitive and signed distance of the union for the points ``begin`` to ``end`` of all scenes.

    Each scene has ``per_scene`` rows of the table and ``count`` points.  The turned box around a primitive bounds its
    signed distance from below, inside too.  Where coordinates are too large for bounds, or no numbers, every primitive
    is looked at.
    """
    listed, box = np.empty(per_scene, np.int64), np.empty((15, per_scene), np.float32)
    up, depth, lower = np.empty(per_scene, np.float32), np.empty(per_scene, np.float32), np.empty(per_scene, np.float32)
    scene, used, extent = -1, 0, 0.0
    for item in range(begin, end):
        if item // count != scene:
            scene = item // count
            used, extent = _boxes(table, scene * per_scene, per_scene, listed, box)
        if used == 0:
            slots[item], values[item] = 0, np.inf
            continue
        x, y, z = points[item, 0], points[item, 1], points[item, 2]
        if abs(x) + abs(y) + abs(z) + extent < FARTHEST:
            _bounds(box, used, x, y, z, extent, up, depth, lower)
        else:
            lower[:used] = -np.inf
        best, closest = _best(table, scene * per_scene, listed, lower, used, x, y, z)
        slots[item], values[item] = listed[closest], best


@kernel("void(f8[:, ::1], i8, f8[:, ::1], i8, i8[::1], f8[::1], f8[:, ::1], f8[:, ::1], i8, i8)")
def pull(table, per_scene, points, count, slots, slope, to_table, to_points, begin, end):
    """Gradient of the distances to known primitives, given the gradient of a loss by each of them.

    ``to_table`` has the rows of the table; the scenes are ``begin`` to ``end``.
    """
    part = np.empty(7)
    for scene in range(begin, end):
        for item in range(scene * count, (scene + 1) * count):
            row, weight = scene * per_scene + slots[item], slope[item]
            if weight == 0:
                continue
            a, b, c = local(table, row, points[item, 0], points[item, 1], points[item, 2])
            slopes(table, row, a, b, c, part)
            for entry_index in range(4):
                if entry_index == 3 or table[row, SIZE + entry_index] >= 0:  # lengths below zero count as zero
                    to_table[row, SIZE + entry_index] += weight * part[3 + entry_index]
            for axis in range(3):
                offset = points[item, axis] - table[row, CENTRE + axis]
                moved = 0.0
                for column in range(3):
                    moved += table[row, ROTATION + 3 * axis + column] * part[column]
                    to_table[row, ROTATION + 3 * axis + column] += weight * offset * part[column]
                to_table[row, CENTRE + axis] -= weight * moved
                to_points[item, axis] = weight * moved


@kernel("void(f8[:, ::1], f8[:, ::1], i8, i8, i8)")
def project(table, points, rounds, begin, end):
    """Move the points ``begin`` to ``end`` onto the second and the first of two primitives in turn.

    Point k belongs to rows 2 k and 2 k + 1 of the table.  Inside a primitive it stays where it is.
    """
    part = np.empty(7)
    for item in range(begin, end):
        still = 0
        for step in range(2 * rounds):
            row = 2 * item + 1 - step % 2
            a, b, c = local(table, row, points[item, 0], points[item, 1], points[item, 2])
            far = distance(table, row, a, b, c)
            still = 0 if far > 0 else still + 1
            if still == 2:
                break
            if far > 0:
                slopes(table, row, a, b, c, part)
                up, depth, side = turned(table, row, part[0], part[1], part[2])
                points[item, 0] -= far * up
                points[item, 1] -= far * depth
                points[item, 2] -= far * side
