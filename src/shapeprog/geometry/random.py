"""Random numbers mixed from a counter, the same on every device and in kernels."""

from __future__ import annotations

from jaxtyping import Float, Int

from shapeprog.kernels.bits import FIRST, GOLDEN, SECOND
from shapeprog.lazy_torch import Tensor


def uniform(seed: int | Int[Tensor, "*batch"], count: Int[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """Numbers of the stream of a seed, uniform in [0, 1): the twin of :func:`shapeprog.kernels.bits.uniform`."""
    word = (count + 1) * (GOLDEN - 2**64) + seed  # whole numbers that wrap around
    for shift, factor in ((30, FIRST), (27, SECOND)):
        word = (word ^ ((word >> shift) & ((1 << (64 - shift)) - 1))) * (factor - 2**64)
    word = word ^ ((word >> 31) & ((1 << 33) - 1))
    numbers: Tensor = ((word >> 11) & ((1 << 53) - 1)).double() * 2.0**-53
    return numbers
