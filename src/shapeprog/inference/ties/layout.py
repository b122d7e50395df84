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
from shapeprog.language.ast import Group, Keywords, Line, Part, Point, Source, changed_lines
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
        self.elements = {
            (index, key, axis): Element(index, key, axis, kind, *self.ends(line, key, axis))
            for index, line in enumerate(self.lines)
            for key, axis, kind in self._keys(index, line)
        }

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
        """An upright round part with a radius in place of a width or depth; in the middle if it fills the whole."""
        arguments = dict(line.keywords) if isinstance(line, Part) else {}
        if not isinstance(line, Part) or line.kind not in ROUND or "start" in arguments:
            return line
        ends = (interval(line, axis, self.numbers) for axis in range(2))
        radius = arguments.get("radius", min(high - low for low, high in ends) / 2)
        left_out = {*SIZES[:2], "radius", *((*AXES[0], *AXES[1]) if self._fills(line) else ())}
        keywords = tuple(pair for pair in line.keywords if pair[0] not in left_out)
        return replace(line, keywords=(*keywords, ("radius", radius)))

    def _fills(self, part: Part) -> bool:
        """Whether a cylinder is nearly as wide as the whole."""
        width, depth = self.numbers["width"], self.numbers["depth"]
        (left, right), (front, rear) = (interval(part, axis, self.numbers) for axis in range(2))
        off = max(abs(left + right - width) / 2, abs(front + rear - width) / 2, abs(width - depth))
        large = min(right - left, rear - front) > TIES.fills * width
        return part.kind == "cylinder" and large and off < TIES.off_middle * width

    def _keys(self, index: int, line: Part | Group) -> Iterator[tuple[str, int, ElementKind]]:
        """The elements of a line: their keys, axes and kinds."""
        keywords = dict(line.keywords)
        for axis, words in enumerate(AXES):
            if isinstance(line, Group):
                if line.kind == "translate" and keywords.get("xyz"[axis]):
                    yield "last", axis, "coordinate"
                elif line.kind != "translate" and not keywords.keys().isdisjoint(words):
                    yield "plane" if line.kind == "mirror" else "centre", axis, "coordinate"
                elif line.kind == "rotate" and axis < 2:
                    yield "centre", axis, "coordinate"
            elif "start" in keywords:
                if self._is_across(line, axis):
                    yield "across", axis, "interval"
                start = self.ends(line, "start", axis)
                for key in POINTS:
                    if key == "start" or (key in keywords and abs(self.ends(line, key, axis)[0] - start[0]) > ALIGNED):
                        yield key, axis, "coordinate"
            else:
                yield "", axis, "round" if axis < 2 and line.kind in ROUND and index not in self.filling else "interval"

    def _is_across(self, bar: Part, axis: int) -> bool:
        """Whether a bar has a size along an axis, across its direction, and lies in the middle of the whole."""
        keywords, extent = dict(bar.keywords), self.extents[axis]
        if SIZES[axis] not in keywords or axis == 2 or abs(float(keywords.get("turn", 0))) > TIES.degrees:  # type: ignore[arg-type]
            return False
        ends = (self.ends(bar, key, axis)[0] for key in ("start", "end"))
        return max(abs(end - extent / 2) for end in ends) < TIES.off_middle * extent

    def ends(self, line: Part | Group, key: str, axis: int) -> tuple[float, float]:
        """The low and high coordinate of an element."""
        if key != "last":
            low, high = ends_of(line, key, axis, self.numbers)
            return low, high
        first = next(inner for inner in Source((line,)).walk() if isinstance(inner, Part))
        copies = max(1, round(float(line.count)) - 1)  # type: ignore[arg-type, union-attr]
        away = copies * float(dict(line.keywords)["xyz"[axis]])  # type: ignore[arg-type]
        low, high = interval(first, axis, self.numbers)
        return low + away, high + away


def ends_of(
    line: Part | Group, key: str, axis: int, numbers: Mapping[str, float], forms: Mapping[str, Any] | None = None
) -> tuple[Any, Any]:
    """The low and high coordinate of an element from the low side of the whole.

    Parameters
    ----------
    line, key, axis
        As of :class:`Element`.
    numbers
        The values of all names.
    forms
        What names stand for in the result, such as linear forms; by default their values.
    """
    keywords, values = dict(line.keywords), numbers if forms is None else forms
    pairs: Keywords = line.keywords
    if key in (*POINTS, "last"):
        argument = keywords[key]
        assert isinstance(argument, Point)
        pairs = argument.keywords
    given = {word: value_at(value, values) for word, value in pairs if word in AXES[axis]}  # type: ignore[arg-type]
    sides = 0.0, values[SIZES[axis]]
    if key in ("", "across"):
        if "radius" in keywords and axis < 2:
            radii = keywords["radius"] if isinstance(keywords["radius"], tuple) else (keywords["radius"],)
            largest = max(radii, key=lambda radius: value_at(radius, numbers))
            given[SIZES[axis]] = 2 * value_at(largest, values)  # type: ignore[arg-type]
        return interval_of(axis, given, *sides)
    start = ends_of(line, "start", axis, numbers, forms)[0] if key in ("through", "end") else None
    coordinate = coordinate_of(axis, given, *sides, start)
    return coordinate, coordinate


def interval(part: Part, axis: int, numbers: Mapping[str, float]) -> tuple[float, float]:
    """The low and high coordinate of a part from the low side of the whole; those of its start if it has one."""
    low, high = ends_of(part, "start" if "start" in dict(part.keywords) else "", axis, numbers)
    return low, high
