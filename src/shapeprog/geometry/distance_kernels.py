"""Kernels that find the nearest primitive of a point, and take the gradient of the distance to it."""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry.dispatch import bound, distance, place, slopes
from shapeprog.kernels.compile import helper, kernel
from shapeprog.kernels.table import CENTRE, KIND, ROTATION, SIZE, local, turned

ROUNDING = 2e-6  # error of a bound in single precision against the size of the coordinates, generously
FARTHEST = 1e18  # coordinates whose squares fit into single precision, in which bounds are taken and points drawn

CONVERGED = 1 - 1e-12  # ratio of distances of two projections above which the gap between primitives is known
STARTS = 9  # points of a primitive from which the nearest ones of another are looked for


@helper
def boxes_around(table, first, per_scene, box):
    """Fill the columns of ``box`` (6, N) with the boxes around primitives: centre and half extent along each axis.

    The box of padding is infinitely far away.  Returns how far the others reach.
    """
    extent = 0.0
    for slot in range(per_scene):
        row = first + slot
        box[:3, slot], box[3:, slot] = 0, -np.inf
        if table[row, KIND] < 0:
            continue
        half = bound(table, row)
        for axis in range(3):
            reach = 0.0
            for column in range(3):
                reach += abs(table[row, ROTATION + 3 * axis + column]) * half[column]
            box[axis, slot], box[3 + axis, slot] = table[row, CENTRE + axis], reach
            reach += abs(table[row, CENTRE + axis])
            extent = max(extent, reach if reach < FARTHEST else np.inf)
    return extent


@helper(forceinline=True)
def lower_bounds(box, x, y, z, extent, lower):
    """Lower bounds of the signed distances of a point: those to the boxes around the primitives.

    In single precision, lowered by more than its rounding; without bound where coordinates are too large for that, or
    no numbers.
    """
    far = abs(x) + abs(y) + abs(z) + extent
    slack, zero = np.float32(ROUNDING * far if far < FARTHEST else np.inf), np.float32(0)
    x, y, z = np.float32(x), np.float32(y), np.float32(z)
    for slot in range(len(lower)):  # the compiler makes vectors of this loop
        u = abs(x - box[0, slot]) - box[3, slot]
        v = abs(y - box[1, slot]) - box[4, slot]
        w = abs(z - box[2, slot]) - box[5, slot]
        p, q, r = max(u, zero), max(v, zero), max(w, zero)
        lower[slot] = math.sqrt(p * p + q * q + r * r) + min(max(u, max(v, w)), zero) - slack


@helper(forceinline=True)
def _best(table, first, lower, x, y, z):
    """The nearest primitive and its exact distance, looking only at those whose bound is below the best so far."""
    start, lowest = 0, np.float32(np.inf)
    for slot in range(len(lower)):
        value = lower[slot]
        if value < lowest:
            start, lowest = slot, value
    best, closest = np.inf, start
    for turn in range(-1 if len(lower) else 0, len(lower)):
        slot = start if turn < 0 else turn
        if (turn >= 0 and slot == start) or lower[slot] > best or table[first + slot, KIND] < 0:
            continue
        a, b, c = local(table, first + slot, x, y, z)
        closer = distance(table, first + slot, a, b, c)
        if closer < best or (closer == best and slot < closest):
            best, closest = closer, slot
    return best, closest


@kernel("void(f8[:, ::1], i8, f8[:, ::1], i8, i8[::1], f8[::1], i8, i8)")
def nearest(table, per_scene, points, count, slots, values, begin, end):
    """Nearest primitive and signed distance of the union for the points ``begin`` to ``end`` of all scenes.

    Each scene has ``per_scene`` rows of the table and ``count`` points.  The box around a primitive bounds its signed
    distance from below, inside too.
    """
    box, lower = np.empty((6, per_scene), np.float32), np.empty(per_scene, np.float32)
    scene, extent = -1, 0.0
    for item in range(begin, end):
        if item // count != scene:
            scene = item // count
            extent = boxes_around(table, scene * per_scene, per_scene, box)
        x, y, z = points[item, 0], points[item, 1], points[item, 2]
        lower_bounds(box, x, y, z, extent, lower)
        values[item], slots[item] = _best(table, scene * per_scene, lower, x, y, z)


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


@helper
def _between(table, row, x, y, z, rounds, ratio, part):
    """A point moved onto the primitive of the next row and back onto that of a row, so many times.

    Inside a primitive it stays where it is.  It stops when a distance is more than ``ratio`` times the one before.
    Returns its last distance, and the point.
    """
    far, before, still = np.inf, np.inf, 0
    for step in range(2 * rounds):
        there = row + 1 - step % 2
        a, b, c = local(table, there, x, y, z)
        far = distance(table, there, a, b, c)
        still = 0 if far > 0 else still + 1
        converged = step > 1 and there > row and far > before * ratio
        if still == 2 or converged:
            break
        before = far
        if far > 0:
            slopes(table, there, a, b, c, part)
            up, depth, side = turned(table, there, part[0], part[1], part[2])
            x, y, z = x - far * up, y - far * depth, z - far * side
    return far, x, y, z


@kernel("void(f8[:, ::1], f8[:, ::1], i8, i8, i8)")
def project(table, points, rounds, begin, end):
    """Move the points ``begin`` to ``end`` onto the second and the first of two primitives in turn.

    Point k belongs to rows 2 k and 2 k + 1 of the table.
    """
    part = np.empty(7)
    for item in range(begin, end):
        x, y, z = points[item, 0], points[item, 1], points[item, 2]
        _, x, y, z = _between(table, 2 * item, x, y, z, rounds, np.inf, part)
        points[item, 0], points[item, 1], points[item, 2] = x, y, z


@kernel("void(f8[:, ::1], i8, f8, f8[::1])")
def gaps(table, rounds, enough, gap):
    """Distances between two primitives, or such as are small enough, by projections of points of the first.

    Those of gap k are in rows 2 k and 2 k + 1 of the table.  The points are on the local axis 0.
    """
    part = np.empty(7)
    for item in range(len(gap)):
        row, gap[item] = 2 * item, np.inf
        for start in range(STARTS):
            a, b, c = place(table, row, 2.0 * start / (STARTS - 1) - 1, 0.0, 0.0)
            x, y, z = turned(table, row, a, b, c)
            x, y, z = x + table[row, CENTRE], y + table[row, CENTRE + 1], z + table[row, CENTRE + 2]
            far, _, _, _ = _between(table, row, x, y, z, rounds, CONVERGED, part)
            gap[item] = min(gap[item], far)
            if far <= enough:
                break
