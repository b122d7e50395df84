"""The named numbers of a program: their values, the lines that use them, and programs with other values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.ast import Assignment, Fault, Line, Source
from shapeprog.language.dimensions import Counts
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import names_in, text_of
from shapeprog.language.parameters import LARGEST, to_float32
from shapeprog.language.printer import printed
from shapeprog.language.program import Program
from shapeprog.language.ranges import Number, ranges


@dataclass(frozen=True)
class Named:
    """A named number of a program.

    Parameters
    ----------
    name, value
        Its name, and its value; lengths are in the unit of the text.
    text
        How it is written: a number, or an expression of others.
    free
        Whether it depends on no other name, so that it can be set.
    whole
        Whether it is a number of copies or of quarter turns.
    ranges
        Finds the ranges of all free names.
    """

    name: str
    value: float
    text: str
    free: bool
    whole: bool
    ranges: Callable[[], Mapping[str, tuple[float, float]]] = field(default=dict, compare=False, repr=False)

    @property
    def range(self) -> tuple[float, float] | None:
        """The lowest and the highest value, up to three times the present one, with which the parts hang together and
        none vanishes, while all other names are as they are; ``None`` unless it is free.  Takes a moment."""
        return self.ranges().get(self.name)


def inline(program: Program) -> Program:
    """The program written out: statements and loops in cells with plain numbers."""
    return Program(program.body)


def names(program: Program) -> list[Named]:
    """The named numbers of a program in the order of its text; none if it is plain.

    Names inside of functions are not among them: their value differs from call to call.
    """
    if program.source is None:
        return []
    numbers = program.source.evaluated_numbers()
    counted = Counts(program.source).outside
    result: list[Named] = []

    @cache
    def found() -> dict[str, tuple[float, float]]:
        free = [Number(named.name, named.value, named.whole) for named in result if named.free]
        return ranges(program, free, partial(_edited, program))

    for name, value in program.source.numbers.items():
        result.append(Named(name, numbers[name], text_of(value), not names_in(value), name in counted, found))
    return result


def set(program: Program, changes: Mapping[str, float] | None = None, /, **numbers: float) -> Program:
    """The program with other numbers for some of its names, in the unit of its text: ``set(program, seat=11)``.

    A number replaces an expression too.  The cells that a unit has stay the same.

    Raises
    ------
    ShapeProgError
        If it has no such name, or the program cannot be drawn with such numbers.
    """
    replacements = {**(changes or {}), **numbers}
    if not replacements:
        return program
    source = program.source or Source()
    declared = source.numbers
    for name in replacements:
        if name not in declared:
            hint = did_you_mean(name, declared) if declared else "it has no names: write name = number at its top"
            raise ShapeProgError(f"this program has no name {name!r}", hint)
        if not abs(replacements[name]) <= LARGEST:  # true of NaN, too
            message = f"{name} = {replacements[name]:g} is too large for single precision, or not finite"
            raise ShapeProgError(message, "write one such as 12.5")
    try:
        return evaluated(replace(source, lines=tuple(_set(line, replacements) for line in source.lines)))
    except Fault as fault:
        (text, _), *_ = printed(Source((fault.line,), scale=source.scale))
        raise ShapeProgError(f"{fault.message}, in {text}", fault.hint) from None


def _edited(program: Program, name: str, value: float) -> Program | None:
    try:
        return set(program, {name: value})
    except ShapeProgError:
        return None


def _set(line: Line, replacements: Mapping[str, float]) -> Line:
    if not isinstance(line, Assignment):
        return line
    pairs = ((name, to_float32(replacements[name]) if name in replacements else value) for name, value in line.numbers)
    return replace(line, numbers=tuple(pairs))
