"""Numbers as linear forms of names, and the best keywords for a position."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple, TypeAlias

from shapeprog.language.ast import Keywords, Point
from shapeprog.language.expression import APPLY, Binary, Expression, Linear, Name, Negative, Value
from shapeprog.language.parameters import shortest
from shapeprog.language.placement import AXES

NOTHING = 2e-6  # cells; a length up to this is none
EVEN = 1e-4  # degrees by which the copies of a rotation may miss a full circle

Triple: TypeAlias = tuple[Linear, ...]
"""Along x, y and z, measured from the middle of the whole."""

Cost: TypeAlias = tuple[int, int]
"""Operators and words."""


class Span(NamedTuple):
    """An interval along an axis: its low end from the middle of the whole, and its length."""

    low: Linear
    size: Linear

    @property
    def middle(self) -> Linear:
        """Its middle."""
        return self.low + self.size / 2.0


Spans: TypeAlias = tuple[Span, ...]
"""A box, by its intervals along x, y and z."""


class Forms:
    """The numbers of a program as linear forms, and the choice of keywords.

    Parameters
    ----------
    sizes
        Width, depth and height of the box around all parts.
    names
        What names stand for in the box.
    numbers
        The values of these names, in cells.
    """

    def __init__(self, sizes: Triple, names: Mapping[str, Linear], numbers: Mapping[str, float]) -> None:
        self.sizes, self.names, self.numbers = sizes, names, numbers

    # ---- numbers ------------------------------------------------------------------------------------------------

    def form(self, value: Value) -> Linear:
        """A number as a linear form of names; plain numbers are the shortest decimals."""
        match value:
            case Name(name):
                return self.names[name]
            case Negative(inner):
                return -self.form(inner)
            case Binary(sign, left, right):
                result: Linear = APPLY[sign](self.form(left), self.form(right))
                return result
        return Linear(float(shortest(value)))  # type: ignore[arg-type]

    def written(self, form: Linear, *, exact: bool = False) -> Value:
        """A linear form as a person writes it; without terms near zero, unless exact."""
        return (form if exact else self._clean(form)).written()

    def number(self, form: Linear) -> float:
        """The value of a form with the numbers in force."""
        return form.at(self.numbers)

    def _clean(self, form: Linear) -> Linear:
        factors = tuple((name, factor) for name, factor in form.factors if abs(factor) > 1e-9)
        return Linear(form.constant if abs(form.constant) > NOTHING else 0.0, factors)

    def _zero(self, form: Linear) -> bool:
        form = self._clean(form)
        return not form.constant and not form.factors

    # ---- the choice of keywords ---------------------------------------------------------------------------------

    def interval(self, axis: int, span: Span) -> Keywords:
        """The best keywords for an interval along an axis."""
        words, half = AXES[axis], self.sizes[axis] / 2.0
        low, high, size = span.low + half, half - span.low - span.size, span.size
        a, b, length = self.number(low), self.number(high), self.number(size)
        nearer, farther = ((words.low, low), (words.high, high)) if a <= b else ((words.high, high), (words.low, low))
        sides = ((words.low, low), (words.high, high))
        sized = (words.size, size)
        options: list[tuple[tuple[str, Linear], ...]] = []
        if self._zero(low) and self._zero(high):
            return ()
        covers = length > max(a, b)
        if covers or size.factors or self.sizes[axis].factors:  # else it would not keep its size with the whole
            options += [(side,) for side, opposite in (sides, sides[::-1]) if self._zero(opposite[1])]
        if self._zero(low) if axis == 2 else self._zero(low - high):
            options.append((sized,))
        options += [sides, (nearer, sized), (farther, sized)] if covers else [(nearer, sized), (farther, sized), sides]
        options.append(((words.offset, span.middle), sized))
        return self._best(options)

    def point(self, place: Triple, start: Triple | None = None) -> Point:
        """The best keywords for a point; those that follow from the start are left out."""
        keywords: list[tuple[str, Value]] = []
        for axis, value in enumerate(place):
            default = start[axis] if start else self.sizes[2] / -2.0 if axis == 2 else Linear()
            if not self._zero(value - default):
                keywords += self._single(axis, value)  # type: ignore[arg-type]
        return Point(tuple(keywords))

    def _single(self, axis: int, middle: Linear, radius: Linear | None = None) -> Keywords:
        """The best keyword for the middle of something along an axis, which reaches so far to both sides."""
        words, half, radius = AXES[axis], self.sizes[axis] / 2.0, radius or Linear()
        low, high = (words.low, middle + half - radius), (words.high, half - middle - radius)
        nearer, farther = (low, high) if self.number(low[1]) <= self.number(high[1]) else (high, low)
        options = [(nearer,), (farther,), ((words.offset, middle),)]
        return self._best(options[::-1] if self._zero(middle) else options)

    def _best(self, options: Iterable[tuple[tuple[str, Linear], ...]]) -> Keywords:
        """The option with the fewest operators, then the fewest words, then the first."""
        written = [tuple((word, self.written(form)) for word, form in option) for option in options]
        return min(written, key=cost)

    def _extra(self, word: str, form: Linear) -> Keywords:
        return () if self._zero(form) else ((word, self.written(form)),)


def cost(keywords: Keywords) -> Cost:
    """How many operators and words keywords have."""
    operators, words = 0, len(keywords)
    for _, argument in keywords:
        if isinstance(argument, Point):
            costs = [cost(argument.keywords), (0, 1)]
        else:
            costs = [_cost(value) for value in (argument if isinstance(argument, tuple) else (argument,))]
        operators, words = operators + sum(a for a, _ in costs), words + sum(b for _, b in costs)
    return operators, words


def _cost(value: Value) -> Cost:
    match value:
        case Binary(_, left, right):
            (a, b), (c, d) = _cost(left), _cost(right)
            return a + c + 1, b + d + 1
        case Negative(inner):
            a, b = _cost(inner)
            return a, b + 1
        case Expression():
            return 0, 1
    return 0, 2 if value < 0 else 1
