"""A placed program taken apart into coordinates; :mod:`~shapeprog.inference.ties.anchored` puts it together again.

The horizontal and vertical position of every part is given by *elements*: an interval (a box), the axis of a round
part with its radius, or a single coordinate (an end of a rod, the plane of a mirror, the last copy of a row).  Each
end of an element is measured from an anchor, the low side, the middle or the high side of the whole, see
:mod:`shapeprog.inference.ties.anchors`; the anchors decide which keywords the text has.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Argument, Group, Line, Part, Point, Source, changed_lines
from shapeprog.language.expression import value_at
from shapeprog.language.placement import AXES, POINTS, ROUND, SIZES, coordinate_of, interval_of

LOW, MIDDLE, HIGH = 0, 1, 2
"""Anchors."""

Anchors = tuple[int, ...]
"""The anchors of both ends of an interval, or of a single coordinate."""

ElementKind = Literal["interval", "round", "coordinate"]
Kind = Literal["extent", "clearance", "offset", "size", "radius", "edge", "angle", "length"]

ANGLES = ("tilt", "turn", "step")
ALIGNED = 1e-5
"""Cells by which coordinates may differ that are the same."""


@dataclass(frozen=True)
class Element:
    """The coordinates of a line along one axis.

    Parameters
    ----------
    line
        Number of the line, in the order of the text.
    key
        Empty for the box of a part; else ``start``, ``through``, ``end``, ``across`` (the size of a bar), ``plane``,
        ``centre`` or ``last``.
    axis
        0 left-right, 1 front-rear, 2 vertical.
    kind
        Whether it is an interval, the axis of a round part, or a single coordinate.
    low, high
        Ends from the low side of the whole, in the unit of the text; the same for a single coordinate.
    """

    line: int
    key: str
    axis: int
    kind: ElementKind
    low: float
    high: float

    @property
    def middle(self) -> float:
        """Half-way between its ends."""
        return (self.low + self.high) / 2


@dataclass(frozen=True)
class Slot:
    """One number of the text.

    Parameters
    ----------
    line, word
        Number of the line, and keyword; that of a point begins with ``start.`` or such.
    kind
        The quantity that it measures.
    axis
        0, 1 or 2 along an axis, else -1.
    anchor
        From where a clearance or offset is measured.
    value
        Its value, in the unit of the text, or in degrees.
    """

    line: int
    word: str
    kind: Kind
    axis: int
    anchor: int
    value: float


class Layout:
    """The elements of a placed program whose parts are all placed in the whole.

    Parameters
    ----------
    source
        A placed program of plain numbers, without groups, functions and names but the sizes of the whole.

    Attributes
    ----------
    source
        The program; its upright round parts have a radius.
    lines
        The parts and loops, in the order of the text.
    numbers
        Width, depth and height of the whole, by name.
    extents
        The same as a tuple.
    filling
        The lines of cylinders that are nearly as wide as the whole, which then has one diameter.
    loops_around
        For every line the numbers of the loops around it.
    elements
        All elements, by line, key and axis.
    """

    def __init__(self, source: Source) -> None:
        self.numbers: dict[str, float] = source.evaluated_numbers()
        self.source = replace(source, lines=changed_lines(source.lines, self._with_radius))
        self.lines = [line for line in self.source.walk() if isinstance(line, Part | Group)]
        self.filling = {index for index, line in enumerate(self.lines) if isinstance(line, Part) and self._fills(line)}
        if self.filling:
            self.numbers["depth"] = self.numbers["width"]
        self.extents = tuple(float(self.numbers[size]) for size in SIZES)
        self.loops_around: list[list[int]] = [[] for _ in self.lines]
        for index, loop in enumerate(self.lines):
            for inner in range(index + 1, index + sum(1 for _ in Source((loop,)).walk())):
                self.loops_around[inner].append(index)
        self.elements: dict[tuple[int, str, int], Element] = {}
        for index, line in enumerate(self.lines):
            for element in self._elements(index, line):
                self.elements[index, element.key, element.axis] = element

    def lines_of(self, top: Collection[int]) -> set[int]:
        """The numbers of the lines at the top level with these indices, and of all lines inside of them."""
        roots = [loops[0] if loops else index for index, loops in enumerate(self.loops_around)]
        selected = {root for index, root in enumerate(dict.fromkeys(roots)) if index in top}
        return {index for index, root in enumerate(roots) if root in selected}

    def first(self, loop: int) -> tuple[int, str]:
        """The first part inside of a loop, and the key of its elements: a row is measured by it."""
        index = next(k for k in range(loop, len(self.lines)) if isinstance(self.lines[k], Part))
        return index, "start" if "start" in dict(self.lines[index].keywords) else ""

    def _with_radius(self, line: Line) -> Line:
        """An upright round part with a radius in place of a width or depth."""
        arguments = dict(line.keywords) if isinstance(line, Part) else {}
        if not isinstance(line, Part) or line.kind not in ROUND or {"radius", "start"} & arguments.keys():
            return line
        ends = (interval(line, axis, self.numbers) for axis in range(2))
        keywords = tuple(pair for pair in line.keywords if pair[0] not in SIZES[:2])
        return replace(line, keywords=(*keywords, ("radius", min(high - low for low, high in ends) / 2)))

    def _fills(self, part: Part) -> bool:
        width, depth = self.numbers["width"], self.numbers["depth"]
        if part.kind != "cylinder" or abs(width - depth) > TIES.off_middle * width:
            return False
        ends = [interval(part, axis, self.numbers) for axis in range(2)]
        off = max(abs((low + high) / 2 - width / 2) for low, high in ends)
        return ends[0][1] - ends[0][0] > TIES.fills * width and off < TIES.off_middle * width

    def _elements(self, index: int, line: Part | Group) -> Iterator[Element]:
        keywords = dict(line.keywords)
        if isinstance(line, Group):
            yield from self._loop_elements(index, line, keywords)
        elif "start" in keywords:
            yield from self._across(index, line, keywords)
            start = [point(keywords["start"], axis, self.numbers) for axis in range(3)]
            for word in POINTS:
                for axis in range(3) if word in keywords else ():
                    value = point(keywords[word], axis, self.numbers, start[axis])
                    if word == "start" or abs(value - start[axis]) > ALIGNED:
                        yield Element(index, word, axis, "coordinate", value, value)
        else:
            for axis, extent in enumerate(self.extents):
                low, high = interval(line, axis, self.numbers)
                if index in self.filling and axis < 2:
                    low, high = (extent - (high - low)) / 2, (extent + (high - low)) / 2
                is_round = axis < 2 and line.kind in ROUND and index not in self.filling
                yield Element(index, "", axis, "round" if is_round else "interval", low, high)

    def _across(self, index: int, bar: Part, keywords: dict[str, Argument]) -> Iterator[Element]:
        """The sizes of a bar across its direction, where it lies in the middle of the whole."""
        if abs(float(keywords.get("turn", 0))) > TIES.degrees:  # type: ignore[arg-type]
            return
        for axis, size in enumerate(SIZES[:2]):
            if size in keywords:
                extent, half = self.extents[axis], float(keywords[size]) / 2  # type: ignore[arg-type]
                start, _ = interval(bar, axis, self.numbers)
                ends = start, point(keywords["end"], axis, self.numbers, start)
                if max(abs(end - extent / 2) for end in ends) < TIES.off_middle * extent:
                    yield Element(index, "across", axis, "interval", extent / 2 - half, extent / 2 + half)

    def _loop_elements(self, index: int, line: Group, keywords: dict[str, Argument]) -> Iterator[Element]:
        if line.kind == "translate":
            first = self.lines[self.first(index)[0]]
            assert isinstance(first, Part)
            copies = max(1, round(float(line.count)) - 1)  # type: ignore[arg-type]
            for axis, word in enumerate("xyz"):
                if step := float(keywords.get(word, 0)):  # type: ignore[arg-type]
                    low, high = interval(first, axis, self.numbers)
                    yield Element(index, "last", axis, "coordinate", low + copies * step, high + copies * step)
            return
        for axis, words in enumerate(AXES):
            if not keywords.keys().isdisjoint(words) or (line.kind == "rotate" and axis < 2):
                value = point(Point(line.keywords), axis, self.numbers)  # type: ignore[arg-type]
                yield Element(index, "plane" if line.kind == "mirror" else "centre", axis, "coordinate", value, value)


def interval(
    part: Part, axis: int, numbers: Mapping[str, float], forms: Mapping[str, Any] | None = None
) -> tuple[Any, Any]:
    """The low and high coordinate of a part from the low side of the whole; those of its start if it has one.

    Parameters
    ----------
    part, axis
        The part, and the axis along which it is measured.
    numbers
        The values of all names.
    forms
        What names stand for in the result, such as linear forms; by default their values.
    """
    keywords, values = dict(part.keywords), numbers if forms is None else forms
    if "start" in keywords:
        start = point(keywords["start"], axis, values)
        return start, start
    given = {word: value_at(keywords[word], values) for word in AXES[axis] if word in keywords}  # type: ignore[arg-type]
    if "radius" in keywords and axis < 2:
        radii = keywords["radius"] if isinstance(keywords["radius"], tuple) else (keywords["radius"],)
        largest = max(radii, key=lambda radius: value_at(radius, numbers))
        given[AXES[axis].size] = 2 * value_at(largest, values)  # type: ignore[arg-type]
    return interval_of(axis, given, 0.0, values[SIZES[axis]])


def point(argument: Argument, axis: int, values: Mapping[str, Any], default: Any = None) -> Any:
    """The coordinate of a point from the low side of the whole, by the values of names."""
    assert isinstance(argument, Point)
    given = {word: value_at(value, values) for word, value in argument.keywords if word in AXES[axis]}
    return coordinate_of(axis, given, 0.0, values[SIZES[axis]], default)
