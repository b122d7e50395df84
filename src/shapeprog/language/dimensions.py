"""Dimensions of the numbers of a program: lengths, plain numbers such as angles, and counts.

The dimension of a number follows from its use: keywords and slots have a dimension; the terms of a sum have the same;
in products, powers of length add up.  Lengths are rescaled when a program is written in another unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
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
    Source,
    body_of,
    with_values,
)
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import Binary, Expression, Name, Negative, Value, names_in, text_of
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import BOX, SIZES
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program, program_of
from shapeprog.language.statement import language
from shapeprog.language.unit import METRES, Unit
from shapeprog.space import SPAN

DIGITS = 6  # digits of a length that is converted: float32 has two more, which would show that it was
ALL_DIGITS = 9  # those of float32, for lengths that are converted back
FINEST = 1e-5  # metres to which lengths are rounded that a person has written, and the least digits that they keep
FINEST_SHARE = 1e-4  # of the longest side, to which they are rounded at most
LEAST_DIGITS = 3

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


def counted_names(source: Source) -> set[str]:
    """Names that stand for a count, turn or axis of a loop, or are passed on to one, and whole numbers that occur in
    sums and products of such alone; parameters of functions and names in them are ``function.name``."""
    used = [(use, {scope(name) for name in names_in(use.value)}) for use, scope in _scoped_uses(source.lines, str)]
    result: set[str] = set()
    size, fractional = -1, {name for name, value in source.numbers.items() if isinstance(value, float) and value % 1}
    while size < len(result):
        size = len(result)
        others = {*SIZES, *fractional}.union(
            *(names for use, names in used if not is_count(use, result) or "/" in text_of(use.value))
        )
        counts = ((use.value, names) for use, names in used if is_count(use, result))
        result |= {name for value, names in counts for name in names if isinstance(value, Name) or name not in others}
    return result


def is_count(use: Use, counted: Collection[str]) -> bool:
    """Whether a number is a count, turn or axis of a loop, or stands for one by its name."""
    return use.kind == "count" or use.name in counted


def _scoped_uses(lines: Iterable[Line], scope: Scope) -> Iterator[tuple[Use, Scope]]:
    """The uses of all numbers, in loops and functions too, and the scope of the names in them."""
    for line in lines:
        for use in uses(line):
            yield use if "." in use.name else use._replace(name=scope(use.name)), scope
        yield from _scoped_uses(body_of(line), _inside(line, scope))


def in_unit(program: Program, unit: Unit | None, workshop: bool = False, digits: int = DIGITS) -> Program:
    """The same placed program with its lengths in a unit, or in cells; unchanged if it is in this unit.

    Lengths keep so many ``digits``, by default six; for a ``workshop`` they are rounded to .01 mm or .001 in, and where
    the object is small to at most a 10,000th of its longest side, so that its parts stay together.

    Raises
    ------
    ShapeProgError
        If a name is a length in one use, and another number elsewhere, the program is in cells and has no unit, or
        ``unit`` is none.
    """
    if not isinstance(unit, Unit | None):
        cure = f"give sp.Unit({unit!r}, n), n being the length of a cell; sp.infer and sp.export take the name alone"
        raise ShapeProgError(f"{unit!r} is the name of a unit" if unit in METRES else f"{unit!r} is no unit", cure)
    program, unit = program_of(program), unit or Unit("", 1.0)
    source = source_of(program)
    if source.unit is None:
        raise ShapeProgError("statements in cells have no unit", "shapeprog tidy places them from sides")
    if source.unit == unit:
        return program
    factor = unit.per_cell / source.unit.per_cell
    decimals = -math.log10(FINEST / METRES[unit.name]) if unit.name else 0.0
    decimals = max(math.floor(decimals), math.ceil(-math.log10(FINEST_SHARE * SPAN * unit.per_cell)))

    def change(number: float, power: float) -> float:
        if not power or not number:
            return number
        result = number * factor**power
        if workshop and power == 1 and unit.name:
            least = LEAST_DIGITS - 1 - math.floor(math.log10(abs(result)))
            return to_float32(round(result, max(least, decimals)))
        return to_float32(float(f"{result:.{digits}g}"))

    return replace(_scaled(Source(_Powers(source).changed(source.lines, change), unit), source), frame=program.frame)


def literal_lengths(program: Program) -> tuple[list[float], Callable[[Sequence[float]], Program]]:
    """The numbers in the text of a program that are lengths, without zeros, and the program as a function of them.

    Raises
    ------
    ShapeProgError
        As for :func:`in_unit`.
    """
    source, numbers = source_of(program), list[float]()
    powers = _Powers(source)

    def noted(number: float, power: float) -> float:
        numbers.extend([number] * _is_length(number, power))
        return number

    def with_numbers(values: Sequence[float]) -> Program:
        new = iter(values)
        lines = powers.changed(source.lines, lambda old, power: next(new) if _is_length(old, power) else old)
        return _scaled(replace(source, lines=lines), source)

    powers.changed(source.lines, noted)
    return numbers, with_numbers


def _is_length(number: float, power: float) -> bool:
    return power == 1 and number != 0


def _scaled(source: Source, before: Source) -> Program:
    """The program of a syntax tree whose unit or sizes have changed, with its middle where it was before: a cell is as
    large as its unit has it."""
    assert source.unit is not None
    assert before.scale is not None
    cells = 1 / source.unit.per_cell
    middle = before.scale.floor + before.evaluated_numbers()["height"] * before.scale.cells_per_unit / 2
    floor = middle - source.evaluated_numbers()["height"] * cells / 2
    return evaluated(replace(source, scale=replace(before.scale, cells_per_unit=cells, floor=floor)))


def lengths(program: Program) -> frozenset[str]:
    """The named numbers of a program that are lengths; none if one is a length in one place only."""
    source = source_of(program)
    try:
        powers = _Powers(source)
    except ShapeProgError:
        return frozenset()
    return frozenset(name for name in source.numbers if powers.of(name) == 1)


class _Powers:
    """The powers of length of the names of a program: 1 for a length, 0 for a plain number or a count, 2 for an area.

    They follow from the uses of names, forwards and back through expressions, in passes until no more is learned.
    Literals in products and quotients are then taken for plain numbers where nothing else follows.
    """

    def __init__(self, source: Source) -> None:
        self._known = dict.fromkeys(SIZES, 1.0)
        for self._plain in (False, True):
            lines, learned = source.lines, -1
            while learned < len(self._known):
                learned, lines = len(self._known), lines[::-1]  # along a chain of names each way once
                self.changed(lines, lambda number, _: number)

    def of(self, name: str) -> float:
        """The power of a name; none if it may have any."""
        return self._known.get(name, 0.0)

    def changed(self, lines: tuple[Line, ...], change: Change, scope: Scope = str) -> tuple[Line, ...]:
        """Some lines with every literal changed by what its power is; learns the powers of names."""
        result = []
        for line in lines:
            new = with_values(line, [self._used(use, scope, change) for use in uses(line)])
            if isinstance(new, Loop | Group | Function):
                new = replace(new, body=self.changed(new.body, change, _inside(line, scope)))
            result.append(new)
        return tuple(result)

    def _used(self, use: Use, scope: Scope, change: Change) -> Value:
        """The value of a use with every literal in it changed."""
        power: float | None = float(use.kind == "length")
        if use.kind == "named":
            name = use.name if "." in use.name else scope(use.name)
            power = self._known.get(name)
            if power is None and (power := self._power(use.value, scope)) is not None:
                self._known[name] = power
        return self._at(use.value, power, scope, change)

    def _at(self, value: Value, power: float | None, scope: Scope, change: Change) -> Value:
        """A value of this power with every literal in it changed; without a power, names in it may still be learned."""
        match value:
            case Name(name):
                if power is not None:
                    _agree(value, power, self._known.setdefault(scope(name), power))
                return value
            case Negative(of):
                return -self._at(of, power, scope, change)
            case Binary("+" | "-" as sign, left, right):
                power = self._power(value, scope) if power is None else power
                return Binary(sign, *(self._at(side, power, scope, change) for side in (left, right)))
            case Binary(sign, left, right):
                first, second = self._power(left, scope), self._power(right, scope)
                way = 1 if sign == "*" else -1
                if self._plain and first is None and second is None:
                    plain_left = isinstance(right, Expression) and not isinstance(left, Expression)
                    first, second = (0.0, None) if plain_left else (None, 0.0)
                if power is not None and first is None and second is not None:
                    first = power - way * second
                elif power is not None and second is None and first is not None:
                    second = way * (power - first)
                elif power is not None and first is not None and second is not None:
                    _agree(value, power, first + way * second)
                left = self._at(left, first, scope, change)
                return Binary(sign, left, self._at(right, second, scope, change))
        return change(value, power or 0.0)  # type: ignore[arg-type]

    def _power(self, value: Value, scope: Scope) -> float | None:
        """The power that is known of a value."""
        match value:
            case Name(name):
                return self._known.get(scope(name))
            case Negative(of):
                return self._power(of, scope)
            case Binary("+" | "-", left, right):
                sides = [self._power(side, scope) for side in (left, right) if isinstance(side, Expression)]
                return next((power for power in sides if power is not None), None)
            case Binary(sign, left, right):
                first, second = (
                    self._power(side, scope) if isinstance(side, Expression) or not self._plain else 0.0
                    for side in (left, right)
                )
                if first is not None and second is not None:
                    return first + second if sign == "*" else first - second
        return None


def _agree(value: Expression, power: float, other: float) -> None:
    if abs(power - other) > _NOTHING:
        message = f"{value} stands for a length in one place, and for another number elsewhere"
        raise ShapeProgError(message, "give each of them a name of its own, or keep the unit")


def _inside(line: Line, scope: Scope) -> Scope:
    """The scope of the lines in a loop or function."""
    if not isinstance(line, Function):
        return scope
    names = line.names
    return lambda name: f"{line.name}.{name}" if name in names else name
