"""Random columns of whole numbers, one row for each program that is being written."""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

Whole = Float[Tensor, " n"]
"""A whole number for each program, in float32."""

Flag = Bool[Tensor, " n"]

Number = Tensor | float
"""A :data:`Whole`, or one number for all programs."""

AT_ONCE = 64
"""Columns of uniform numbers drawn together: one call instead of many small ones."""


class Dice:
    """Random columns for ``count`` programs.

    Parameters
    ----------
    count
        Rows n.
    generator
        Where the randomness comes from; columns are on its device.
    """

    def __init__(self, count: int, generator: torch.Generator) -> None:
        self.count, self.device = count, generator.device
        self._generator = generator
        self._columns: list[Tensor] = []

    def uniform(self) -> Float[Tensor, " n"]:
        """Numbers in [0, 1)."""
        if not self._columns:
            drawn = torch.rand(AT_ONCE, self.count, generator=self._generator, device=self.device)
            self._columns = list(drawn.unbind(0))
        return self._columns.pop()

    def whole(self, low: Number, high: Number) -> Whole:
        """Whole numbers from ``low`` to ``high``, both included; ``low`` where the range is empty."""
        if not isinstance(low, Tensor) and not isinstance(high, Tensor):
            return (self.uniform() * (high - low + 1)).floor_().add_(low)
        width = torch.as_tensor(high - low + 1, dtype=torch.float32, device=self.device).clamp(min=1)
        return (self.uniform() * width).floor_() + low

    def even(self, low: Number, high: Number) -> Whole:
        """Even numbers between two even ones, both included."""
        return self.whole(low / 2, high / 2) * 2

    def chance(self, share: float) -> Flag:
        """Whether something of that probability happens."""
        return self.uniform() < share

    def kind(self, *weights: float) -> list[Flag]:
        """One of several possibilities for each program, as one flag for each: exactly one is true."""
        total, place, flags = sum(weights), 0.0, []
        drawn = self.uniform()
        for number, weight in enumerate(weights):
            first = drawn >= place
            place = 2.0 if number == len(weights) - 1 else place + weight / total
            flags.append(first & (drawn < place))
        return flags

    def pick(self, *values: Number, weights: tuple[float, ...] = ()) -> Whole:
        """One of several numbers or columns for each program."""
        flags = self.kind(*(weights or (1,) * len(values)))
        chosen = torch.zeros(self.count, device=self.device)
        for flag, value in zip(flags, values, strict=True):
            chosen = torch.where(flag, value, chosen)
        return chosen
