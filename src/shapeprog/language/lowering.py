"""Lowering: placed parts and groups become statements and loops in cells.

A side, a size or an offset becomes coordinates; ``inside`` vanishes; ``row`` and ``divide`` become ``translate``.
"""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import Argument, Call, Draw, Fault, Group, Line, Loop, Part, Point, Source
from shapeprog.language.expression import Expression, ExpressionError, Value, text_of, value_at
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import (
    AXES,
    LEAST_ALONG,
    MOST_SOLIDS,
    POINTS,
    ROUND,
    SIZES,
    coordinate_of,
    interval_of,
    is_sized,
)
from shapeprog.language.program import DEEPEST

TOO_LARGE = 1e12  # magnitude from which numbers of placed text are refused

POSITIVE = "a size must be positive, and more than a millionth of the whole"

SMALLEST = 1e-5
"""Sizes up to this, in cells, are refused in placed text: rounding to float32 leaves that much of a zero."""

Scope: TypeAlias = dict[str, Any]
Box: TypeAlias = tuple[tuple[Any, Any], ...]
"""The low and high coordinate of a box along x, y and z, in the unit of the text."""

Vector: TypeAlias = tuple[Any, ...]


class Context(NamedTuple):
    """Where lines are evaluated: the values of names, the box around placed parts, the depth of nesting in loops and
    calls, and the role around the call that the lines belong to."""

    scope: Scope
    box: Box | None = None
    loops: int = 0
    calls: int = 0
    role: str = ""


class Placed(NamedTuple):
    """A line with keywords, and the names and the box around it."""

    line: Part | Group | Call
    keywords: Mapping[str, Argument]
    scope: Scope
    box: Box

    @staticmethod
    def of(line: Part | Group | Call, context: Context) -> Placed:
        """The line where it stands."""
        assert context.box is not None
        pairs = line.arguments if isinstance(line, Call) else line.keywords
        return Placed(line, dict(pairs), context.scope, context.box)


class Drawn(NamedTuple):
    """Statements and loops in cells, and the box of the first element, to which a row refers."""

    nodes: list[Any]
    first: Box | None


