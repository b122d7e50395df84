"""Programs with their lengths written in another unit.

Every literal that stands for a length is multiplied.  Which these are follows from where numbers end up: those of
statements are lengths, or they are angles or counts; what is added up is alike; powers of length add up in products.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeAlias

from shapeprog.errors import ShapeProgError
from shapeprog.language.evaluation import evaluated
from shapeprog.language.expression import Binary, Expression, Linear, Name, Negative, Value, text_of
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Program
from shapeprog.language.source import (
    Assignment,
    Call,
    Function,
    Line,
    Source,
    WrittenDraw,
    WrittenLoop,
    with_values,
)
from shapeprog.language.statement import language
from shapeprog.language.text import source_of
from shapeprog.language.unit import Unit

DIGITS = 6
"""Digits of a length that is converted: float32 has two more, which would show that it was."""

FEWEST = 2
"""Digits that lengths have at least where they are rounded, so that thin parts keep their thickness."""

_NOTHING = 1e-9

Change: TypeAlias = Callable[[float, float], float]
Scope: TypeAlias = Callable[[str], str]
"""What a name is called among those of the whole program."""


def in_unit(program: Program, unit: Unit | None, *, digits: int | None = None) -> Program:
    """The same program with its lengths written in a unit, or in cells; one in this unit is left as it is.

    Parameters
    ----------
    digits
        Decimals to which lengths are rounded; else they keep six digits.

    Raises
    ------
    ShapeProgError
        If a name stands for a length in one place, and for another number elsewhere.
    """
    source = source_of(program)
    if source.unit == unit:
        return program
    before, after = (1.0 if each is None else each.per_cell for each in (source.unit, unit))

    def change(number: float, power: float) -> float:
        if not power or not number:
            return number
        found = number * (after / before) ** power
        if digits is None or power != 1:
            return to_float32(float(f"{found:.{DIGITS}g}"))
        return to_float32(round(found, max(digits, FEWEST - 1 - math.floor(math.log10(abs(found))))))

    return evaluated(Source(_Powers(source).changed(source.lines, str, change), unit))


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
        self._look(source.lines, str)
        for literal in reversed(self._literals.values()):  # factors and divisors are plain numbers where they may be
            self._holds(literal)

    def of(self, power: Linear) -> float:
        """A power as a number; what may have any has none."""
        return self._reduced(power).constant

    def changed(self, lines: tuple[Line, ...], scope: Scope, change: Change) -> tuple[Line, ...]:
        """Some lines with every literal changed by what its power is."""
        found = []
        for line in lines:
            pairs = self._wanted(line, scope)
            new = with_values(line, [self._changed(value, self.of(power), scope, change) for value, power in pairs])
            if isinstance(new, WrittenLoop | Function):
                new = replace(new, body=self.changed(new.body, _inside(line, scope), change))
            found.append(new)
        return tuple(found)

    def _changed(self, value: Value, power: float, scope: Scope, change: Change) -> Value:
        match value:
            case Binary("+" | "-" as sign, left, right):
                return Binary(sign, *(self._changed(side, power, scope, change) for side in (left, right)))
            case Binary(sign, left, right):
                sides = zip((left, right), map(self.of, self._factors(value, scope)), strict=True)
                return Binary(sign, *(self._changed(side, own, scope, change) for side, own in sides))
            case Negative(inner):
                return -self._changed(inner, power, scope, change)
            case Expression():
                return value
        return change(value, power)

    def _look(self, lines: tuple[Line, ...], scope: Scope) -> None:
        """Find what the lines say of powers."""
        for line in lines:
            for value, wanted in self._wanted(line, scope):
                if isinstance(value, Expression):
                    self._agree(value, self._power(value, scope), wanted)
            if isinstance(line, WrittenLoop | Function):
                self._look(line.body, _inside(line, scope))

    def _wanted(self, line: Line, scope: Scope) -> Iterator[tuple[Value, Linear]]:
        """The numbers on a line, as ``values`` has them, and the power that each is to have."""
        match line:
            case WrittenDraw() | WrittenLoop():
                for value, quantity in zip(line.values, language()[line.name].quantities, strict=True):
                    yield value, Linear(float(quantity.spatial))
            case Assignment():
                yield from ((value, Linear.of(scope(name))) for name, value in line.numbers)
            case Call(function, given) | Function(function, given):
                for name, number in given:
                    if number is not None:
                        yield number, Linear.of(f"{function}.{name}")

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
            self._power(side, scope) if isinstance(side, Expression) else self._literal(value, place)
            for place, side in enumerate((value.left, value.right))
        )
        return first, second

    def _literal(self, value: Binary, place: int) -> Linear:
        """The power of a literal in an expression, which is not known as yet."""
        return self._literals.setdefault((id(value), place), Linear.of(f"#{len(self._literals)}"))

    def _agree(self, value: Expression, one: Linear, other: Linear) -> None:
        if not self._holds(one - other):
            said = f"{text_of(value)} stands for a length in one place, and for another number elsewhere"
            raise ShapeProgError(said, "give each of them a name of its own, or keep the unit")

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
    local = (name for inner in line.body if isinstance(inner, Assignment) for name, _ in inner.numbers)
    own = {*local, *(name for name, _ in line.parameters)}
    return lambda name: f"{line.name}.{name}" if name in own else name
