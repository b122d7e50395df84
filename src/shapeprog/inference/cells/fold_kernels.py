"""Helpers that find the best repeated box: fold the weights along the axes of a loop, then search one box.

A loop along an axis that repeats a box n times at distance d covers the same weight as one box in the sum of n
shifted volumes; a mirrored pair covers that of one box in the volume folded at the mirror plane.
"""

from __future__ import annotations

import numpy as np

from shapeprog.inference.cells.box_kernels import heaviest_box
from shapeprog.inference.cells.families import MIRROR, PERIOD
from shapeprog.kernels.compile import helper

ANY = 1 << 20
"""A limit above the length of any side: no limit."""

VOLUMES = 4
"""Volumes of a search: the weights, folded once and twice, and with the axes in another order."""


@helper
def mirrors(plane):
    """The cells left and right of a mirror plane: between two cells for an even number, through a cell for an odd one.

    The plane is at ``plane`` / 2 cells, a cell farther when odd; the cell that it runs through belongs to no side.
    """
    left = (plane - 1) // 2 if plane % 2 else plane // 2 - 1
    return left, left + 2 if plane % 2 else left + 1


@helper
def fold(volume, out, outer, size, inner, kind, a, b):
    """Fold the middle axis of a volume (outer, size, inner): mirrored at plane a, or a copies at distance b summed.

    Returns its cells along that axis, none where the copies do not fit.
    """
    left, right = mirrors(a)
    mirrored = kind == MIRROR
    length = max(0, min(left + 1, size - right) if mirrored else size - (a - 1) * b)
    for cell in range(outer * length * inner):
        out[np.uint64(cell)] = 0
    for copy in range(2 if mirrored else a):
        first = (right if copy else left) if mirrored else copy * b
        step = -1 if mirrored and copy == 0 else 1
        for o in range(outer):
            if inner == 1:  # the compiler makes fast code of each of these two loops
                to, source = np.uint64(o * length), np.uint64(o * size + first)
                if step > 0:
                    for i in range(length):
                        out[to + np.uint64(i)] += volume[source + np.uint64(i)]
                else:
                    for i in range(length):
                        out[to + np.uint64(i)] += volume[source - np.uint64(i)]
            else:
                for i in range(length):
                    to, source = np.uint64((o * length + i) * inner), np.uint64((o * size + first + i * step) * inner)
                    for k in range(inner):
                        out[to + np.uint64(k)] += volume[source + np.uint64(k)]
    return length


@helper
def turn(volume, out, sizes, order):
    """Write a volume with its axes in another order."""
    at = np.uint64(0)
    steps = np.array([sizes[1] * sizes[2], sizes[2], 1])
    step0, step1, step2 = steps[order[0]], steps[order[1]], np.uint64(steps[order[2]])
    for i in range(sizes[order[0]]):
        for j in range(sizes[order[1]]):
            cell = np.uint64(i * step0 + j * step1)
            for _ in range(sizes[order[2]]):
                out[at] = volume[cell]
                cell += step2
                at += np.uint64(1)


@helper
def unfold(kind, a, b, low, high):
    """First low end, count and distance of the copies of a folded side [low, high)."""
    if kind == MIRROR:
        left, right = mirrors(a)
        first = left - high + 1
        return first, 2, right + low - first
    return low, a, b


@helper
def search_family(volumes, size0, size1, size2, family, floor, result):
    """Best repeated box of one family: its sum, or the floor when none beats it.

    Parameters
    ----------
    volumes
        The weights (size0, size1, size2) in the first of ``VOLUMES`` flat volumes; the others are scratch.
    family
        A row of ``families``.
    result
        Output: the box (start, extent, count1, axis1, step1, count2, axis2, step2), twelve numbers.
    """
    sizes, limits, order = np.array([size0, size1, size2]), np.array([ANY, ANY, ANY]), np.array([0, 1, 2])
    box = np.zeros(6, np.int64)
    held = 0
    for part in range(0, 8, 4):
        axis, kind, a, b = family[part], family[part + 1], family[part + 2], family[part + 3]
        if axis < 0:
            continue
        volume, out = volumes[held], volumes[held + 1]
        outer = (1, sizes[0], sizes[0] * sizes[1])[axis]
        inner = (sizes[1] * sizes[2], sizes[2], 1)[axis]
        sizes[axis] = fold(volume, out, outer, sizes[axis], inner, kind, a, b)
        held += 1
        if kind == PERIOD:
            limits[axis] = b - 1
    if sizes[0] * sizes[1] * sizes[2] == 0:
        return floor
    # The scan along the last axis is the fast one, so the longest goes there; it takes no limit of its length.
    last = 2
    for axis in range(3):
        free, last_free = limits[axis] == ANY, limits[last] == ANY
        if (free and not last_free) or (free == last_free and sizes[axis] > sizes[last]):
            last = axis
    if last != 2:
        order[0] = 0 if last != 0 else 1
        order[1], order[2] = 3 - last - order[0], last
        turn(volumes[held], volumes[held + 1], sizes, order)
        held += 1
    first, second = order[0], order[1]
    best = heaviest_box(
        volumes[held], sizes[first], sizes[second], sizes[last], limits[first], limits[second], floor, box
    )
    if best <= floor:
        return floor
    for k in range(3):
        result[order[k]] = box[2 * k]
        result[3 + order[k]] = box[2 * k + 1] - box[2 * k]
    result[6], result[9] = 1, 1
    result[7], result[10] = family[0], family[4]
    for part in range(2):
        axis = family[4 * part]
        if axis >= 0:
            kind, a, b = family[4 * part + 1], family[4 * part + 2], family[4 * part + 3]
            low = result[axis]
            result[axis], result[6 + 3 * part], result[8 + 3 * part] = unfold(kind, a, b, low, low + result[3 + axis])
    return best
