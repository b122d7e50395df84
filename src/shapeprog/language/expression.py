"""Numbers that depend on named numbers, such as ``depth / 2 - thick``: small immutable values with + - * /.

    width = Name("width")
    inner = width - 2 * Name("thick")       # str(inner) == "width - 2 * thick"
    inner.at({"width": 10, "thick": 1})     # 8.0

Names may have any values with + - * /: plain numbers, tensors (then gradients flow), or linear forms.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.parameters import shortest, to_float32

Operator = Literal["+", "-", "*", "/"]

Method: TypeAlias = "Callable[[Expression, Value], Expression]"

APPLY = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}
_LEVEL = {"+": 1, "-": 1, "*": 2, "/": 2}  # how tightly they bind; a sign binds at 3, a number or a name at 4


class ExpressionError(ShapeProgError):
    """An expression without a value; ``expression`` is the part of it that has none."""

    def __init__(self, expression: Expression, message: str, hint: str) -> None:
        super().__init__(message, hint)
        self.expression = expression


def _operators(sign: Operator) -> tuple[Method, Method]:
    """The methods of an operator with an expression on its left, and on its right."""
    return lambda left, right: Binary(sign, left, right), lambda right, left: Binary(sign, left, right)


class Expression:
    """A number that depends on names."""

    level = 4

    def at(self, numbers: Mapping[str, Any]) -> Any:
        """Its value for these named numbers; an ``ExpressionError`` if a name is not among them, or it has no value."""
        raise NotImplementedError

    def names(self) -> Iterator[Name]:
        """The names in it, in the order of its text, with repetitions."""
        raise NotImplementedError

    __add__, __radd__ = _operators("+")
    __sub__, __rsub__ = _operators("-")
    __mul__, __rmul__ = _operators("*")
    __truediv__, __rtruediv__ = _operators("/")

    def __neg__(self) -> Expression:
        return Negative(self)


Value: TypeAlias = float | Expression  # a number that float32 holds exactly, or an expression


@dataclass(frozen=True)
class Name(Expression):
    """A named number."""

    name: str

    def at(self, numbers: Mapping[str, Any]) -> Any:
        """The number of this name."""
        if self.name not in numbers:
            otherwise = "" if numbers else f"write {self.name} = ... above this line"
            near = did_you_mean(self.name, numbers, otherwise)
            raise ExpressionError(self, f"undefined name {self.name!r}", near)
        return numbers[self.name]

    def names(self) -> Iterator[Name]:
        """Itself."""
        yield self

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Negative(Expression):
    """An expression with a minus sign; numbers have signs of their own."""

    of: Expression
    level = 3

    def __post_init__(self) -> None:
        if not isinstance(self.of, Expression):
            raise ShapeProgError(f"-({self.of}) is a number, not an expression", "write the number with its sign")

    def at(self, numbers: Mapping[str, Any]) -> Any:
        """What it is put before, the other way round."""
        return -self.of.at(numbers)

    def names(self) -> Iterator[Name]:
        """The names in its operand."""
        return self.of.names()

    def __str__(self) -> str:
        return f"-{_within(self.of, self.level)}"


@dataclass(frozen=True)
class Binary(Expression):
    """A sum, difference, product or quotient; plain numbers in it are rounded to float32."""

    operator: Operator
    left: Value
    right: Value

    def __post_init__(self) -> None:
        for side in ("left", "right"):
            value = getattr(self, side)
            if not isinstance(value, Expression):
                object.__setattr__(self, side, to_float32(value))

    @property
    def level(self) -> int:  # type: ignore[override]
        """How tightly its operator binds."""
        return _LEVEL[self.operator]

    def at(self, numbers: Mapping[str, Any]) -> Any:
        """What its operator makes of both sides."""
        try:
            result = APPLY[self.operator](value_at(self.left, numbers), value_at(self.right, numbers))
        except ZeroDivisionError:
            cure = f"let {text_of(self.right)} be another number"
            if isinstance(self.right, Binary) and self.right.operator == "-" and isinstance(self.right.left, Name):
                cure = f"let {self.right.left} be more than {text_of(self.right.right)}"
            raise ExpressionError(self, f"{self} divides by zero", cure) from None
        if isinstance(result, float) and not math.isfinite(result):
            raise ExpressionError(self, f"{self} is too large", "numbers end at 3.4028235e+38")
        return result

    def names(self) -> Iterator[Name]:
        """The names on both sides."""
        for side in (self.left, self.right):
            if isinstance(side, Expression):
                yield from side.names()

    def __str__(self) -> str:
        return f"{_within(self.left, self.level)} {self.operator} {_within(self.right, self.level + 1)}"


def value_at(value: Value, numbers: Mapping[str, Any]) -> Any:
    """The value of a number or expression for these named numbers."""
    return value.at(numbers) if isinstance(value, Expression) else value


def text_of(value: Value) -> str:
    """A number or expression as program text, with no more parentheses than it needs."""
    return str(value) if isinstance(value, Expression) else shortest(value)


def replaced(value: Value, change: Callable[[float | Name], Value]) -> Value:
    """The same number or expression with every plain number and every name in it changed."""
    match value:
        case Binary(sign, left, right):
            return Binary(sign, replaced(left, change), replaced(right, change))
        case Negative(inner):
            return -replaced(inner, change)
        case Name() | float() | int():
            return change(value)
    return value


def rounded(value: Value, digits: int) -> Value:
    """The same number or expression with so many decimals of every plain number in it."""
    return replaced(value, lambda leaf: leaf if isinstance(leaf, Name) else round(leaf, digits) + 0.0)


def names_in(value: Value) -> list[str]:
    """The names in a number or expression, in the order of its text, with repetitions."""
    return [name.name for name in value.names()] if isinstance(value, Expression) else []


def _within(value: Value, level: int) -> str:
    """The text of a value beside an operator that binds at a level."""
    text = text_of(value)
    return f"({text})" if isinstance(value, Expression) and value.level < level else text


@dataclass(frozen=True)
class Linear:
    """A number that is linear in names: ``constant`` and what each name is multiplied by.

    Evaluating an expression with ``Linear.of(name)`` for its names gives its linear form.  A product or quotient of
    names is no linear form, and raises a ``ShapeProgError``.
    """

    constant: float = 0.0
    factors: tuple[tuple[str, float], ...] = ()

    @staticmethod
    def of(name: str) -> Linear:
        """The name itself."""
        return Linear(0.0, ((name, 1.0),))

    def at(self, numbers: Mapping[str, float]) -> float:
        """Its value for these named numbers."""
        return self.constant + sum(factor * numbers[name] for name, factor in self.factors)

    def written(self) -> Value:
        """The form as a person writes it, positive terms first."""
        terms = sorted(self.factors, key=lambda term: term[1] < 0)
        return combined(self.constant, [(Name(name), factor) for name, factor in terms])

    def __add__(self, other: Linear | float) -> Linear:
        if not isinstance(other, Linear):
            return replace(self, constant=self.constant + other)
        factors = dict(self.factors)
        for name, factor in other.factors:
            factors[name] = factors.get(name, 0.0) + factor
        nonzero = tuple((name, factor) for name, factor in factors.items() if factor)
        return Linear(self.constant + other.constant, nonzero)

    def __mul__(self, other: Linear | float) -> Linear:
        if isinstance(other, Linear) and other.factors:
            if self.factors:
                raise ShapeProgError("a product of two names is not linear", "multiply names by plain numbers")
            return other * self.constant
        by = other.constant if isinstance(other, Linear) else other
        return Linear(self.constant * by, tuple((name, factor * by) for name, factor in self.factors if by))

    def __truediv__(self, other: Linear | float) -> Linear:
        if isinstance(other, Linear) and other.factors:
            raise ShapeProgError("what is divided by a name is not linear in it", "divide names by plain numbers")
        by = other.constant if isinstance(other, Linear) else other
        return Linear(self.constant / by, tuple((name, factor / by) for name, factor in self.factors))

    def __neg__(self) -> Linear:
        return self * -1.0

    def __sub__(self, other: Linear | float) -> Linear:
        return self + -other

    def __rsub__(self, other: float) -> Linear:
        return -self + other

    def __rtruediv__(self, other: float) -> Linear:
        return Linear(other) / self

    __radd__, __rmul__ = __add__, __mul__


def combined(constant: float, terms: Sequence[tuple[Value, float]]) -> Value:
    """The sum of ``constant`` and of each value times its factor, as a person writes it: ``depth / 2 - thick``."""
    constant += sum(value * factor for value, factor in terms if not isinstance(value, Expression))
    named = [(value, factor) for value, factor in terms if isinstance(value, Expression) and factor]
    total: Value | None = None
    if not named or (constant > 0 and all(factor < 0 for _, factor in named)):  # 4 - depth rather than -depth + 4
        total, constant = to_float32(constant), 0.0
    for value, factor in named:
        size = _scaled(value, factor if total is None else abs(factor))
        total = size if total is None else total - size if factor < 0 else total + size
    assert total is not None
    return total if not constant else total - -constant if constant < 0 else total + constant


def _scaled(value: Expression, factor: float) -> Expression:
    if abs(factor) == 1:
        return -value if factor < 0 else value
    if abs(factor) < 1 and abs(1 / factor - round(1 / factor)) < 1e-9:
        return (-value if factor < 0 else value) / abs(round(1 / factor))
    if abs(factor - round(factor)) > 1e-9 and abs(3 * factor - round(3 * factor)) < 1e-9:
        return round(3 * factor) * value / 3
    return factor * value
