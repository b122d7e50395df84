"""Kernels that count the points on round rods."""

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
def local(point, normal, centre, frame, at):
    """Write where a point is along the columns of a frame, its distance from the last, and how far it faces away."""
    for axis in range(3):
        at[axis] = 0.0
        for row in range(3):
            at[axis] += (point[row] - centre[row]) * frame[row, axis]
    at[3], at[4] = np.sqrt(at[0] * at[0] + at[1] * at[1]), 0.0
    for row in range(3):
        at[4] += (point[row] - centre[row] - at[2] * frame[row, 2]) * normal[row]


@kernel("void(f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1], f8, f8, f8, f8, b1[::1])")
def mark_rod(points, normals, centre, frame, radius, half, tolerance, cosine, inside):
    """Write which points (N, 3) with normals (N, 3) lie on a cylinder and face across its axis (N,)."""
    at = np.empty(5)
    for k in range(len(points)):
        local(points[k], normals[k], centre, frame, at)
        inside[k] = abs(at[2]) <= half and abs(at[3] - radius) < tolerance and abs(at[4]) > cosine * at[3]


@kernel("void(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[::1], f8, f8, f8[:, ::1])")
def count_rods(points, normals, centre, frame, radius, tolerance, cosine, counts):
    """Count the points on endless cylinders, along the stretch of their axes from the centre that has points.

    Parameters
    ----------
    points, normals
        Points (N, 3) with unit normals (N, 3) of either sign.
    centre, frame, radius
        Points on the axes (T, 3), frames (T, 3, 3) whose last columns are the axes, and radii (T,).
    tolerance, cosine
        How far a point may be from the cylinder, and how well its normal agrees with it.
    counts
        Output (T, 4): number of points, start and end of the stretch along the axis, share of sectors with points.
    """
    at = np.empty(5)
    stretch = np.empty(STRETCHES, np.int64)
    sector = np.empty((STRETCHES, BINS), np.bool_)
    middle = STRETCHES // 2
    for rod in range(len(radius)):
        stretch[:] = 0
        sector[:] = False
        for k in range(0, len(points), EVERY):
            local(points[k], normals[k], centre[rod], frame[rod], at)
            if abs(at[3] - radius[rod]) < tolerance and abs(at[4]) > cosine * at[3]:
                place = int(np.floor(at[2] / REACH)) + middle
                if 0 <= place < STRETCHES:
                    stretch[place] += EVERY
                    turn = np.arctan2(at[1], at[0]) / (2 * np.pi) + 0.5
                    sector[place, min(int(turn * BINS), BINS - 1)] = True
        low, high = middle, middle
        while low > 0 and stretch[low - 1] > 0:
            low -= 1
        while high < STRETCHES and stretch[high] > 0:
            high += 1
        counts[rod, 0], counts[rod, 3] = 0.0, 0.0
        counts[rod, 1], counts[rod, 2] = REACH * (low - middle), REACH * (high - middle)
        for place in range(low, high):
            counts[rod, 0] += stretch[place]
        for b in range(BINS):
            for place in range(low, high):
                if sector[place, b]:
                    counts[rod, 3] += 1.0 / BINS
                    break
