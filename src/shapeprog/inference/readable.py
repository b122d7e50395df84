"""Programs in a unit with the decimals that a person expects, ``45.2`` for ``45.187``: as few as the parts allow."""

from __future__ import annotations

import math

from shapeprog.inference.connecting import afloat
from shapeprog.language.dimensions import in_unit
from shapeprog.language.program import Loop, Program
from shapeprog.language.statement import language
from shapeprog.language.unit import Unit

COARSE, DRIFT = 0.03, 0.2
"""What the last decimal of a length is worth at most, in cells; times the copies of a loop that it moves."""

FINER = 3
"""How many decimals more are tried where parts come apart."""

MOST = 256
"""Most primitives of which it is looked at whether they come apart."""


def in_readable_unit(program: Program, unit: Unit | None, seed: int = 0) -> Program:
    """The program with its lengths in a unit, or in cells, rounded as coarsely as a person expects.

    A number moves by no more than .015 cells, and the copies of a loop by .1; where parts would come apart, lengths
    keep more decimals.  A program in this unit is left as it is.

    Raises
    ------
    ShapeProgError
        As for :func:`~shapeprog.language.dimensions.in_unit`.
    """
    if program.unit == unit:
        return program
    fewest, apart = _decimals(program, 1.0 if unit is None else unit.per_cell), _floating(program, seed)
    for digits in range(fewest, fewest + FINER):
        found = in_unit(program, unit, digits=digits)
        if _floating(found, seed) <= apart:
            return found
    return in_unit(program, unit)


def _decimals(program: Program, per_cell: float) -> int:
    loops = (node for node in program.walk() if isinstance(node, Loop))
    moved = (loop.count - 1 for loop in loops if any(q.kind == "shift" for q in language()[loop.name].quantities))
    return max(0, math.ceil(-math.log10(per_cell * min(COARSE, DRIFT / max(1, *moved, 1)))))


def _floating(program: Program, seed: int) -> int:
    """How many blocks hang together with the others by nothing."""
    return afloat(program, seed) if program.size <= MOST else 0
