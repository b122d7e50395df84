"""Kernels that draw blocks of whole-numbered parameters as rows of bits, one word for the 32 cells of a row."""

from __future__ import annotations

import numpy as np

from shapeprog.inference.cells.block_layout import (
    BACK,
    COUNT1,
    COUNT2,
    DISC,
    EXTENT,
    FIRST,
    FORM,
    SHIFT1,
    SHIFT2,
    TILT,
)  # fmt: skip
from shapeprog.kernels.bits import ones, span
from shapeprog.kernels.compile import helper, kernel
from shapeprog.kernels.rows import REACH

ROWS = 1024
"""Rows of the grid: row 32 i + j holds the cells at height i and depth j."""


@helper
def draw_back(rows, a, b, c, ta, tb, tc, tilt):
    """Set the cells of a box whose layers are shifted in depth by up to ``tilt``; an upright box has none."""
    bits = span(c + 16, c + 16 + tc)
    if bits == 0:
        return
    for i in range(max(-a - 16, 0), min(16 - a, ta)):
        low = b + 16 if tilt == 0 else int(np.rint(b + tilt * i / ta)) + 16
        for j in range(max(low, 0), min(low + tb, 32)):
            rows[(a + i + 16) * 32 + j] |= bits


@helper
def draw_disc(rows, a, yc, zc, t, r):
    """Set the cells of an upright cylinder: centres within ``REACH`` radii of its axis."""
    if r <= 0:
        return
    limit = (REACH * r) ** 2
    for j in range(max(0, yc + 16 - r - 1), min(32, yc + 16 + r + 1)):
        square = limit - (j - 15.5 - yc) ** 2
        if square < 0:
            continue
        reach = np.sqrt(square)
        bits = span(int(np.ceil(zc + 15.5 - reach)), int(np.floor(zc + 15.5 + reach)) + 1)
        for i in range(max(a + 16, 0), min(a + 16 + t, 32)):
            rows[i * 32 + j] |= bits


@helper
def draw_block(rows, block):
    """Set the cells of all copies of a block, clipped to the grid."""
    form, p0, p1, p2 = int(block[FORM]), int(block[FIRST]), int(block[FIRST + 1]), int(block[FIRST + 2])
    p3, p4, p5, last = int(block[EXTENT]), int(block[EXTENT + 1]), int(block[EXTENT + 2]), int(block[TILT])
    for i1 in range(int(block[COUNT1])):
        for i2 in range(int(block[COUNT2])):
            s0 = int(i1 * block[SHIFT1] + i2 * block[SHIFT2])
            s1 = int(i1 * block[SHIFT1 + 1] + i2 * block[SHIFT2 + 1])
            s2 = int(i1 * block[SHIFT1 + 2] + i2 * block[SHIFT2 + 2])
            if form == DISC:
                draw_disc(rows, p0 + s0, p1 + s1, p2 + s2, p3, p4)
            else:
                draw_back(rows, p0 + s0, p1 + s1, p2 + s2, p3, p4, p5, last if form == BACK else 0)


@kernel("void(f8[:, ::1], u4[:, ::1])")
def draw_blocks(blocks, rows):
    """Set the cells of block k in row k of ``rows`` (P, 1024), or those of all blocks in its only row."""
    step = 1 if len(rows) > 1 else 0
    for k in range(len(blocks)):
        draw_block(rows[k * step], blocks[k])


@kernel("void(u8[:, ::1], u8[::1], u8[::1], i8[:, ::1])")
def count_cells(sets, first, second, counts):
    """Write the number of cells that each row of words (P, 512) shares with either of two sets of cells: (P, 2)."""
    for k in range(len(sets)):
        count1, count2 = 0, 0
        for i in range(sets.shape[1]):
            count1 += ones(sets[k, i] & first[i])
            count2 += ones(sets[k, i] & second[i])
        counts[k, 0], counts[k, 1] = count1, count2
