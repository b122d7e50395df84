"""Kernels that find the best repeated box: fold the weights along the axes of a loop, then search one box.

A loop along an axis that repeats a box n times at distance d covers the same weight as one box in the sum of n
shifted volumes; a mirrored pair covers that of one box in the volume folded at the mirror plane.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from shapeprog.inference.box_kernels import heaviest_box
from shapeprog.inference.families import MIRROR, PERIOD

ANY = 1 << 20
"""More cells than any side has: no limit."""


@njit(cache=True, nogil=True)
def mirrors(plane):  # type: ignore[no-untyped-def]
    """The cells left and right of a mirror plane: between two cells for an even number, through a cell for an odd one.

    The plane is at ``plane`` / 2 cells, a cell farther when odd; the cell that it runs through belongs to no side.
    """
    left = (plane - 1) // 2 if plane % 2 else plane // 2 - 1
    return left, left + 2 if plane % 2 else left + 1


@njit(cache=True, nogil=True)
def fold(volume, axis, kind, a, b):  # type: ignore[no-untyped-def]
    """Fold an axis: mirrored at plane a, or summed over a copies at distance b."""
    size0, size1, size2 = volume.shape
    size = volume.shape[axis]
    left, right = mirrors(a)
    length = max(0, min(left + 1, size - right) if kind == MIRROR else size - (a - 1) * b)
    new0, new1, new2 = length if axis == 0 else size0, length if axis == 1 else size1, length if axis == 2 else size2
    out = np.zeros((new0, new1, new2), np.float32)
    if axis == 2:
        fold_rows(volume.reshape((size0 * size1, size2)), out.reshape((size0 * size1, length)), kind, left, right, a, b)
        return out
    outer, inner = (1, size1 * size2) if axis == 0 else (size0, size2)
    source, folded = volume.reshape((outer, size, inner)), out.reshape((outer, length, inner))
    for o in range(outer):
        for i in range(length):
            if kind == MIRROR:
                near, far = np.uint64(left - i), np.uint64(right + i)  # unsigned: no test for indices from the end
                for k in range(inner):
                    folded[o, i, k] = source[o, near, k] + source[o, far, k]
            else:
                for copy in range(a):
                    near = np.uint64(i + copy * b)
                    for k in range(inner):
                        folded[o, i, k] += source[o, near, k]
    return out


@njit(cache=True, nogil=True)
def fold_rows(rows, out, kind, left, right, a, b):  # type: ignore[no-untyped-def]
    """Fold the rows of a matrix, as ``fold`` does its last axis."""
    length = out.shape[1]
    for r in range(len(rows)):
        if kind == MIRROR:
            near, far = np.uint64(left), np.uint64(right)
            for i in range(length):
                step = np.uint64(i)
                out[r, i] = rows[r, near - step] + rows[r, far + step]
        else:
            for copy in range(a):
                near = np.uint64(copy * b)
                for i in range(length):
                    out[r, i] += rows[r, near + np.uint64(i)]


@njit(cache=True, nogil=True)
def turn(volume, order):  # type: ignore[no-untyped-def]
    """The volume with its axes in another order."""
    if order[2] == 2:
        return volume
    steps = np.array([volume.shape[1] * volume.shape[2], volume.shape[2], 1])
    step0, step1, step2 = steps[order[0]], steps[order[1]], np.uint64(steps[order[2]])
    size0, size1, size2 = volume.shape[order[0]], volume.shape[order[1]], volume.shape[order[2]]
    cells = volume.reshape(volume.size)
    out = np.empty((size0, size1, size2), np.float32)
    for i in range(size0):
        for j in range(size1):
            at = np.uint64(i * step0 + j * step1)  # unsigned: no test for indices from the end
            for k in range(size2):
                out[i, j, k] = cells[at]
                at += step2
    return out


@njit(cache=True, nogil=True)
def unfold(kind, a, b, low, high):  # type: ignore[no-untyped-def]
    """First low end, count and distance of the copies of a folded side [low, high)."""
    if kind == MIRROR:
        left, right = mirrors(a)
        first = left - high + 1
        return first, 2, right + low - first
    return low, a, b


@njit(cache=True, nogil=True)
def search_family(weights, family, floor):  # type: ignore[no-untyped-def]
    """Best repeated box of one family: its sum, and (start, extent, count1, axis1, step1, count2, axis2, step2)."""
    found = np.zeros(12, np.int64)
    folded = weights
    limits = np.full(3, ANY)
    for part in (0, 4):
        axis, kind, a, b = family[part], family[part + 1], family[part + 2], family[part + 3]
        if axis >= 0:
            folded = fold(folded, axis, kind, a, b)
            if kind == PERIOD:
                limits[axis] = b - 1
    if folded.size == 0:
        return floor, found
    # The scan along the last axis is the fast one, so the longest goes there; it takes no limit of its length.
    last = 2
    for axis in range(3):
        free, taken = limits[axis] == ANY, limits[last] == ANY
        if (free and not taken) or (free == taken and folded.shape[axis] > folded.shape[last]):
            last = axis
    first = 0 if last != 0 else 1
    order = np.array([first, 3 - last - first, last])
    best, box = heaviest_box(turn(folded, order), limits[order[0]], limits[order[1]], floor)
    if best <= floor:
        return floor, found
    for place in range(3):
        found[order[place]] = box[2 * place]
        found[3 + order[place]] = box[2 * place + 1] - box[2 * place]
    found[6], found[9] = 1, 1
    found[7], found[10] = family[0], family[4]
    for part in range(2):
        axis = family[4 * part]
        if axis >= 0:
            kind, a, b = family[4 * part + 1], family[4 * part + 2], family[4 * part + 3]
            low = found[axis]
            found[axis], found[6 + 3 * part], found[8 + 3 * part] = unfold(kind, a, b, low, low + found[3 + axis])
    return best, found
