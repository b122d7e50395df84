"""The kernel that draws the outline of projected triangles."""

from __future__ import annotations

import math

from shapeprog.kernels.compile import helper, kernel


@helper
def widened(low, high, a, b, bottom, top):
    """An interval of a row that also holds what of the edge from ``a`` to ``b`` lies between ``bottom`` and ``top``."""
    if max(a[1], b[1]) < bottom or min(a[1], b[1]) > top:
        return low, high
    rise = b[1] - a[1]
    first, last = a[0], b[0]
    if abs(rise) > 1e-12:
        enter, leave = (bottom - a[1]) / rise, (top - a[1]) / rise
        if enter > leave:
            enter, leave = leave, enter
        first = a[0] + max(enter, 0.0) * (b[0] - a[0])
        last = a[0] + min(leave, 1.0) * (b[0] - a[0])
    return min(low, first, last), max(high, first, last)


@kernel("void(f8[:, ::1], i8[:, ::1], u1[:, ::1])")
def draw_outline(points, faces, pixels):
    """Mark every pixel of ``pixels`` (H, W) that a triangle touches.

    ``points`` (V, 2) are across and down; pixel (y, x) is the square of side 1 about (x, y).
    """
    height, width = pixels.shape
    for f in range(len(faces)):
        a, b, c = points[faces[f, 0]], points[faces[f, 1]], points[faces[f, 2]]
        first = max(0, math.floor(min(a[1], b[1], c[1]) + 0.5))
        last = min(height - 1, math.floor(max(a[1], b[1], c[1]) + 0.5))
        for y in range(first, last + 1):
            low, high = math.inf, -math.inf
            low, high = widened(low, high, a, b, y - 0.5, y + 0.5)
            low, high = widened(low, high, b, c, y - 0.5, y + 0.5)
            low, high = widened(low, high, c, a, y - 0.5, y + 0.5)
            if low > high:
                continue
            for x in range(max(0, math.floor(low + 0.5)), min(width - 1, math.floor(high + 0.5)) + 1):
                pixels[y, x] = 1
