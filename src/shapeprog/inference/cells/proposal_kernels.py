"""The kernel that proposes a block: the repeated box that gains most on what no block covers yet."""

from __future__ import annotations

import numpy as np

from shapeprog.inference.cells.block_layout import COUNT1, COUNT2, EXTENT, FIRST, SHIFT1, SHIFT2
from shapeprog.inference.cells.fold_kernels import search_family
from shapeprog.kernels.compile import helper, kernel


@helper
def weigh(occupied, covered, waste, low, high, out):
    """Weights of the cells in the box [low, high): +1 for occupied, -waste for empty, 0 once covered."""
    n = 0
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            full = occupied[i * 32 + j]
            done = covered[i * 32 + j]
            for k in range(low[2], high[2]):
                bit = np.uint32(1) << np.uint32(k)
                out[n] = 0.0 if done & bit else (1.0 if full & bit else -waste)
                n += 1


@kernel("f8(u4[::1], u4[::1], f8, i8[::1], i8[::1], i8[:, ::1], i8[::1], f8, f4[:, ::1], f8[::1])")
def propose(occupied, covered, waste, low, high, table, picks, price, volumes, block):
    """The repeated box that gains most on what is uncovered, among the families named by ``picks``.

    Parameters
    ----------
    occupied, covered
        The solid, and what is drawn, as rows (1024).
    waste
        Weight of an empty cell against an occupied one.
    low, high
        Box of cells outside which nothing is proposed.
    table, picks
        All families, and the numbers of those to try.
    price
        Cells that one statement has to gain.
    volumes
        Scratch for ``VOLUMES`` volumes of 32^3 cells.
    block
        The block (20) is written here; it comes with zeros.

    Returns
    -------
    gain
        Zero when nothing gains.
    """
    weigh(occupied, covered, waste, low, high, volumes[0])
    size0, size1, size2 = high[0] - low[0], high[1] - low[1], high[2] - low[2]
    found = np.zeros(12, np.int64)
    block[COUNT1], block[COUNT2] = 1, 1
    best = 0.0
    for s in picks:
        cost = price * (1 + (table[s, 0] >= 0) + (table[s, 4] >= 0))
        value = search_family(volumes, size0, size1, size2, table[s], best + cost, found)
        if value > best + cost:
            best = value - cost
            for slot in range(len(block)):
                block[slot] = 0
            for axis in range(3):
                block[FIRST + axis] = found[axis] + low[axis] - 16
                block[EXTENT + axis] = found[3 + axis]
            block[COUNT1], block[COUNT2] = found[6], found[9]
            if found[6] > 1:
                block[SHIFT1 + found[7]] = found[8]
            if found[9] > 1:
                block[SHIFT2 + found[10]] = found[11]
    return best
