"""The syntax tree of program text, as immutable values.

There are two notations.  In *cells*, the statements of the paper have coordinates (:class:`Draw`, :class:`Loop`).  In
*placed* text, the usual one, parts are placed from the sides of a box by keywords (:class:`Part`, :class:`Group`).  A
placed program is evaluated to statements and loops in cells, see :mod:`shapeprog.language.evaluate`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias, TypeVar

from shapeprog.errors import ShapeProgError
from shapeprog.language.expression import Expression, Value, names_in, value_at
from shapeprog.language.unit import Unit


@dataclass(frozen=True)
class Comment:
    """A comment on a line of its own, without its ``#``; an empty line if its text is empty."""

    text: str = ""


@dataclass(frozen=True)
class Assignment:
    """``width, depth = 10.2, 9``: names with their values; ``note`` is the comment behind it, as in other lines."""

    numbers: tuple[tuple[str, Value], ...]
    note: str = ""


@dataclass(frozen=True)
class Draw:
    """A drawing statement in cells: its values in slot order, and its role if that is not its own name.

    The values in a :class:`~shapeprog.language.program.Program` are numbers that float32 holds exactly; symbolic
    evaluation gives tensors or linear forms.
    """

    name: str
    values: tuple[Any, ...]
    role: str = ""

    @property
    def word(self) -> str:
        """The name of the part, its role or else its statement."""
        return self.role or self.name


@dataclass(frozen=True)
class Loop:
    """A loop in cells: its values in slot order, and the statements and loops that it repeats."""

    name: str
    values: tuple[Any, ...]
    body: tuple[Any, ...]

    @property
    def count(self) -> int:
        """Number of copies; none when the count is not positive."""
        return max(0, round(self.values[0]))


@dataclass(frozen=True)
class Point:
    """``at(left=3, top=0)``: a point by its distances from the sides of a box, or its offsets from the middle."""

    keywords: tuple[tuple[str, Value], ...] = ()


Argument: TypeAlias = Value | tuple[Value, Value] | Point
Keywords: TypeAlias = tuple[tuple[str, Argument], ...]


@dataclass(frozen=True)
class Part:
    """A placed solid: ``leg(cylinder(left=3, radius=2))`` has the kind ``cylinder`` and the role ``leg``.

    A role alone, ``leg(left=0, width=2)``, has the kind ``box``.
    """

    kind: str
    keywords: Keywords = ()
    role: str = ""
    note: str = ""

    @property
    def word(self) -> str:
        """The name of the part, its role or else its kind."""
        return self.role or self.kind


@dataclass(frozen=True)
class Group:
    """Lines with a placed loop or box around them: ``for _ in row(3, last=at(top=0)):``, ``with inside(left=2):``."""

    kind: str  # ``inside``, ``divide``, ``mirror``, ``rotate``, ``translate`` or ``row``
    keywords: Keywords  # its keywords; ``last`` of a row is a :class:`Point`
    body: tuple[Line, ...]  # the lines inside
    count: Value | None = None  # how many copies; ``None`` for ``inside`` and ``mirror``
    axis: str = ""  # ``x``, ``y`` or ``z`` for ``divide``, else empty
    note: str = ""


