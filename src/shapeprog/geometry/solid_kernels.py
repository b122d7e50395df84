"""Kernels that find the nearest primitive of a point: the scalar twins of the declared distances."""

from __future__ import annotations

import numpy as np
from numba import njit

CYLINDER = 1

STRIDE = 2.0
"""How far in cells from a point its list of possible nearest primitives is used."""


@njit(cache=True, nogil=True)
def distance(kind, size, slot, a, b, c):
    """Signed distance of the local point (a, b, c) to the cuboid or cylinder of a slot."""
    half_up = max(size[slot, 0], 0.0)
    if kind[slot] == CYLINDER:
        over_up = abs(a) - half_up
        over_side = np.sqrt(b * b + c * c) - max(size[slot, 1], 0.0)
    else:
        over_side = abs(c) - max(size[slot, 2], 0.0)
        half_depth = max(size[slot, 1], 0.0)
        if size[slot, 3] == 0:
            up, depth = abs(a) - half_up, abs(b) - half_depth
            over_up = max(up, depth)
            if over_up > 0:
                over_up = np.sqrt(max(up, 0.0) ** 2 + max(depth, 0.0) ** 2)
        else:
            over_up = _parallelogram(half_up, half_depth, size[slot, 3] / 2, a, b)
    inner = max(over_up, over_side)
    if inner <= 0:
        return inner
    return np.sqrt(max(over_up, 0.0) ** 2 + max(over_side, 0.0) ** 2)


@njit(cache=True, nogil=True)
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
    to_side = (edge_up - foot * half_up) ** 2 + (edge_depth - foot * slant) ** 2
    plane = np.sqrt(min(to_cap, to_side))
    inside = over_up < 0 and abs(cross) < half_depth * half_up
    return -plane if inside else plane


@njit(cache=True, nogil=True)
def local(centre, rotation, slot, x, y, z):
    """A point in the local frame of a slot."""
    x, y, z = x - centre[slot, 0], y - centre[slot, 1], z - centre[slot, 2]
    return (
        rotation[slot, 0, 0] * x + rotation[slot, 1, 0] * y + rotation[slot, 2, 0] * z,
        rotation[slot, 0, 1] * x + rotation[slot, 1, 1] * y + rotation[slot, 2, 1] * z,
        rotation[slot, 0, 2] * x + rotation[slot, 1, 2] * y + rotation[slot, 2, 2] * z,
    )


@njit(cache=True, nogil=True)
def bound(kind, size, rotation, slot, axis):
    """Half extent along a grid axis of the box around the primitive of a slot."""
    if kind[slot] == CYLINDER:
        along = rotation[slot, axis, 0]
        across = np.sqrt(max(1 - along * along, 0.0))
        return abs(along) * max(size[slot, 0], 0.0) + across * max(size[slot, 1], 0.0)
    depth = max(size[slot, 1], 0.0) + abs(size[slot, 3]) / 2
    return (
        abs(rotation[slot, axis, 0]) * max(size[slot, 0], 0.0)
        + abs(rotation[slot, axis, 1]) * depth
        + abs(rotation[slot, axis, 2]) * max(size[slot, 2], 0.0)
    )


@njit(cache=True, nogil=True)
def _box(kind, size, centre, rotation, slot, box, n):
    """Column n of the boxes: centre, local axes and half extents of the turned box around the primitive of a slot.

    Returns whether the primitive fills it: a cuboid without a shear.
    """
    for axis in range(3):
        box[axis, n] = centre[slot, axis]
        for other in range(3):
            box[3 + 3 * axis + other, n] = rotation[slot, other, axis]
        box[12 + axis, n] = max(size[slot, axis], 0.0)
    if kind[slot] == CYLINDER:
        box[14, n] = box[13, n]
        return False
    box[13, n] += abs(size[slot, 3]) / 2
    return size[slot, 3] == 0


