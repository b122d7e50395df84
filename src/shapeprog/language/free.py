"""The free numbers of a program: those that may be set without another having to follow.

They are the names of plain numbers, all other plain numbers of statements, loops and calls, and the terms of sums in
expressions, in the order of the text.  Counts, turns and axes are not free; neither are zeros, which change nothing,
nor the factors and divisors of an expression, which define how it depends on names.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from shapeprog.language.ast import Function, Source
from shapeprog.language.dimensions import counted_names, is_count, uses
from shapeprog.language.expression import Binary, Expression, Negative, Value
from shapeprog.language.printer import numbers_written, source_of
from shapeprog.language.program import Program


def numbers(program: Program) -> int:
    """How many continuous numbers make a program: all that are written, or those that are free where others follow from
    names; counts and steps of loops are none."""
    if program.source is not None:
        return free_numbers(program)
    return sum(numbers_written(node) for node in program.walk())


def numbers_outside(program: Program) -> int:
    """The same without those inside of functions: the numbers of a program that shares its functions with others."""
    return numbers(program) if program.source is None else len(free_values(program, functions=False))


def free_numbers(program: Program) -> int:
    """How many numbers of a program are free."""
    return len(free_values(program))


def free_values(program: Program, functions: bool = True) -> list[float]:
    """The free numbers of a program in the order of its text, with or without those inside of functions.

    Defaults of parameters are not free.
    """
    source, result = source_of(program), list[float]()
    counted = counted_names(source)

    def noted(number: float) -> float:
        result.append(number)
        return number

    for line in Source(tuple(line for line in source.lines if functions or not isinstance(line, Function))).walk():
        for use in () if isinstance(line, Function) else uses(line):
            if not is_count(use, counted):
                mapped(use.value, noted)
    return result


def mapped(value: Value, change: Callable[[float], float]) -> Value:
    """The value with a change made to its free numbers, from left to right: a plain number, or the terms of a sum."""
    if not isinstance(value, Expression):
        return change(value) if value else value
    if isinstance(value, Negative):
        of = mapped(value.of, change)
        assert isinstance(of, Expression)
        return replace(value, of=of)
    if not isinstance(value, Binary):
        return value
    adds = value.operator in ("+", "-")
    first, second = value.left, value.right
    if adds or isinstance(first, Expression):
        first = mapped(first, change)
    if adds or (value.operator == "*" and isinstance(second, Expression)):
        second = mapped(second, change)
    return replace(value, left=first, right=second)
