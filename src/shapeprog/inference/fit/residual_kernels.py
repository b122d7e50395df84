"""Kernels that pair points with samples of a surface, and sum residuals of pairs over primitives."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import kernel


@kernel(
    "void(f8[:, ::1], f8[:, ::1], b1[::1], i8[:, ::1], f8[:, ::1], f8[:, ::1], i8[:, ::1], f8, f8, f8, f8[::1], "
    "i8[::1])"
)
def closest(points, normals, sides, at, samples, facing, candidates, spacing, turned, never, offset, best):
    """The best of several partners for each row, and its penalty besides the distance along the normal.

    Parameters
    ----------
    points, normals, sides
        Points (N, 3), their normals, and whether these are known to point outwards (N,).
    at
        Which of the points each row is offered (R, k).
    samples, facing
        Samples (S, 3) and their outward normals.
    candidates
        Index of the sample that is paired with each of these points (R, k).
    spacing
        Distance along the surface up to which a sample is as good as one right at the point.
    turned, never
        Distances by which samples count as farther whose normal is at a right angle, and faces the other way.
    offset, best
        Output (R,): squared penalty of the best pair, and its index.
    """
    for row in range(len(at)):
        minimum = np.inf
        for k in range(at.shape[1]):
            p, s = at[row, k], candidates[row, k]
            plane, squared, length, cosine = 0.0, 0.0, 0.0, 0.0
            for axis in range(3):
                off = points[p, axis] - samples[s, axis]
                plane += off * facing[s, axis]
                squared += off * off
                length += normals[p, axis] * normals[p, axis]
                cosine += normals[p, axis] * facing[s, axis]
            along = max(np.sqrt(max(squared - plane * plane, 0.0)) - spacing, 0.0)
            against = along * along
            if length > 0.25:
                differ = never if sides[p] and cosine < 0 else max(1 - cosine * cosine, 0.0)
                against += turned * turned * differ
            if plane * plane + against < minimum:
                minimum = plane * plane + against
                offset[row], best[row] = against, k


@kernel("void(f8[:, ::1], f8[::1], f8[::1], i8[::1], f8[:, ::1], f8[:, :, ::1])")
def gathered(slopes, weights, residuals, slots, slope, curvature):
    """The sums over the rows of each primitive of w r s and w s s'.

    Parameters
    ----------
    slopes, weights, residuals
        s (R, V), w (R,) and r (R,).
    slots
        The primitive (R,) of each row.
    slope, curvature
        Output (N, V) and (N, V, V), zero before.
    """
    width = slopes.shape[1]
    for row in range(len(slopes)):
        slot, weight = slots[row], weights[row]
        if weight == 0:
            continue
        for i in range(width):
            scaled = weight * slopes[row, i]
            slope[slot, i] += scaled * residuals[row]
            for j in range(i + 1):
                curvature[slot, i, j] += scaled * slopes[row, j]
    for slot in range(len(curvature)):
        for i in range(width):
            for j in range(i):
                curvature[slot, j, i] = curvature[slot, i, j]
