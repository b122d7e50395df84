"""Random numbers for the search, from the one generator that compiled code draws from, so that a seed is enough."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def start(seed):  # type: ignore[no-untyped-def]
    """Begin the sequence of a seed."""
    np.random.seed(seed)


@njit(cache=True, nogil=True)
def uniform():  # type: ignore[no-untyped-def]
    """A number in [0, 1)."""
    return np.random.random()


@njit(cache=True, nogil=True)
def below(count):  # type: ignore[no-untyped-def]
    """One of 0 to count - 1."""
    return np.random.randint(count)


@njit(cache=True, nogil=True)
def shuffled(count):  # type: ignore[no-untyped-def]
    """The numbers 0 to count - 1 in random order."""
    return np.random.permutation(count)
