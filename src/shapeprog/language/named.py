"""The named numbers of a program: what they are, where they stand, and programs with others in their place."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass, replace

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.counts import Counts
from shapeprog.language.evaluation import evaluated, in_own_unit
from shapeprog.language.expression import Expression, Value, text_of, value_at
from shapeprog.language.parameters import LARGEST, to_float32
from shapeprog.language.program import Program
from shapeprog.language.source import Assignment, Comment, Function, Line, Source, WrittenLoop, values
from shapeprog.language.text import line_of


@dataclass(frozen=True)
class Named:
    """A named number of a program.

    Parameters
    ----------
    name, value
        What it is called, and the number that it stands for; lengths are in the unit of the text.
    text
        How it is written: a number, or an expression of others.
    free
        Whether it depends on no other name, so that it can be set.
    whole
        Whether it says how often something is repeated, or how far by quarters.
    lines
        The lines of :func:`~shapeprog.language.text.format_program`, from 1, that use it.
    """

    name: str
    value: float
    text: str
    free: bool
    whole: bool
    lines: tuple[int, ...]


def inline(program: Program) -> Program:
    """The program written out: statements and loops with plain numbers, in the unit of its text."""
    if program.source is None or program.unit is None:
        return Program(program.body)
    return evaluated(Source(tuple(map(line_of, in_own_unit(program.source))), program.unit))


def names(program: Program) -> list[Named]:
    """The named numbers of a program in the order of its text; none if it is plain.

    Names inside of functions are not among them: they stand for another number in every call.
    """
    if program.source is None:
        return []
    known: dict[str, float] = {}
    rows: dict[str, list[int]] = {name: [] for name in program.source.numbers}
    first = 1 if program.unit is None else 2
    for row, line, local in _rows(program.source.lines, first, frozenset()):
        used = {name.name for value in values(line) if isinstance(value, Expression) for name in value.names()}
        for name in used - local:
            rows[name].append(row)
    found, whole = [], Counts(program.source).outside
    for name, value in program.source.numbers.items():
        known[name] = value_at(value, known)
        found.append(Named(name, known[name], text_of(value), _is_free(value), name in whole, tuple(rows[name])))
    return found


def set(program: Program, changes: Mapping[str, float] | None = None, /, **numbers: float) -> Program:
    """The program with other numbers for some of its names, in the unit of its text: ``set(program, seat=11)``.

    Raises
    ------
    ShapeProgError
        If it has no such name, the name follows from others, or the program cannot be drawn with such numbers.
    """
    wanted = {**(changes or {}), **numbers}
    if not wanted:
        return program
    source = program.source or Source()
    known = source.numbers
    for name in wanted:
        if name not in known:
            hint = did_you_mean(name, known) if known else "it has no names: write name = number at its top"
            raise ShapeProgError(f"this program has no name {name!r}", hint)
        if not abs(wanted[name]) <= LARGEST:  # neither is what is no number at all
            raise ShapeProgError(
                f"{name} = {wanted[name]:g} is too large for single precision, or not finite", "write one such as 12.5"
            )
        value = known[name]
        if isinstance(value, Expression) and not _is_free(value):
            others = dict.fromkeys(each.name for each in value.names())
            cure = f"set {' or '.join(others)}, or edit the text"
            raise ShapeProgError(f"{name} follows from other numbers: {name} = {value}", cure)
    return evaluated(replace(source, lines=tuple(_set(line, wanted) for line in source.lines)))


def _set(line: Line, wanted: Mapping[str, float]) -> Line:
    if not isinstance(line, Assignment):
        return line
    pairs = ((name, to_float32(wanted[name]) if name in wanted else value) for name, value in line.numbers)
    return replace(line, numbers=tuple(pairs))


def _is_free(value: Value) -> bool:
    return not isinstance(value, Expression) or not any(value.names())


def _rows(
    lines: tuple[Line, ...], row: int, local: frozenset[str]
) -> Generator[tuple[int, Line, frozenset[str]], None, int]:
    """Every line with its row in the text, and the names of the function around it; returns the row below them."""
    for line in lines:
        yield row, line, local
        row += 1
        if isinstance(line, WrittenLoop | Function):
            own = local
            if isinstance(line, Function):
                named = (name for each in line.body if isinstance(each, Assignment) for name, _ in each.numbers)
                own = frozenset([*named, *(name for name, _ in line.parameters)])
            row = yield from _rows(line.body, row, own)
            row += all(isinstance(inner, Comment) for inner in line.body)  # for the word pass
    return row
