"""Kernels that find the nearest primitive of a point: the scalar twins of the declared distances."""

from __future__ import annotations

import numpy as np
from numba import njit

CYLINDER = 1


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
def _exact(kind, size, rotation, slot):
    """Whether a primitive fills the box around it: a cuboid at right angles to the grid, without a shear."""
    if kind[slot] == CYLINDER or size[slot, 3] != 0:
        return False
    for i in range(3):
        for j in range(3):
            if rotation[slot, i, j] != np.rint(rotation[slot, i, j]):
                return False
    return True


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
def _nearest_in_scene(kind, size, centre, rotation, mask, points, slots, values, begin, end):
    """The same for one scene.

    The box around a primitive bounds its signed distance from below, inside too; only primitives whose bound is
    below the best value so far are looked at closely.
    """
    kept = np.nonzero(mask)[0]
    used = len(kept)
    full = np.empty(used, np.bool_)
    box = np.empty((6, used), points.dtype)
    lower = np.empty(used, points.dtype)
    zero = points.dtype.type(0)
    for n in range(used):
        full[n] = _exact(kind, size, rotation, kept[n])
        for axis in range(3):
            box[axis, n] = centre[kept[n], axis]
            box[axis + 3, n] = bound(kind, size, rotation, kept[n], axis)
    for item in range(begin, end):
        if used == 0:
            slots[item], values[item] = 0, np.inf
            continue
        x, y, z = points[item, 0], points[item, 1], points[item, 2]
        for n in range(used):
            u = abs(x - box[0, n]) - box[3, n]
            v = abs(y - box[1, n]) - box[4, n]
            w = abs(z - box[2, n]) - box[5, n]
            p, q, r = max(u, zero), max(v, zero), max(w, zero)
            lower[n] = np.sqrt(p * p + q * q + r * r) + min(max(u, max(v, w)), zero)
        found = 0
        for n in range(used):
            if lower[n] < lower[found]:
                found = n
        best = float(lower[found])
        if not full[found]:
            a, b, c = local(centre, rotation, kept[found], x, y, z)
            best = distance(kind, size, kept[found], a, b, c)
        start = found
        for n in range(used):
            if lower[n] <= best and n != start:
                value = float(lower[n])
                if not full[n]:
                    a, b, c = local(centre, rotation, kept[n], x, y, z)
                    value = distance(kind, size, kept[n], a, b, c)
                if value < best or (value == best and n < found):
                    best, found = value, n
        slots[item], values[item] = kept[found], best


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
