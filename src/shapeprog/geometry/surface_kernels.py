"""Kernels that draw visible surface points: choose faces by area, place points on them, drop hidden ones.

They are the twins of the declared ``sample``, ``place`` and ``normal`` of cuboid and cylinder: the same points.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from shapeprog.geometry.solid_kernels import bound, distance, local

CYLINDER = 1

GUIDE = 256
"""Steps of the table that shortens the search for a face."""


@njit(cache=True, nogil=True)
def _place(kind, size, slot, u, v, w):
    """Local point of a unit place."""
    if kind[slot] == CYLINDER:
        return size[slot, 0] * u, size[slot, 1] * v, size[slot, 1] * w
    return size[slot, 0] * u, size[slot, 1] * v + size[slot, 3] / 2 * u, size[slot, 2] * w


@njit(cache=True, nogil=True)
def _turn(rotation, slot, a, b, c):
    """A local direction in the grid frame."""
    return (
        rotation[slot, 0, 0] * a + rotation[slot, 0, 1] * b + rotation[slot, 0, 2] * c,
        rotation[slot, 1, 0] * a + rotation[slot, 1, 1] * b + rotation[slot, 1, 2] * c,
        rotation[slot, 2, 0] * a + rotation[slot, 2, 1] * b + rotation[slot, 2, 2] * c,
    )


@njit(cache=True, nogil=True)
def _draw(kind, face, one, two, three):
    """Unit place on a face for three uniform numbers."""
    if kind == CYLINDER:
        angle = 2 * np.pi * one
        if face == 2:
            return 2 * three - 1, np.cos(angle), np.sin(angle)
        rim = np.sqrt(two)
        return 2.0 * face - 1, rim * np.cos(angle), rim * np.sin(angle)
    sign = 2.0 * (face % 2) - 1
    u, v, w = 2 * one - 1, 2 * two - 1, 2 * three - 1
    if face < 2:
        return sign, v, w
    if face < 4:
        return u, sign, w
    return u, v, sign


@njit(cache=True, nogil=True)
def _normal(kind, size, slot, face, u, v, w):
    """Local normal of a face at a unit place."""
    if kind[slot] == CYLINDER:
        return (0.0, v, w) if face == 2 else (u, 0.0, 0.0)
    sign = 2.0 * (face % 2) - 1
    if face < 2:
        return sign, 0.0, 0.0
    if face < 4:
        slant = size[slot, 3] / 2
        length = np.sqrt(max(size[slot, 0] * size[slot, 0] + slant * slant, 1e-24))
        return -sign * slant / length, sign * size[slot, 0] / length, 0.0
    return 0.0, 0.0, sign


@njit(cache=True, nogil=True)
def uniform(seed, count):
    """Number ``count`` of the stream of a seed, uniform in [0, 1): a counter put through the mixer of SplitMix64."""
    word = np.uint64(seed) + np.uint64(count + 1) * np.uint64(0x9E3779B97F4A7C15)
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    word = word ^ (word >> np.uint64(31))
    return float(word >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@njit(cache=True, nogil=True)
def _around(kind, size, centre, rotation, mask, skin, reach, near, nears):
    """For each primitive the others whose boxes touch its own: only they can hide it."""
    for slot in range(kind.shape[0]):
        for axis in range(3):
            reach[slot, axis] = skin + bound(kind, size, rotation, slot, axis)
    for slot in range(kind.shape[0]):
        nears[slot] = 0
        for other in range(kind.shape[0]):
            apart = other == slot or not mask[slot] or not mask[other]
            for axis in range(3):
                gap = abs(centre[slot, axis] - centre[other, axis]) - reach[slot, axis] - reach[other, axis]
                apart = apart or gap > 0
            if not apart:
                near[slot, nears[slot]] = other
                nears[slot] += 1


@njit(cache=True, nogil=True)
def _hidden(kind, size, centre, rotation, reach, near, nears, slot, x, y, z, dx, dy, dz):
    """Whether another part begins just outside the point, or an earlier part has the same face there."""
    for place in range(nears[slot]):
        other = near[slot, place]
        if abs(x - centre[other, 0]) > reach[other, 0] or abs(y - centre[other, 1]) > reach[other, 1]:
            continue
        if abs(z - centre[other, 2]) > reach[other, 2]:
            continue
        a, b, c = local(centre, rotation, other, x + dx, y + dy, z + dz)
        if distance(kind, size, other, a, b, c) < 0:
            return True
        if other < slot:
            a, b, c = local(centre, rotation, other, x - dx, y - dy, z - dz)
            if distance(kind, size, other, a, b, c) < 0:
                return True
    return False


@njit(cache=True, nogil=True)
def _choose(shares, guide, number):
    """First cell whose cumulative share is above a number; the guide says where to start looking."""
    cell = guide[int(number * GUIDE)]
    while shares[cell] <= number:
        cell += 1
    return cell


@njit(cache=True, nogil=True)
def _visible_in_scene(
    kind, size, centre, rotation, mask, shares, seed, stream, skin, most, slots, faces, units, normals
):
    """Fill the outputs (n, ...) of one scene; returns how many of at most ``most`` candidates were kept."""
    many = kind.shape[0]
    per = shares.shape[0] // max(many, 1)
    reach, near, nears = np.empty((many, 3)), np.empty((many, many), np.int64), np.empty(many, np.int64)
    _around(kind, size, centre, rotation, mask, skin, reach, near, nears)
    guide = np.searchsorted(shares, np.arange(GUIDE + 1) / GUIDE, side="right")
    kept = 0
    for candidate in range(most):
        if kept == slots.shape[0]:
            break
        count = stream + 4 * candidate
        cell = _choose(shares, guide, uniform(seed, count))
        slot, face = cell // per, cell % per
        u, v, w = _draw(kind[slot], face, uniform(seed, count + 1), uniform(seed, count + 2), uniform(seed, count + 3))
        a, b, c = _place(kind, size, slot, u, v, w)
        x, y, z = _turn(rotation, slot, a, b, c)
        a, b, c = _normal(kind, size, slot, face, u, v, w)
        a, b, c = _turn(rotation, slot, a, b, c)
        x, y, z = x + centre[slot, 0], y + centre[slot, 1], z + centre[slot, 2]
        if _hidden(kind, size, centre, rotation, reach, near, nears, slot, x, y, z, skin * a, skin * b, skin * c):
            continue
        slots[kept], faces[kept] = slot, face
        units[kept, 0], units[kept, 1], units[kept, 2] = u, v, w
        normals[kept, 0], normals[kept, 1], normals[kept, 2] = a, b, c
        kept += 1
    return kept


@njit(cache=True, nogil=True)
def visible(
    kind, size, centre, rotation, mask, shares, seed, skin, most, slots, faces, units, normals, found, begin, end
):
    """Fill the outputs (B, n, ...) with visible surface points of the scenes ``begin`` to ``end``.

    ``shares`` (B, N * F) are cumulative shares of area; ``found`` (B,) receives how many of at most ``most``
    candidates were visible, n at most.
    """
    for scene in range(begin, end):
        found[scene] = _visible_in_scene(
            kind[scene], size[scene], centre[scene], rotation[scene], mask[scene], shares[scene],
            seed, scene << 40, skin, most, slots[scene], faces[scene], units[scene], normals[scene],
        )  # fmt: skip


@njit(cache=True, nogil=True)
def put(kinds, sizes, centres, rotations, slots, units, points, begin, end):
    """Grid positions of unit places."""
    for scene in range(begin, end):
        kind, size, centre, rotation = kinds[scene], sizes[scene], centres[scene], rotations[scene]
        for item in range(slots.shape[1]):
            slot = slots[scene, item]
            a, b, c = _place(kind, size, slot, units[scene, item, 0], units[scene, item, 1], units[scene, item, 2])
            x, y, z = _turn(rotation, slot, a, b, c)
            points[scene, item, 0] = x + centre[slot, 0]
            points[scene, item, 1] = y + centre[slot, 1]
            points[scene, item, 2] = z + centre[slot, 2]


@njit(cache=True, nogil=True)
def pull(kinds, sizes, rotations, slots, units, slope, to_size, to_centre, to_rotation, begin, end):
    """Gradient by size, centre and rotation of placed points, given the gradient of a loss by each point."""
    for scene in range(begin, end):
        kind, size, rotation = kinds[scene], sizes[scene], rotations[scene]
        for item in range(slots.shape[1]):
            slot = slots[scene, item]
            u, v, w = units[scene, item, 0], units[scene, item, 1], units[scene, item, 2]
            a, b, c = _place(kind, size, slot, u, v, w)
            da, db, dc = 0.0, 0.0, 0.0
            for axis in range(3):
                part = slope[scene, item, axis]
                to_centre[scene, slot, axis] += part
                to_rotation[scene, slot, axis, 0] += part * a
                to_rotation[scene, slot, axis, 1] += part * b
                to_rotation[scene, slot, axis, 2] += part * c
                da += rotation[slot, axis, 0] * part
                db += rotation[slot, axis, 1] * part
                dc += rotation[slot, axis, 2] * part
            to_size[scene, slot, 0] += da * u
            if kind[slot] == CYLINDER:
                to_size[scene, slot, 1] += db * v + dc * w
            else:
                to_size[scene, slot, 1] += db * v
                to_size[scene, slot, 2] += dc * w
                to_size[scene, slot, 3] += db * u / 2
