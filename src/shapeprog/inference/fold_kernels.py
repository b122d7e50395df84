"""Kernels that find the best repeated box: fold the weights along the axes of a loop, then search one box.

A loop along an axis that repeats a box n times at distance d covers the same weight as one box in the sum of n
shifted volumes; a mirrored pair covers that of one box in the volume folded at the mirror plane.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from shapeprog.inference.box_kernels import heaviest_box

PLAIN, MIRROR, PERIOD = 0, 1, 2


@njit(cache=True, nogil=True)
def fold(weights, kind, a, b):  # type: ignore[no-untyped-def]
    """Fold the first axis: mirrored at boundary a / 2 cells, or summed over a copies at distance b."""
    size = weights.shape[0]
    if kind == MIRROR:
        left = (a - 1) // 2 if a % 2 else a // 2 - 1
        right = left + 2 if a % 2 else left + 1
        length = max(0, min(left + 1, size - right))
        out = np.zeros((length, weights.shape[1], weights.shape[2]), np.float32)
        for i in range(length):
            out[i] = weights[left - i] + weights[right + i]
        return out
    length = max(0, size - (a - 1) * b)
    out = np.zeros((length, weights.shape[1], weights.shape[2]), np.float32)
    for i in range(length):
        for copy in range(a):
            out[i] += weights[i + copy * b]
    return out


@njit(cache=True, nogil=True)
def unfold(kind, a, b, lo, hi):  # type: ignore[no-untyped-def]
    """First low end, count and distance of the copies of a folded side [lo, hi)."""
    if kind == MIRROR:
        left = (a - 1) // 2 if a % 2 else a // 2 - 1
        right = left + 2 if a % 2 else left + 1
        first = left - hi + 1
        return first, 2, right + lo - first
    if kind == PERIOD:
        return lo, a, b
    return lo, 1, 0


@njit(cache=True, nogil=True)
def families(size, planes, most):  # type: ignore[no-untyped-def]
    """Rows (axis1, kind1, a1, b1, axis2, kind2, a2, b2) of ways to repeat a box in a volume of this size."""
    single = np.zeros((600, 4), np.int64)
    n = 0
    for axis in range(3):
        length = size[axis]
        for plane in range(max(2, length // 2), min(2 * length - 1, 3 * length // 2 + 1)):
            single[n] = (axis, MIRROR, plane, 0)
            n += 1
        for count in range(3, most + 1):
            for step in range(2, (length - 1) // (count - 1) + 1):
                single[n] = (axis, PERIOD, count, step)
                n += 1
    out = np.zeros((1 + n + n * planes * 6, 8), np.int64)
    total = 1
    for s in range(n):
        out[total, :4] = single[s]
        out[total, 4] = -1
        total += 1
    for axis in range(3):
        length = size[axis]
        for p in range(planes):
            plane = length + (p + 1) // 2 * (1 if p % 2 else -1)
            if plane < 2 or plane > 2 * length - 2:
                continue
            for s in range(n):
                if single[s, 0] == axis:
                    continue
                if single[s, 1] == MIRROR and single[s, 0] > axis and single[s, 2] == size[single[s, 0]]:
                    continue
                out[total, :4] = single[s]
                out[total, 4:] = (axis, MIRROR, plane, 0)
                total += 1
    out[0, 0] = -1
    out[0, 4] = -1
    return out[:total]


@njit(cache=True, nogil=True)
def search_family(weights, family, floor):  # type: ignore[no-untyped-def]
    """Best repeated box of one family: its sum, and (start, extent, count1, axis1, step1, count2, axis2, step2)."""
    found = np.zeros(12, np.int64)
    folded = weights
    order = np.array([0, 1, 2])
    limits = np.array([1 << 20, 1 << 20, 1 << 20])
    for part in range(2):
        axis = family[4 * part]
        if axis < 0:
            continue
        kind, a, b = family[4 * part + 1], family[4 * part + 2], family[4 * part + 3]
        if axis == 0:
            folded = fold(folded, kind, a, b)
        elif axis == 1:
            turned = fold(np.ascontiguousarray(folded.transpose(1, 0, 2)), kind, a, b)
            folded = np.ascontiguousarray(turned.transpose(1, 0, 2))
        else:
            turned = fold(np.ascontiguousarray(folded.transpose(2, 1, 0)), kind, a, b)
            folded = np.ascontiguousarray(turned.transpose(2, 1, 0))
        if kind == PERIOD:
            limits[axis] = b - 1
    if folded.shape[0] == 0 or folded.shape[1] == 0 or folded.shape[2] == 0:
        return floor, found
    last = 2
    for axis in range(3):
        free = limits[axis] > 1000
        taken = limits[last] > 1000
        if (free and not taken) or (free == taken and folded.shape[axis] > folded.shape[last]):
            last = axis
    first = 0 if last != 0 else 1
    second = 3 - last - first
    order[0], order[1], order[2] = first, second, last
    turned = np.ascontiguousarray(folded.transpose(order[0], order[1], order[2]))
    best, box = heaviest_box(turned, limits[first], limits[second], floor)
    if best <= floor:
        return floor, found
    lo = np.zeros(3, np.int64)
    hi = np.zeros(3, np.int64)
    for place in range(3):
        lo[order[place]] = box[2 * place]
        hi[order[place]] = box[2 * place + 1]
    counts = np.ones(2, np.int64)
    steps = np.zeros(2, np.int64)
    for part in range(2):
        axis = family[4 * part]
        if axis < 0:
            continue
        length = hi[axis] - lo[axis]
        start, counts[part], steps[part] = unfold(
            family[4 * part + 1], family[4 * part + 2], family[4 * part + 3], lo[axis], hi[axis]
        )
        lo[axis] = start
        hi[axis] = start + length
    for axis in range(3):
        found[axis] = lo[axis]
        found[3 + axis] = hi[axis] - lo[axis]
    found[6], found[7], found[8] = counts[0], family[0], steps[0]
    found[9], found[10], found[11] = counts[1], family[4], steps[1]
    return best, found
