"""Kernels that find the nearest primitive of a point: the scalar twins of the declared distances."""

from __future__ import annotations

import numpy as np
from numba import njit

CYLINDER = 1


@njit(cache=True, nogil=True)
def distance(kind, size, a, b, c):
    """Signed distance of the local point (a, b, c) to a cuboid or a cylinder."""
    half_up = max(size[0], 0.0)
    if kind == CYLINDER:
        over_up = abs(a) - half_up
        over_side = np.sqrt(b * b + c * c) - max(size[1], 0.0)
    else:
        over_side = abs(c) - max(size[2], 0.0)
        half_depth = max(size[1], 0.0)
        if size[3] == 0:
            up, depth = abs(a) - half_up, abs(b) - half_depth
            over_up = max(up, depth)
            if over_up > 0:
                over_up = np.sqrt(max(up, 0.0) ** 2 + max(depth, 0.0) ** 2)
        else:
            over_up = _parallelogram(half_up, half_depth, size[3] / 2, a, b)
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
def local(centre, rotation, x, y, z):
    """A point in the local frame of a primitive."""
    x, y, z = x - centre[0], y - centre[1], z - centre[2]
    return (
        rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z,
        rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z,
        rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z,
    )


@njit(cache=True, nogil=True)
def bound(kind, size, rotation, axis):
    """Half extent along a grid axis of the box around a primitive."""
    if kind == CYLINDER:
        along = rotation[axis, 0]
        across = np.sqrt(max(1 - along * along, 0.0))
        return abs(along) * max(size[0], 0.0) + across * max(size[1], 0.0)
    depth = max(size[1], 0.0) + abs(size[3]) / 2
    return (
        abs(rotation[axis, 0]) * max(size[0], 0.0)
        + abs(rotation[axis, 1]) * depth
        + abs(rotation[axis, 2]) * max(size[2], 0.0)
    )


@njit(cache=True, nogil=True)
def _exact(kind, size, rotation):
    """Whether a primitive fills the box around it: a cuboid at right angles to the grid, without a shear."""
    if kind == CYLINDER or size[3] != 0:
        return False
    for i in range(3):
        for j in range(3):
            if rotation[i, j] != np.rint(rotation[i, j]):
                return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def nearest(kind, size, centre, rotation, mask, points, slots, values, begin, end):
    """Nearest primitive and signed distance of the union for the points ``begin`` to ``end`` of all scenes.

    The box around a primitive bounds its signed distance from below, inside too; only primitives whose bound is
    below the best value so far are looked at closely.
    """
    count = points.shape[1]
    most = kind.shape[1]
    kept = np.empty(most, np.int64)
    full = np.empty(most, np.bool_)
    box = np.empty((6, most), points.dtype)
    lower = np.empty(most, points.dtype)
    zero = points.dtype.type(0)
    last, used = -1, 0
    for item in range(begin, end):
        scene = item // count
        if scene != last:
            last, used = scene, 0
            for slot in range(most):
                if mask[scene, slot]:
                    kept[used] = slot
                    full[used] = _exact(kind[scene, slot], size[scene, slot], rotation[scene, slot])
                    for axis in range(3):
                        box[axis, used] = centre[scene, slot, axis]
                        box[axis + 3, used] = bound(kind[scene, slot], size[scene, slot], rotation[scene, slot], axis)
                    used += 1
        x, y, z = points[scene, item % count]
        if used == 0:
            slots[scene, item % count] = 0
            values[scene, item % count] = np.inf
            continue
        for n in range(used):
            u = abs(x - box[0, n]) - box[3, n]
            v = abs(y - box[1, n]) - box[4, n]
            w = abs(z - box[2, n]) - box[5, n]
            p, q, r = max(u, zero), max(v, zero), max(w, zero)
            lower[n] = np.sqrt(p * p + q * q + r * r) + min(max(u, max(v, w)), zero)
        first = 0
        for n in range(used):
            if lower[n] < lower[first]:
                first = n
        best, found = (
            _closely(kind, size, centre, rotation, scene, kept[first], full[first], lower[first], x, y, z),
            first,
        )
        for n in range(used):
            if lower[n] <= best and n != first:
                value = _closely(kind, size, centre, rotation, scene, kept[n], full[n], lower[n], x, y, z)
                if value < best or (value == best and n < found):
                    best, found = value, n
        slots[scene, item % count] = kept[found]
        values[scene, item % count] = best


@njit(cache=True, nogil=True)
def _closely(kind, size, centre, rotation, scene, slot, full, lower, x, y, z):
    if full:
        return float(lower)
    a, b, c = local(centre[scene, slot], rotation[scene, slot], x, y, z)
    return distance(kind[scene, slot], size[scene, slot], a, b, c)
