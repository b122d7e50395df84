"""Programs in a unit, with numbers as round as a person would write them: ``34`` for ``33.99``.

The numbers are rounded one after another, each to the fewest decimals with which no face of any part moves farther than
a tolerance by all rounding.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.mesh import pieces_of_parts
from shapeprog.language.dimensions import in_unit, literal_lengths
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Program
from shapeprog.language.tensors import encode
from shapeprog.language.unit import Unit
from shapeprog.language.unroll import Plan, unroll

TOLERANCES = (0.015, 0.01, 0.004, 0.001)  # how far a face may move, in cells; the smaller ones where parts come apart
IN_CELLS = TOLERANCES[2:]  # the tolerances for programs in cells
STEP = 4e-3  # change of a number, in cells, by which slopes are measured
ROUNDING = 1e-5  # cells that float32 may add to a move


def in_readable_unit(program: Program, unit: Unit | None) -> Program:
    """The program with its lengths in a unit, or in cells, rounded as a person would.

    No number, and no face of the box around a part, moves by more than .015 cells; where parts would come apart, by
    less.  A program of more than 256 primitives is not rounded, and one in this unit is returned unchanged.  What
    ``in_unit`` refuses is refused.
    """
    if program.unit == unit:
        return program
    exact = in_unit(program, unit)
    if not 0 < exact.size <= 256:  # rounding takes long for more primitives
        return exact
    pieces = _pieces(program)
    for tolerance in TOLERANCES if unit is not None else IN_CELLS:
        result = _rounded(exact, tolerance)
        if result is not None and _pieces(result) <= pieces:
            return result
    return exact


def _pieces(program: Program) -> int:
    """The number of connected solids besides the largest."""
    return int(pieces_of_parts(unroll(program)).max(initial=0))


def _rounded(program: Program, tolerance: float) -> Program | None:
    """The program with rounded numbers; ``None`` if the box around a part then moves by more than the tolerance.

    The moves are added up, as if they were linear in the numbers.  Those of nearly upright bars are not, so the result
    is evaluated.
    """
    lengths, with_numbers = literal_lengths(program)
    per_cell = 1.0 if program.unit is None else program.unit.per_cell
    farthest, step = tolerance * per_cell, STEP * per_cell
    try:
        changed = (with_numbers([*lengths[:k], length + step, *lengths[k + 1 :]]) for k, length in enumerate(lengths))
        before, *others = _faces([program, *changed])
        slopes = [(faces - before) / step for faces in others]
        numbers, moved = [*lengths], torch.zeros_like(before)
        for share in (0.5, 1.0):  # of the tolerance: numbers that are nearly round go first
            for k, length in enumerate(lengths):
                for tried in _rounder(length, share * farthest):
                    then = moved + (tried - numbers[k]) * slopes[k]
                    if float(then.abs().max()) <= share * tolerance + ROUNDING:
                        numbers[k], moved = tried, then
                        break
        result = with_numbers(numbers)
        (after,) = _faces([result])
    except ShapeProgError:  # something has no size any more
        return None
    return result if float((after - before).abs().max()) <= tolerance + ROUNDING else None


def _rounder(number: float, farthest: float) -> Iterator[float]:
    """Numbers near one, those with the fewest decimals first; zero, or at most 3 % off: thin parts stay as thick."""
    if abs(number) <= farthest:
        yield 0.0
    farthest = min(farthest, 0.03 * abs(number))
    fewest, maximum = (-math.floor(math.log10(value)) for value in (abs(number), farthest))
    for digits in range(fewest - 1, maximum + 2):  # finer than one number alone needs
        nearest, step = round(number, digits), math.copysign(10.0**-digits, number - round(number, digits))
        for tried in (to_float32(nearest), to_float32(round(nearest + step, digits))):
            if abs(tried - number) <= farthest:
                yield tried


def _faces(programs: list[Program]) -> Float[Tensor, "B N 2 3"]:
    """The lowest and highest corners of the boxes around the primitives of programs that differ in numbers alone, along
    the axes of the grid."""
    code = encode(programs, dtype=torch.float64)
    scene = Plan(code).scene(code.parameters)
    return torch.stack([scene.centre - scene.reach, scene.centre + scene.reach], -2)
