"""Kernels that find the box of cells with the largest sum of weights, exactly.

A volume (A, B, C) is a flat array with its three sizes, so that any scratch can hold one.  Indices of cells are
unsigned, so the compiled loops need no test for negative indices.
"""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import helper

SLACK = 0.01
"""Margin below the best at which a bound prunes: more than the rounding error of a sum in single precision."""

SIDE = 32
"""Largest number of cells along a side of a volume."""


@helper(fastmath={"reassoc", "nsz", "nnan"})
def positive_sum(values, start, count):
    """Sum of the positive values of a stretch, in any order: a bound on the sum of any part of it."""
    total = np.float32(0)
    first = np.uint64(start)
    for k in range(count):
        value = values[first + np.uint64(k)]
        total += value if value > 0 else np.float32(0)
    return total


@helper
def add(total, values, start, count):
    """Add a stretch of values to the first values of another array."""
    first = np.uint64(start)
    for k in range(count):
        total[k] += values[first + np.uint64(k)]


@helper
def heaviest_box(weights, size0, size1, size2, limit0, limit1, floor, box):
    """Largest sum over all boxes of a weight volume; the box (lo0, hi0, lo1, hi1, lo2, hi2), half-open, is written.

    Sides along the first two axes are at most ``limit0`` and ``limit1`` cells.  Only sums above ``floor`` count; the
    floor comes back, and no box is written, when none beats it.  Slabs are accumulated over the first two axes and
    Kadane's scan runs along the third.  No box weighs more than the positive weights that it holds, so planes, slabs
    and lines whose positive weights cannot beat the best are skipped.
    """
    best = floor
    plane = size1 * size2
    planes, positive = np.empty(SIDE + 1, np.float32), np.empty(SIDE + 1, np.float32)
    slab, line = np.empty(SIDE * SIDE, np.float32), np.empty(SIDE, np.float32)
    planes[size0] = positive[size1] = 0
    for i in range(size0 - 1, -1, -1):
        planes[i] = planes[i + 1] + positive_sum(weights, i * plane, plane)
    for lo0 in range(size0):
        if planes[lo0] <= best - SLACK:
            break
        for k in range(plane):
            slab[k] = 0
        for hi0 in range(lo0, min(size0, lo0 + limit0)):
            add(slab, weights, hi0 * plane, plane)
            if planes[lo0] - planes[hi0 + 1] <= best - SLACK:
                continue
            for j in range(size1 - 1, -1, -1):
                positive[j] = positive[j + 1] + positive_sum(slab, j * size2, size2)
            for lo1 in range(size1):
                if positive[lo1] <= best - SLACK:
                    break
                for k in range(size2):
                    line[k] = 0
                for hi1 in range(lo1, min(size1, lo1 + limit1)):
                    add(line, slab, hi1 * size2, size2)
                    if positive[hi1] == positive[hi1 + 1]:  # nothing positive here: no box ends here
                        continue
                    if positive[lo1] - positive[hi1 + 1] <= best - SLACK:
                        continue
                    if positive_sum(line, 0, size2) <= best - SLACK:
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
    return best