@njit(cache=True, nogil=True)
def nearest(kinds, sizes, centres, rotations, masks, points, slots, values, begin, end):
    """Nearest primitive and signed distance of the union for the points ``begin`` to ``end`` of all scenes."""
    count = points.shape[1]
    item = begin
    while item < end:
        scene, first = item // count, item % count
        last = min(count, first + end - item)
        _nearest_in_scene(
            kinds[scene], sizes[scene], centres[scene], rotations[scene], masks[scene],
            points[scene], slots[scene], values[scene], first, last,
        )  # fmt: skip
        item += last - first


@njit(cache=True, nogil=True)
def _over(box, axis, count, x, y, z, over):
    """How far a point is beyond the faces of each box along one of its axes."""
    for n in range(count):
        dx, dy, dz = x - box[0, n], y - box[1, n], z - box[2, n]
        along = box[3 + 3 * axis, n] * dx + box[4 + 3 * axis, n] * dy + box[5 + 3 * axis, n] * dz
        over[n] = abs(along) - box[12 + axis, n]


@njit(cache=True, nogil=True)
def _bounds(box, count, x, y, z, up, depth, lower):
    """Lower bounds of the signed distances of a point: those to the turned boxes around the primitives.

    One short loop after another, because the compiler makes vectors of loops over few arrays only.
    """
    zero = box.dtype.type(0)
    _over(box, 0, count, x, y, z, up)
    _over(box, 1, count, x, y, z, depth)
    _over(box, 2, count, x, y, z, lower)
    for n in range(count):
        u, v, w = up[n], depth[n], lower[n]
        p, q, r = max(u, zero), max(v, zero), max(w, zero)
        lower[n] = np.sqrt(p * p + q * q + r * r) + min(max(u, max(v, w)), zero)


@njit(cache=True, nogil=True)
def _best(kind, size, centre, rotation, kept, full, lower, count, x, y, z):
    """The best primitive by its exact distance, looking only at those whose bound is below the best so far."""
    found, least = 0, lower[0]
    for n in range(count):
        value = lower[n]
        if value < least:
            least, found = value, n
    best = float(least)
    if not full[found]:
        a, b, c = local(centre, rotation, kept[found], x, y, z)
        best = distance(kind, size, kept[found], a, b, c)
    start = found
    for n in range(count):
        if lower[n] <= best and n != start:
            closer = float(lower[n])
            if not full[n]:
                a, b, c = local(centre, rotation, kept[n], x, y, z)
                closer = distance(kind, size, kept[n], a, b, c)
            if closer < best or (closer == best and n < found):
                best, found = closer, n
    return best, found


