"""Kernels that find the nearest primitive of a point: the scalar twins of the declared distances.

Primitives come as rows of one table, see ``arrays.solids``: kind, sizes, centre, and rotation row by row.
"""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry.compiling import helper, kernel

CYLINDER = 1.0

SIZE, CENTRE, ROTATION = 1, 5, 8
"""Where in a row of the table sizes, centre and rotation begin; the kind comes first, negative for padding."""

ROUNDING = 2e-6
"""Error of a bound in single precision against the size of the coordinates, generously."""

STRIDE = 2.0
"""How far in cells from a point its list of possible nearest primitives is used."""


@helper
def distance(solids, row, a, b, c):
    """Signed distance of the local point (a, b, c) to the cuboid or cylinder of a row."""
    half_up = max(solids[row, 1], 0.0)
    if solids[row, 0] == CYLINDER:
        over_up = abs(a) - half_up
        over_side = math.sqrt(b * b + c * c) - max(solids[row, 2], 0.0)
    else:
        over_side = abs(c) - max(solids[row, 3], 0.0)
        half_depth = max(solids[row, 2], 0.0)
        if solids[row, 4] == 0:
            up, depth = abs(a) - half_up, abs(b) - half_depth
            over_up = max(up, depth)
            if over_up > 0:
                up, depth = max(up, 0.0), max(depth, 0.0)
                over_up = math.sqrt(up * up + depth * depth)
        else:
            over_up = _parallelogram(half_up, half_depth, solids[row, 4] / 2, a, b)
    inner = max(over_up, over_side)
    if inner <= 0:
        return inner
    over_up, over_side = max(over_up, 0.0), max(over_side, 0.0)
    return math.sqrt(over_up * over_up + over_side * over_side)


@helper
def _parallelogram(half_up, half_depth, slant, up, depth):
    """Signed distance in the plane of the shear; the twin of the first half of ``cuboid.distance``."""
    if up < 0:
        up, depth = -up, -depth
    over_up = up - half_up
    over_along = max(abs(depth - slant) - half_depth, 0.0)
    to_cap = over_up * over_up + over_along * over_along
    cross = depth * half_up - up * slant
    fold = -1.0 if cross < 0 else 1.0
    edge_up, edge_depth = up * fold, depth * fold - half_depth
    length = max(half_up * half_up + slant * slant, 1e-24)
    foot = min(max((edge_up * half_up + edge_depth * slant) / length, -1.0), 1.0)
    side_up, side_depth = edge_up - foot * half_up, edge_depth - foot * slant
    plane = math.sqrt(min(to_cap, side_up * side_up + side_depth * side_depth))
    inside = over_up < 0 and abs(cross) < half_depth * half_up
    return -plane if inside else plane


@helper
def local(solids, row, x, y, z):
    """A point in the local frame of a row."""
    x, y, z = x - solids[row, 5], y - solids[row, 6], z - solids[row, 7]
    return (
        solids[row, 8] * x + solids[row, 11] * y + solids[row, 14] * z,
        solids[row, 9] * x + solids[row, 12] * y + solids[row, 15] * z,
        solids[row, 10] * x + solids[row, 13] * y + solids[row, 16] * z,
    )


@helper
def _boxes(solids, first, many, kept, box):
    """Fill the columns of ``box`` with the primitives that are there; returns how many, and how far they reach.

    Of each: centre, local axes and half extents of the turned box around it.
    """
    used, extent = 0, 0.0
    for slot in range(many):
        row = first + slot
        if solids[row, 0] < 0:
            continue
        for axis in range(3):
            box[axis, used] = solids[row, CENTRE + axis]
            for other in range(3):
                box[3 + 3 * axis + other, used] = solids[row, ROTATION + 3 * other + axis]
            box[12 + axis, used] = max(solids[row, SIZE + axis], 0.0)
        if solids[row, 0] == CYLINDER:
            box[14, used] = box[13, used]
        else:
            box[13, used] += abs(solids[row, 4]) / 2
        for entry in range(3):
            extent = max(extent, abs(box[entry, used]) + box[12 + entry, used])
        kept[used] = slot
        used += 1
    return used, extent


