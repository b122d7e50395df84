"""The free numbers of a program: those that may be set without another having to follow.

They are the names that stand for plain numbers, all other plain numbers of statements, loops and calls, and those that
expressions add, in the order of the text.  Counts, turns and axes are none; neither is a zero, which says that
something is left as it is, nor what an expression multiplies or divides by, which is how it follows from others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count

from shapeprog.language.counts import Counts
from shapeprog.language.evaluation import evaluated
from shapeprog.language.expression import Binary, Expression, Negative, Value
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Program
from shapeprog.language.source import (
    Assignment,
    Call,
    Function,
    Line,
    WrittenDraw,
    WrittenLoop,
    with_values,
)
from shapeprog.language.statement import language
from shapeprog.language.text import numbers_written, source_of


def numbers(program: Program) -> int:
    """How many continuous numbers make a program: all that are written, or those that are free where others follow from
    names; counts and steps of loops are none."""
    if program.source is not None and not program.source.plain:
        return free_numbers(program)
    return sum(numbers_written(node) for node in program.walk())


def numbers_outside(program: Program) -> int:
    """The same without those inside of functions: what is said by a program whose functions are known."""
    if program.source is None:
        return numbers(program)
    lines = tuple(line for line in program.source.lines if not isinstance(line, Function))
    return len(list(_places(lines, Counts(program.source))))


def free_numbers(program: Program) -> int:
    """How many numbers of a program are free."""
    return len(free_values(program))


def free_values(program: Program) -> list[float]:
    """The free numbers of a program, in the order of its text."""
    source = source_of(program)
    return list(_places(source.lines, Counts(source)))


def multiplied(program: Program, place: int, factor: float) -> Program:
    """The program with one of its free numbers multiplied; ``place`` counts them from 0.

    A ``ShapeProgError`` if that is no program, as when an expression then divides by zero.
    """
    source, counter = source_of(program), count()
    counts = Counts(source)
    lines = tuple(_changed(line, counts, counter, place, factor) for line in source.lines)
    return evaluated(replace(source, lines=lines))


def _places(lines: tuple[Line, ...], counts: Counts) -> Iterator[float]:
    for line in lines:
        for value, free in _numbers(line, counts):
            if free:
                yield from _within(value)
        if isinstance(line, WrittenLoop | Function):
            yield from _places(line.body, counts)


def _within(value: Value) -> list[float]:
    """All that is free in a number, from left to right."""
    found: list[float] = []

    def noted(number: float) -> float:
        found.append(number)
        return number

    _mapped(value, noted)
    return found


def _numbers(line: Line, counts: Counts) -> Iterator[tuple[Value, bool]]:
    """The numbers on a line, and whether each may have free ones in it: it is continuous, and no count."""
    if isinstance(line, WrittenDraw | WrittenLoop):
        declared = language()[line.name]
        for value, quantity in zip(line.values, declared.quantities, strict=True):
            yield value, not quantity.discrete
    elif isinstance(line, Assignment):
        yield from ((value, name not in counts.outside) for name, value in line.numbers)
    elif isinstance(line, Call):
        whole = counts.of.get(line.name, ())
        yield from ((value, name not in whole) for name, value in line.arguments)


def _mapped(value: Value, change: Callable[[float], float]) -> Value:
    """The number with a change made to all that is free in it, from left to right: itself, or what it adds."""
    if not isinstance(value, Expression):
        return change(value) if value else value
    if isinstance(value, Negative):
        of = _mapped(value.of, change)
        assert isinstance(of, Expression)
        return replace(value, of=of)
    if not isinstance(value, Binary):
        return value
    adds = value.operator in ("+", "-")
    left, right = value.left, value.right
    if adds or isinstance(left, Expression):
        left = _mapped(left, change)
    if adds or (value.operator == "*" and isinstance(right, Expression)):
        right = _mapped(right, change)
    return replace(value, left=left, right=right)


def _changed(line: Line, counts: Counts, counter: Iterator[int], place: int, factor: float) -> Line:
    """The line with one free number of the program multiplied."""

    def changed(number: float) -> float:
        return to_float32(number * factor) if next(counter) == place else number

    values = [_mapped(value, changed) if free else value for value, free in _numbers(line, counts)]
    found = line if isinstance(line, Function) else with_values(line, values)
    if isinstance(found, WrittenLoop | Function):
        body = tuple(_changed(inner, counts, counter, place, factor) for inner in found.body)
        return replace(found, body=body)
    return found
