"""The kernel that proposes a block: the repeated box that gains most on what no block covers yet."""

from __future__ import annotations

import numpy as np
from numba import njit

from shapeprog.inference.block_layout import COUNT1, COUNT2, EXTENT, FIRST, SHIFT1, SHIFT2, WIDTH
from shapeprog.inference.fold_kernels import search_family


@njit(cache=True, nogil=True)
def weigh(occupied, covered, waste, low, high):  # type: ignore[no-untyped-def]
    """Weights of the cells in the box [low, high): +1 for occupied, -waste for empty, 0 once covered."""
    out = np.zeros((high[0] - low[0], high[1] - low[1], high[2] - low[2]), np.float32)
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            full = occupied[i * 32 + j]
            done = covered[i * 32 + j]
            for k in range(low[2], high[2]):
                bit = np.uint32(1) << np.uint32(k)
                if done & bit == 0:
                    out[i - low[0], j - low[1], k - low[2]] = 1.0 if full & bit else -waste
    return out


@njit(cache=True, nogil=True)
def propose(occupied, covered, waste, low, high, table, picks, price):  # type: ignore[no-untyped-def]
    """The repeated box that gains most on what is uncovered, among the families named by ``picks``.

    Parameters
    ----------
    waste
        Weight of an empty cell against an occupied one.
    price
        Cells that one statement has to gain.

    Returns
    -------
    gain, block
        Zero when nothing gains.
    """
    weights = weigh(occupied, covered, waste, low, high)
    block = np.zeros(WIDTH)
    block[COUNT1], block[COUNT2] = 1, 1
    best = 0.0
    for s in picks:
        cost = price * (1 + (table[s, 0] >= 0) + (table[s, 4] >= 0))
        value, found = search_family(weights, table[s], best + cost)
        if value > best + cost:
            best = value - cost
            for slot in range(WIDTH):
                block[slot] = 0
            for axis in range(3):
                block[FIRST + axis] = found[axis] + low[axis] - 16
                block[EXTENT + axis] = found[3 + axis]
            block[COUNT1], block[COUNT2] = found[6], found[9]
            if found[6] > 1:
                block[SHIFT1 + found[7]] = found[8]
            if found[9] > 1:
                block[SHIFT2 + found[10]] = found[11]
    return best, block
