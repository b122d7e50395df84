"""Random numbers for the search, from the one generator that compiled code draws from, so that a seed is enough."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import helper, kernel


@kernel("void(i8)")
def start(seed):
    """Begin the sequence of a seed."""
    np.random.seed(seed)


@kernel("f8()")
def uniform():
    """A number in [0, 1)."""
    return np.random.random()


@helper
def one_of(count):
    """One of 0 to count - 1."""
    return np.random.randint(count)


@kernel("i8(i8)")
def below(count):
    """One of 0 to count - 1."""
    return one_of(count)


@kernel("void(i8[::1])")
def shuffle(numbers):
    """Put numbers in random order (Fisher and Yates, from the last to the first)."""
    for last in range(len(numbers) - 1, 0, -1):
        index = one_of(last + 1)
        numbers[last], numbers[index] = numbers[index], numbers[last]
