"""The kernel that finds the blocks of programs that others hide, on packed rows of cells."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import kernel


@kernel("void(u4[:, :, ::1], b1[:, ::1], u4[:, ::1], i8, i8)")
def unhide(blocks, keep, union, begin, end):
    """Of the blocks (B, K, words), mark in (B, K) those with cells of their own, and gather what they draw.

    From the last to the first each is compared with all blocks before it and with those after it that are kept.
    """
    count, words = blocks.shape[1], blocks.shape[2]
    before = np.empty((count, words), np.uint32)
    for program in range(begin, end):
        before[0] = np.uint32(0)
        for k in range(1, count):
            for word in range(words):
                before[k, word] = before[k - 1, word] | blocks[program, k - 1, word]
        for back in range(count):
            k = count - 1 - back
            own = np.uint32(0)
            for word in range(words):
                own |= blocks[program, k, word] & ~(before[k, word] | union[program, word])
            keep[program, k] = own != 0
            if own != 0:
                for word in range(words):
                    union[program, word] |= blocks[program, k, word]
