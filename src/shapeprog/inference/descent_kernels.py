"""Kernels that improve one block by local search on IoU minus price x statements, the other blocks fixed."""

from __future__ import annotations

import numpy as np
from numba import njit

from shapeprog.inference.block_layout import (
    BACK,
    BOX,
    COUNT1,
    COUNT2,
    DISC,
    EXTENT,
    FIRST,
    FORM,
    LINE,
    RADIUS,
    ROTATE,
    TILT,
)
from shapeprog.inference.raster_kernels import ROWS, WORDS, draw_block, popcount

MOST_MOVES = 200
"""At least the number of neighbours that any block has."""

MOST_STEPS = 60
"""Most steps of one descent."""

MOST_COPIES = 64
"""Most copies of one block."""

GAIN = 1e-9
"""Least rise of the objective that counts, above the noise of rounding."""


@njit(cache=True, nogil=True)
def statements(block):  # type: ignore[no-untyped-def]
    """Statements of a block: itself and its loops."""
    return 1 + (block[COUNT1] > 1) + (block[COUNT2] > 1) + (block[ROTATE] > 1)


@njit(cache=True, nogil=True)
def valid(block):  # type: ignore[no-untyped-def]
    """Whether the lengths are positive and no two neighbouring copies of a loop are drawn over each other."""
    form = int(block[FORM])
    if block[COUNT1] < 1 or block[COUNT2] < 1 or block[COUNT1] * block[COUNT2] > MOST_COPIES:
        return False
    for level in (COUNT1, COUNT2):
        if block[level] > 1:
            apart = False
            for axis in range(3):
                if form in (BOX, BACK):
                    extent = block[EXTENT + axis]
                elif form == DISC:
                    extent = block[EXTENT] if axis == 0 else 2 * block[RADIUS]
                else:
                    extent = 2.0
                apart = apart or abs(block[level + 1 + axis]) >= extent
            if not apart:
                return False
    if form in (BOX, BACK):
        return block[EXTENT] >= 1 and block[EXTENT + 1] >= 1 and block[EXTENT + 2] >= 1
    if form == LINE:
        return block[TILT] >= 1
    return block[EXTENT] >= 1 and block[RADIUS] >= 1


@njit(cache=True, nogil=True)
def layers(block):  # type: ignore[no-untyped-def]
    """First layer of the grid that a block can touch, and the one after the last."""
    start, end = block[FIRST], block[FIRST] + block[EXTENT]
    if block[FORM] == LINE:
        margin = 1.01 * block[TILT] + 2
        start, end = min(block[FIRST], block[EXTENT]) - margin, max(block[FIRST], block[EXTENT]) + margin
    for level in (COUNT1, COUNT2):
        reach = (block[level] - 1) * block[level + 1]
        start += min(reach, 0.0)
        end += max(reach, 0.0)
    return max(int(np.floor(start)) + 16, 0), min(int(np.ceil(end)) + 16, 32)


@njit(cache=True, nogil=True)
def gains(rows, block, gained, wasted):  # type: ignore[no-untyped-def]
    """How many cells of ``gained`` and of ``wasted`` a block covers; ``rows`` is scratch."""
    first, last = layers(block)
    words, good_words, bad_words = rows.view(np.uint64), gained.view(np.uint64), wasted.view(np.uint64)
    for i in range(first * WORDS, last * WORDS):
        words[i] = 0
    draw_block(rows, block)
    good = 0
    bad = 0
    for i in range(first * WORDS, last * WORDS):
        good += popcount(words[i] & good_words[i])
        bad += popcount(words[i] & bad_words[i])
    return good, bad


@njit(cache=True, nogil=True)
def put(out, n, block, slot, by, slot2, by2):  # type: ignore[no-untyped-def]
    """Write the block with two of its numbers changed as neighbour n; returns the next n."""
    for i in range(len(block)):
        out[n, i] = block[i]
    out[n, slot] += by
    out[n, slot2] += by2
    return n + 1


@njit(cache=True, nogil=True)
def put_loop(out, n, block, slot, by, shift, share):  # type: ignore[no-untyped-def]
    """Write the block with one number of a loop changed and its first copy moved; returns the next n.

    Along the axis of ``shift`` (or all three for -1) the copy moves back by ``share``.
    """
    n = put(out, n, block, slot, by, slot, 0.0)
    for axis in range(3):
        if shift < 0 or shift == axis:
            back = share * block[slot + 1 + axis] if shift < 0 else share
            out[n - 1, FIRST + axis] -= back
            if block[FORM] == LINE:
                out[n - 1, EXTENT + axis] -= back
    return n


@njit(cache=True, nogil=True)
def moves(block, out, far):  # type: ignore[no-untyped-def]
    """Neighbours of a block: faces, places, ends, spacings and counts moved by up to ``far``; their number."""
    n = 0
    form = int(block[FORM])
    last = RADIUS if form == DISC else (TILT if form == LINE else TILT - 1)
    for which in range(2 * far):
        delta = (which // 2 + 1.0) * (1.0 if which % 2 else -1.0)
        if form in (BOX, BACK):
            for axis in range(3):
                place, extent = FIRST + axis, EXTENT + axis
                n = put(out, n, block, place, delta, place, 0.0)
                n = put(out, n, block, extent, delta, extent, 0.0)
                n = put(out, n, block, place, delta, extent, -delta)
                if which < 2:
                    n = put(out, n, block, place, -delta, extent, 2 * delta)
            if form == BACK:
                n = put(out, n, block, TILT, delta, TILT, 0.0)
                n = put(out, n, block, TILT, delta, FIRST + 1, -delta)
        else:
            for slot in range(FIRST, last + 1):
                n = put(out, n, block, slot, delta, slot, 0.0)
            if form == LINE:
                for axis in range(3):
                    n = put(out, n, block, FIRST + axis, delta, EXTENT + axis, delta)
            else:
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
        if block[ROTATE] > 0 and which < 2:
            n = put(out, n, block, ROTATE, delta, ROTATE, 0.0)
    return n


@njit(cache=True, nogil=True)
def improve_block(block, occupied, others, price, far):  # type: ignore[no-untyped-def]
    """Best-improvement descent of one block; the block and its objective."""
    gained, wasted = np.empty(ROWS, np.uint32), np.empty(ROWS, np.uint32)
    inter = 0
    union = 0
    for i in range(ROWS):
        gained[i] = occupied[i] & ~others[i]
        wasted[i] = ~occupied[i] & ~others[i]
        inter += popcount(occupied[i] & others[i])
        union += popcount(occupied[i] | others[i])
    rows = np.zeros(ROWS, np.uint32)
    around = np.zeros((MOST_MOVES, len(block)))
    good, bad = gains(rows, block, gained, wasted)
    best = (inter + good) / max(union + bad, 1) - price * statements(block)
    current = block.copy()
    for _ in range(MOST_STEPS):
        chosen = -1
        for m in range(moves(current, around, far)):
            if not valid(around[m]):
                continue
            good, bad = gains(rows, around[m], gained, wasted)
            value = (inter + good) / max(union + bad, 1) - price * statements(around[m])
            if value > best + GAIN:
                best = value
                chosen = m
        if chosen < 0:
            break
        for i in range(len(current)):
            current[i] = around[chosen, i]
    return current, best
