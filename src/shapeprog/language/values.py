"""Numbers of a program: exact in float32, written with the fewest digits, checked against their declaration."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.language.parameters import Parameter, Quantity
from shapeprog.language.statement import Statement

LARGEST = 3.4028234663852886e38
"""The largest finite float32."""

LARGEST_WHOLE = 1 << 24
"""Up to here float32 holds every whole number; counts and turns end here."""


def to_float32(value: float) -> float:
    """The float32 nearest to ``value``; a ``ShapeProgError`` if it is not finite, or too large for float32."""
    try:
        single: float = struct.unpack("f", struct.pack("f", value))[0]
    except OverflowError:
        single = math.inf
    if not math.isfinite(single):
        limits = f"numbers go from -{LARGEST:.7e} to {LARGEST:.7e}"
        raise ShapeProgError("this number is too large or no number at all", limits)
    return single


def shortest(value: float) -> str:
    """The shortest decimal that reads back as exactly this float32: ``16``, ``0.1``, ``-0.0``, ``1e-40``."""
    single = to_float32(value)
    decimal = float(str(np.float32(single)))
    if to_float32(decimal) != single:  # it was rounded twice on its way through float64
        decimal = single
    if single == 0 and math.copysign(1, single) < 0:
        return "-0.0"
    return repr(decimal).removesuffix(".0")


def written(quantity: Quantity, value: float) -> str:
    """A number as program text: whole for counts and turns, else the shortest decimal."""
    return str(int(to_float32(value))) if quantity.discrete else shortest(value)


def range_text(quantity: Quantity) -> str:
    """The declared range in words."""
    whole = "whole numbers " if quantity.discrete else ""
    return f"{whole}from {shortest(quantity.low)} to {shortest(quantity.high)}"


def checked(declared: Statement, parameter: Parameter, numbers: Sequence[float]) -> list[float]:
    """The numbers of one parameter, rounded to float32.

    Coordinates and lengths may be any finite number: the declared range is where programs are sampled from, and a
    negative length draws nothing.  Counts and turns must be whole; beyond their range they stay legal as far as
    float32 holds whole numbers, since a count of zero or less erases what is inside.

    Raises
    ------
    ShapeProgError
        If there are too many or too few, or one is not finite, or a count or turn is not whole or too large.
    """
    quantity = parameter.quantity
    place = f"{parameter.name} of {declared.name}"
    if len(numbers) != quantity.width:
        wanted = "1 number" if quantity.width == 1 else f"{quantity.width} numbers"
        raise ShapeProgError(f"{place} takes {wanted}, not {len(numbers)}", f"write {blank(parameter)}")
    singles = [to_float32(number) for number in numbers]
    if not quantity.discrete:
        return singles
    for number in numbers:
        if number != math.floor(number):
            raise ShapeProgError(f"{place} is {number!r}, but must be whole", f"it takes {range_text(quantity)}")
        if abs(number) > LARGEST_WHOLE:
            said = f"{place} is {int(number)}, beyond {LARGEST_WHOLE}, the end of exact whole numbers"
            raise ShapeProgError(said, f"it takes {range_text(quantity)}")
    return [single + 0.0 for single in singles]  # no minus zero


def blank(parameter: Parameter) -> str:
    """How a parameter is written, with a blank for each number: ``at=(_, _, _)``."""
    width = parameter.quantity.width
    return f"{parameter.name}=" + ("_" if width == 1 else f"({', '.join('_' * width)})")


def signature(declared: Statement) -> str:
    """How a statement is written, with a blank for each number; loops begin with ``for i in``."""
    words = [blank(parameter) for parameter in declared.parameters]
    if declared.is_loop:
        return f"for i in {declared.name}({', '.join(['_', *words[1:]])}):"
    return f"{declared.name}({', '.join(words)})"
