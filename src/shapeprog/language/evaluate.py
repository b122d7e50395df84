"""Evaluation: from the syntax tree of a program to statements and loops in cells with plain numbers.

Functions are expanded.  Placed parts become statements in cells: a side, a size or an offset becomes coordinates,
``inside`` vanishes, ``row`` and ``divide`` become ``translate``.  All arithmetic is + - * /, so that the same code
evaluates with numbers, with tensors (then gradients flow), and with linear forms.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.ast import (
    Assignment,
    Call,
    Comment,
    Draw,
    Fault,
    Function,
    Group,
    Line,
    Loop,
    Part,
    Scale,
    Source,
    without_double_blanks,
)
from shapeprog.language.expression import value_at
from shapeprog.language.lowering import Context, Drawn, Lowering, Placed, Scope, sizes_of, too_deep
from shapeprog.language.placement import MOST_SOLIDS, SIZES
from shapeprog.language.program import DEEPEST, Node, Program
from shapeprog.language.statement import language
from shapeprog.language.unit import Unit
from shapeprog.space import SPAN

MOST_STATEMENTS = 1 << 16
"""Most statements, loops and calls that calls may expand to: a function may call another twice, that one a third..."""


def evaluated(source: Source) -> Program:
    """The program of a syntax tree; one of statements in cells has no source.

    Raises
    ------
    Fault
        If a name, function, argument or number in it is wrong.
    """
    if not source.placed:
        return Program(expanded(source))
    source = replace(source, lines=without_double_blanks(source.lines))
    return Program(expanded(source), source)


def placed_source(lines: tuple[Line, ...], unit: str = "", warnings: tuple[str, ...] = ()) -> Source:
    """The source of placed lines: the longest side of the whole is 24 cells, and its middle that of the grid.

    Parameters
    ----------
    lines
        Lines of which one assigns ``width``, ``depth`` and ``height``.
    unit
        Name of the unit of their lengths; empty if unknown.
    warnings
        See :class:`Source`.
    """
    names: dict[str, Any] = {}
    try:
        for line in lines:
            if isinstance(line, Assignment) and not set(SIZES) <= names.keys():
                names |= {name: value_at(value, names) for name, value in line.numbers}
        cells = SPAN / max(names[size] for size in SIZES)
        scale = Scale(cells, -names["height"] * cells / 2)
        per_cell = Unit(unit, 1 / cells)
    except (ShapeProgError, ArithmeticError):  # evaluation reports the mistake
        scale, per_cell = Scale(1.0, 0.0), Unit(unit, 1.0)
    return Source(lines, per_cell, scale, warnings)


def expanded(source: Source) -> tuple[Node, ...]:
    """The statements and loops of a program in cells, with numbers in place of expressions; a ``Fault`` if an
    expression has no value, a number does not fit its place, or there are more than ``MOST_STATEMENTS``."""
    return tuple(_Evaluator(source, None).program())


def symbolic(source: Source, values: Mapping[str, Any], origin: tuple[Any, float] | None = None) -> tuple[Node, ...]:
    """The statements and loops of a program for other values of the names that stand for plain numbers.

    The values may be tensors or linear forms; results are neither rounded nor checked.  ``origin`` is the height of the
    floor in the grid and the depth of the middle of the whole, by default those of its scale.
    """
    evaluator = _Evaluator(source, values)
    if origin is not None:
        evaluator.floor, evaluator.middle = origin
    return tuple(evaluator.program())


def provenance(source: Source) -> dict[int, list[int]]:
    """Indices of the drawing statements of the expanded program that each line draws or repeats, by its ``id``."""
    evaluator = _Evaluator(source, None)
    evaluator.program()
    return evaluator.blocks


class _Evaluator(Lowering):
    """One evaluation of a program.

    Parameters
    ----------
    source
        What to evaluate.
    values
        Values that replace those of names of the program, and switch rounding and checks off; ``None`` for neither.
    """

    def __init__(self, source: Source, values: Mapping[str, Any] | None) -> None:
        exact = values is None
        super().__init__(source, exact, iter(() if exact else _decisions(source)))
        self.given = values
        self.functions = source.functions
        self.outermost: Scope = {}
        self.expansions = 0
        self.blocks: dict[int, list[int]] = defaultdict(list)

    def program(self) -> list[Any]:
        """The statements and loops of the whole program."""
        return self.lines(self.source.lines, Context({})).nodes

    # ---- lines --------------------------------------------------------------------------------------------------

    def lines(self, lines: Sequence[Line], context: Context) -> Drawn:
        """Evaluate the lines of a program, function, loop or group; names are added to the scope of the context."""
        nodes: list[Any] = []
        new: list[Any]
        scope, calls = context.scope, context.calls
        first = None
        self.bodies += 1
        for line in lines:
            start = self.drawn
            if isinstance(line, Draw | Part | Call) and line.role and line.role not in language().roles:
                raise Fault(line, f"unknown role {line.role!r}", did_you_mean(line.role, language().roles))
            match line:
                case Comment() | Function():
                    continue
                case Assignment():
                    scope |= self._named(line, scope, calls)
                    if context.box is None and not calls and set(SIZES) <= scope.keys():
                        context = context._replace(box=self.whole(scope))
                    continue
                case Draw():
                    _check(line)
                    self.drawn += 1
                    new = [replace(line, role="" if line.role == line.name else line.role)]
                case Loop():
                    _check(line)
                    if context.loops >= DEEPEST:
                        raise too_deep(line)
                    body = self.lines(line.body, context._replace(loops=context.loops + 1)).nodes
                    new = [replace(line, body=tuple(body))]
                case Call():
                    new, element = self._call(line, context)
                    first = first or element
                case Part() | Group():
                    if self.exact and self.bodies > MOST_SOLIDS:
                        raise Fault(line, "the program evaluates too many lines", "use smaller counts")
                    self._count(line, calls)
                    drawing = self.part(line, context) if isinstance(line, Part) else self.group(line, context)
                    new, element = drawing
                    first = first or element
            self.blocks[id(line)] += range(start, self.drawn)
            nodes += new
        return Drawn(nodes, first)

    def _call(self, line: Call, context: Context) -> Drawn:
        self._count(line, context.calls + 1)
        if context.calls >= DEEPEST:
            raise Fault(line, f"functions call each other more than {DEEPEST} deep", "write some of them out")
        if line.name not in self.functions:
            raise Fault(line, f"undefined function {line.name!r}", did_you_mean(line.name, self.functions))
        function, scope = self.functions[line.name], self._arguments(line, context.scope)
        call, start = Placed.of(line, context), self.drawn
        element = self.box(call)
        scope |= sizes_of(element)
        inner = Context(scope, element, context.loops, context.calls + 1, line.role or context.role)
        nodes = self.tilted(call, self.lines(function.body, inner).nodes, element)
        self.blocks[id(function)] += range(start, self.drawn)
        return Drawn(nodes, element)

    def _count(self, line: Line, calls: int) -> None:
        """Limit what calls expand to; without calls the length of the text is the limit."""
        self.expansions += calls > 0
        if self.expansions > MOST_STATEMENTS:
            message = f"this program expands to more than {MOST_STATEMENTS} statements"
            raise Fault(line, message, "use loops in place of calls")

    def _named(self, line: Assignment, scope: Scope, calls: int) -> Scope:
        """The names of a line with their values, all evaluated before any of them is assigned."""
        values = {name: self.at(line, name, value, scope) for name, value in line.numbers}
        if not calls:
            values |= {name: number for name, number in (self.given or {}).items() if name in values}
            for name in SIZES if self.exact else ():
                if name in values and not values[name] > 0:
                    message = f"the {name} of the whole is {values[name]:g}"
                    raise Fault(line, message, "a size must be positive")
            self.outermost |= values
        return values

    def _arguments(self, line: Call, scope: Scope) -> Scope:
        """The names in a function that is called: those of the program, and its parameters."""
        function: Function = self.functions[line.name]
        parameters = dict(function.parameters)
        given = {name: self.at(line, name, v, scope) for name, v in line.arguments if name in parameters}
        for name, default in parameters.items():
            if name not in given:
                if default is None:
                    raise Fault(line, f"{line.name} needs {name}", f"write {line.name}({name}=...)")
                given[name] = self.at(function, name, default, self.outermost)
        return self.outermost | given


def _decisions(source: Source) -> list[int]:
    """The counts of loops, and which radius of each upright taper is the larger, in the order of evaluation."""
    evaluator = _Evaluator(source, None)
    evaluator.program()
    return evaluator.decisions


def _check(line: Draw | Loop) -> None:
    """Refuse a statement or loop in cells that is not declared, or with other numbers."""
    try:
        language().declaration(line.name, len(line.values))
    except ShapeProgError as error:
        raise Fault(line, error.message, error.hint) from None
