"""Kernels that propose a block: the repeated box with the largest gain on uncovered cells, exactly.

A loop along an axis that repeats a box n times at distance d covers the same weight as one box in the sum of n
shifted volumes; a mirrored pair covers that of one box in the volume folded at the mirror plane.  So the weights are
folded along the axes of the loops, then one box is searched.

Volumes are indexed flat and by unsigned numbers where that is fast: the compiled loops then need no test for negative
indices.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shapeprog.inference.cells.block_kernels import COUNT1, COUNT2, EXTENT, FIRST
from shapeprog.kernels.compile import helper, kernel
from shapeprog.space import IntArray

MIRROR, PERIOD = 1, 2

SLACK = 0.01  # margin below the best at which a bound prunes: more than the rounding error of a sum in single precision
SIDE = 32
"""Largest number of cells along a side of a volume; a limit of so many cells for the side of a box is no limit."""


def families(size: Sequence[int], max_copies: int) -> IntArray:
    """Rows (axis1, kind1, a1, b1, axis2, kind2, a2, b2) of ways to repeat a box in a volume of this size.

    Kind ``MIRROR`` pairs a box with its image in plane a (see ``mirrors``), ``PERIOD`` repeats it a times at distance
    b, at most ``max_copies`` times; an axis of -1 means no repetition.  The first row is the single box.  A second loop
    is a mirrored pair about the middle.
    """
    single: list[tuple[int, int, int, int]] = []
    for axis, length in enumerate(size):
        for plane in range(max(2, length // 2), min(2 * length - 1, 3 * length // 2 + 1)):
            single.append((axis, MIRROR, plane, 0))
        for count in range(3, max_copies + 1):
            for step in range(2, (length - 1) // (count - 1) + 1):
                single.append((axis, PERIOD, count, step))
    none = (-1, 0, 0, 0)
    rows = [none + none, *(first + none for first in single)]
    for axis, length in enumerate(size):
        for first in single:
            same = first[1] == MIRROR and first[0] > axis and first[2] == size[first[0]]  # found the other way
            if length > 1 and first[0] != axis and not same:
                rows.append((*first, axis, MIRROR, length, 0))
    return np.array(rows, np.int64)


@helper
def mirrors(plane):
    """The cells left and right of a mirror plane: between two cells for an even number, through a cell for an odd one.

    The plane is at ``plane`` / 2 cells, a cell farther when odd; the cell that it runs through belongs to no side.
    """
    left = (plane - 1) // 2
    return left, left + 1 + plane % 2


@helper
def fold(volume, axis, kind, a, b):
    """The volume folded along an axis: mirrored at plane a, or a copies at distance b summed; empty if none fits."""
    size0, size1, size2 = volume.shape
    outer, size, inner = (1, size0, size0 * size1)[axis], volume.shape[axis], (size1 * size2, size2, 1)[axis]
    left, right = mirrors(a)
    mirrored = kind == MIRROR
    length = max(0, min(left + 1, size - right) if mirrored else size - (a - 1) * b)
    folded = np.zeros(
        (length if axis == 0 else size0, length if axis == 1 else size1, length if axis == 2 else size2), np.float32
    )
    cells, out = volume.reshape(-1), folded.reshape(-1)
    for copy in range(2 if mirrored else a):
        first = (right if copy else left) if mirrored else copy * b
        step = -1 if mirrored and copy == 0 else 1
        for o in range(outer):
            if inner == 1:  # the compiler makes fast code of each of these two loops
                to, source = np.uint64(o * length), np.uint64(o * size + first)
                if step > 0:
                    for i in range(length):
                        out[to + np.uint64(i)] += cells[source + np.uint64(i)]
                else:
                    for i in range(length):
                        out[to + np.uint64(i)] += cells[source - np.uint64(i)]
            else:
                for i in range(length):
                    to, source = np.uint64((o * length + i) * inner), np.uint64((o * size + first + i * step) * inner)
                    for k in range(inner):
                        out[to + np.uint64(k)] += cells[source + np.uint64(k)]
    return folded


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
def heaviest_box(volume, limit0, limit1, floor, box):
    """Largest sum over all boxes of a weight volume; the box (lo0, hi0, lo1, hi1, lo2, hi2), half-open, is written.

    Sides along the first two axes are at most ``limit0`` and ``limit1`` cells.  Only sums above ``floor`` count; the
    floor comes back, and no box is written, when none beats it.  Slabs are accumulated over the first two axes and
    Kadane's scan runs along the third.  No box weighs more than the positive weights that it holds, so planes and
    lines whose positive weights cannot beat the best are skipped.
    """
    best, weights = floor, volume.reshape(-1)
    size0, size1, size2 = volume.shape
    plane = size1 * size2
    planes, positive = np.zeros(size0 + 1, np.float32), np.zeros(size1 + 1, np.float32)
    slab, line = np.empty(plane, np.float32), np.empty(size2, np.float32)
    for i in range(size0 - 1, -1, -1):
        planes[i] = planes[i + 1] + positive_sum(weights, i * plane, plane)
    for lo0 in range(size0):
        if planes[lo0] <= best - SLACK:
            break
        slab[:] = 0
        for hi0 in range(lo0, min(size0, lo0 + limit0)):
            slab += weights[hi0 * plane : (hi0 + 1) * plane]
            for j in range(size1 - 1, -1, -1):
                positive[j] = positive[j + 1] + positive_sum(slab, j * size2, size2)
            for lo1 in range(size1):
                if positive[lo1] <= best - SLACK:
                    break
                line[:] = 0
                for hi1 in range(lo1, min(size1, lo1 + limit1)):
                    line += slab[hi1 * size2 : (hi1 + 1) * size2]
                    # Where nothing is positive, no box ends.
                    if positive[hi1] == positive[hi1 + 1] or positive[lo1] - positive[hi1 + 1] <= best - SLACK:
                        continue
                    current, start = np.float32(0), 0
                    for k in range(size2):
                        if current <= 0:
                            current, start = np.float32(0), k
                        current += line[k]
                        if current > best:
                            best = current
                            box[0], box[1], box[2] = lo0, hi0 + 1, lo1
                            box[3], box[4], box[5] = hi1 + 1, start, k + 1
    return best


@helper
def search_family(weights, family, floor, block):
    """Write the best repeated box of a row of ``families`` in a volume; its sum, or the floor if none beats it."""
    volume, limits, box = weights, np.array([SIDE, SIDE, SIDE]), np.zeros(6, np.int64)
    for part in range(0, 8, 4):
        axis, kind, a, b = family[part], family[part + 1], family[part + 2], family[part + 3]
        if axis >= 0:
            volume = fold(volume, axis, kind, a, b)
            if kind == PERIOD:
                limits[axis] = b - 1
    if volume.size == 0:
        return floor
    # The scan along the last axis is the fast one, so the longest goes there; it takes no limit of its length.
    free, last = np.where(limits == SIDE, np.array(volume.shape), 0), 2
    for axis in range(2):
        if free[axis] > free[last]:
            last = axis
    first = 0 if last != 0 else 1
    order = (first, 3 - first - last, last)
    volume = np.ascontiguousarray(volume.transpose(order))
    best = heaviest_box(volume, limits[order[0]], limits[order[1]], floor, box)
    if best <= floor:
        return floor
    block[:] = 0
    for k in range(3):
        block[FIRST + order[k]] = box[2 * k]
        block[EXTENT + order[k]] = box[2 * k + 1] - box[2 * k]
    for part, level in ((0, COUNT1), (4, COUNT2)):
        axis, kind, a, b = family[part], family[part + 1], family[part + 2], family[part + 3]
        block[level] = 1
        if kind == PERIOD:
            block[level], block[level + 1 + axis] = a, b
        elif kind == MIRROR:
            left, right = mirrors(a)
            low = block[FIRST + axis]
            block[FIRST + axis] = left + 1 - low - block[EXTENT + axis]
            block[level], block[level + 1 + axis] = 2, right + low - block[FIRST + axis]
    return best


@kernel("f8(f4[:, :, ::1], i8[:, ::1], f8, f8[::1])")
def propose(weights, table, price, block):
    """Write the repeated box with the largest gain of weight as a block (16); its gain, zero when no box gains.

    The box and its copies are in a volume of weights (A, B, C), in whose frame it is.  The table has the rows of
    ``families`` to try, and every statement has to gain its price.
    """
    best = 0.0
    for family in table:
        cost = price * (1 + (family[0] >= 0) + (family[4] >= 0))
        value = search_family(weights, family, best + cost, block)
        if value > best + cost:
            best = value - cost
    return best