@helper
def _over(box, axis, count, x, y, z, over):
    """How far a point is beyond the faces of each box along one of its axes."""
    for n in range(count):
        dx, dy, dz = x - box[0, n], y - box[1, n], z - box[2, n]
        along = box[3 + 3 * axis, n] * dx + box[4 + 3 * axis, n] * dy + box[5 + 3 * axis, n] * dz
        over[n] = abs(along) - box[12 + axis, n]


@helper
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


@helper
def _best(solids, first, kept, lower, count, x, y, z):
    """The best primitive by its exact distance, looking only at those whose bound is below the best so far."""
    found, least = 0, lower[0]
    for n in range(count):
        value = lower[n]
        if value < least:
            least, found = value, n
    best, start = np.inf, found
    for turn in range(-1, count):
        n = start if turn < 0 else turn
        if (turn >= 0 and n == start) or lower[n] > best:
            continue
        a, b, c = local(solids, first + kept[n], x, y, z)
        closer = distance(solids, first + kept[n], a, b, c)
        if closer < best or (closer == best and n < found):
            best, found = closer, n
    return best, found


@helper
def _few(all_kept, all_box, lower, used, limit, kept, box):
    """Keep the boxes whose bound is below a limit; returns how many."""
    number = 0
    for n in range(used):
        if lower[n] <= limit:
            kept[number] = all_kept[n]
            for entry in range(15):
                box[entry, number] = all_box[entry, n]
            number += 1
    return number


@kernel
def nearest(solids, many, points, count, slots, values, begin, end):
    """Nearest primitive and signed distance of the union for the points ``begin`` to ``end`` of all scenes.

    Each scene has ``many`` rows of the table and ``count`` points.  The turned box around a primitive bounds its
    signed distance from below, inside too.  Distances change no faster than points move: a primitive whose bound at
    one point exceeds the best there by more than twice ``STRIDE`` is not the nearest within ``STRIDE`` of it, so
    points that come in order, such as cells, look at few primitives.
    """
    all_kept, kept = np.empty(many, np.int64), np.empty(many, np.int64)
    all_box, box = np.empty((15, many), np.float32), np.empty((15, many), np.float32)
    up, depth, lower = np.empty(many, np.float32), np.empty(many, np.float32), np.empty(many, np.float32)
    scene, used, number, extent, least = -1, 0, 0, 0.0, 0.0
    px, py, pz = np.inf, np.inf, np.inf
    for item in range(begin, end):
        if item // count != scene:
            scene, px = item // count, np.inf
            used, extent = _boxes(solids, scene * many, many, all_kept, all_box)
        if used == 0:
            slots[item], values[item] = 0, np.inf
            continue
        x, y, z = points[item, 0], points[item, 1], points[item, 2]
        if (x - px) * (x - px) + (y - py) * (y - py) + (z - pz) * (z - pz) < STRIDE * STRIDE:
            if number == 0:
                number = _few(all_kept, all_box, lower, used, least + 2 * STRIDE + 1e-3, kept, box)
            of, some, those = number, kept, box
        else:
            px, py, pz, number = x, y, z, 0
            of, some, those = used, all_kept, all_box
        _bounds(those, of, x, y, z, extent, up, depth, lower)
        best, found = _best(solids, scene * many, some, lower, of, x, y, z)
        slots[item], values[item] = some[found], best
        if number == 0:
            least = best


@helper
def _sign(value):
    """-1, 0 or 1."""
    if value > 0:
        return 1.0
    return -1.0 if value < 0 else 0.0


