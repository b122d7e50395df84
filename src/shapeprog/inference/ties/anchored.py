"""A program in which every face is measured from its anchor, and every number has a name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from shapeprog.inference.ties.layout import (
    ALIGNED,
    ANGLES,
    HIGH,
    LOW,
    MIDDLE,
    Anchors,
    Element,
    Kind,
    Layout,
    Slot,
    ends_of,
)
from shapeprog.language.ast import Argument, Assignment, Group, Keywords, Line, Part, Point, body_of
from shapeprog.language.evaluate import placed_source
from shapeprog.language.expression import Binary, Linear, Name, Value
from shapeprog.language.placement import AXES, POINTS, SIZES
from shapeprog.space import FloatArray


class Anchored:
    """A layout with an anchor for every end, as the tree of a program in which every number is a name.

    Parameters
    ----------
    layout
        The program.
    anchors
        The anchors of every element.

    Attributes
    ----------
    slots
        The numbers (P,), the three sizes of the whole first.
    index
        The number of every line and keyword.
    names, forms
        The names of the numbers, and each of them as a linear form.
    lines
        The parts and loops with names, as ``layout.lines``.
    source
        The program.
    """

    def __init__(self, layout: Layout, anchors: dict[tuple[int, str, int], Anchors]) -> None:
        self.layout, self.anchors = layout, anchors
        self.slots = [Slot(-1, word, "extent", axis, LOW, layout.extents[axis]) for axis, word in enumerate(SIZES)]
        self.index: dict[tuple[int, str], int] = {}
        self.names = [*SIZES]
        self.lines: list[Part | Group] = []
        self.body = self._named(layout.source.lines)
        self.forms = {name: Linear.of(name) for name in self.names}
        numbers = tuple(zip(self.names, (slot.value for slot in self.slots), strict=True))
        self.source = replace(
            placed_source((Assignment(numbers[:3]), Assignment(numbers[3:]), *self.body)),
            scale=layout.source.scale,
            unit=layout.source.unit,
        )

    def row(self, form: Linear) -> FloatArray:
        """The factors (P,) of a linear form."""
        factors = dict(form.factors)
        return np.array([factors.get(name, 0.0) for name in self.names])

    def fixed(self) -> FloatArray:
        """Relations (M, P) that always hold: the width and the depth of a round part that fills the whole are equal."""
        pairs = [(0, 1)] if self.layout.filling else []
        for line in self.layout.filling:
            words = [word for words in AXES[:2] for word in words[:2] if (line, word) in self.index]
            pairs += [(self.index[line, words[0]], self.index[line, word]) for word in words[1:]]
        unit = np.eye(len(self.slots))
        return np.array([unit[a] - unit[b] for a, b in pairs]).reshape(-1, len(self.slots))

    def ends(self) -> Iterator[tuple[Element, FloatArray, FloatArray]]:
        """Every element that is measured by numbers, and how its low and high coordinate from the low side of the whole
        follow from them (P,)."""
        numbers = {name: slot.value for name, slot in zip(self.names, self.slots, strict=True)}
        for (index, key, axis), element in self.layout.elements.items():
            if key == "across" and self.anchors[index, key, axis] != (LOW, HIGH):
                continue
            low, high = ends_of(self.lines[index], key, axis, numbers, self.forms)
            rows = [self.row(end) for end in (low, high)]
            if rows[0][3:].any():
                yield element, rows[0], rows[1]

    def _named(self, lines: Sequence[Line]) -> tuple[Line, ...]:
        """Lines of the layout with a name for every number, measured from the anchors."""
        result: list[Line] = []
        for line in lines:
            if isinstance(line, Part | Group):
                index = len(self.lines)
                new = self._part(index, line) if isinstance(line, Part) else self._group(index, line)
                self.lines.append(new)
                result.append(replace(new, body=self._named(body_of(line))) if isinstance(new, Group) else new)
        return tuple(result)

    def _part(self, index: int, line: Part) -> Part:
        keywords: list[tuple[str, Argument]] = []
        arguments = dict(line.keywords)
        further = () if index in self.layout.filling else ("radius", "edge", "tilt", "lean", "turn")
        plain = [(word, self._plain(index, word, argument)) for word, argument in line.keywords if word in further]
        if "start" in arguments:
            keywords += [(word, self._point(index, word)) for word in POINTS if word in arguments]
            sizes = [(word, axis) for axis, word in enumerate(SIZES) if word in arguments]
            keywords += [(word, self._across(index, word, axis, float(arguments[word]))) for word, axis in sizes]  # type: ignore[arg-type]
        else:
            for axis in range(3):
                keywords += self._placed(self.layout.elements[index, "", axis])
        return replace(line, keywords=(*keywords, *plain))

    def _group(self, index: int, line: Group) -> Group:
        arguments = dict(line.keywords)
        if line.kind == "translate":
            return replace(line, kind="row", keywords=(("last", self._point(index, "last")),))
        keywords: Keywords = self._point(index, "plane" if line.kind == "mirror" else "centre").keywords
        if "step" in arguments:
            keywords = (*keywords, ("step", self._plain(index, "step", arguments["step"])))
        return replace(line, keywords=keywords)

    def _placed(self, element: Element) -> Iterator[tuple[str, Argument]]:
        """The keywords of an element: clearances, size and offset, by its anchors."""
        line, axis, words = element.line, element.axis, AXES[element.axis]
        anchors = self.anchors[line, element.key, axis]
        if len(set(anchors)) == 1:
            yield self._distance(element, anchors[0])
            if element.kind != "round":
                yield words.size, self._slot(line, words.size, "size", axis, LOW, element.high - element.low)
            return
        extent = self.layout.extents[axis]
        for word, anchor, distance in zip(words, anchors, (element.low, extent - element.high), strict=False):
            if anchor == MIDDLE:  # half of the whole, and as much more or less
                value = self._slot(line, word, "offset", axis, anchor, distance - extent / 2)
                yield word, Binary("+", Binary("/", Name(SIZES[axis]), 2.0), value)
            else:
                yield word, self._slot(line, word, "clearance", axis, anchor, distance)

    def _point(self, index: int, key: str) -> Point:
        pairs: list[tuple[str, Value]] = []
        for axis, words in enumerate(AXES):
            element = self.layout.elements.get((index, key, axis))
            if element is not None:
                (anchor,), off = self.anchors[index, key, axis], element.middle - self.layout.extents[axis] / 2
                if key not in ("plane", "centre") or anchor != MIDDLE or abs(off) >= ALIGNED:
                    pairs.append(self._distance(element, anchor))
                elif key == "plane":
                    pairs.append((words.offset, 0.0))
        return Point(tuple(pairs))

    def _across(self, index: int, word: str, axis: int, size: float) -> Value:
        """A size of a bar: a number, or the extent of the whole less two equal clearances."""
        if self.anchors.get((index, "across", axis)) != (LOW, HIGH):
            return self._slot(index, word, "size", axis, LOW, size)
        value = self._slot(index, AXES[axis].low, "clearance", axis, LOW, (self.layout.extents[axis] - size) / 2)
        return Binary("-", Name(SIZES[axis]), Binary("*", 2.0, value))

    def _distance(self, element: Element, anchor: int) -> tuple[str, Name]:
        """The keyword and the number of a distance from an anchor."""
        axis, extent = element.axis, self.layout.extents[element.axis]
        word = (AXES[axis].low, AXES[axis].offset, AXES[axis].high)[anchor]
        value = (element.low, element.middle - extent / 2, extent - element.high)[anchor]
        key = f"{element.key}.{word}" if element.key else word
        return word, self._slot(element.line, key, "offset" if anchor == MIDDLE else "clearance", axis, anchor, value)

    def _plain(self, index: int, word: str, argument: Argument) -> Argument:
        """A number, or a pair of radii, that is not measured from a side."""
        kind: Kind = "angle" if word in ANGLES else "length" if word == "lean" else word  # type: ignore[assignment]
        if isinstance(argument, tuple):
            first, second = (self._slot(index, f"{word}.{end}", kind, -1, LOW, float(argument[end])) for end in (0, 1))  # type: ignore[arg-type]
            return first, second
        return self._slot(index, word, kind, -1, LOW, float(argument))  # type: ignore[arg-type]

    def _slot(self, line: int, word: str, kind: Kind, axis: int, anchor: int, value: float) -> Name:
        self.index[line, word] = len(self.slots)
        self.names.append(f"n{len(self.slots)}")
        self.slots.append(Slot(line, word, kind, axis, anchor, value))
        return Name(self.names[-1])
