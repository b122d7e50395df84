"""The kernel that proposes a block: the repeated box with the largest gain on uncovered cells."""

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
    """The repeated box with the largest gain on uncovered cells, among the families with indices ``picks``.

    Parameters
    ----------
    occupied, covered
        The solid, and the cells of the blocks, as rows (1024).
    waste
        Weight of an empty cell against an occupied one.
    low, high
        Box of cells that contains every proposal.
    table, picks
        All families, and the indices of those to try.
    price
        Cells that one statement has to gain.
    volumes
        Scratch for ``VOLUMES`` volumes of 32^3 cells.
    block
        Output (16), initially zeros.

    Returns
    -------
    gain
        Zero when no box gains.
    """
    weigh(occupied, covered, waste, low, high, volumes[0])
    size0, size1, size2 = high[0] - low[0], high[1] - low[1], high[2] - low[2]
    candidate = np.zeros(12, np.int64)
    block[COUNT1], block[COUNT2] = 1, 1
    best = 0.0
    for s in picks:
        cost = price * (1 + (table[s, 0] >= 0) + (table[s, 4] >= 0))
        value = search_family(volumes, size0, size1, size2, table[s], best + cost, candidate)
        if value > best + cost:
            best = value - cost
            for slot in range(len(block)):
                block[slot] = 0
            for axis in range(3):
                block[FIRST + axis] = candidate[axis] + low[axis] - 16
                block[EXTENT + axis] = candidate[3 + axis]
            block[COUNT1], block[COUNT2] = candidate[6], candidate[9]
            if candidate[6] > 1:
                block[SHIFT1 + candidate[7]] = candidate[8]
            if candidate[9] > 1:
                block[SHIFT2 + candidate[10]] = candidate[11]
    return best
