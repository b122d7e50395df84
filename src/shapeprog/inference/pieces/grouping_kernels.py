"""A kernel that follows neighbours."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import kernel


@kernel("void(b1[:, ::1], b1[:, ::1], b1[:, ::1])")
def grow(beside, fits, reached):
    """Write all that is reached (N, N) from each start, a row, from neighbour to neighbour through what fits it.

    Parameters
    ----------
    beside
        Which are neighbours (N, N).
    fits
        What each start (a row) allows (N, N), beside itself.
    reached
        Output, all false at first.
    """
    count = len(beside)
    waiting = np.empty(count, np.int64)
    for start in range(count):
        reached[start, start], waiting[0], left = True, start, 1
        while left > 0:
            left -= 1
            here = waiting[left]
            for other in range(count):
                if beside[here, other] and fits[start, other] and not reached[start, other]:
                    reached[start, other], waiting[left] = True, other
                    left += 1
