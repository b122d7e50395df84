"""Kernels that guess what is no upright box: discs, sheared backs, oblique bars, stars and crosses."""

from __future__ import annotations

import numpy as np
from numba import njit

from shapeprog.inference.block_layout import (
    BACK,
    BOX,
    COUNT1,
    COUNT2,
    CROSS,
    DISC,
    EXTENT,
    FIRST,
    FORM,
    LINE,
    RADIUS,
    ROTATE,
    SHIFT1,
    TILT,
    WIDTH,
)
from shapeprog.inference.descent_kernels import gains, statements
from shapeprog.inference.raster_kernels import ROWS


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
    block[FORM] = form
    block[COUNT1] = 1
    block[COUNT2] = 1
    return block


@njit(cache=True, nogil=True)
def guess(form, cells, box):  # type: ignore[no-untyped-def]
    """A rough block of a form, from two random uncovered cells or from a proposed box."""
    block = plain(form)
    a = cells[np.random.randint(len(cells))]
    b = cells[np.random.randint(len(cells))]
    if form == LINE:
        guess_line(block, a, b, box)
    elif form == BACK:
        guess_back(block, a, b, box)
    elif form == DISC:
        guess_disc(block, a, b, box)
    else:
        guess_star(block, a, cells)
    return block


@njit(cache=True, nogil=True)
def guess_line(block, a, b, box):  # type: ignore[no-untyped-def]
    """A bar along the middle of a box and repeated like it, or from one cell to the other."""
    if np.random.random() < 0.4 and box[FORM] == BOX and box[EXTENT] > 0:
        long = 0
        for axis in range(3):
            middle = int(box[FIRST + axis] + (box[EXTENT + axis] - 1) / 2)
            block[FIRST + axis], block[EXTENT + axis] = middle, middle
            if box[EXTENT + axis] > box[EXTENT + long]:
                long = axis
        block[FIRST + long] = box[FIRST + long]
        block[EXTENT + long] = box[FIRST + long] + box[EXTENT + long] - 1
        copy_loops(block, box)
    else:
        for axis in range(3):
            block[FIRST + axis], block[EXTENT + axis] = a[axis], b[axis]
    block[TILT] = 1 + (np.random.random() < 0.2)


@njit(cache=True, nogil=True)
def guess_back(block, a, b, box):  # type: ignore[no-untyped-def]
    """A board that leans from the lower to the higher of two cells, or a box with a random tilt in or beyond it."""
    if box[EXTENT] <= 0 or np.random.random() < 0.5:
        low, high = (a, b) if a[0] <= b[0] else (b, a)
        block[FIRST], block[EXTENT] = low[0], high[0] - low[0] + 1
        block[FIRST + 1] = low[1] - np.random.randint(0, 2)
        block[EXTENT + 1] = np.random.randint(1, 4)
        block[FIRST + 2], block[EXTENT + 2] = min(a[2], b[2]), abs(a[2] - b[2]) + 1
        block[TILT] = high[1] - low[1] + np.random.randint(-1, 2)
        return
    copy_loops(block, box)
    for axis in range(3):
        block[FIRST + axis], block[EXTENT + axis] = box[FIRST + axis], box[EXTENT + axis]
    tilt = np.random.randint(1, 6) * (1 if np.random.random() < 0.7 else -1)
    block[TILT] = tilt
    if np.random.random() < 0.5 and block[EXTENT + 1] > abs(tilt):
        block[EXTENT + 1] -= abs(tilt)
        if tilt < 0:
            block[FIRST + 1] -= tilt


@njit(cache=True, nogil=True)
def guess_disc(block, a, b, box):  # type: ignore[no-untyped-def]
    """An upright cylinder inside a box or between two cells."""
    copy_loops(block, box)
    if box[EXTENT] > 0 and np.random.random() < 0.6:
        block[FIRST], block[EXTENT] = box[FIRST], box[EXTENT]
        block[RADIUS] = max(1, int(np.rint((box[EXTENT + 1] + box[EXTENT + 2]) / 4)))
        for axis in (1, 2):
            block[FIRST + axis] = np.rint(box[FIRST + axis] + box[EXTENT + axis] / 2)
    else:
        block[FIRST], block[EXTENT] = min(a[0], b[0]), abs(a[0] - b[0]) + 1
        for axis in (1, 2):
            block[FIRST + axis] = np.rint((a[axis] + b[axis] + 1) / 2)
        block[RADIUS] = max(1, int(max(abs(a[1] - b[1]), abs(a[2] - b[2])) / 2) + np.random.randint(0, 2))


@njit(cache=True, nogil=True)
def guess_star(block, a, cells):  # type: ignore[no-untyped-def]
    """A cross, or a star of bars where the form says a bar, around the middle of the grid or of the cells."""
    centre1, centre2 = 0.0, 0.0
    for i in range(len(cells)):
        centre1 += cells[i, 1]
        centre2 += cells[i, 2]
    centre1, centre2 = centre1 / len(cells) + 0.5, centre2 / len(cells) + 0.5
    if np.random.random() < 0.5:
        centre1, centre2 = 0.0, 0.0
    block[FIRST] = a[0]
    if block[FORM] == CROSS:
        block[FIRST + 1], block[FIRST + 2] = np.rint(centre1), np.rint(centre2)
        block[EXTENT] = np.random.randint(1, 4)
        block[RADIUS] = max(2.0, np.rint(np.sqrt((a[1] - centre1) ** 2 + (a[2] - centre2) ** 2)))
        block[RADIUS + 1] = np.random.randint(0, 4)
        block[ROTATE] = 4
    else:
        block[FORM] = LINE
        block[FIRST + 1], block[FIRST + 2] = np.floor(centre1), np.floor(centre2)
        for axis in range(3):
            block[EXTENT + axis] = a[axis]
        block[FIRST] = a[0] + np.random.randint(0, 4)
        block[TILT] = 1
        block[ROTATE] = np.random.randint(3, 7)


@njit(cache=True, nogil=True)
def copy_loops(block, box):  # type: ignore[no-untyped-def]
    """Give a block the translation loops of another."""
    for slot in range(COUNT1, ROTATE):
        block[slot] = box[slot]


@njit(cache=True, nogil=True)
def repeat(block, gained, wasted, waste, price):  # type: ignore[no-untyped-def]
    """The block in its best translation loop of two to four copies along one axis, if that gains."""
    rows = np.zeros(ROWS, np.uint32)
    good, bad = gains(rows, block, gained, wasted)
    best = good - waste * bad - price * statements(block)
    chosen = block.copy()
    if block[COUNT1] > 1 or block[ROTATE] > 0:
        return chosen
    trial = block.copy()
    for axis in range(3):
        for other in range(3):
            trial[SHIFT1 + other] = 0
        for step in range(-23, 24):
            if step == 0:
                continue
            for count in range(2, 5):
                if (count - 1) * abs(step) > 24:
                    break
                trial[COUNT1] = count
                trial[SHIFT1 + axis] = step
                good, bad = gains(rows, trial, gained, wasted)
                value = good - waste * bad - price * statements(trial)
                if value > best:
                    best = value
                    for i in range(len(trial)):
                        chosen[i] = trial[i]
    return chosen
