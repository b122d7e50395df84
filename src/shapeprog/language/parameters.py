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

from shapeprog.errors import ShapeProgError
from shapeprog.lazy_torch import Tensor
from shapeprog.space import AXES, HALF, RESOLUTION

Kind = Literal["position", "length", "shift", "angle", "count", "turn", "axis"]

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
        raise ShapeProgError("this number is too large for single precision, or not finite", limits)
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
    ``angle`` is in degrees, ``count`` a number of copies, ``turn`` a number of quarter turns, ``axis`` an axis of the
    grid, written as its word.  The width is how many numbers there are, one tensor slot each, and ``each`` names
    them in order; programs are sampled from ``low`` to ``high``, which errors name.  A count with one legal value, such
    as that of a mirror, is not written.
    """

    kind: Kind
    width: int = 1
    low: float = 0.0
    high: float = 0.0
    each: str = ""

    @property
    def spatial(self) -> bool:
        """Whether the numbers are coordinates or lengths, which text may write in another unit than cells."""
        return self.kind in ("position", "length", "shift")

    @property
    def discrete(self) -> bool:
        """Whether the numbers are whole and carry no gradient."""
        return self.kind in ("count", "turn", "axis")

    @property
    def written_out(self) -> bool:
        """Whether text contains it."""
        return self.kind != "count" or self.low < self.high

    @property
    def blank(self) -> str:
        """The placeholder of one of its numbers."""
        return self.written(self.high) if self.kind == "axis" or not self.written_out else "_"

    def nearest(self, value: float) -> float:
        """The legal whole number nearest to ``value``: counts and turns end where float32 does not hold them all."""
        bounded = self.kind == "axis" or not self.written_out
        low, high = (self.low, self.high) if bounded else (-LARGEST_WHOLE, LARGEST_WHOLE)
        return float(round(min(max(value, low), high)))

    @property
    def range_text(self) -> str:
        """The declared range in words."""
        if self.kind == "axis":
            return f"one of {', '.join(AXES)}"
        prefix = "whole numbers " if self.discrete else ""
        return f"{prefix}from {shortest(self.low)} to {shortest(self.high)}"

    def written(self, value: float) -> str:
        """A number as program text: whole for counts and turns, the word of an axis, else the shortest decimal."""
        if self.kind == "axis":
            return AXES[int(value)]
        return str(int(to_float32(value))) if self.discrete else shortest(value)


_ALL, _LEVEL = "up, depth, left-right", "depth, left-right"

Position = Annotated[Tensor, Quantity("position", 3, -HALF, HALF, _ALL)]
Extent = Annotated[Tensor, Quantity("length", 3, 0, RESOLUTION, _ALL)]
Half = Annotated[Tensor, Quantity("length", 2, 0, HALF, _LEVEL)]
Length = Annotated[Tensor, Quantity("length", 1, 0, RESOLUTION)]
Radius = Annotated[Tensor, Quantity("length", 1, 0, HALF)]
Shift = Annotated[Tensor, Quantity("shift", 1, -RESOLUTION, RESOLUTION)]
Shift3 = Annotated[Tensor, Quantity("shift", 3, -RESOLUTION, RESOLUTION, _ALL)]
Count = Annotated[Tensor, Quantity("count", 1, 0, 64)]
Turn = Annotated[Tensor, Quantity("turn", 1, -64, 64)]
Angle = Annotated[Tensor, Quantity("angle", 1, -45, 45)]
Axis = Annotated[Tensor, Quantity("axis", 1, 0, 2)]
Two = Annotated[Tensor, Quantity("count", 1, 2, 2)]
Section = Annotated[Tensor, Quantity("length", 2, 0, RESOLUTION, "first, second")]
Radii = Annotated[Tensor, Quantity("length", 2, 0, HALF, "start, end")]
Pivot = Annotated[Tensor, Quantity("position", 2, -HALF, HALF, "of the two axes that turn")]
Place = Annotated[Tensor, Quantity("position", 1, -HALF, HALF)]


@dataclass(frozen=True)
class Parameter:
    """One named parameter of a statement and the first of the tensor slots it takes.

    A parameter of one number may have a default, which program text omits and which is in its unit.
    """

    name: str
    quantity: Quantity
    start: int
    default: float | None = None

    @property
    def slots(self) -> slice:
        """Its slots among those of the statement."""
        return slice(self.start, self.start + self.quantity.width)

    def silent(self, numbers: Sequence[str]) -> bool:
        """Whether text leaves it out, with these numbers as text."""
        return self.unsaid is not None and list(numbers) == [self.quantity.written(self.unsaid)]

    @property
    def unsaid(self) -> float | None:
        """The number it has where text leaves it out, if it may."""
        return self.default if self.quantity.written_out else float(self.quantity.low)

    def call(self, numbers: Sequence[str]) -> str:
        """How it is written with these numbers: ``at=(4, 0, -2.5)``."""
        return f"{self.name}=" + (numbers[0] if self.quantity.width == 1 else f"({', '.join(numbers)})")

    @property
    def blank(self) -> str:
        """How it is written, with a blank for each number: ``at=(_, _, _)``."""
        return self.call([self.quantity.blank] * self.quantity.width)

    def checked(self, owner: str, numbers: Sequence[float]) -> list[float]:
        """Its numbers in a call of the statement ``owner``, rounded to float32; a ``ShapeProgError`` if they are wrong.

        Coordinates and lengths may be any finite number: the declared range is where programs are sampled from, and a
        negative length draws nothing.  Counts and turns must be whole; beyond their range they stay legal as far as
        float32 holds whole numbers, since a count of zero or less draws nothing.
        """
        quantity, label = self.quantity, f"{self.name} of {owner}"
        if len(numbers) != quantity.width:
            expected = "1 number" if quantity.width == 1 else f"{quantity.width} numbers"
            raise ShapeProgError(f"{label} takes {expected}, not {len(numbers)}", f"write {self.blank}")
        singles = [to_float32(number) for number in numbers]
        if not quantity.discrete:
            return singles
        for number in numbers:
            if quantity.kind == "axis" and number not in range(len(AXES)):
                raise ShapeProgError(f"{label} is {number!r}, which is not an axis", f"it is {quantity.range_text}")
            if not quantity.written_out and number != quantity.low:
                only = quantity.written(quantity.low)
                raise ShapeProgError(f"{label} is {number!r}, but {owner} always has {only}", f"leave it at {only}")
            if number != math.floor(number):
                raise ShapeProgError(f"{label} is {number!r}, but must be whole", f"it takes {quantity.range_text}")
            if abs(number) > LARGEST_WHOLE:
                message = f"{label} is {int(number)}, beyond {LARGEST_WHOLE}, the end of exact whole numbers"
                raise ShapeProgError(message, f"it takes {quantity.range_text}")
        return [single + 0.0 for single in singles]  # no minus zero
