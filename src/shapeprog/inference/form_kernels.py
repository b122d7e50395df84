"""Kernels that propose what is no upright box: discs, sheared backs, oblique bars, stars and crosses."""

from __future__ import annotations

import numpy as np
from numba import njit

from shapeprog.inference.raster_kernels import (
    BACK,
    CROSS,
    DISC,
    LINE,
    ROWS,
    WIDTH,
    gains,
    improve_block,
    statements,
    valid,
)


@njit(cache=True, nogil=True)
def cells_of(rows):  # type: ignore[no-untyped-def]
    """Grid coordinates (n, 3) of the low corners of the set cells."""
    out = np.zeros((32768, 3), np.int64)
    n = 0
    for i in range(ROWS):
        if rows[i] != 0:
            for k in range(32):
                if rows[i] & (np.uint32(1) << np.uint32(k)):
                    out[n, 0], out[n, 1], out[n, 2] = i // 32 - 16, i % 32 - 16, k - 16
                    n += 1
    return out[:n]


@njit(cache=True, nogil=True)
def plain(form):  # type: ignore[no-untyped-def]
    """A block of a form without loops."""
    block = np.zeros(WIDTH)
    block[0] = form
    block[8] = 1
    block[12] = 1
    return block


@njit(cache=True, nogil=True)
def guess(form, cells, box):  # type: ignore[no-untyped-def]
    """A rough block of a form, from two random uncovered cells or from a proposed box."""
    block = plain(form)
    a = cells[np.random.randint(len(cells))]
    b = cells[np.random.randint(len(cells))]
    if form == LINE:
        if np.random.random() < 0.4 and box[0] == 0 and box[4] > 0:
            long = np.argmax(box[4:7])
            for axis in range(3):
                middle = int(box[1 + axis] + (box[4 + axis] - 1) / 2)
                block[1 + axis], block[4 + axis] = middle, middle
            block[1 + long], block[4 + long] = box[1 + long], box[1 + long] + box[4 + long] - 1
            block[8:16] = box[8:16]
        else:
            for axis in range(3):
                block[1 + axis], block[4 + axis] = a[axis], b[axis]
        block[7] = 1 + (np.random.random() < 0.2)
    elif form == BACK:
        block[1:7] = box[1:7]
        block[8:16] = box[8:16]
        if box[4] <= 0:
            for axis in range(3):
                block[1 + axis] = min(a[axis], b[axis])
                block[4 + axis] = abs(a[axis] - b[axis]) + 1
        tilt = np.random.randint(1, 6) * (1 if np.random.random() < 0.7 else -1)
        block[7] = tilt
        if np.random.random() < 0.5 and block[5] > abs(tilt):
            block[5] -= abs(tilt)
            if tilt < 0:
                block[2] -= tilt
    elif form == DISC:
        block[8:16] = box[8:16]
        if box[4] > 0 and np.random.random() < 0.6:
            radius = max(1, int(np.rint((box[5] + box[6]) / 4)))
            block[1], block[4], block[5] = box[1], box[4], radius
            block[2], block[3] = np.rint(box[2] + box[5] / 2), np.rint(box[3] + box[6] / 2)
        else:
            block[1], block[4] = min(a[0], b[0]), abs(a[0] - b[0]) + 1
            block[2], block[3] = np.rint((a[1] + b[1] + 1) / 2), np.rint((a[2] + b[2] + 1) / 2)
            block[5] = max(1, int(max(abs(a[1] - b[1]), abs(a[2] - b[2])) / 2) + np.random.randint(0, 2))
    else:
        centre1, centre2 = cells[:, 1].mean() + 0.5, cells[:, 2].mean() + 0.5
        if np.random.random() < 0.5:
            centre1, centre2 = 0.0, 0.0
        block[1] = a[0]
        if form == CROSS:
            block[2], block[3] = np.rint(centre1), np.rint(centre2)
            block[4] = np.random.randint(1, 4)
            block[5] = max(2.0, np.rint(np.sqrt((a[1] - centre1) ** 2 + (a[2] - centre2) ** 2)))
            block[6] = np.random.randint(0, 4)
            block[16] = 4
        else:
            block[0] = LINE
            block[2], block[3] = np.floor(centre1), np.floor(centre2)
            block[4], block[5], block[6] = a[0], a[1], a[2]
            block[1] = a[0] + np.random.randint(0, 4)
            block[7] = 1
            block[16] = np.random.randint(3, 7)
    return block


@njit(cache=True, nogil=True)
def repeat(block, gained, wasted, waste, price):  # type: ignore[no-untyped-def]
    """The block in its best translation loop of two to four copies along one axis, if that gains."""
    rows = np.zeros(ROWS, np.uint32)
    good, bad = gains(rows, block, gained, wasted)
    best = good - waste * bad - price * statements(block)
    chosen = block.copy()
    if block[8] > 1 or block[16] > 0:
        return chosen
    trial = block.copy()
    for axis in range(3):
        for step in range(-23, 24):
            if step == 0:
                continue
            for count in range(2, 5):
                if (count - 1) * abs(step) > 24:
                    break
                trial[8] = count
                trial[9:12] = 0
                trial[9 + axis] = step
                good, bad = gains(rows, trial, gained, wasted)
                value = good - waste * bad - price * statements(trial)
                if value > best:
                    best = value
                    chosen[:] = trial
    return chosen


@njit(cache=True, nogil=True)
def propose_form(form, occupied, covered, waste, box, price, share, tries):  # type: ignore[no-untyped-def]
    """The best of several guesses of one form, improved by descent; gain and block.

    ``price`` is in cells for the gain and ``share`` is the same in IoU for the descent.
    """
    gained = occupied & ~covered
    wasted = ~occupied & ~covered
    cells = cells_of(gained)
    best = 0.0
    chosen = plain(form)
    if len(cells) < 4:
        return best, chosen
    rows = np.zeros(ROWS, np.uint32)
    first = -1e9
    rough = plain(form)
    for _ in range(tries):
        block = guess(form, cells, box)
        if not valid(block):
            continue
        good, bad = gains(rows, block, gained, wasted)
        if good - waste * bad > first:
            first = good - waste * bad
            rough[:] = block
    if first < -1e8:
        return best, chosen
    block, _value = improve_block(rough, occupied, covered, share, 2)
    looped = repeat(block, gained, wasted, waste, price)
    if looped[8] > block[8]:
        block, _value = improve_block(looped, occupied, covered, share, 1)
    good, bad = gains(rows, block, gained, wasted)
    return good - waste * bad - price * statements(block), block
