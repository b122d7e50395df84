"""Blocks of the structure search: the row of numbers that stores one, the cells that it covers, and its descent.

A block is a row of 16 whole numbers (as float64): a form, the numbers of its statement in cells, in their order, and
the loops around it.  Its cells are bits of words: the lowest bit of a word is the cell at the lowest height, depth and
side.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.kernels.bits import ones, span
from shapeprog.kernels.compile import helper, kernel
from shapeprog.kernels.rows import REACH
from shapeprog.space import BoolArray, FloatArray

WIDTH = 16  # numbers of one block

FORM = 0
BOX, DISC, BACK = 0, 1, 2  # the forms
FIRST = 1  # low corner (up, depth, side) of a box or back; centre of the bottom of a disc
EXTENT = FIRST + 3  # extents (up, depth, side) of a box or back; thickness of a disc
RADIUS = FIRST + 4  # of a disc
TILT = FIRST + 6  # of a back
COUNT1, COUNT2 = 8, 12  # copies of two translation loops, 1 for none
SHIFT1, SHIFT2 = 9, 13  # their steps (up, depth, side)

WORDS = 512  # words of 64 cells of the grid; as 1024 of 32, word 32 i + j holds the cells at height i and depth j
MOST_MOVES = 80  # an upper bound on the number of neighbours of a block
MOST_COPIES = 64  # largest number of copies of one block
GAIN = 1e-9  # smallest increase of the objective that is accepted, above rounding errors

Words = npt.NDArray[np.uint64]


def draw_each(blocks: FloatArray) -> Words:
    """The cells (P, 512) of each block on its own."""
    words = np.zeros((len(blocks), WORDS), np.uint64)
    draw_blocks(blocks, words.view(np.uint32))
    return words


def draw_all(blocks: FloatArray) -> Words:
    """The cells (512) of the union of blocks."""
    return np.asarray(np.bitwise_or.reduce(draw_each(blocks)))


def cells_of(words: Words) -> BoolArray:
    """Cells (32, 32, 32) from words (512)."""
    return np.unpackbits(words.view(np.uint8), bitorder="little").view(np.bool_).reshape(32, 32, 32)


@kernel("void(f8[:, ::1], u4[:, ::1])")
def draw_blocks(blocks, rows):
    """Set the cells of each block in its row (P, 1024)."""
    for k in range(len(blocks)):
        draw_block(rows[k], blocks[k])


@helper
def draw_block(rows, block):
    """Set the cells of all copies of a block, clipped to the grid."""
    up, depth, side = int(block[EXTENT]), int(block[EXTENT + 1]), int(block[EXTENT + 2])
    for i1 in range(int(block[COUNT1])):
        for i2 in range(int(block[COUNT2])):
            a = int(block[FIRST] + i1 * block[SHIFT1] + i2 * block[SHIFT2]) + 16
            b = int(block[FIRST + 1] + i1 * block[SHIFT1 + 1] + i2 * block[SHIFT2 + 1]) + 16
            c = int(block[FIRST + 2] + i1 * block[SHIFT1 + 2] + i2 * block[SHIFT2 + 2]) + 16
            if block[FORM] == DISC:
                draw_disc(rows, a, b, c, up, depth)
            else:
                draw_back(rows, a, b, c, up, depth, side, block[TILT])


@helper
def draw_back(rows, a, b, c, up, depth, side, tilt):
    """Set the cells of a box whose layers are shifted in depth by up to ``tilt``, which is zero for upright boxes."""
    bits = span(c, c + side)
    for i in range(max(-a, 0), min(32 - a, up)):
        front = int(np.rint(b + tilt * i / up))
        for j in range(max(front, 0), min(front + depth, 32)):
            rows[(a + i) * 32 + j] |= bits


@helper
def draw_disc(rows, a, b, c, up, radius):
    """Set the cells of an upright cylinder: centres within ``REACH`` radii of its axis."""
    limit = (REACH * radius) ** 2
    for j in range(max(0, b - radius - 1), min(32, b + radius + 1)):
        square = limit - (j + 0.5 - b) ** 2
        if square >= 0:
            reach = np.sqrt(square)
            bits = span(int(np.ceil(c - 0.5 - reach)), int(np.floor(c - 0.5 + reach)) + 1)
            for i in range(max(a, 0), min(a + up, 32)):
                rows[i * 32 + j] |= bits


@helper
def statements(block):
    """Statements of a block: itself and its loops; from Python also for each column of a transposed array of blocks."""
    return 1 + (block[COUNT1] > 1) + (block[COUNT2] > 1)


@helper
def valid(block):
    """Whether the lengths are positive and no two neighbouring copies of a loop are drawn over each other."""
    disc = block[FORM] == DISC
    if block[COUNT1] < 1 or block[COUNT2] < 1 or block[COUNT1] * block[COUNT2] > MOST_COPIES:
        return False
    for level in (COUNT1, COUNT2):
        separate = block[level] == 1
        for axis in range(3):
            extent = 2 * block[RADIUS] if disc and axis > 0 else block[EXTENT + axis]
            separate = separate or abs(block[level + 1 + axis]) >= extent
        if not separate:
            return False
    return block[EXTENT] >= 1 and block[EXTENT + 1] >= 1 and (disc or block[EXTENT + 2] >= 1)


@helper
def put(out, n, block, slot, by, slot2, by2):
    """Write the block with two of its numbers changed as neighbour n; returns the next n."""
    out[n] = block
    out[n, slot] += by
    out[n, slot2] += by2
    return n + 1


@helper
def moves(block, out):
    """Neighbours of a block: faces, positions, ends, spacings and counts changed by one; their number."""
    n, form = 0, int(block[FORM])
    last = RADIUS if form == DISC else TILT if form == BACK else TILT - 1
    for delta in (1.0, -1.0):
        for slot in range(FIRST, last + 1):
            n = put(out, n, block, slot, delta, slot, 0.0)
        for axis in range(1 if form == DISC else 3):
            corner, extent = FIRST + axis, EXTENT + axis
            n = put(out, n, block, corner, delta, extent, -delta)
            n = put(out, n, block, corner, -delta, extent, 2 * delta)
        if form == BACK:
            n = put(out, n, block, TILT, delta, FIRST + 1, -delta)
        for level in (COUNT1, COUNT2):
            if block[level] > 1:
                for axis in range(3):
                    corner, step = FIRST + axis, level + 1 + axis
                    n = put(out, n, block, step, delta, step, 0.0)
                    n = put(out, n, block, step, delta, corner, -delta)
                    if block[level] > 2:
                        n = put(out, n, block, step, delta, corner, -np.rint(delta * (block[level] - 1) / 2))
                n = put(out, n, block, level, delta, level, 0.0)
                n = put(out, n, block, level, delta, level, 0.0)  # the same at the other end
                out[n - 1, FIRST:EXTENT] -= delta * block[level + 1 : level + 4]
    return n


@kernel("void(f8[::1], u8[::1], u8[::1], f8)")
def descend(block, occupied, covered, price):
    """Best-improvement descent of one block, in place, on IoU less the price of its statements.

    ``occupied`` are the cells of the solid, ``covered`` those of the other blocks, as words (512).
    """
    words, around = np.empty(WORDS, np.uint64), np.empty((MOST_MOVES, WIDTH))
    around[0] = block
    best, number = -np.inf, 1  # the block alone first, its neighbours later
    for step in range(61):
        best_index = -1
        for m in range(number):
            if step > 0 and not valid(around[m]):
                continue
            words[:] = covered
            draw_block(words.view(np.uint32), around[m])
            shared, union = 0, 0
            for i in range(WORDS):
                shared += ones(words[i] & occupied[i])
                union += ones(words[i] | occupied[i])
            value = shared / union - price * statements(around[m])
            if value > best + GAIN:
                best, best_index = value, m
        if best_index < 0:
            break
        block[:] = around[best_index]
        number = moves(block, around)
