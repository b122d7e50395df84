"""Kernels that try round rods through pairs of points."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import helper, kernel

BINS = 16
"""Number of sectors around the axis of a rod."""

EVERY = 2
"""Stride over the points that are tested."""

REACH = 0.5
"""Length in cells of the stretches along the axis of a rod; an empty one ends it."""

STRETCHES = 128
"""Stretches along the longest rod: more than the diagonal of the grid."""


@helper
def dot(a, b):
    """The scalar product of two vectors of space."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@helper
def on_rod(point, normal, centre, axis, radius, tolerance, cosine):
    """Whether a point lies on an endless cylinder and faces across its axis."""
    along, square, across = 0.0, 0.0, 0.0
    for k in range(3):
        along += (point[k] - centre[k]) * axis[k]
    for k in range(3):
        off = point[k] - centre[k] - along * axis[k]
        square += off * off
        across += off * normal[k]
    distance = np.sqrt(square)
    return abs(distance - radius) < tolerance and abs(across) > cosine * distance


@kernel("void(f8[:, ::1], f8[:, ::1], f8[::1], f8[::1], f8, f8, f8, f8, b1[::1])")
def mark_rod(points, normals, centre, axis, radius, half, tolerance, cosine, inside):
    """Write which points (N, 3) with normals (N, 3) lie on a cylinder and face across its axis (N,)."""
    for k in range(len(points)):
        along = 0.0
        for row in range(3):
            along += (points[k, row] - centre[row]) * axis[row]
        inside[k] = abs(along) <= half and on_rod(points[k], normals[k], centre, axis, radius, tolerance, cosine)


@kernel("void(f8[:, ::1], f8[:, ::1], i4[:, ::1], i8[:, ::1], f8, f8, f8, f8[:, ::1])")
def try_rods(points, normals, neighbours, draws, tolerance, cosine, largest, rods):
    """Round rods through pairs of points, each with its number of supporting points.

    The axis is normal to both normals, and passes through their intersection (as in Schnabel, Wahl and Klein 2007).

    Parameters
    ----------
    points, normals, neighbours
        Points (N, 3) with unit normals (N, 3) of either sign, and indices (N, k) of neighbouring points.
    draws
        Random numbers (T, D): a first point, and the neighbours of a walk from it to the second.
    tolerance, cosine
        How far a point may be from the cylinder, and how well its normal agrees with it.
    largest
        Largest radius.
    rods
        Output (T, 10): number of supporting points, middle (3), axis (3), radius, half length, share of sectors with
        points.  Failed trials have no points.
    """
    count = len(points)
    axis, centre, off = np.empty(3), np.empty(3), np.empty(3)
    stretch = np.empty(STRETCHES, np.int64)
    sector = np.empty((STRETCHES, BINS), np.bool_)
    u, v = np.empty(3), np.empty(3)
    for trial in range(len(draws)):
        rods[trial] = 0.0
        first = draws[trial, 0] % count
        second = first
        for step in range(1, draws.shape[1]):
            second = neighbours[second, draws[trial, step] % neighbours.shape[1]]
            if abs(dot(normals[first], normals[second])) < 0.8:
                break
        p, q = normals[first], normals[second]
        cross = dot(p, q)
        if abs(cross) > 0.8:
            continue
        for k in range(3):
            a, b = (k + 1) % 3, (k + 2) % 3
            axis[k] = p[a] * q[b] - p[b] * q[a]
            off[k] = points[second, k] - points[first, k]
        length = np.sqrt(dot(axis, axis))
        for k in range(3):
            axis[k] /= length
        # first + s p and second + t q are equally far along the axis; elsewhere they meet
        det = 1 - cross * cross
        s = (dot(off, p) - cross * dot(off, q)) / det
        t = (cross * dot(off, p) - dot(off, q)) / det
        radius = (abs(s) + abs(t)) / 2
        if abs(abs(s) - abs(t)) > tolerance + 0.1 * radius or radius > largest or radius < 0.5 * tolerance:
            continue
        for k in range(3):
            centre[k] = points[first, k] + s * p[k]
        side = 0 if abs(axis[0]) < 0.6 else 1
        for k in range(3):
            u[k] = (1.0 if k == side else 0.0) - axis[side] * axis[k]
        length = np.sqrt(dot(u, u))
        for k in range(3):
            u[k] /= length
        for k in range(3):
            a, b = (k + 1) % 3, (k + 2) % 3
            v[k] = axis[a] * u[b] - axis[b] * u[a]
        stretch[:] = 0
        sector[:] = False
        middle = STRETCHES // 2
        for k in range(0, count, EVERY):
            if on_rod(points[k], normals[k], centre, axis, radius, tolerance, cosine):
                for m in range(3):
                    off[m] = points[k, m] - centre[m]
                at = int(np.floor(dot(off, axis) / REACH)) + middle
                if 0 <= at < STRETCHES:
                    stretch[at] += EVERY
                    angle = np.arctan2(dot(off, v), dot(off, u)) / (2 * np.pi) + 0.5
                    sector[at, min(int(angle * BINS), BINS - 1)] = True
        low, high = middle, middle
        while low > 0 and stretch[low - 1] > 0:
            low -= 1
        while high < STRETCHES and stretch[high] > 0:
            high += 1
        support, filled = 0, 0
        for at in range(low, high):
            support += stretch[at]
        for b in range(BINS):
            for at in range(low, high):
                if sector[at, b]:
                    filled += 1
                    break
        rods[trial, 0] = support
        for k in range(3):
            rods[trial, 1 + k] = centre[k] + axis[k] * REACH * ((low + high) / 2 - middle)
            rods[trial, 4 + k] = axis[k]
        rods[trial, 7], rods[trial, 8], rods[trial, 9] = radius, REACH * (high - low) / 2, filled / BINS
