"""A placed program taken apart into coordinates; :mod:`~shapeprog.inference.ties.anchored` puts it together again.

The horizontal and vertical position of every part is given by *elements*: an interval (a box), the axis of a round
part with its radius, or a single coordinate (an end of a rod, the plane of a mirror, the last copy of a row).  Each
end of an element is measured from an anchor, the low side, the middle or the high side of the whole, see
:mod:`shapeprog.inference.ties.anchors`; the anchors decide which keywords the text has.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Literal

from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Argument, Group, Part, Point, Source
from shapeprog.language.placement import AXES, POINTS, ROUND, SIZES

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
    lines
        The parts and loops, in the order of the text.
    extents
        Width, depth and height of the whole.
    loops_around
        For every line the numbers of the loops around it.
    elements
        All elements, by line, key and axis.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        numbers = source.evaluated_numbers()
        self.extents = tuple(float(numbers[size]) for size in SIZES)
        self.lines = [line for line in source.walk() if isinstance(line, Part | Group)]
        if any(isinstance(line, Part) and self.fills(line) for line in self.lines):
            self.extents = (self.extents[0], self.extents[0], self.extents[2])
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
        counter, result = count(), set[int]()
        drawing = [line for line in self.source.lines if isinstance(line, Part | Group)]
        for index, line in enumerate(drawing):
            numbers = {next(counter) for _ in Source((line,)).walk()}
            result |= numbers if index in top else set()
        return result

    def _elements(self, index: int, line: Part | Group) -> Iterator[Element]:
        keywords = dict(line.keywords)
        if isinstance(line, Group):
            yield from self._loop_elements(index, line, keywords)
            return
        if "start" in keywords:
            start = None
            yield from self._across(index, keywords)
            for word in POINTS:
                if word in keywords:
                    point = [self._coordinate(axis, keywords[word], start) for axis in range(3)]
                    start = start or point
                    for axis, value in enumerate(point):
                        if word == "start" or abs(value - start[axis]) > ALIGNED:
                            yield Element(index, word, axis, "coordinate", value, value)
            return
        diameter = None
        if line.kind in ROUND and not self.fills(line):
            diameter = 2 * self.radius(line)
        for axis in range(3):
            low, high = self._interval(axis, keywords, diameter if axis < 2 else None)
            if axis < 2 and line.kind in ROUND and diameter is None:
                radius = self.radius(line)
                low, high = self.extents[0] / 2 - radius, self.extents[0] / 2 + radius
            kind: ElementKind = "round" if diameter is not None and axis < 2 else "interval"
            yield Element(index, "", axis, kind, low, high)

    def _across(self, index: int, keywords: dict[str, Argument]) -> Iterator[Element]:
        """The sizes of a bar across its direction, where it lies in the middle of the whole."""
        for axis, size in enumerate(SIZES):
            if size in keywords and axis < 2 and abs(float(keywords.get("turn", 0))) < TIES.degrees:  # type: ignore[arg-type]
                start = self._coordinate(axis, keywords["start"], None)
                end = self._coordinate(axis, keywords["end"], [start] * 3)
                middle, half = self.extents[axis] / 2, float(keywords[size]) / 2  # type: ignore[arg-type]
                if max(abs(start - middle), abs(end - middle)) < TIES.off_middle * self.extents[axis]:
                    yield Element(index, "across", axis, "interval", middle - half, middle + half)

    def first(self, loop: int) -> tuple[int, str]:
        """The first part inside of a loop, and the key of its elements: a row is measured by it."""
        index = next(k for k in range(loop, len(self.lines)) if isinstance(self.lines[k], Part))
        return index, "start" if "start" in dict(self.lines[index].keywords) else ""

    def fills(self, line: Part) -> bool:
        """Whether a cylinder is as wide as the whole nearly, which then has one diameter."""
        width, depth, _ = self.extents
        if line.kind != "cylinder" or abs(width - depth) > TIES.off_middle * width:
            return False
        radius, keywords = self.radius(line), dict(line.keywords)
        spans = [self._interval(axis, keywords, 2 * radius) for axis in range(2)]
        middles = [abs((low + high) / 2 - width / 2) for low, high in spans]
        return 2 * radius > TIES.fills * width and max(middles) < TIES.off_middle * width

    def radius(self, line: Part) -> float:
        """The radius of an upright round part, the larger of two."""
        keywords = dict(line.keywords)
        if "radius" in keywords:
            argument = keywords["radius"]
            return max(map(float, argument)) if isinstance(argument, tuple) else float(argument)  # type: ignore[arg-type]
        sizes = (self._interval(axis, keywords, None) for axis in range(2))
        return min(high - low for low, high in sizes) / 2

    def _loop_elements(self, index: int, line: Group, keywords: dict[str, Argument]) -> Iterator[Element]:
        if line.kind == "translate":
            number, key = self.first(index)
            first = self.lines[number]
            copies = max(1, round(float(line.count)) - 1)  # type: ignore[arg-type]
            for axis, word in enumerate("xyz"):
                if step := float(keywords.get(word, 0)):  # type: ignore[arg-type]
                    element = next(e for e in self._elements(number, first) if (e.key, e.axis) == (key, axis))
                    low, high = element.low + copies * step, element.high + copies * step
                    yield Element(index, "last", axis, "coordinate", low, high)
        elif line.kind in ("mirror", "rotate"):
            for axis, words in enumerate(AXES):
                used = [word for word in words if word in keywords]
                if used or (line.kind == "rotate" and axis < 2):
                    value = self._coordinate(axis, Point(tuple((w, keywords[w]) for w in used)), None)  # type: ignore[misc]
                    yield Element(
                        index, "plane" if line.kind == "mirror" else "centre", axis, "coordinate", value, value
                    )

    def _interval(self, axis: int, keywords: dict[str, Argument], diameter: float | None) -> tuple[float, float]:
        words, extent = AXES[axis], self.extents[axis]
        lengths: dict[str, float] = {word: float(keywords[word]) for word in words if word in keywords}  # type: ignore[arg-type]
        size = lengths.get(words.size, diameter)
        if size is None:
            return lengths.get(words.low, 0.0), extent - lengths.get(words.high, 0.0)
        if words.low in lengths:
            low = lengths[words.low]
        elif words.high in lengths:
            low = extent - lengths[words.high] - size
        elif words.offset in lengths or axis < 2:
            low = (extent - size) / 2 + lengths.get(words.offset, 0.0)
        else:
            low = 0.0
        return low, low + size

    def _coordinate(self, axis: int, point: Argument, start: Sequence[float] | None) -> float:
        assert isinstance(point, Point)
        words, extent, arguments = AXES[axis], self.extents[axis], dict(point.keywords)
        if words.low in arguments:
            return float(arguments[words.low])  # type: ignore[arg-type]
        if words.high in arguments:
            return extent - float(arguments[words.high])  # type: ignore[arg-type]
        if words.offset in arguments:
            return extent / 2 + float(arguments[words.offset])  # type: ignore[arg-type]
        return start[axis] if start else 0.0 if axis == 2 else extent / 2
