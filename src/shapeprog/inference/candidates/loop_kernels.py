"""Kernels that compare candidates with each other, and search for copies at equal steps."""

from __future__ import annotations

from shapeprog.kernels.compile import helper, kernel


@helper
def far(first, second, limit):
    """Whether two arrays of numbers differ by ``limit`` or more anywhere."""
    for k in range(len(first)):  # noqa: SIM110 (numba has no any)
        if not abs(first[k] - second[k]) < limit:
            return True
    return False


@kernel(
    "void(i8[::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8, f8, b1[:, ::1])"
)
def copies(kind, scale, spread, skew, lean, moved_spread, moved_skew, moved_lean, tolerance, leaning, out):
    """Write whether a candidate (column) has the same shape as a candidate (row) after a transformation.

    Parameters
    ----------
    kind
        Numbers (C,) that are equal for equal statements.
    scale
        The size (C,) of each candidate about its middle.
    spread, skew, lean
        Moments (C, 9) and (C, 3), and asymmetry between sides (C, 3), of the candidates.
    moved_spread, moved_skew, moved_lean
        The same after a mirror image or a turn.
    tolerance, leaning
        Largest relative difference of moments, and largest difference between sides.
    out
        Output (C, C).
    """
    for a in range(len(kind)):
        second, third = tolerance * scale[a] ** 2, tolerance * scale[a] ** 3
        for b in range(len(kind)):
            out[a, b] = not (
                kind[a] != kind[b]
                or far(spread[b], moved_spread[a], second)
                or far(skew[b], moved_skew[a], third)
                or far(lean[b], moved_lean[a], leaning)
            )


@kernel("void(f8[:, ::1], f8, f8, i8[:, ::1])")
def at_steps(positions, times, stray, out):
    """Write the index of the position nearest to ``times`` steps from position a towards b; -1 if none.

    Parameters
    ----------
    positions
        Positions (M, 3).
    times
        Number of steps from the first of two positions.
    stray
        Distance along each axis below which a position matches.
    out
        Output (M, M), a row for each first position.
    """
    count = len(positions)
    for a in range(count):
        for b in range(count):
            nearest, minimum = -1, stray
            up = positions[a, 0] + times * (positions[b, 0] - positions[a, 0])
            depth = positions[a, 1] + times * (positions[b, 1] - positions[a, 1])
            side = positions[a, 2] + times * (positions[b, 2] - positions[a, 2])
            for c in range(count):
                off = abs(positions[c, 0] - up)
                if off < minimum:
                    off = max(off, abs(positions[c, 1] - depth), abs(positions[c, 2] - side))
                    if off < minimum:
                        nearest, minimum = c, off
            out[a, b] = nearest
