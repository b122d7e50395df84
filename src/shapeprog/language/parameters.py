"""What the parameters of a statement mean, written as annotations: kinds, widths, ranges, and their numbers as text.

Numbers are exact in float32, written with the fewest digits, and checked against their declaration.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from torch import Tensor

from shapeprog.errors import ShapeProgError
from shapeprog.space import HALF, RESOLUTION

Kind = Literal["position", "length", "shift", "count", "turn"]

LARGEST = float(np.finfo(np.float32).max)
LARGEST_WHOLE = 1 << 24  # up to here float32 holds every whole number; counts and turns end here


def to_float32(value: float) -> float:
    """The float32 nearest to ``value``; a ``ShapeProgError`` if it is not finite, or too large for float32."""
    try:
        single: float = struct.unpack("f", struct.pack("f", value))[0]
    except (OverflowError, struct.error):  # the latter for a whole number beyond float64
        single = math.inf
    if not math.isfinite(single):
        limits = f"numbers go from -{LARGEST:.7e} to {LARGEST:.7e}"
        raise ShapeProgError("this number is too large or no number at all", limits)
    return single


def shortest(value: float) -> str:
    """The shortest decimal that reads back as exactly this float32, such as ``0.1``, ``-0.0`` or ``1e-40``."""
    single = to_float32(value)
    decimal = float(str(np.float32(single)))
    if to_float32(decimal) != single:  # it was rounded twice on its way through float64
        decimal = single
    return repr(decimal).removesuffix(".0") if single or math.copysign(1, single) > 0 else "-0.0"


@dataclass(frozen=True)
class Quantity:
    """A group of numbers of one kind.

    ``position`` and ``shift`` are coordinates in cells (a shift is relative), ``length`` is an extent in cells,
    ``count`` a number of copies, ``turn`` a number of quarter turns.  The width is how many numbers there are, one
    tensor slot each; programs are sampled from ``low`` to ``high``, which errors name.
    """

    kind: Kind
    width: int = 1
    low: float = 0.0
    high: float = 0.0

    @property
    def discrete(self) -> bool:
        """Whether the numbers are whole and carry no gradient."""
        return self.kind in ("count", "turn")

    @property
    def range_text(self) -> str:
        """The declared range in words."""
        whole = "whole numbers " if self.discrete else ""
        return f"{whole}from {shortest(self.low)} to {shortest(self.high)}"

    def written(self, value: float) -> str:
        """A number as program text: whole for counts and turns, else the shortest decimal."""
        return str(int(to_float32(value))) if self.discrete else shortest(value)


Position = Annotated[Tensor, Quantity("position", 3, -HALF, HALF)]
Extent = Annotated[Tensor, Quantity("length", 3, 0, RESOLUTION)]
Half = Annotated[Tensor, Quantity("length", 2, 0, HALF)]
Length = Annotated[Tensor, Quantity("length", 1, 0, RESOLUTION)]
Radius = Annotated[Tensor, Quantity("length", 1, 0, HALF)]
Shift = Annotated[Tensor, Quantity("shift", 1, -RESOLUTION, RESOLUTION)]
Shift3 = Annotated[Tensor, Quantity("shift", 3, -RESOLUTION, RESOLUTION)]
Count = Annotated[Tensor, Quantity("count", 1, 0, 64)]
Turn = Annotated[Tensor, Quantity("turn", 1, -64, 64)]


@dataclass(frozen=True)
class Parameter:
    """One named parameter of a statement and the first of the tensor slots it takes."""

    name: str
    quantity: Quantity
    start: int

    @property
    def slots(self) -> slice:
        """Its slots among those of the statement."""
        return slice(self.start, self.start + self.quantity.width)

    def call(self, numbers: Sequence[str]) -> str:
        """How it is written with these numbers: ``at=(4, 0, -2.5)``."""
        return f"{self.name}=" + (numbers[0] if self.quantity.width == 1 else f"({', '.join(numbers)})")

    @property
    def blank(self) -> str:
        """How it is written, with a blank for each number: ``at=(_, _, _)``."""
        return self.call("_" * self.quantity.width)

    def checked(self, owner: str, numbers: Sequence[float]) -> list[float]:
        """Its numbers in a call of the statement ``owner``, rounded to float32; a ``ShapeProgError`` if they are wrong.

        Coordinates and lengths may be any finite number: the declared range is where programs are sampled from, and a
        negative length draws nothing.  Counts and turns must be whole; beyond their range they stay legal as far as
        float32 holds whole numbers, since a count of zero or less erases what is inside.
        """
        quantity, place = self.quantity, f"{self.name} of {owner}"
        if len(numbers) != quantity.width:
            wanted = "1 number" if quantity.width == 1 else f"{quantity.width} numbers"
            raise ShapeProgError(f"{place} takes {wanted}, not {len(numbers)}", f"write {self.blank}")
        singles = [to_float32(number) for number in numbers]
        if not quantity.discrete:
            return singles
        for number in numbers:
            if number != math.floor(number):
                raise ShapeProgError(f"{place} is {number!r}, but must be whole", f"it takes {quantity.range_text}")
            if abs(number) > LARGEST_WHOLE:
                said = f"{place} is {int(number)}, beyond {LARGEST_WHOLE}, the end of exact whole numbers"
                raise ShapeProgError(said, f"it takes {quantity.range_text}")
        return [single + 0.0 for single in singles]  # no minus zero
