"""Kernels that draw visible surface points: choose faces by area, place points on them, drop hidden ones.

They are the twins of the declared ``sample``, ``place`` and ``normal`` of cuboid and cylinder: the same points.
Primitives come as rows of one table, see ``arrays.solids``.
"""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry.compiling import helper, kernel
from shapeprog.geometry.solid_kernels import CYLINDER, local

GUIDE = 256
"""Steps of the table that shortens the search for a face."""


@helper
def _place(solids, row, u, v, w):
    """Local point of a unit place."""
    if solids[row, 0] == CYLINDER:
        return solids[row, 1] * u, solids[row, 2] * v, solids[row, 2] * w
    return solids[row, 1] * u, solids[row, 2] * v + solids[row, 4] / 2 * u, solids[row, 3] * w


@helper
def _turn(solids, row, a, b, c):
    """A local direction in the grid frame."""
    return (
        solids[row, 8] * a + solids[row, 9] * b + solids[row, 10] * c,
        solids[row, 11] * a + solids[row, 12] * b + solids[row, 13] * c,
        solids[row, 14] * a + solids[row, 15] * b + solids[row, 16] * c,
    )


@helper
def _draw(kind, face, one, two, three):
    """Unit place on a face for three uniform numbers."""
    if kind == CYLINDER:
        angle = 2 * math.pi * one
        if face == 2:
            return 2 * three - 1, math.cos(angle), math.sin(angle)
        rim = math.sqrt(two)
        return 2.0 * face - 1, rim * math.cos(angle), rim * math.sin(angle)
    sign = 2.0 * (face % 2) - 1
    u, v, w = 2 * one - 1, 2 * two - 1, 2 * three - 1
    if face < 2:
        return sign, v, w
    if face < 4:
        return u, sign, w
    return u, v, sign


@helper
def _normal(solids, row, face, u, v, w):
    """Local normal of a face at a unit place."""
    if solids[row, 0] == CYLINDER:
        return (0.0, v, w) if face == 2 else (u, 0.0, 0.0)
    sign = 2.0 * (face % 2) - 1
    if face < 2:
        return sign, 0.0, 0.0
    if face < 4:
        slant = solids[row, 4] / 2
        length = math.sqrt(max(solids[row, 1] * solids[row, 1] + slant * slant, 1e-24))
        return -sign * slant / length, sign * solids[row, 1] / length, 0.0
    return 0.0, 0.0, sign


