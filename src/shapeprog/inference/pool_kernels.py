"""Kernels that draw many blocks one by one, and weigh all of them on the same uncovered cells."""

from __future__ import annotations

import numpy as np
from numba import njit

from shapeprog.inference.raster_kernels import ROWS, draw_block, popcount


@njit(cache=True, nogil=True)
def draw_each(blocks):  # type: ignore[no-untyped-def]
    """Rows (P, 1024) of each block on its own."""
    drawn = np.zeros((len(blocks), ROWS), np.uint32)
    for k in range(len(blocks)):
        draw_block(drawn[k], blocks[k])
    return drawn


@njit(cache=True, nogil=True)
def net_gains(drawn, gained, wasted, waste):  # type: ignore[no-untyped-def]
    """Cells of ``gained`` that each block covers, minus ``waste`` times those of ``wasted``."""
    good_words, bad_words = gained.view(np.uint64), wasted.view(np.uint64)
    found = np.empty(len(drawn))
    for k in range(len(drawn)):
        words = drawn[k].view(np.uint64)
        good = 0
        bad = 0
        for i in range(len(words)):
            good += popcount(words[i] & good_words[i])
            bad += popcount(words[i] & bad_words[i])
        found[k] = good - waste * bad
    return found
