"""What a written program comes to: the statements and loops that it draws, with the numbers of its expressions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from shapeprog.errors import ShapeProgError
from shapeprog.language.checking import Fault, check
from shapeprog.language.expression import Expression, ExpressionError, Value, value_at
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import DEEPEST, Draw, Loop, Node, Program
from shapeprog.language.source import (
    Assignment,
    Call,
    Function,
    Line,
    Source,
    WrittenDraw,
    WrittenLoop,
    tidy,
)
from shapeprog.language.statement import language

MOST_STATEMENTS = 1 << 16
"""Most statements, loops and calls that calls may come to: a function may call another twice, that one a third..."""


def evaluated(source: Source) -> Program:
    """The program that is written so; one in cells without names, expressions and functions is its statements alone.

    Raises
    ------
    Fault
        If a name, function, argument or number in it is wrong.
    """
    if source.plain and source.unit is None:
        return Program(expanded(source))
    source = replace(source, lines=_tidied(source.lines))
    check(source)
    return Program(expanded(source), source)


def expanded(source: Source) -> tuple[Node, ...]:
    """The statements and loops of a program, with the numbers of its expressions in place of them, in cells.

    Raises
    ------
    Fault
        If an expression has no value, a number does not fit its place, or there are more than ``MOST_STATEMENTS``.
    """
    return tuple(_Run(source, None).block(source.lines, {}, 0, 0))


def in_own_unit(source: Source) -> tuple[Node, ...]:
    """The statements and loops of a program with the numbers that its text comes to, in its unit instead of cells."""
    return expanded(replace(source, unit=None))


@dataclass(frozen=True)
class Symbolic:
    """A statement, or a loop with its body, whose numbers may be tensors or linear forms; see ``Draw`` and ``Loop``."""

    name: str
    values: tuple[Any, ...]
    body: tuple[Symbolic, ...] | None = None

    def chains(self, *around: Symbolic) -> Iterator[tuple[Symbolic, ...]]:
        """The blocks in it, in the order of :attr:`Program.chains`."""
        if self.body is None:
            yield (*around, self)
        for inner in self.body or ():
            yield from inner.chains(*around, self)


def symbolic(source: Source, given: Mapping[str, Any]) -> tuple[Symbolic, ...]:
    """The statements and loops of a program for other numbers of the names that stand for plain ones.

    They may be tensors or linear forms; what follows from them is neither rounded nor checked.
    """
    return tuple(_Run(source, given).block(source.lines, {}, 0, 0))


def occurrences(source: Source) -> dict[int, list[Node]]:
    """What every statement and loop comes to, once for each time it is met, by the ``id`` of its line."""
    run = _Run(source, None)
    run.block(source.lines, {}, 0, 0)
    return run.met


class _Run:
    """One evaluation of a program."""

    def __init__(self, source: Source, given: Mapping[str, Any] | None) -> None:
        self.given = given
        self.unit = source.unit
        self.functions = source.functions
        self.outermost: dict[str, Any] = {}
        self.made = 0
        self.met: dict[int, list[Any]] = defaultdict(list)

    def block(
        self, lines: tuple[Line, ...], scope: dict[str, Any], loops: int, calls: int, role: str = ""
    ) -> list[Any]:
        """What the lines of a program, function or loop come to; names are added to ``scope``.

        ``role`` stands around the call that they are of.
        """
        found: list[Any] = []
        for line in lines:
            match line:
                case WrittenDraw():
                    self._count(line, calls)
                    values = self._values(line, scope)
                    exact = self.given is None
                    found.append(Draw(line.name, values, _role(line, role)) if exact else Symbolic(line.name, values))
                    self.met[id(line)].append(found[-1])
                case WrittenLoop():
                    self._count(line, calls)
                    if loops >= DEEPEST:
                        cure = "put some of them side by side"
                        raise Fault(line, f"loops are nested more than {DEEPEST} deep", cure)
                    body = tuple(self.block(line.body, scope, loops + 1, calls, role))
                    kind = Loop if self.given is None else Symbolic
                    loop = kind(line.name, self._values(line, scope), body)
                    self.met[id(line)].append(loop)
                    found += body if calls and _once(loop) else [loop]
                case Call():
                    self._count(line, calls + 1)
                    if calls >= DEEPEST:
                        raise Fault(
                            line, f"functions call each other more than {DEEPEST} deep", "write some of them out"
                        )
                    inner = self.functions[line.name].body
                    found += self.block(inner, self._inner(line, scope), loops, calls + 1, line.role or role)
                case Assignment():
                    scope |= self._named(line, scope, calls)
        return found

    def _count(self, line: Line, calls: int) -> None:
        """Calls alone make more of a program than its text holds."""
        self.made += calls > 0
        if self.made > MOST_STATEMENTS:
            said = f"this program comes to more than {MOST_STATEMENTS} statements"
            raise Fault(line, said, "use loops in place of calls")

    def _named(self, line: Assignment, scope: dict[str, Any], calls: int) -> dict[str, Any]:
        """The numbers that a line names, all found before any of them has its name."""
        found = {name: _at(line, name, value, scope) for name, value in line.numbers}
        if not calls:
            found |= {name: number for name, number in (self.given or {}).items() if name in found}
            self.outermost |= found
        return found

    def _inner(self, line: Call, scope: dict[str, Any]) -> dict[str, Any]:
        """The names in a function that is called: those of the program, and its parameters."""
        given = {name: _at(line, name, value, scope) for name, value in line.arguments}
        function: Function = self.functions[line.name]
        for name, default in function.parameters:
            if name not in given:
                assert default is not None
                given[name] = _at(function, name, default, self.outermost)
        return self.outermost | given

    def _values(self, line: WrittenDraw | WrittenLoop, scope: dict[str, Any]) -> tuple[Any, ...]:
        if not any(isinstance(value, Expression) for value in line.values):
            return self._in_cells(line, line.values)
        numbers = [_at(line, slot, value, scope) for slot, value in enumerate(line.values)]
        if self.given is not None:
            return self._in_cells(line, numbers)
        for parameter in language()[line.name].parameters:
            slots = parameter.slots
            written = [isinstance(value, Expression) for value in line.values[slots]]
            if any(written):
                try:
                    numbers[slots] = parameter.checked(line.name, [to_float32(number) for number in numbers[slots]])
                except ShapeProgError as mistake:
                    key = slots.start + written.index(True)
                    raise Fault(line, mistake.message, mistake.hint, key) from None
        return self._in_cells(line, numbers)

    def _in_cells(self, line: WrittenDraw | WrittenLoop, numbers: Sequence[Any]) -> tuple[Any, ...]:
        """The numbers of a statement or loop, of which coordinates and lengths are in the unit of the text."""
        if self.unit is None:
            return tuple(numbers)
        found = list(numbers)
        for slot, quantity in enumerate(language()[line.name].quantities):
            if quantity.spatial:
                found[slot] = numbers[slot] / self.unit.per_cell
                if self.given is None:
                    try:
                        found[slot] = to_float32(found[slot])
                    except ShapeProgError as mistake:
                        raise Fault(line, "in cells this number is too large", mistake.hint, slot) from None
        return tuple(found)


def _once(loop: Loop | Symbolic) -> bool:
    """Whether a loop draws its body once, where it stands: a function may be called for a row of one."""
    return loop.name == "translate" and isinstance(loop.values[0], float) and loop.values[0] == 1


def _role(line: WrittenDraw, around: str) -> str:
    """The role of a part: its own, that of its statement, which is not written, or else the one around the call."""
    return line.role or ("" if line.name == around or language().own_role(line.name) else around)


def _at(line: Line, key: int | str, value: Value, scope: dict[str, Any]) -> Any:
    try:
        return value_at(value, scope)
    except ExpressionError as mistake:
        raise Fault(line, mistake.message, mistake.hint, key, mistake.expression) from None


def _tidied(lines: tuple[Line, ...]) -> tuple[Line, ...]:
    """The lines without superfluous empty ones, in loops and functions too; what has none is left as it is."""
    found = []
    for line in lines:
        if isinstance(line, WrittenLoop | Function) and (body := _tidied(line.body)) != line.body:
            line = replace(line, body=body)
        found.append(line)
    return tidy(tuple(found))
