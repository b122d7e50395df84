"""Kernels that pair points with samples of a surface, and add up what pairs ask of each primitive."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import kernel


@kernel(
    "void(f8[:, ::1], f8[:, ::1], b1[::1], i8[:, ::1], f8[:, ::1], f8[:, ::1], i8[:, ::1], f8, f8, f8, f8[::1], "
    "i8[::1])"
)
def closest(points, normals, sides, at, places, facing, near, spacing, turned, never, offset, best):
    """The best of several partners for each row, and what beside the distance along its normal tells against it.

    Parameters
    ----------
    points, normals, sides
        Points (N, 3), their normals, and whether these are known to point outwards (N,).
    at
        Which of the points each row is offered (R, k).
    places, facing
        Samples (S, 3) and their outward normals.
    near
        Which of the samples goes with each of these (R, k).
    spacing
        Distance along the surface up to which a sample is as good as one right at the point.
    turned, never
        Distances by which samples count as farther whose normal is at a right angle, and faces the other way.
    offset, best
        Output (R,): what tells against the best pair, squared, and which it is.
    """
    for row in range(len(at)):
        least = np.inf
        for k in range(at.shape[1]):
            p, s = at[row, k], near[row, k]
            plane, apart, length, cosine = 0.0, 0.0, 0.0, 0.0
            for axis in range(3):
                off = points[p, axis] - places[s, axis]
                plane += off * facing[s, axis]
                apart += off * off
                length += normals[p, axis] * normals[p, axis]
                cosine += normals[p, axis] * facing[s, axis]
            along = max(np.sqrt(max(apart - plane * plane, 0.0)) - spacing, 0.0)
            against = along * along
            if length > 0.25:
                differ = never if sides[p] and cosine < 0 else max(1 - cosine * cosine, 0.0)
                against += turned * turned * differ
            if plane * plane + against < least:
                least = plane * plane + against
                offset[row], best[row] = against, k


@kernel("void(f8[:, ::1], f8[::1], f8[::1], i8[::1], f8[:, ::1], f8[:, :, ::1])")
def gathered(slopes, weights, residuals, slots, slope, curvature):
    """The sums over the rows of each primitive of w r s and w s s'.

    Parameters
    ----------
    slopes, weights, residuals
        s (R, V), w (R,) and r (R,).
    slots
        The primitive (R,) that each row is of.
    slope, curvature
        Output (N, V) and (N, V, V), zero before.
    """
    width = slopes.shape[1]
    for row in range(len(slopes)):
        slot, weight = slots[row], weights[row]
        if weight == 0:
            continue
        for i in range(width):
            own = weight * slopes[row, i]
            slope[slot, i] += own * residuals[row]
            for j in range(i + 1):
                curvature[slot, i, j] += own * slopes[row, j]
    for slot in range(len(curvature)):
        for i in range(width):
            for j in range(i):
                curvature[slot, j, i] = curvature[slot, i, j]
