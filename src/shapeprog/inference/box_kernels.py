"""Kernels that find the box of cells with the largest sum of weights, exactly."""

from __future__ import annotations

import numpy as np
from numba import njit

SLACK = 0.01
"""What a bound must fall short by before it prunes: more than the rounding of a sum in single precision."""


@njit(cache=True, nogil=True, fastmath={"reassoc", "nsz", "nnan"})
def positive_sum(values):  # type: ignore[no-untyped-def]
    """Sum of the positive values of a row, in any order: a bound on the sum of any stretch of it."""
    total = np.float32(0)
    for k in range(len(values)):
        total += values[k] if values[k] > 0 else np.float32(0)
    return total


@njit(cache=True, nogil=True)
def heaviest_box(weights, limit0, limit1, floor):  # type: ignore[no-untyped-def]
    """Largest sum over all boxes of a weight volume (A, B, C), and the box.

    Sides along the first two axes are at most ``limit0`` and ``limit1`` cells.  Only sums above ``floor`` count.
    Slabs are accumulated over the first two axes and Kadane's scan runs along the third.  No box weighs more than the
    positive weights that it holds, so planes, slabs and lines whose positive weights cannot beat the best are skipped.

    Returns
    -------
    sum, box
        ``floor`` and zeros when no box beats the floor; else the sum and (lo0, hi0, lo1, hi1, lo2, hi2), half-open.
    """
    size0, size1, size2 = weights.shape
    best = floor
    box = np.zeros(6, np.int64)
    planes = np.zeros(size0 + 1, np.float32)
    for i in range(size0 - 1, -1, -1):
        planes[i] = planes[i + 1] + positive_sum(weights[i].reshape(size1 * size2))
    slab = np.zeros((size1, size2), np.float32)
    line = np.zeros(size2, np.float32)
    positive = np.zeros(size1 + 1, np.float32)
    for lo0 in range(size0):
        if planes[lo0] <= best - SLACK:
            break
        slab[:] = 0
        for hi0 in range(lo0, min(size0, lo0 + limit0)):
            for j in range(size1):
                for k in range(size2):
                    slab[j, k] += weights[hi0, j, k]
            if planes[lo0] - planes[hi0 + 1] <= best - SLACK:
                continue
            for j in range(size1 - 1, -1, -1):
                positive[j] = positive[j + 1] + positive_sum(slab[j])
            for lo1 in range(size1):
                if positive[lo1] <= best - SLACK:
                    break
                line[:] = 0
                for hi1 in range(lo1, min(size1, lo1 + limit1)):
                    if positive[hi1] == positive[hi1 + 1]:  # nothing positive here: no box ends here
                        for k in range(size2):
                            line[k] += slab[hi1, k]
                        continue
                    for k in range(size2):
                        line[k] += slab[hi1, k]
                    if positive[lo1] - positive[hi1 + 1] <= best - SLACK or positive_sum(line) <= best - SLACK:
                        continue
                    current = np.float32(0)
                    start = 0
                    for k in range(size2):
                        if current <= 0:
                            current = np.float32(0)
                            start = k
                        current += line[k]
                        if current > best:
                            best = current
                            box[0], box[1], box[2] = lo0, hi0 + 1, lo1
                            box[3], box[4], box[5] = hi1 + 1, start, k + 1
    return best, box