@helper
def _slopes(solids, row, a, b, c, slope):
    """Fill ``slope`` with the derivatives of the distance by a, b, c and the four sizes, as autograd takes them."""
    for place in range(7):
        slope[place] = 0.0
    if solids[row, 0] == CYLINDER:
        over_up = abs(a) - max(solids[row, 1], 0.0)
        rho = math.sqrt(b * b + c * c)
        over_side = rho - max(solids[row, 2], 0.0)
        by_up, by_side = _corner_slopes(over_up, over_side)
        slope[0], slope[3], slope[4] = by_up * _sign(a), -by_up, -by_side
        if rho >= 1e-12:
            slope[1], slope[2] = by_side * b / rho, by_side * c / rho
    else:
        plane = _parallelogram_slopes(
            max(solids[row, 1], 0.0), max(solids[row, 2], 0.0), solids[row, 4] / 2, a, b, slope
        )
        by_plane, by_side = _corner_slopes(plane, abs(c) - max(solids[row, 3], 0.0))
        for place in (0, 1, 3, 4, 6):
            slope[place] *= by_plane
        slope[2], slope[5] = by_side * _sign(c), -by_side
    for place in range(3):
        if solids[row, SIZE + place] < 0:
            slope[3 + place] = 0.0


@helper
def _corner_slopes(one, two):
    """Derivatives of the distance to the corner of two half planes by the distances to each."""
    if one <= 0 and two <= 0:
        if one == two:
            return 0.5, 0.5
        return (1.0, 0.0) if one > two else (0.0, 1.0)
    one, two = max(one, 0.0), max(two, 0.0)
    whole = math.sqrt(one * one + two * two)
    if whole < 1e-12:
        return 0.0, 0.0
    return one / whole, two / whole


@helper
def _parallelogram_slopes(half_up, half_depth, slant, up, depth, slope):
    """Signed distance in the plane of the shear, its derivatives by up, depth, the half extents and the lean.

    The foot of the perpendicular is where the squared distance is least, so it need not be differentiated.
    """
    turn = -1.0 if up < 0 else 1.0
    up, depth = up * turn, depth * turn
    over_up, along = up - half_up, depth - slant
    over_along = max(abs(along) - half_depth, 0.0)
    to_cap = over_up * over_up + over_along * over_along
    cross = depth * half_up - up * slant
    fold = -1.0 if cross < 0 else 1.0
    edge_up, edge_depth = up * fold, depth * fold - half_depth
    length = max(half_up * half_up + slant * slant, 1e-24)
    foot = min(max((edge_up * half_up + edge_depth * slant) / length, -1.0), 1.0)
    side_up, side_depth = edge_up - foot * half_up, edge_depth - foot * slant
    to_side = side_up * side_up + side_depth * side_depth
    plane = math.sqrt(min(to_cap, to_side))
    inside = over_up < 0 and abs(cross) < half_depth * half_up
    if plane >= 1e-12:
        scale = (-1.0 if inside else 1.0) / plane
        if to_cap <= to_side:
            slope[0], slope[3] = over_up * scale * turn, -over_up * scale
            slope[1] = over_along * _sign(along) * scale * turn
            slope[4] = -over_along * scale
            slope[6] = -over_along * _sign(along) * scale / 2
        else:
            slope[0], slope[3] = side_up * fold * scale * turn, -foot * side_up * scale
            slope[1] = side_depth * fold * scale * turn
            slope[4] = -side_depth * scale
            slope[6] = -foot * side_depth * scale / 2
    return -plane if inside else plane


@kernel
def pull(solids, many, points, count, slots, slope, to_solids, to_points, begin, end):
    """Gradient of the distances to known primitives, given the gradient of a loss by each of them.

    ``to_solids`` has the rows of the table; the scenes are ``begin`` to ``end``.
    """
    part = np.empty(7)
    for scene in range(begin, end):
        for item in range(scene * count, (scene + 1) * count):
            row, weight = scene * many + slots[item], slope[item]
            if weight == 0:
                continue
            a, b, c = local(solids, row, points[item, 0], points[item, 1], points[item, 2])
            _slopes(solids, row, a, b, c, part)
            for place in range(4):
                to_solids[row, SIZE + place] += weight * part[3 + place]
            for axis in range(3):
                offset = points[item, axis] - solids[row, CENTRE + axis]
                moved = 0.0
                for other in range(3):
                    moved += solids[row, ROTATION + 3 * axis + other] * part[other]
                    to_solids[row, ROTATION + 3 * axis + other] += weight * offset * part[other]
                to_solids[row, CENTRE + axis] -= weight * moved
                to_points[item, axis] = weight * moved
