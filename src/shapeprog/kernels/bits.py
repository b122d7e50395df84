"""Words of bits in kernels: stretches of cells, numbers of set bits, and random numbers mixed from a counter."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import helper

WORD = 32  # cells in a word

GOLDEN, FIRST, SECOND = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
"""The step and the two factors of SplitMix64 (Steele, Lea and Flood 2014), which makes random numbers of a counter."""


@helper
def span(first, last):
    """The bits of one word from ``first`` to ``last - 1``, as far as it has them."""
    low, high = max(first, 0), min(last, 32)
    if low >= high:
        return np.uint32(0)
    return np.uint32(((np.uint64(1) << np.uint64(high - low)) - np.uint64(1)) << np.uint64(low))


@helper
def ones(word):
    """Number of set bits of an unsigned word of 64 bits; compiles to one instruction."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@helper
def uniform(seed, count):
    """Number ``count`` of the stream of a seed, uniform in [0, 1): a counter put through the mixer of SplitMix64."""
    word = np.uint64(seed) + np.uint64(count + 1) * np.uint64(GOLDEN)
    word = (word ^ (word >> np.uint64(30))) * np.uint64(FIRST)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(SECOND)
    word = word ^ (word >> np.uint64(31))
    return float(word >> np.uint64(11)) * (1.0 / 9007199254740992.0)
