"""Kernels that draw visible surface points: choose faces by area, place points on them, drop hidden ones."""

from __future__ import annotations

import numpy as np

from shapeprog.geometry.dispatch import excess, normal, place, sample
from shapeprog.geometry.dispatch import pull as pull_sizes
from shapeprog.geometry.distance_kernels import FARTHEST, boxes_around, lower_bounds
from shapeprog.kernels.bits import uniform
from shapeprog.kernels.compile import helper, kernel
from shapeprog.kernels.table import CENTRE, ROTATION, local, turned


@helper
def _inside(table, row, x, y, z):
    """Whether a point is inside the primitive of a row."""
    a, b, c = local(table, row, x, y, z)
    return excess(table, row, a, b, c) < 0


@helper
def _hidden(table, first, lower, skin, slot, x, y, z, dx, dy, dz):
    """Whether another part begins just outside the point, or an earlier part has the same face there.

    ``lower`` are lower bounds of the distances of the primitives.
    """
    for rival in range(len(lower)):
        if rival == slot or lower[rival] > skin:
            continue
        if _inside(table, first + rival, x + dx, y + dy, z + dz):
            return True
        if rival < slot and _inside(table, first + rival, x - dx, y - dy, z - dz):
            return True
    return False


@kernel("void(f8[:, ::1], i8, f8[:, ::1], i8, f8, i8, i8, i8[:, ::1], f8[:, ::1], i8[::1], i8, i8)")
def visible(table, per_scene, shares, seed, skin, attempts, n, chosen, places, found, begin, end):
    """Draw visible surface points of the scenes ``begin`` to ``end``, n of each.

    ``shares`` (B, N * F) are cumulative shares of area.  ``chosen`` (B * n, 2) receives slot and face, ``places``
    (B * n, 9) the unit place, the grid position and the normal, and ``found`` (B,) how many of at most ``attempts``
    candidates were visible, n at most; -1 if one of them is farther away than ``FARTHEST``.
    """
    box, lower = np.empty((6, per_scene), np.float32), np.empty(per_scene, np.float32)
    faces = shares.shape[1] // max(per_scene, 1)
    for scene in range(begin, end):
        first, stream, base = scene * per_scene, scene << 40, scene * n
        extent = boxes_around(table, first, per_scene, box)
        accepted = 0
        for candidate in range(attempts):
            if accepted == n:
                break
            count = stream + 4 * candidate
            cell = np.searchsorted(shares[scene], uniform(seed, count), side="right")
            slot, face = cell // faces, cell % faces
            row = first + slot
            one, two, three = uniform(seed, count + 1), uniform(seed, count + 2), uniform(seed, count + 3)
            u, v, w = sample(table, row, face, one, two, three)
            a, b, c = place(table, row, u, v, w)
            x, y, z = turned(table, row, a, b, c)
            x, y, z = x + table[row, CENTRE], y + table[row, CENTRE + 1], z + table[row, CENTRE + 2]
            a, b, c = normal(table, row, face, u, v, w)
            a, b, c = turned(table, row, a, b, c)
            lower_bounds(box, x, y, z, extent, lower)
            if _hidden(table, first, lower, skin, slot, x, y, z, skin * a, skin * b, skin * c):
                continue
            if not abs(x) + abs(y) + abs(z) < FARTHEST:
                accepted = -1
                break
            item = base + accepted
            chosen[item, 0], chosen[item, 1] = slot, face
            places[item, 0], places[item, 1], places[item, 2] = u, v, w
            places[item, 3], places[item, 4], places[item, 5] = x, y, z
            places[item, 6], places[item, 7], places[item, 8] = a, b, c
            accepted += 1
        found[scene] = accepted


@kernel("void(f8[:, ::1], i8, i8, i8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1], f8[:, ::1], i8, i8)")
def pull(table, per_scene, n, chosen, places, slope, weigh, to_table, to_faces, begin, end):
    """Gradient by rows of the table and by faces of placed points and their weights.

    ``slope`` (B * n, 3) and ``weigh`` (B * n,) are the gradients of a loss by each point and each weight;
    ``to_faces`` (B * N, F) adds up the latter.
    """
    for scene in range(begin, end):
        for item in range(scene * n, (scene + 1) * n):
            row = scene * per_scene + chosen[item, 0]
            to_faces[row, chosen[item, 1]] += weigh[item]
            u, v, w = places[item, 0], places[item, 1], places[item, 2]
            a, b, c = place(table, row, u, v, w)
            da, db, dc = 0.0, 0.0, 0.0
            for axis in range(3):
                part, column = slope[item, axis], ROTATION + 3 * axis
                to_table[row, CENTRE + axis] += part
                to_table[row, column] += part * a
                to_table[row, column + 1] += part * b
                to_table[row, column + 2] += part * c
                da += table[row, column] * part
                db += table[row, column + 1] * part
                dc += table[row, column + 2] * part
            pull_sizes(table, row, u, v, w, da, db, dc, to_table)
