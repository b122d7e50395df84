"""Kernels that improve one block by local search on IoU minus price x statements, the other blocks fixed."""

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
    RADIUS,
    TILT,
)
from shapeprog.inference.cells.raster_kernels import draw_block
from shapeprog.kernels.bits import ones
from shapeprog.kernels.compile import helper, kernel

MOST_MOVES = 200
"""An upper bound on the number of neighbours of a block."""

MOST_COPIES = 64
"""Largest number of copies of one block."""

GAIN = 1e-9
"""Smallest increase of the objective that is accepted, above rounding errors."""


@helper
def statements(block):
    """Statements of a block: itself and its loops; from Python also for each column of a transposed array of blocks."""
    return 1 + (block[COUNT1] > 1) + (block[COUNT2] > 1)


@helper
def valid(block):
    """Whether the lengths are positive and no two neighbouring copies of a loop are drawn over each other."""
    form = int(block[FORM])
    if block[COUNT1] < 1 or block[COUNT2] < 1 or block[COUNT1] * block[COUNT2] > MOST_COPIES:
        return False
    for level in (COUNT1, COUNT2):
        if block[level] > 1:
            separate = False
            for axis in range(3):
                extent = 2 * block[RADIUS] if form == DISC and axis > 0 else block[EXTENT + axis]
                separate = separate or abs(block[level + 1 + axis]) >= extent
            if not separate:
                return False
    return block[EXTENT] >= 1 and block[EXTENT + 1] >= 1 and (form == DISC or block[EXTENT + 2] >= 1)


@helper
def layers(block):
    """First layer of the grid that a block can touch, and the one after the last."""
    start, end = block[FIRST], block[FIRST] + block[EXTENT]
    for level in (COUNT1, COUNT2):
        reach = (block[level] - 1) * block[level + 1]
        start += min(reach, 0.0)
        end += max(reach, 0.0)
    return max(int(np.floor(start)) + 16, 0), min(int(np.ceil(end)) + 16, 32)


@helper
def put(out, n, block, slot, by, slot2, by2):
    """Write the block with two of its numbers changed as neighbour n; returns the next n."""
    for i in range(len(block)):
        out[n, i] = block[i]
    out[n, slot] += by
    out[n, slot2] += by2
    return n + 1


@helper
def put_loop(out, n, block, slot, by, shift, share):
    """Write the block with one number of a loop changed and its first copy moved; returns the next n.

    Along the axis of ``shift`` (or all three for -1) the copy moves back by ``share``.
    """
    n = put(out, n, block, slot, by, slot, 0.0)
    for axis in range(3):
        if shift < 0 or shift == axis:
            back = share * block[slot + 1 + axis] if shift < 0 else share
            out[n - 1, FIRST + axis] -= back
    return n


@helper
def moves(block, out, far):
    """Neighbours of a block: faces, positions, ends, spacings and counts changed by up to ``far``; their number."""
    n = 0
    form = int(block[FORM])
    for which in range(2 * far):
        delta = (which // 2 + 1.0) * (1.0 if which % 2 else -1.0)
        if form != DISC:
            for axis in range(3):
                corner, extent = FIRST + axis, EXTENT + axis
                n = put(out, n, block, corner, delta, corner, 0.0)
                n = put(out, n, block, extent, delta, extent, 0.0)
                n = put(out, n, block, corner, delta, extent, -delta)
                if which < 2:
                    n = put(out, n, block, corner, -delta, extent, 2 * delta)
            if form == BACK:
                n = put(out, n, block, TILT, delta, TILT, 0.0)
                n = put(out, n, block, TILT, delta, FIRST + 1, -delta)
        else:
            for slot in range(FIRST, RADIUS + 1):
                n = put(out, n, block, slot, delta, slot, 0.0)
            n = put(out, n, block, FIRST, delta, EXTENT, -delta)
        for level in (COUNT1, COUNT2):
            if block[level] > 1:
                for axis in range(3):
                    step = level + 1 + axis
                    if block[step] != 0 or which < 2:
                        n = put(out, n, block, step, delta, step, 0.0)
                        n = put_loop(out, n, block, step, delta, axis, delta)
                        if block[level] > 2:
                            n = put_loop(out, n, block, step, delta, axis, np.rint(delta * (block[level] - 1) / 2))
                if which < 2:
                    n = put(out, n, block, level, delta, level, 0.0)
                    n = put_loop(out, n, block, level, delta, -1, delta)
    return n


@kernel("f8(f8[::1], u8[::1], u8[::1], f8, i8, u4[:, ::1], u8[:, ::1], f8[:, ::1])")
def descend(block, occupied, covered, price, far, scratch_rows, scratch_words, around):
    """Best-improvement descent of one block, in place; its objective.

    Parameters
    ----------
    block
        Input and output: the block.
    occupied, covered
        The solid, and the cells of the other blocks, as words (512).
    price, far
        Price of a statement in IoU, and largest step of one move in cells.
    scratch_rows, scratch_words, around
        Scratch: the same three times 1024 words of 32 cells as 512 of 64, and room for all neighbours (M, 16).
    """
    rows, words, gained, wasted = scratch_rows[0], scratch_words[0], scratch_words[1], scratch_words[2]
    inter = 0
    union = 0
    for i in range(len(occupied)):
        gained[i] = occupied[i] & ~covered[i]
        wasted[i] = ~occupied[i] & ~covered[i]
        inter += ones(occupied[i] & covered[i])
        union += ones(occupied[i] | covered[i])
    best = -np.inf
    for slot in range(len(block)):
        around[0, slot] = block[slot]
    number = 1  # the block alone first, its neighbours later
    for step in range(61):
        best_index = -1
        for m in range(number):
            if step > 0 and not valid(around[m]):
                continue
            first, last = layers(around[m])
            first, last = 16 * first, 16 * last  # a layer has 16 words
            for i in range(first, last):
                words[i] = 0
            draw_block(rows, around[m])
            good = inter
            bad = union
            for i in range(first, last):
                good += ones(words[i] & gained[i])
                bad += ones(words[i] & wasted[i])
            value = good / max(bad, 1) - price * statements(around[m])
            if value > best + GAIN:
                best = value
                best_index = m
        if best_index < 0:
            break
        for slot in range(len(block)):
            block[slot] = around[best_index, slot]
        number = moves(block, around, far)
    return best