@helper
def uniform(seed, count):
    """Number ``count`` of the stream of a seed, uniform in [0, 1): a counter put through the mixer of SplitMix64."""
    word = np.uint64(seed) + np.uint64(count + 1) * np.uint64(0x9E3779B97F4A7C15)
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    word = word ^ (word >> np.uint64(31))
    return float(word >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@helper
def _reach(solids, row, axis):
    """Half extent along a grid axis of the box around the primitive of a row."""
    start = 8 + 3 * axis
    half_up, one, two = max(solids[row, 1], 0.0), max(solids[row, 2], 0.0), max(solids[row, 3], 0.0)
    if solids[row, 0] == CYLINDER:
        along = solids[row, start]
        return abs(along) * half_up + math.sqrt(max(1 - along * along, 0.0)) * one
    one += abs(solids[row, 4]) / 2
    return abs(solids[row, start]) * half_up + abs(solids[row, start + 1]) * one + abs(solids[row, start + 2]) * two


@helper
def _around(solids, first, many, skin, box, near, nears):
    """Boxes around the primitives, and for each of them the others whose box touches its own: only they can hide it."""
    for slot in range(many):
        for axis in range(3):
            box[slot, axis] = solids[first + slot, 5 + axis]
            box[slot, 3 + axis] = skin + _reach(solids, first + slot, axis)
    for slot in range(many):
        nears[slot] = 0
        for other in range(many):
            apart = other == slot or solids[first + slot, 0] < 0 or solids[first + other, 0] < 0
            for axis in range(3):
                gap = abs(box[slot, axis] - box[other, axis]) - box[slot, 3 + axis] - box[other, 3 + axis]
                apart = apart or gap > 0
            if not apart:
                near[slot, nears[slot]] = other
                nears[slot] += 1


@helper
def _inside(solids, row, x, y, z):
    """Whether a point is inside the primitive of a row: where its distance is negative."""
    a, b, c = local(solids, row, x, y, z)
    half_up, radius = solids[row, 1], solids[row, 2]
    if not abs(a) < half_up:
        return False
    if solids[row, 0] == CYLINDER:
        return radius > 0 and b * b + c * c < radius * radius
    return abs(b * half_up - a * solids[row, 4] / 2) < radius * half_up and abs(c) < solids[row, 3]


@helper
def _hidden(solids, first, box, near, nears, slot, x, y, z, dx, dy, dz):
    """Whether another part begins just outside the point, or an earlier part has the same face there."""
    for place in range(nears[slot]):
        other = near[slot, place]
        if abs(x - box[other, 0]) > box[other, 3] or abs(y - box[other, 1]) > box[other, 4]:
            continue
        if abs(z - box[other, 2]) > box[other, 5]:
            continue
        if _inside(solids, first + other, x + dx, y + dy, z + dz):
            return True
        if other < slot and _inside(solids, first + other, x - dx, y - dy, z - dz):
            return True
    return False


@kernel
def visible(solids, many, shares, seed, skin, most, n, chosen, places, found, begin, end):
    """Draw visible surface points of the scenes ``begin`` to ``end``, n of each.

    ``shares`` (B, N * F) are cumulative shares of area.  ``chosen`` (B * n, 2) receives slot and face, ``places``
    (B * n, 9) the unit place, the grid position and the normal, and ``found`` (B,) how many of at most ``most``
    candidates were visible, n at most.
    """
    box, near, nears = np.empty((many, 6)), np.empty((many, many), np.int64), np.empty(many, np.int64)
    guide = np.empty(GUIDE + 1, np.int64)
    per = shares.shape[1] // max(many, 1)
    for scene in range(begin, end):
        first, stream, base = scene * many, scene << 40, scene * n
        _around(solids, first, many, skin, box, near, nears)
        cell = 0
        for step in range(GUIDE + 1):
            while cell < shares.shape[1] and shares[scene, cell] <= step / GUIDE:
                cell += 1
            guide[step] = cell
        kept = 0
        for candidate in range(most):
            if kept == n:
                break
            count = stream + 4 * candidate
            number = uniform(seed, count)
            cell = guide[int(number * GUIDE)]
            while shares[scene, cell] <= number:
                cell += 1
            slot, face = cell // per, cell % per
            row = first + slot
            u, v, w = _draw(
                solids[row, 0], face, uniform(seed, count + 1), uniform(seed, count + 2), uniform(seed, count + 3)
            )
            a, b, c = _place(solids, row, u, v, w)
            x, y, z = _turn(solids, row, a, b, c)
            a, b, c = _normal(solids, row, face, u, v, w)
            a, b, c = _turn(solids, row, a, b, c)
            x, y, z = x + solids[row, 5], y + solids[row, 6], z + solids[row, 7]
            if _hidden(solids, first, box, near, nears, slot, x, y, z, skin * a, skin * b, skin * c):
                continue
            item = base + kept
            chosen[item, 0], chosen[item, 1] = slot, face
            places[item, 0], places[item, 1], places[item, 2] = u, v, w
            places[item, 3], places[item, 4], places[item, 5] = x, y, z
            places[item, 6], places[item, 7], places[item, 8] = a, b, c
            kept += 1
        found[scene] = kept


@kernel
def pull(solids, many, n, chosen, places, slope, weigh, to_solids, to_faces, begin, end):
    """Gradient by rows of the table and by faces of placed points and their weights.

    ``slope`` (B * n, 3) and ``weigh`` (B * n,) are the gradients of a loss by each point and each weight;
    ``to_faces`` (B * N, F) adds up the latter.
    """
    for scene in range(begin, end):
        for item in range(scene * n, (scene + 1) * n):
            row = scene * many + chosen[item, 0]
            to_faces[row, chosen[item, 1]] += weigh[item]
            u, v, w = places[item, 0], places[item, 1], places[item, 2]
            a, b, c = _place(solids, row, u, v, w)
            da, db, dc = 0.0, 0.0, 0.0
            for axis in range(3):
                part = slope[item, axis]
                start = 8 + 3 * axis
                to_solids[row, 5 + axis] += part
                to_solids[row, start] += part * a
                to_solids[row, start + 1] += part * b
                to_solids[row, start + 2] += part * c
                da += solids[row, start] * part
                db += solids[row, start + 1] * part
                dc += solids[row, start + 2] * part
            to_solids[row, 1] += da * u
            if solids[row, 0] == CYLINDER:
                to_solids[row, 2] += db * v + dc * w
            else:
                to_solids[row, 2] += db * v
                to_solids[row, 3] += dc * w
                to_solids[row, 4] += db * u / 2
