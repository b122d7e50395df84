"""Dimensions of the numbers of a program: lengths, plain numbers such as angles, and counts.

The dimension of a number follows from its use: keywords and slots have a dimension; the terms of a sum have the same;
in products, powers of length add up.  Lengths are rescaled when a program is written in another unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Literal, NamedTuple, TypeAlias

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import (
    Assignment,
    Call,
    Draw,
    Function,
    Group,
    Keywords,
    Line,
    Loop,
    Part,
    Point,
    Scale,
    Source,
    body_of,
    with_values,
)
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import Binary, Expression, Linear, Name, Negative, Value, text_of
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import BOX, SIZES
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program
from shapeprog.language.statement import language
from shapeprog.language.unit import Unit

DIGITS = 6  # digits of a length that is converted: float32 has two more, which would show that it was
FEWEST = 2  # digits that lengths have at least where they are rounded, so that thin parts keep their thickness

_NOTHING = 1e-9
_PLAIN = ("tilt", "turn", "step")

Change: TypeAlias = Callable[[float, float], float]
Scope: TypeAlias = Callable[[str], str]  # the name that a local name has in the whole program


class Use(NamedTuple):
    """A number on a line and its use: a name or parameter has the dimension of all of its uses."""

    value: Value
    kind: Literal["length", "plain", "count", "named"]
    name: str = ""


def uses(line: Line) -> Iterator[Use]:
    """The numbers on a line with their uses, in the order of :func:`~shapeprog.language.ast.values`."""
    match line:
        case Draw() | Loop():
            for value, quantity in zip(line.values, language()[line.name].quantities, strict=True):
                yield Use(value, "count" if quantity.discrete else "length" if quantity.spatial else "plain")
        case Part(keywords=keywords):
            yield from _keywords(keywords)
        case Group(keywords=keywords, count=count):
            if count is not None:
                yield Use(count, "count")
            yield from _keywords(keywords)
        case Assignment(pairs):
            yield from (Use(value, "named", name) for name, value in pairs)
        case Call(function, arguments):
            for name, value in arguments:
                if name in (*BOX, "tilt"):
                    yield Use(value, "plain" if name == "tilt" else "length")
                else:
                    yield Use(value, "named", f"{function}.{name}")
        case Function(function, parameters):
            yield from (Use(value, "named", f"{function}.{name}") for name, value in parameters if value is not None)


def _keywords(keywords: Keywords) -> Iterator[Use]:
    for word, argument in keywords:
        numbers = [value for _, value in argument.keywords] if isinstance(argument, Point) else argument
        for value in numbers if isinstance(numbers, list | tuple) else [numbers]:
            yield Use(value, "plain" if word in _PLAIN else "length")


class Counts:
    """Names and parameters that are written for a count, turn or axis of a loop, or passed on to one.

    Attributes
    ----------
    of
        The parameters of each function, and names in it, by the name of the function.
    outside
        The names of the program itself.
    """

    def __init__(self, source: Source) -> None:
        self.of: dict[str, set[str]] = {}
        for function in source.functions.values():  # each calls those above it
            self.of[function.name] = self._within(function.body)
        self.outside = self._within(tuple(line for line in source.lines if not isinstance(line, Function)))
        for function in source.functions.values():
            self.outside |= self.of[function.name] - {name for name, _ in function.parameters}

    def has(self, use: Use) -> bool:
        """Whether a number is a count."""
        function, _, name = use.name.rpartition(".")
        return use.kind == "count" or (use.kind == "named" and name in self.of.get(function, self.outside))

    def _within(self, lines: tuple[Line, ...]) -> set[str]:
        counted = (use for line in Source(lines).walk() for use in uses(line) if use.kind == "count" or "." in use.name)
        return {
            use.value.name
            for use in counted
            if isinstance(use.value, Name) and (use.kind == "count" or use.name.rpartition(".")[2] in self._of(use))
        }

    def _of(self, use: Use) -> set[str]:
        return self.of.get(use.name.rpartition(".")[0], set())


def in_unit(program: Program, unit: Unit | None, *, digits: int | None = None) -> Program:
    """The same program with its lengths written in a unit, or in cells; unchanged if it is in this unit.

    Parameters
    ----------
    digits
        Decimals to which lengths are rounded; else they keep six digits.

    Raises
    ------
    ShapeProgError
        If a name is a length in one use, and another number elsewhere.
    """
    source = source_of(program)
    if source.placed and unit is None:
        unit = Unit("", 1.0)
    if source.unit == unit:
        return program
    before, after = (1.0 if system is None else system.per_cell for system in (source.unit, unit))

    def change(number: float, power: float) -> float:
        if not power or not number:
            return number
        new = number * (after / before) ** power
        if digits is None or power != 1:
            return to_float32(float(f"{new:.{DIGITS}g}"))
        return to_float32(round(new, max(digits, FEWEST - 1 - math.floor(math.log10(abs(new))))))

    result = Source(_Powers(source).changed(source.lines, str, change), unit)
    if source.placed:
        height = result.evaluated_numbers()["height"]
        result = replace(result, scale=Scale(1 / after, -height / after / 2))
    return evaluated(result)


def lengths(program: Program) -> frozenset[str]:
    """The named numbers of a program that are lengths; none if one is a length in one place only."""
    source = source_of(program)
    try:
        powers = _Powers(source)
    except ShapeProgError:
        return frozenset()
    return frozenset(name for name in source.numbers if powers.of(Linear.of(name)) == 1)


class _Powers:
    """The powers of length that the names and literals of a program have."""

    def __init__(self, source: Source) -> None:
        self._known: dict[str, Linear] = {}
        self._literals: dict[tuple[int, int], Linear] = {}
        for size in SIZES if source.placed else ():
            self._known[size] = Linear(1.0)
        self._look(source.lines, str)
        for literal in reversed(self._literals.values()):  # factors and divisors are plain numbers where they may be
            self._holds(literal)

    def of(self, power: Linear) -> float:
        """A power as a number; what may have any has none."""
        return self._reduced(power).constant

    def changed(self, lines: tuple[Line, ...], scope: Scope, change: Change) -> tuple[Line, ...]:
        """Some lines with every literal changed by what its power is."""
        result = []
        for line in lines:
            pairs = self._wanted(line, scope)
            new = with_values(line, [self._changed(value, self.of(power), scope, change) for value, power in pairs])
            if isinstance(new, Loop | Group | Function):
                new = replace(new, body=self.changed(new.body, _inside(line, scope), change))
            result.append(new)
        return tuple(result)

    def _changed(self, value: Value, power: float, scope: Scope, change: Change) -> Value:
        match value:
            case Binary("+" | "-" as sign, left, right):
                return Binary(sign, *(self._changed(side, power, scope, change) for side in (left, right)))
            case Binary(sign, left, right):
                sides = zip((left, right), map(self.of, self._factors(value, scope)), strict=True)
                return Binary(sign, *(self._changed(side, inner_power, scope, change) for side, inner_power in sides))
            case Negative(inner):
                return -self._changed(inner, power, scope, change)
            case Expression():
                return value
        return change(value, power)

    def _look(self, lines: tuple[Line, ...], scope: Scope) -> None:
        """Collect the equations of powers that the lines imply."""
        for line in lines:
            for value, power in self._wanted(line, scope):
                if isinstance(value, Expression):
                    self._agree(value, self._power(value, scope), power)
            self._look(body_of(line), _inside(line, scope))

    def _wanted(self, line: Line, scope: Scope) -> Iterator[tuple[Value, Linear]]:
        """The numbers on a line, as ``values`` has them, and the power that each is to have."""
        for use in uses(line):
            name = use.name if "." in use.name else scope(use.name)
            yield use.value, Linear.of(name) if use.kind == "named" else Linear(float(use.kind == "length"))

    def _power(self, value: Expression, scope: Scope) -> Linear:
        """The power of an expression, linear in those that are not known."""
        match value:
            case Name(name):
                return Linear.of(scope(name))
            case Negative(inner):
                return self._power(inner, scope)
            case Binary("*" | "/" as sign):
                first, second = self._factors(value, scope)
                return first + second if sign == "*" else first - second
            case Binary(_, left, right):
                powers = [self._power(side, scope) for side in (left, right) if isinstance(side, Expression)]
                if not powers:
                    return self._literal(value, 0)
                self._agree(value, powers[0], powers[-1])
                return powers[0]
        raise TypeError(f"{value!r} is not an expression")

    def _factors(self, value: Binary, scope: Scope) -> tuple[Linear, Linear]:
        """The powers of both sides of a product or quotient."""
        first, second = (
            self._power(side, scope) if isinstance(side, Expression) else self._literal(value, index)
            for index, side in enumerate((value.left, value.right))
        )
        return first, second

    def _literal(self, value: Binary, index: int) -> Linear:
        """The power of a literal in an expression, which is not known as yet."""
        return self._literals.setdefault((id(value), index), Linear.of(f"#{len(self._literals)}"))

    def _agree(self, value: Expression, first: Linear, second: Linear) -> None:
        if not self._holds(first - second):
            message = f"{text_of(value)} stands for a length in one place, and for another number elsewhere"
            raise ShapeProgError(message, "give each of them a name of its own, or keep the unit")

    def _holds(self, power: Linear) -> bool:
        """Whether a power may be zero; from now on it is."""
        power = self._reduced(power)
        if not power.factors:
            return abs(power.constant) < _NOTHING
        name, factor = power.factors[0]
        self._known[name] = (power - Linear.of(name) * factor) / -factor
        return True

    def _reduced(self, power: Linear) -> Linear:
        """A power, linear in those that are free."""
        while name := next((name for name, _ in power.factors if name in self._known), None):
            power = power + (self._known[name] - Linear.of(name)) * dict(power.factors)[name]
        return replace(power, factors=tuple(pair for pair in power.factors if abs(pair[1]) > _NOTHING))


def _inside(line: Line, scope: Scope) -> Scope:
    """The scope of the lines in a loop or function."""
    if not isinstance(line, Function):
        return scope
    names = line.names
    return lambda name: f"{line.name}.{name}" if name in names else name