class Lowering(ABC):
    """The part of an evaluation that knows boxes and points.

    Parameters
    ----------
    source
        The program.
    exact
        Whether values are plain numbers, which are rounded and checked; else they may be tensors or linear forms.
    decided
        The counts of loops, and which radius of each upright taper is the larger, in the order of evaluation, where
        values are not plain numbers.
    """

    def __init__(self, source: Source, exact: bool, decided: Iterator[int]) -> None:
        self.source, self.exact, self.decided = source, exact, decided
        self.decisions: list[int] = []
        self.floor: Any = source.scale.floor if source.scale else 0.0
        self.middle: float = source.scale.middle if source.scale else 0.0
        self.side: float = source.scale.side if source.scale else 0.0
        self.drawn = self.bodies = 0

    @abstractmethod
    def lines(self, lines: Sequence[Line], context: Context) -> Drawn:
        """Evaluate lines."""

    def leaf(self, line: Line, name: str, values: Sequence[Any], role: str) -> Draw:
        """A drawing statement of the result."""
        self.drawn += 1
        return Draw(name, self._numbers(line, values), "" if role == name else role)

    def at(self, line: Line, key: int | str, value: Value, scope: Scope) -> Any:
        """The value of a number or expression on a line."""
        try:
            number = value_at(value, scope)
        except ExpressionError as error:
            raise Fault(line, error.message, error.hint, key, error.expression) from None
        if self.exact and not abs(number) < TOO_LARGE:
            expression = value if isinstance(value, Expression) else None
            raise Fault(line, f"{text_of(value)} is too large", "numbers end at 1e12", key, expression)
        return number

    # ---- placed parts -----------------------------------------------------------------------------------------------

    def whole(self, scope: Scope) -> Box:
        """The box of the whole, which stands on z = 0 and is centred at x = 0, y = 0."""
        width, depth, height = (scope[name] for name in SIZES)
        return (-width / 2, width / 2), (-depth / 2, depth / 2), (0.0, height)

    def part(self, line: Part, context: Context) -> Drawn:
        """A placed solid."""
        part, role = Placed.of(line, context), line.role or context.role
        if "start" in part.keywords:
            return self._between(line, part, role)
        if line.kind in ROUND:
            outer, radii = self._round_box(part)
            x, y = ((low + high) / 2 for low, high in outer[:2])
            low, high = self._point((x, y, outer[2][0])), self._point((x, y, outer[2][1]))
            ends = [*low, high[0] - low[0]] if line.kind == "cylinder" else [*low, *high]
            node = self.leaf(line, line.kind, [*ends, *map(self._length, radii)], role)
            return Drawn(self.tilted(part, [node], outer), outer)
        outer = self.box(part)
        (left, right), (front, rear), (bottom, top) = outer
        corner = self._point((right, front, bottom))
        values = [*corner, *map(self._length, (top - bottom, rear - front, right - left))]
        if line.kind == "cushion":
            edge = self._number(part, "edge")
            if self.exact and edge < 0:
                raise Fault(line, f"edge is {edge:g}", "an edge cannot be negative", "edge")
            node = self.leaf(line, "cushion", [*values, self._length(edge)], role)
        elif "lean" in part.keywords:
            node = self.leaf(line, "leaning_box", [*values, self._length(self._number(part, "lean"))], role)
        elif "tilt" in part.keywords:
            return Drawn([self.leaf(line, "board", [*values, self._number(part, "tilt")], role)], outer)
        else:
            return Drawn([self.leaf(line, "box", values, role)], outer)
        return Drawn(self.tilted(part, [node], outer), outer)

    def _between(self, line: Part, part: Placed, role: str) -> Drawn:
        """A solid between points."""
        named: dict[str, Vector] = {}
        for word in POINTS:
            if word in part.keywords:
                named[word] = self._place(part, word, part.keywords[word], named.get("start"))
        points = [*named.values()]
        start, end = points[0], points[-1]
        for (first, one), (second, other) in itertools.combinations(named.items(), 2) if self.exact else ():
            if not self._length(math.dist(one, other)) > SMALLEST:
                raise Fault(line, f"{first} and {second} are the same point", "move one of them", second)
        grid = [number for point in points for number in self._point(point)]
        element = tuple((value, value) for value in start)
        if line.kind != "bar":
            return Drawn([self.leaf(line, line.kind, [*grid, *map(self._length, self._radii(part))], role)], element)
        sizes = {
            axis: self._positive(part, word, self._number(part, word))
            for axis, word in enumerate(SIZES)
            if word in part.keywords
        }
        main = ({0, 1, 2} - set(sizes)).pop()
        if self.exact and not abs(end[main] - start[main]) >= LEAST_ALONG * math.dist(start, end):
            runs = ("left-right", "front-rear", "upwards")[main]
            words = " and ".join(SIZES[axis] for axis in sorted(sizes))
            message = f"a bar with {words} runs {runs}, and this one does not"
            raise Fault(line, message, "name the two sizes across its direction")
        # The grid axes are up, depth, side: the section is given in their order.  Side points against x.
        section = [self._length(sizes[axis]) for axis in (2, 1, 0) if axis != main]
        turn = self._number(part, "turn", 0.0)
        values = [*grid, *section, float(2 - main), -turn if main == 0 else turn]
        return Drawn([self.leaf(line, "beam", values, role)], element)

    def group(self, line: Group, context: Context) -> Drawn:
        """A loop or a box around lines."""
        group = Placed.of(line, context)
        inner = context._replace(loops=context.loops + 1)
        if context.loops >= DEEPEST:
            raise too_deep(line)
        if line.kind == "inside":
            outer = self.box(group)
            nodes = self.lines(line.body, inner._replace(scope=group.scope | sizes_of(outer), box=outer)).nodes
            return Drawn(self.tilted(group, nodes, outer), outer)
        if line.kind == "mirror":
            nodes, first = self.lines(line.body, inner)
            plane = self._point(self._place(group, "", Point(line.keywords)))  # type: ignore[arg-type]
            for axis, words in enumerate(AXES):
                if any(word in group.keywords for word in words):
                    values = [2.0, float(2 - axis), plane[2 - axis]]
                    nodes = [Loop("mirror", self._numbers(line, values), tuple(nodes))]
            return Drawn(nodes, first)
        count = self._repetitions(line, group.scope)
        if line.kind == "divide":
            return self._divide(line, group, count, inner)
        nodes, first = self.lines(line.body, inner)
        if self.exact and max(1, count) * len(nodes) > MOST_SOLIDS:
            raise Fault(line, "the program draws too many solids", "use smaller counts")
        if line.kind == "rotate":
            point = Point(tuple((word, value) for word, value in line.keywords if word != "step"))  # type: ignore[misc]
            _, depth, side = self._point(self._place(group, "", point))
            step = self._number(group, "step", 360 / max(1, count))
            return Drawn([Loop("rotate_about", self._numbers(line, [count, step, depth, side]), tuple(nodes))], first)
        if line.kind == "translate":
            steps: Vector = tuple(self._number(group, word, 0.0) for word in ("x", "y", "z"))
        else:
            steps = self._row_step(group, count, first)
        return Drawn(self._translate(line, count, steps, nodes, context), first)

    def _divide(self, line: Group, group: Placed, count: int, context: Context) -> Drawn:
        """The body in ``count`` equal boxes along an axis: the first box, repeated."""
        outer, axis = self.box(group), ("x", "y", "z").index(line.axis)
        low, high = outer[axis]
        gap = self._number(group, "gap", 0.0)
        size = (high - low + gap) / max(1, count) - gap
        if self.exact and not size > 0:
            raise Fault(line, f"{count} boxes with gaps of {gap:g} do not fit into {high - low:g}", "use fewer")
        if count <= 0:
            return Drawn([], outer)
        inner = tuple((low, low + size) if index == axis else span for index, span in enumerate(outer))
        nodes = self.lines(line.body, context._replace(scope=group.scope | sizes_of(inner), box=inner)).nodes
        step = tuple(size + gap if index == axis else 0.0 for index in range(3))
        return Drawn(self.tilted(group, self._translate(line, count, step, nodes, context), outer), outer)

    def _row_step(self, row: Placed, count: int, first: Box | None) -> Vector:
        """From one copy of a row to the next: the last copy of its first element is where ``last`` says."""
        last = row.keywords["last"]
        assert isinstance(last, Point)
        if first is None:
            raise Fault(row.line, "the body of this row draws nothing", "draw a part in it")
        target = self._place(row, "last", last)
        step: list[Any] = [0.0, 0.0, 0.0]
        words = {word for word, _ in last.keywords}
        for axis, names in enumerate(AXES):
            low, high = first[axis]
            for word, reference in ((names.low, low), (names.high, high), (names.offset, (low + high) / 2)):
                if word in words:
                    step[axis] = (target[axis] - reference) / max(1, count - 1)
        return tuple(step)

    def _translate(self, line: Group, count: int, step: Vector, nodes: list[Any], context: Context) -> list[Any]:
        """Copies; in a function, which may be called for a row of one, a single copy is the body itself."""
        if context.calls and count == 1:
            return nodes
        by = [self._length(value) for value in (step[2], step[1], -step[0])]
        return [Loop("translate", self._numbers(line, [count, *by]), tuple(nodes))]

    def tilted(self, part: Placed, nodes: list[Any], box: Box) -> list[Any]:
        """Statements leaned back about the bottom front edge of a box, if there is a ``tilt``."""
        if "tilt" not in part.keywords or not nodes:
            return nodes
        up, depth, _ = self._point((0.0, box[1][0], box[2][0]))
        values = [1.0, self._number(part, "tilt"), up, depth]
        return [Loop("tilt_about", self._numbers(part.line, values), tuple(nodes))]

    # ---- placed numbers -----------------------------------------------------------------------------------------

    def _number(self, part: Placed, word: str, default: Any = None) -> Any:
        """The value of a keyword that takes one number."""
        if default is not None and word not in part.keywords:
            return default
        return self.at(part.line, word, part.keywords[word], part.scope)  # type: ignore[arg-type]

    def _positive(self, part: Placed, word: str, value: Any) -> Any:
        """A size, which must be positive."""
        if self.exact and not self._length(value) > SMALLEST:
            raise Fault(part.line, f"{word} is {value:g}", POSITIVE, word if word in part.keywords else "")
        return value

    def _repetitions(self, line: Group, scope: Scope) -> int:
        """The count of a loop, rounded half to even; nothing below zero."""
        assert line.count is not None
        value = self.at(line, "count", line.count, scope)
        if not self.exact:
            return next(self.decided)
        if value > MOST_SOLIDS:
            raise Fault(line, f"a count of {value:g} is too large", f"at most {MOST_SOLIDS}", "count")
        self.decisions.append(max(0, round(value)))
        return self.decisions[-1]

    def box(self, part: Placed) -> Box:
        """The box that the keywords of a line describe in another box."""
        return tuple(self._interval(axis, part) for axis in range(3))

    def _interval(self, axis: int, part: Placed, diameter: Any = None) -> tuple[Any, Any]:
        """Where a part lies along one axis of a box; ``diameter`` is the size of a round solid, if it is known."""
        words = AXES[axis]
        given = {word: self._number(part, word) for word in part.keywords if word in words}
        if diameter is not None:
            given.setdefault(words.size, diameter)
        start, end = interval_of(axis, given, *part.box[axis])
        if words.size in given:
            self._positive(part, words.size, given[words.size])
        elif self.exact and not self._length(end - start) > SMALLEST:
            full = part.box[axis][1] - part.box[axis][0]
            hint = f"{POSITIVE}; the {words.size} around it is {full:g}"
            raise Fault(part.line, f"{words.size} is {end - start:g}", hint, [*given][-1] if given else "")
        return start, end

    def _place(self, part: Placed, key: str, point: Argument, start: Vector | None = None) -> Vector:
        """A point in a box; an axis without a keyword is that of ``start``, or the middle of the bottom."""
        assert isinstance(point, Point)
        prefix = f"{key}." if key else ""
        given = {word: self.at(part.line, prefix + word, value, part.scope) for word, value in point.keywords}
        return tuple(
            coordinate_of(axis, given, *sides, start[axis] if start else None) for axis, sides in enumerate(part.box)
        )

    def _radii(self, part: Placed) -> tuple[Any, ...]:
        """The radius of a round solid, or its two radii; none if it has none."""
        if "radius" not in part.keywords:
            return ()
        given = part.keywords["radius"]
        pair = given if isinstance(given, tuple) else (given,)
        radii = tuple(self.at(part.line, "radius", value, part.scope) for value in pair)  # type: ignore[arg-type]
        if self.exact and min(radii) < 0:
            raise Fault(part.line, f"radius is {min(radii):g}", "a radius cannot be negative", "radius")
        if self.exact:
            self._positive(part, "radius", max(radii))
        return radii

    def _round_box(self, part: Placed) -> tuple[Box, tuple[Any, ...]]:
        """The box and the radii of an upright round solid, from its radius, or from its width and depth."""
        radii, vertical = self._radii(part), self._interval(2, part)
        if radii:
            largest = self._largest(radii)
            x, y = (self._interval(axis, part, 2 * largest) for axis in range(2))
            return (x, y, vertical), radii
        sized = [is_sized(part.keywords, axis) for axis in range(2)]
        first = 1 if sized[1] and not sized[0] else 0
        low, high = self._interval(first, part)
        other = self._interval(1 - first, part, None if sized[0] == sized[1] else high - low)
        x, y = ((low, high), other) if first == 0 else (other, (low, high))
        width, depth = x[1] - x[0], y[1] - y[0]
        if self.exact and not abs(width - depth) <= 1e-6 * width:
            raise Fault(part.line, f"width {width:g} and depth {depth:g} differ", "give one size, or radius")
        return (x, y, vertical), (width / 2,)

    def _largest(self, radii: tuple[Any, ...]) -> Any:
        """The larger radius; without exact numbers the one that is larger in the program as it is."""
        if len(radii) == 1:
            return radii[0]
        if not self.exact:
            return radii[next(self.decided)]
        self.decisions.append(radii.index(max(radii)))
        return max(radii)

    def _point(self, point: Vector) -> Vector:
        """A point in the grid, in cells: up, depth, side."""
        scale = self.source.scale
        assert scale is not None
        x, y, z = (value * scale.cells_per_unit for value in point)
        return z + self.floor, y + self.middle, self.side - x

    def _length(self, value: Any) -> Any:
        assert self.source.scale is not None
        return value * self.source.scale.cells_per_unit

    def _numbers(self, line: Line, values: Sequence[Any]) -> tuple[Any, ...]:
        """Values in cells, rounded to float32 if they are plain numbers."""
        if not self.exact:
            return tuple(values)
        try:
            return tuple(to_float32(value) + 0.0 for value in values)
        except ShapeProgError as error:
            raise Fault(line, error.message, error.hint) from None


def too_deep(line: Line) -> Fault:
    """The mistake of a loop inside of too many others."""
    return Fault(line, f"loops are nested more than {DEEPEST} deep", "put some of them side by side")


def sizes_of(box: Box) -> Scope:
    """Width, depth and height of a box, by name."""
    return {word: high - low for word, (low, high) in zip(SIZES, box, strict=True)}
