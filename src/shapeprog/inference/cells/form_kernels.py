"""Kernels that guess forms other than upright boxes: discs and sheared backs."""

from __future__ import annotations

import numpy as np

from shapeprog.inference.cells.block_layout import (
    BACK,
    COUNT1,
    COUNT2,
    EXTENT,
    FIRST,
    FORM,
    RADIUS,
    TILT,
)
from shapeprog.inference.cells.descent_kernels import valid
from shapeprog.kernels.compile import helper, kernel


@kernel("i8(i8, i8[:, ::1], f8[::1], i8, f8[:, ::1])")
def guess(form, cells, box, seed, out):
    """Rough blocks of a form, each from two random cells or from a proposed box; the number of valid ones.

    Parameters
    ----------
    form
        ``BACK`` or ``DISC``.
    cells
        Low corners (n, 3) of the cells to choose from.
    box
        The proposed box.
    seed
        Seed of the random numbers.
    out
        Output for G guesses (G, 16); the valid blocks come first.
    """
    np.random.seed(seed)
    count = 0
    for _ in range(len(out)):
        block = out[count]
        for slot in range(len(block)):
            block[slot] = 0
        block[FORM], block[COUNT1], block[COUNT2] = form, 1, 1
        a = cells[np.random.randint(len(cells))]
        b = cells[np.random.randint(len(cells))]
        if form == BACK:
            guess_back(block, a, b, box)
        else:
            guess_disc(block, a, b, box)
        if valid(block):
            count += 1
    return count


@helper
def guess_back(block, a, b, box):
    """A board that leans from the lower to the higher of two cells, or a box with a random tilt in or beyond it."""
    if box[EXTENT] <= 0 or np.random.random() < 0.5:
        low, high = (a, b) if a[0] <= b[0] else (b, a)
        block[FIRST], block[EXTENT] = low[0], high[0] - low[0] + 1
        block[FIRST + 1] = low[1] - np.random.randint(2)
        block[EXTENT + 1] = 1 + np.random.randint(3)
        block[FIRST + 2], block[EXTENT + 2] = min(a[2], b[2]), abs(a[2] - b[2]) + 1
        block[TILT] = high[1] - low[1] + np.random.randint(3) - 1
        return
    copy_loops(block, box)
    for axis in range(3):
        block[FIRST + axis], block[EXTENT + axis] = box[FIRST + axis], box[EXTENT + axis]
    tilt = (1 + np.random.randint(5)) * (1 if np.random.random() < 0.7 else -1)
    block[TILT] = tilt
    if np.random.random() < 0.5 and block[EXTENT + 1] > abs(tilt):
        block[EXTENT + 1] -= abs(tilt)
        if tilt < 0:
            block[FIRST + 1] -= tilt


@helper
def guess_disc(block, a, b, box):
    """An upright cylinder inside a box or between two cells."""
    copy_loops(block, box)
    if box[EXTENT] > 0 and np.random.random() < 0.6:
        block[FIRST], block[EXTENT] = box[FIRST], box[EXTENT]
        block[RADIUS] = max(1, int(np.rint((box[EXTENT + 1] + box[EXTENT + 2]) / 4)))
        for axis in range(1, 3):
            block[FIRST + axis] = np.rint(box[FIRST + axis] + box[EXTENT + axis] / 2)
    else:
        block[FIRST], block[EXTENT] = min(a[0], b[0]), abs(a[0] - b[0]) + 1
        for axis in range(1, 3):
            block[FIRST + axis] = np.rint((a[axis] + b[axis] + 1) / 2)
        block[RADIUS] = max(1, int(max(abs(a[1] - b[1]), abs(a[2] - b[2])) / 2) + np.random.randint(2))


@helper
def copy_loops(block, box):
    """Give a block the translation loops of another."""
    for slot in range(COUNT1, len(block)):
        block[slot] = box[slot]