@njit(cache=True, nogil=True)
def _nearest_in_scene(kind, size, centre, rotation, mask, points, slots, values, begin, end):
    """The same for one scene.

    The turned box around a primitive bounds its signed distance from below, inside too.  Distances change no faster
    than points move: a primitive whose bound at one point exceeds the best there by more than twice ``STRIDE`` is
    not the nearest within ``STRIDE`` of it, so points that come in order, such as cells, look at few primitives.
    """
    kept = np.nonzero(mask)[0]
    used = len(kept)
    full, box, lower = np.empty(used, np.bool_), np.empty((15, used), points.dtype), np.empty(used, points.dtype)
    up, depth = np.empty(used, points.dtype), np.empty(used, points.dtype)
    few, few_full, few_box = kept.copy(), full.copy(), box.copy()
    count = 0
    for n in range(used):
        full[n] = _box(kind, size, centre, rotation, kept[n], box, n)
    px, py, pz = np.inf, np.inf, np.inf
    for item in range(begin, end):
        if used == 0:
            slots[item], values[item] = 0, np.inf
            continue
        x, y, z = points[item, 0], points[item, 1], points[item, 2]
        if (x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2 < STRIDE**2:
            _bounds(few_box, count, x, y, z, up, depth, lower)
            best, found = _best(kind, size, centre, rotation, few, few_full, lower, count, x, y, z)
            slots[item], values[item] = few[found], best
            continue
        _bounds(box, used, x, y, z, up, depth, lower)
        best, found = _best(kind, size, centre, rotation, kept, full, lower, used, x, y, z)
        slots[item], values[item] = kept[found], best
        px, py, pz, count = x, y, z, 0
        for n in range(used):
            if lower[n] <= best + 2 * STRIDE + 1e-3:
                few[count], few_full[count] = kept[n], full[n]
                for row in range(15):
                    few_box[row, count] = box[row, n]
                count += 1


@njit(cache=True, nogil=True)
def _slopes(kind, size, slot, a, b, c, slope):
    """Fill ``slope`` with the derivatives of the distance by a, b, c and the four sizes, as autograd takes them."""
    slope[:] = 0.0
    if kind[slot] == CYLINDER:
        over_up = abs(a) - max(size[slot, 0], 0.0)
        rho = np.sqrt(b * b + c * c)
        over_side = rho - max(size[slot, 1], 0.0)
        by_up, by_side = _corner_slopes(over_up, over_side)
        slope[0], slope[3], slope[4] = by_up * np.sign(a), -by_up, -by_side
        if rho >= 1e-12:
            slope[1], slope[2] = by_side * b / rho, by_side * c / rho
    else:
        plane = _parallelogram_slopes(max(size[slot, 0], 0.0), max(size[slot, 1], 0.0), size[slot, 3] / 2, a, b, slope)
        by_plane, by_side = _corner_slopes(plane, abs(c) - max(size[slot, 2], 0.0))
        for place in (0, 1, 3, 4, 6):
            slope[place] *= by_plane
        slope[2], slope[5] = by_side * np.sign(c), -by_side
    for place in range(3):
        if size[slot, place] < 0:
            slope[3 + place] = 0.0


@njit(cache=True, nogil=True)
def _corner_slopes(one, two):
    """Derivatives of the distance to the corner of two half planes by the distances to each."""
    if one <= 0 and two <= 0:
        if one == two:
            return 0.5, 0.5
        return (1.0, 0.0) if one > two else (0.0, 1.0)
    one, two = max(one, 0.0), max(two, 0.0)
    whole = np.sqrt(one * one + two * two)
    if whole < 1e-12:
        return 0.0, 0.0
    return one / whole, two / whole


@njit(cache=True, nogil=True)
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
    plane = np.sqrt(min(to_cap, to_side))
    inside = over_up < 0 and abs(cross) < half_depth * half_up
    if plane >= 1e-12:
        scale = (-1.0 if inside else 1.0) / plane
        if to_cap <= to_side:
            slope[0], slope[3] = over_up * scale * turn, -over_up * scale
            slope[1] = over_along * np.sign(along) * scale * turn
            slope[4] = -over_along * scale
            slope[6] = -over_along * np.sign(along) * scale / 2
        else:
            slope[0], slope[3] = side_up * fold * scale * turn, -foot * side_up * scale
            slope[1] = side_depth * fold * scale * turn
            slope[4] = -side_depth * scale
            slope[6] = -foot * side_depth * scale / 2
    return -plane if inside else plane


@njit(cache=True, nogil=True)
def pull(
    kinds, sizes, centres, rotations, points, slots, slope, to_size, to_centre, to_rotation, to_points, begin, end
):
    """Gradient of the distances to known primitives, given the gradient of a loss by each of them."""
    part = np.empty(7)
    for scene in range(begin, end):
        kind, size, centre, rotation = kinds[scene], sizes[scene], centres[scene], rotations[scene]
        for item in range(slots.shape[1]):
            slot, weight = slots[scene, item], slope[scene, item]
            if weight == 0:
                continue
            x, y, z = points[scene, item, 0], points[scene, item, 1], points[scene, item, 2]
            a, b, c = local(centre, rotation, slot, x, y, z)
            _slopes(kind, size, slot, a, b, c, part)
            for place in range(4):
                to_size[scene, slot, place] += weight * part[3 + place]
            for axis in range(3):
                offset = points[scene, item, axis] - centre[slot, axis]
                moved = 0.0
                for other in range(3):
                    moved += rotation[slot, axis, other] * part[other]
                    to_rotation[scene, slot, axis, other] += weight * offset * part[other]
                to_centre[scene, slot, axis] -= weight * moved
                to_points[scene, item, axis] = weight * moved