@dataclass(frozen=True)
class Call:
    """``leg(posts(thick=2))``: the lines of a function, with a value for each parameter that has no default.

    A role around it is that of all parts in it that have none of their own.  The arguments may also be keywords of the
    box in which the lines are drawn, and ``tilt``.
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

    @property
    def names(self) -> set[str]:
        """Its parameters, and the names that it assigns."""
        assigned = {name for line in self.body if isinstance(line, Assignment) for name, _ in line.numbers}
        return assigned | {name for name, _ in self.parameters}


Line: TypeAlias = Comment | Assignment | Draw | Loop | Part | Group | Call | Function
Some = TypeVar("Some", bound=Line)


@dataclass(frozen=True)
class Scale:
    """How placed text lies in the grid; fixed when the text is read, whatever is set afterwards."""

    cells_per_unit: float  # cells per unit of length; as read, the longest side of the whole is 24 cells
    floor: float  # height of the floor in the grid, in cells
    middle: float = 0.0  # depth of the middle of the whole in the grid, in cells
    side: float = 0.0  # left-right middle of the whole in the grid, in cells; 0 but in the grid of another shape

    @property
    def origin(self) -> tuple[float, float, float]:
        """The origin of the text, in cells to the right, to the rear and upwards from that of the grid."""
        return -self.side, self.middle, self.floor


@dataclass(frozen=True)
class Source:
    """A program as its lines, in the order of the text.

    Parameters
    ----------
    lines
        The lines at the top level.
    unit
        Unit of its lengths, if its parts are placed.
    scale
        How it lies in the grid, if its parts are placed; ``None`` for statements in cells.
    warnings
        What is legal and probably a mistake, as messages with their line.
    """

    lines: tuple[Line, ...] = ()
    unit: Unit | None = None
    scale: Scale | None = None
    warnings: tuple[str, ...] = field(default=(), compare=False, repr=False)

    @property
    def placed(self) -> bool:
        """Whether its parts are placed from the sides of a box."""
        return self.scale is not None

    @property
    def functions(self) -> dict[str, Function]:
        """The functions by name."""
        return {line.name: line for line in self.lines if isinstance(line, Function)}

    @property
    def numbers(self) -> dict[str, Value]:
        """The named numbers of the program itself, not those inside of functions, in the order of the text."""
        pairs = (line.numbers for line in self.lines if isinstance(line, Assignment))
        return dict(pair for numbers in pairs for pair in numbers)

    def evaluated_numbers(self, given: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """The values of these names, some of which may be given."""
        known = dict(given or {})
        for name, value in self.numbers.items():
            if name not in known:
                known[name] = value_at(value, known)
        return known

    def walk(self) -> Iterator[Line]:
        """Every line in the order of the text, those in loops, groups and functions included."""
        stack = [*reversed(self.lines)]
        while stack:
            yield (line := stack.pop())
            stack += reversed(body_of(line))


class Fault(ShapeProgError):
    """A mistake on a line of a program.

    Parameters
    ----------
    line
        The line.
    message, hint
        What is wrong, and what to do.
    key
        Where on the line: the slot of a number, or the name of a keyword, number, argument or parameter.
    expression
        The part of an expression that is wrong.
    """

    def __init__(
        self, line: Line, message: str, hint: str, key: int | str = "", expression: Expression | None = None
    ) -> None:
        super().__init__(message, hint)
        self.line, self.key, self.expression = line, key, expression


def body_of(line: Line) -> tuple[Line, ...]:
    """The lines inside of a line; none if it has no body."""
    return line.body if isinstance(line, Loop | Group | Function) else ()


def note_of(line: Line) -> str:
    """The comment behind a line."""
    return "" if isinstance(line, Comment | Draw | Loop) else line.note


def values(line: Line) -> tuple[Value, ...]:
    """The numbers and expressions on a line, in the order of its text."""
    result: list[Value] = []

    def noted(value: Value) -> Value:
        result.append(value)
        return value

    changed_values(line, noted)
    return tuple(result)


def with_values(line: Line, new_values: Iterable[Value]) -> Line:
    """The line with other numbers and expressions, as many as :func:`values` gives."""
    new = iter(new_values)
    return changed_values(line, lambda _: next(new))


def changed_values(line: Some, change: Callable[[Any], Any]) -> Some:
    """The line with a change made to each number and expression, in the order of its text."""
    match line:
        case Draw() | Loop():
            return replace(line, values=tuple(map(change, line.values)))
        case Assignment(pairs):
            return replace(line, numbers=tuple((name, change(value)) for name, value in pairs))
        case Function(parameters=given):
            return replace(line, parameters=tuple((name, None if v is None else change(v)) for name, v in given))
        case Part(keywords=keywords):
            return replace(line, keywords=_changed_arguments(keywords, change))
        case Call(arguments=pairs):
            return replace(line, arguments=tuple((name, change(value)) for name, value in pairs))
        case Group(keywords=keywords, count=count):
            count = None if count is None else change(count)
            return replace(line, count=count, keywords=_changed_arguments(keywords, change))
        case _:
            return line


def used_names(lines: Iterable[Line]) -> set[str]:
    """The names in the numbers of lines, not in those inside of them."""
    return {name for line in lines for value in values(line) for name in names_in(value)}


def assignments(lines: Iterable[Line], names: Collection[str]) -> tuple[Assignment, ...]:
    """The assignments among lines, of some names and those that they depend on."""
    result: list[Assignment] = []
    needed = {*names}
    for line in reversed([line for line in lines if isinstance(line, Assignment)]):
        if pairs := tuple(pair for pair in line.numbers if pair[0] in needed):
            needed.update(name for _, value in pairs for name in names_in(value))
            result.append(replace(line, numbers=pairs))
    return tuple(result[::-1])


def names_of(source: Source) -> set[str]:
    """All names of numbers: those of the program, and those inside of functions."""
    return {*source.numbers}.union(*(function.names for function in source.functions.values()))


def changed_lines(lines: Iterable[Some], change: Callable[[Some], Some]) -> tuple[Some, ...]:
    """The lines with a change made to each of them, and then to those inside of it."""
    result = []
    for line in map(change, lines):
        if body := body_of(line):
            line = replace(line, body=changed_lines(body, change))  # type: ignore[arg-type]
        result.append(line)
    return tuple(result)


def without_double_blanks(lines: tuple[Line, ...]) -> tuple[Line, ...]:
    """The lines of a block without empty ones at its ends, or one behind another, and so within; lines that do not
    change stay the same objects."""
    result: list[Line] = []
    for line in lines:
        if (body := body_of(line)) and (tidied := without_double_blanks(body)) != body:
            line = replace(line, body=tidied)  # type: ignore[arg-type]
        if line != Comment() or (result and result[-1] != Comment()):
            result.append(line)
    return tuple(result[:-1] if result and result[-1] == Comment() else result)


def _changed_arguments(keywords: Keywords, change: Callable[[Value], Value]) -> Keywords:
    def changed(argument: Argument) -> Argument:
        if isinstance(argument, Point):
            return Point(tuple((word, change(value)) for word, value in argument.keywords))
        return (change(argument[0]), change(argument[1])) if isinstance(argument, tuple) else change(argument)

    return tuple((word, changed(argument)) for word, argument in keywords)
