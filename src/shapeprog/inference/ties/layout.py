"""A placed program in which every face is measured from its anchor, and every number has a name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from shapeprog.inference.ties.elements import ALIGNED, HIGH, LOW, MIDDLE, Anchors, Element, Key, ends_of
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Argument, Assignment, Group, Line, Part, Point, Source, changed_lines
from shapeprog.language.expression import Binary, Linear, Name, Value
from shapeprog.language.placement import AXES, POINTS, ROUND, SIZES
from shapeprog.space import FloatArray

Kind = Literal["extent", "clearance", "offset", "size", "radius", "edge", "angle", "length"]

KINDS: dict[str, Kind] = {
    "radius": "radius", "edge": "edge", "tilt": "angle", "turn": "angle", "step": "angle", "lean": "length"
}  # fmt: skip
"""What keywords measure that are not measured from a side."""


@dataclass(frozen=True)
class Slot:
    """One number of the text.

    Parameters
    ----------
    line, word
        Number of the line, and keyword; that of a point begins with ``start.`` or such.
    kind, axis
        The quantity that it measures, along an axis 0, 1 or 2, else -1.
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
    """A placed program whose parts are all placed in the whole, measured from anchors, with names for its numbers.

    Parameters
    ----------
    source
        A placed program of plain numbers, without groups, functions and names but the sizes of the whole.
    anchors
        The anchors of all elements; by default the low side.

    Attributes
    ----------
    sizes, extents
        Width, depth and height of the whole, by name and in this order.
    lines, parts
        Its parts and loops, in the order of the text, and the numbers of those that are parts; upright round parts have
        a radius.
    top, loops_around
        For every line the index at the top level of the line that it is inside of, and the numbers of the loops around
        it.
    filling
        The lines of cylinders that are nearly as wide as the whole, which then has one diameter.
    elements
        All elements, by line, key and axis.
    slots, names, forms
        The numbers (P,), the three sizes of the whole first, their names, and linear forms by these names.
    index
        The number of every line and keyword.
    named, body, source
        The parts and loops with names, as ``lines``; as lines of a program; and this program.
    """

    def __init__(self, source: Source, anchors: Mapping[Key, Anchors] | None = None) -> None:
        self.sizes: dict[str, float] = source.evaluated_numbers()
        tree = changed_lines([line for line in source.lines if isinstance(line, Part | Group)], self._with_radius)
        self.lines = [line for line in Source(tree).walk() if isinstance(line, Part | Group)]
        self.top = [index for index, line in enumerate(tree) for _ in Source((line,)).walk()]
        self.parts = [index for index, line in enumerate(self.lines) if isinstance(line, Part)]
        self.filling = {index for index in self.parts if self._fills(self.lines[index])}  # type: ignore[arg-type]
        if self.filling:
            self.sizes["depth"] = self.sizes["width"]
        self.extents = tuple(float(self.sizes[size]) for size in SIZES)
        self.loops_around: list[list[int]] = [[] for _ in self.lines]
        for index, loop in enumerate(self.lines):
            for inner in range(index + 1, index + sum(1 for _ in Source((loop,)).walk())):
                self.loops_around[inner].append(index)
        elements = (element for index in range(len(self.lines)) for element in self._elements(index))
        self.elements: dict[Key, Element] = {(each.line, each.key, each.axis): each for each in elements}
        self.anchors = anchors or {
            key: (LOW, LOW) if element.kind == "interval" else (LOW,) for key, element in self.elements.items()
        }
        self.slots = [Slot(-1, word, "extent", axis, LOW, self.extents[axis]) for axis, word in enumerate(SIZES)]
        self.index: dict[tuple[int, str], int] = {}
        self.names = [*SIZES]
        self.named: list[Part | Group] = []
        self.body = changed_lines(tree, self._with_names)
        self.forms = {name: Linear.of(name) for name in self.names}
        self._numbers = {name: slot.value for name, slot in zip(self.names, self.slots, strict=True)}
        pairs = tuple(self._numbers.items())
        lines = Assignment(pairs[:3]), Assignment(pairs[3:]), *self.body
        self.source = Source(lines, source.unit, source.scale)

    def first(self, loop: int) -> tuple[int, str]:
        """The first part inside of a loop, and the key of its elements: a row is measured by it."""
        index = next(index for index in self.parts if index > loop)
        return index, "start" if "start" in dict(self.lines[index].keywords) else ""

    def row(self, form: Linear) -> FloatArray:
        """The factors (P,) of a linear form."""
        factors = dict(form.factors)
        return np.array([factors.get(name, 0.0) for name in self.names])

    def fixed(self) -> FloatArray:
        """Relations (M, P) that always hold: the width and the depth of a round part that fills the whole are equal."""
        pairs = [(0, 1)] if self.filling else []
        for line in self.filling:
            words = [word for words in AXES[:2] for word in words[:2] if (line, word) in self.index]
            pairs += [(self.index[line, words[0]], self.index[line, word]) for word in words[1:]]
        unit = np.eye(len(self.slots))
        return np.array([unit[a] - unit[b] for a, b in pairs]).reshape(-1, len(self.slots))

    def ends(self) -> Iterator[tuple[Element, FloatArray, FloatArray]]:
        """Every element that is measured by numbers, and how its low and high coordinate from the low side of the whole
        follow from them (P,)."""
        for (index, key, axis), element in self.elements.items():
            if key == "across" and self.anchors[index, key, axis] != (LOW, HIGH):
                continue
            low, high = map(self.row, ends_of(self.named[index], key, axis, self._numbers, self.forms))
            if low[3:].any():
                yield element, low, high

    def _with_radius(self, line: Line) -> Line:
        """An upright round part with a radius in place of a width or depth; in the middle if it fills the whole."""
        arguments = dict(line.keywords) if isinstance(line, Part) else {}
        if not isinstance(line, Part) or line.kind not in ROUND or "start" in arguments:
            return line
        ends = (ends_of(line, "", axis, self.sizes) for axis in range(2))
        radius = arguments.get("radius", min(high - low for low, high in ends) / 2)
        left_out = {*SIZES[:2], "radius", *((*AXES[0], *AXES[1]) if self._fills(line) else ())}
        keywords = tuple(pair for pair in line.keywords if pair[0] not in left_out)
        return replace(line, keywords=(*keywords, ("radius", radius)))

    def _fills(self, part: Part) -> bool:
        """Whether a cylinder is nearly as wide as the whole."""
        if part.kind != "cylinder":
            return False
        width, depth = self.sizes["width"], self.sizes["depth"]
        (left, right), (front, rear) = (ends_of(part, "", axis, self.sizes) for axis in range(2))
        off = max(abs(left + right - width) / 2, abs(front + rear - width) / 2, abs(width - depth))
        return min(right - left, rear - front) > TIES.fills * width and off < TIES.off_middle * width

    def _elements(self, index: int) -> Iterator[Element]:
        """The elements of a line."""
        line = self.lines[index]
        keywords = dict(line.keywords)
        for axis, words in enumerate(AXES):
            if isinstance(line, Part) and "start" not in keywords:
                is_round = axis < 2 and line.kind in ROUND and index not in self.filling
                ends = ends_of(line, "", axis, self.sizes)
                yield Element(index, "", axis, "round" if is_round else "interval", *ends)
            elif isinstance(line, Part):
                points = {key: ends_of(line, key, axis, self.sizes) for key in POINTS if key in keywords}
                if self._is_across(line, axis):
                    yield Element(index, "across", axis, "interval", *ends_of(line, "across", axis, self.sizes))
                for key, ends in points.items():
                    if key == "start" or abs(ends[0] - points["start"][0]) > ALIGNED:
                        yield Element(index, key, axis, "coordinate", *ends)
            elif line.kind == "translate":
                if step := keywords.get("xyz"[axis]):
                    first, key = self.first(index)
                    away = max(1, round(float(line.count)) - 1) * float(step)  # type: ignore[arg-type]
                    low, high = ends_of(self.lines[first], key, axis, self.sizes)
                    yield Element(index, "last", axis, "coordinate", low + away, high + away)
            elif not keywords.keys().isdisjoint(words) or (line.kind == "rotate" and axis < 2):
                key = "plane" if line.kind == "mirror" else "centre"
                yield Element(index, key, axis, "coordinate", *ends_of(line, key, axis, self.sizes))

    def _is_across(self, bar: Part, axis: int) -> bool:
        """Whether a bar has a size along an axis, across its direction, and lies in the middle of the whole."""
        keywords, extent = dict(bar.keywords), self.extents[axis]
        if SIZES[axis] not in keywords or axis == 2 or abs(float(keywords.get("turn", 0))) > TIES.degrees:  # type: ignore[arg-type]
            return False
        ends = (ends_of(bar, key, axis, self.sizes)[0] for key in ("start", "end"))
        return max(abs(end - extent / 2) for end in ends) < TIES.off_middle * extent

    def _with_names(self, line: Line) -> Line:
        """A line with a name for every number, measured from the anchors; lines are given in the order of the text."""
        assert isinstance(line, Part | Group)
        index = len(self.named)
        self.named.append(self._part(index, line) if isinstance(line, Part) else self._group(index, line))
        return self.named[-1]

    def _part(self, index: int, line: Part) -> Part:
        keywords: list[tuple[str, Argument]] = []
        arguments = dict(line.keywords)
        plain = [(word, self._plain(index, word, argument)) for word, argument in line.keywords
                 if word in KINDS and index not in self.filling]  # fmt: skip
        if "start" in arguments:
            keywords += [(word, self._point(index, word)) for word in POINTS if word in arguments]
            sizes = [(word, axis) for axis, word in enumerate(SIZES) if word in arguments]
            keywords += [(word, self._across(index, word, axis, float(arguments[word]))) for word, axis in sizes]  # type: ignore[arg-type]
        else:
            for axis in range(3):
                keywords += self._placed(self.elements[index, "", axis])
        return replace(line, keywords=(*keywords, *plain))

    def _group(self, index: int, line: Group) -> Group:
        if line.kind == "translate":
            return replace(line, kind="row", keywords=(("last", self._point(index, "last")),))
        place = self._point(index, "plane" if line.kind == "mirror" else "centre").keywords
        step = [(word, self._plain(index, word, argument)) for word, argument in line.keywords if word == "step"]
        return replace(line, keywords=(*place, *step))

    def _placed(self, element: Element) -> Iterator[tuple[str, Argument]]:
        """The keywords of an element: clearances, size and offset, by its anchors."""
        line, axis, words = element.line, element.axis, AXES[element.axis]
        anchors = self.anchors[line, element.key, axis]
        if len(set(anchors)) == 1:
            yield self._distance(element, anchors[0])
            if element.kind != "round":
                yield words.size, self._slot(line, words.size, "size", axis, LOW, element.high - element.low)
            return
        extent = self.extents[axis]
        for word, anchor, distance in zip(words, anchors, (element.low, extent - element.high), strict=False):
            if anchor == MIDDLE:  # half of the whole, and as much more or less
                value = self._slot(line, word, "offset", axis, anchor, distance - extent / 2)
                yield word, Binary("+", Binary("/", Name(SIZES[axis]), 2.0), value)
            else:
                yield word, self._slot(line, word, "clearance", axis, anchor, distance)

    def _point(self, index: int, key: str) -> Point:
        pairs: list[tuple[str, Value]] = []
        for axis, words in enumerate(AXES):
            element = self.elements.get((index, key, axis))
            if element is not None:
                (anchor,), off = self.anchors[index, key, axis], element.middle - self.extents[axis] / 2
                if key not in ("plane", "centre") or anchor != MIDDLE or abs(off) >= ALIGNED:
                    pairs.append(self._distance(element, anchor))
                elif key == "plane":
                    pairs.append((words.offset, 0.0))
        return Point(tuple(pairs))

    def _across(self, index: int, word: str, axis: int, size: float) -> Value:
        """A size of a bar: a number, or the extent of the whole less two equal clearances."""
        if self.anchors.get((index, "across", axis)) != (LOW, HIGH):
            return self._slot(index, word, "size", axis, LOW, size)
        value = self._slot(index, AXES[axis].low, "clearance", axis, LOW, (self.extents[axis] - size) / 2)
        return Binary("-", Name(SIZES[axis]), Binary("*", 2.0, value))

    def _distance(self, element: Element, anchor: int) -> tuple[str, Name]:
        """The keyword and the number of a distance from an anchor."""
        axis, extent = element.axis, self.extents[element.axis]
        word = (AXES[axis].low, AXES[axis].offset, AXES[axis].high)[anchor]
        value = (element.low, element.middle - extent / 2, extent - element.high)[anchor]
        key = f"{element.key}.{word}" if element.key else word
        return word, self._slot(element.line, key, "offset" if anchor == MIDDLE else "clearance", axis, anchor, value)

    def _plain(self, index: int, word: str, argument: Argument) -> Argument:
        """A number, or a pair of radii, that is not measured from a side."""
        if isinstance(argument, tuple):
            return self._plain(index, f"{word}.0", argument[0]), self._plain(index, f"{word}.1", argument[1])  # type: ignore[return-value]
        kind = KINDS[word.partition(".")[0]]
        return self._slot(index, word, kind, -1, LOW, float(argument))  # type: ignore[arg-type]

    def _slot(self, line: int, word: str, kind: Kind, axis: int, anchor: int, value: float) -> Name:
        self.index[line, word] = len(self.slots)
        self.names.append(f"n{len(self.slots)}")
        self.slots.append(Slot(line, word, kind, axis, anchor, value))
        return Name(self.names[-1])
