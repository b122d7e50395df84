"""The description length of a program: its statements, and the numbers and names in them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from shapeprog.language.ast import Assignment, Call, Draw, Function, Group, Line, Loop, Part, body_of, values
from shapeprog.language.expression import Binary, Negative, Value
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program
from shapeprog.language.statement import language

STATEMENT = 50
"""Price of a statement, loop or call in numbers or names.  From 30 on, functions learned from three quarters of the
validation programs shorten the others most."""


def statements(program: Program) -> int:
    """How many statements, loops and calls are written, apart from those in functions."""
    return written(source_of(program).lines)


def written(lines: Iterable[Line]) -> int:
    """How many statements, loops and calls are among some lines and in their loops, apart from those in functions."""
    return sum(isinstance(line, Draw | Loop | Part | Group | Call) for line in outside(lines))


def length(lines: Iterable[Line]) -> int:
    """The price of lines: statements, loops, calls and functions, and every number and name in them."""
    total = 0
    for line in lines:
        match line:
            case Draw() | Loop():
                total += STATEMENT + _written(line) + length(body_of(line))
            case Function():
                total += STATEMENT + len(line.parameters) + length(line.body)
            case Part() | Group() | Call():
                total += STATEMENT + sum(map(terms, values(line))) + length(body_of(line))
            case Assignment():
                total += sum(map(terms, values(line)))
    return total


def terms(value: Value) -> int:
    """How many numbers and names are in a number or expression."""
    match value:
        case Binary(_, left, right):
            return terms(left) + terms(right)
        case Negative(inner):
            return terms(inner)
    return 1


def _written(line: Draw | Loop) -> int:
    total = 0
    for parameter in language()[line.name].parameters:
        values = line.values[parameter.slots]
        silent = parameter.unsaid is not None and values == (parameter.unsaid,)
        if parameter.quantity.written_out and not silent:
            total += sum(map(terms, values))
    return total


def outside(lines: Iterable[Line]) -> Iterator[Line]:
    """Every line outside of functions, the lines in loops and groups included."""
    for line in lines:
        if not isinstance(line, Function):
            yield line
            yield from outside(body_of(line))
