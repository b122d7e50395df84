"""A program as it is written: named numbers, expressions, functions and comments, line by line, as immutable values.

What it means is found in :mod:`shapeprog.language.evaluation`, its text in :mod:`shapeprog.language.text`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

from shapeprog.language.expression import Expression, Value
from shapeprog.language.unit import Unit


@dataclass(frozen=True)
class Comment:
    """A comment on a line of its own, without its ``#``; an empty line if there is nothing in it."""

    text: str = ""


@dataclass(frozen=True)
class Assignment:
    """``width, depth = 10.2, 9``: named numbers; ``note`` is the comment behind them, as in all that follow."""

    numbers: tuple[tuple[str, Value], ...]
    note: str = ""


@dataclass(frozen=True)
class WrittenDraw:
    """A drawing statement, its numbers in slot order, and the role around it, see ``Draw``."""

    name: str
    values: tuple[Value, ...]
    role: str = ""
    note: str = ""


@dataclass(frozen=True)
class WrittenLoop:
    """A loop, its numbers in slot order, and the lines that it repeats, see ``Loop``."""

    name: str
    values: tuple[Value, ...]
    body: tuple[Line, ...]
    note: str = ""


@dataclass(frozen=True)
class Call:
    """``leg(posts(height=seat))``: the lines of a function, with a number for each parameter that has no default.

    A role around it is that of all parts in it that have none of their own.
    """

    name: str
    arguments: tuple[tuple[str, Value], ...]
    note: str = ""
    role: str = ""


@dataclass(frozen=True)
class Function:
    """``def legs(height, thick=2):`` with the lines of its body; ``None`` is a parameter without a default."""

    name: str
    parameters: tuple[tuple[str, Value | None], ...]
    body: tuple[Line, ...]
    note: str = ""


Line: TypeAlias = Comment | Assignment | WrittenDraw | WrittenLoop | Call | Function


@dataclass(frozen=True)
class Source:
    """A program as its lines, in the order of the text, and the unit of its lengths, cells where there is none."""

    lines: tuple[Line, ...] = ()
    unit: Unit | None = None

    @property
    def plain(self) -> bool:
        """Whether plain numbers in statements and loops are all there is, beside comments."""
        named = (isinstance(line, Assignment | Call | Function) for line in self.walk())
        return not any(named) and not any(isinstance(each, Expression) for line in self.walk() for each in values(line))

    @property
    def functions(self) -> dict[str, Function]:
        """The functions by name."""
        return {line.name: line for line in self.lines if isinstance(line, Function)}

    @property
    def numbers(self) -> dict[str, Value]:
        """The named numbers of the program itself, not those inside of functions, in the order of the text."""
        given = (line.numbers for line in self.lines if isinstance(line, Assignment))
        return dict(pair for pairs in given for pair in pairs)

    def walk(self) -> Iterator[Line]:
        """Every line in the order of the text, those in loops and functions included."""
        stack = [*reversed(self.lines)]
        while stack:
            yield (line := stack.pop())
            stack += reversed(line.body) if isinstance(line, WrittenLoop | Function) else ()


def values(line: Line) -> tuple[Value, ...]:
    """The numbers and expressions on a line, in the order of its text."""
    match line:
        case WrittenDraw() | WrittenLoop():
            return line.values
        case Assignment(pairs) | Call(arguments=pairs):
            return tuple(value for _, value in pairs)
        case Function():
            return tuple(default for _, default in line.parameters if default is not None)
        case _:
            return ()


def with_values(line: Line, found: Iterable[Value]) -> Line:
    """The line with other numbers and expressions, as many as :func:`values` gives."""
    new = iter(found)
    match line:
        case WrittenDraw() | WrittenLoop():
            return replace(line, values=tuple(new))
        case Assignment(pairs):
            return replace(line, numbers=tuple((name, next(new)) for name, _ in pairs))
        case Call(arguments=pairs):
            return replace(line, arguments=tuple((name, next(new)) for name, _ in pairs))
        case Function(parameters=given):
            return replace(line, parameters=tuple((name, None if v is None else next(new)) for name, v in given))
        case _:
            return line


def names_of(source: Source) -> set[str]:
    """All names of numbers: those of the program, and those inside of functions."""
    lines = list(source.walk())
    found = {name for line in lines if isinstance(line, Assignment) for name, _ in line.numbers}
    return found | {name for line in lines if isinstance(line, Function) for name, _ in line.parameters}


def tidy(lines: tuple[Line, ...]) -> tuple[Line, ...]:
    """The lines of a block without empty ones at its ends, or one behind another."""
    kept: list[Line] = []
    for line in lines:
        if line != Comment() or (kept and kept[-1] != Comment()):
            kept.append(line)
    return tuple(kept[:-1] if kept and kept[-1] == Comment() else kept)
