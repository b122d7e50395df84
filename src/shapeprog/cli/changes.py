"""Changes of named numbers on the command line: ``--set seat=11 'width*=1.2'``."""

from __future__ import annotations

import operator
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from shapeprog.errors import InputError, ShapeProgError

if TYPE_CHECKING:
    from shapeprog.language.program import Program

CHANGE = re.compile(r"([^\W\d]\w*)\s*([-+*/]?)=\s*(.*)", re.DOTALL)
DIGITS = 7  # of numbers that are computed: those that float32 holds
_APPLY = {"": lambda _, number: number, "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


def changed(program: Program, changes: Sequence[str]) -> tuple[Program, list[str]]:
    """The program with other numbers for some of its names, one change after another, and a warning that names the
    parts that come apart.

    Raises
    ------
    InputError
        If a change is none.
    ShapeProgError
        If the program has no such name, or cannot be drawn so, with the range within which it can.
    """
    if not changes:
        return program, []
    from shapeprog.language.named import loose_parts, loosened, names, ranges_of
    from shapeprog.language.named import set as set_numbers
    from shapeprog.language.parameters import shortest

    values = {named.name: float(shortest(named.value)) for named in names(program)}
    wanted: dict[str, float] = {}
    for change in changes:
        match = CHANGE.fullmatch(change.strip())
        if match is None:
            raise InputError(f"invalid change {change!r}", "write name=number, or name*=number with one of + - * /")
        name, sign, text = match.groups()
        try:
            number = float(text)
            result = _APPLY[sign](wanted.get(name, values.get(name, number)), number)
            wanted[name] = float(f"{result:.{DIGITS}g}") if sign else result
        except ValueError:
            unit = f", {program.unit.name}" if program.unit and program.unit.name else ""
            cure = f"write a number such as 11 or 1.2; lengths are in the unit of the program{unit}"
            raise InputError(f"{change!r}: {text!r} is not a number", cure) from None
        except ZeroDivisionError:
            raise InputError(f"{change!r} divides by zero", "divide by another number") from None
    numbers = ", ".join(f"{name}={number:g}" for name, number in wanted.items())
    try:
        edited = set_numbers(program, wanted)
    except ShapeProgError as error:
        if not wanted.keys() <= values.keys():
            raise
        hint = f"{error.hint}{_allowed(ranges_of(program, wanted))}"
        raise ShapeProgError(f"with --set {numbers}: {error.message}", hint) from None
    ranges, loose = loosened(program, edited, wanted), Counter(loose_parts(program, edited))
    if ranges is None and not loose:
        return edited, []
    named = ", ".join(word if count == 1 else f"{word} ({count} times)" for word, count in loose.items())
    trouble = f"parts come apart: {named}" if loose else "parts come apart or vanish"
    return edited, [f"with {numbers}: {trouble}{_allowed(ranges or {})}"]


def _allowed(ranges: Mapping[str, tuple[float, float]]) -> str:
    """The end of a sentence that names the ranges of names, if there are any."""
    known = [f"{name} may be {low + 0.0:.4g} to {high + 0.0:.4g}" for name, (low, high) in ranges.items()]
    return f"; while the other numbers are as they are, {', '.join(known)}" if known else ""
