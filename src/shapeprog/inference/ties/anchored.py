"""A program in which every face is measured from its anchor, and every number has a name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from shapeprog.inference.ties.layout import ALIGNED, ANGLES, HIGH, LOW, MIDDLE, Anchors, Element, Kind, Layout, Slot
from shapeprog.language.ast import Argument, Assignment, Group, Keywords, Line, Part, Point, body_of
from shapeprog.language.evaluate import placed_source
from shapeprog.language.expression import Binary, Linear, Name, Value
from shapeprog.language.placement import AXES, POINTS, ROUND, SIZES
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
        The numbers, the three sizes of the whole first.
    source
        The program, its numbers named by :meth:`name`.
    """

    def __init__(self, layout: Layout, anchors: dict[tuple[int, str, int], Anchors]) -> None:
        self.layout, self.anchors = layout, anchors
        self.slots = [Slot(-1, word, "extent", axis, LOW, layout.extents[axis]) for axis, word in enumerate(SIZES)]
        self.index: dict[tuple[int, str], int] = {}
        self._ends: dict[tuple[int, str, int], tuple[Linear, Linear]] = {}
        self._counter = iter(range(len(layout.lines)))
        body = self._body(layout.source.lines)
        sizes = Assignment(tuple((self.name(axis), layout.extents[axis]) for axis in range(3)))
        assigned = tuple((self.name(index), slot.value) for index, slot in enumerate(self.slots))[3:]
        self.lines: tuple[Line, ...] = (sizes, *([Assignment(assigned)] if assigned else []), *body)
        self.source = replace(placed_source(self.lines), scale=layout.source.scale, unit=layout.source.unit)

    def fixed(self) -> FloatArray:
        """Relations (M, P) that always hold: the width and the depth of a round part that fills the whole are equal."""
        rows = []
        for index, line in enumerate(self.layout.lines):
            if isinstance(line, Part) and self.layout.fills(line):
                words = [word for words in AXES[:2] for word in words[:2] if (index, word) in self.index]
                pairs = [(0, 1), *((self.index[index, words[0]], self.index[index, word]) for word in words[1:])]
                rows += [np.eye(len(self.slots))[a] - np.eye(len(self.slots))[b] for a, b in pairs]
        distinct = {row.tobytes(): row for row in rows}
        return np.array([*distinct.values()]).reshape(-1, len(self.slots))

    def ends(self) -> Iterator[tuple[Element, FloatArray, FloatArray]]:
        """Every element, and how its low and high coordinate from the low side of the whole follow from the numbers
        (P,)."""
        index = {self.name(slot): slot for slot in range(len(self.slots))}
        for key, forms in self._ends.items():
            rows = np.zeros((2, len(self.slots)))
            for row, form in zip(rows, forms, strict=True):
                for name, factor in form.factors:
                    row[index[name]] = factor
            yield self.layout.elements[key], rows[0], rows[1]

    def name(self, slot: int) -> str:
        """The name of a number."""
        return SIZES[slot] if slot < 3 else f"n{slot}"

    def _slot(self, line: int, word: str, kind: Kind, axis: int, anchor: int, value: float) -> Name:
        self.index[line, word] = len(self.slots)
        self.slots.append(Slot(line, word, kind, axis, anchor, value))
        return Name(self.name(len(self.slots) - 1))

    def _body(self, lines: Sequence[Line]) -> list[Line]:
        result: list[Line] = []
        for line in lines:
            if isinstance(line, Part | Group):
                index = next(self._counter)
                new = self._part(index, line) if isinstance(line, Part) else self._group(index, line)
                result.append(replace(new, body=tuple(self._body(body_of(line)))) if isinstance(new, Group) else new)
        return result

    def _part(self, index: int, line: Part) -> Part:
        keywords: list[tuple[str, Argument]] = []
        arguments, fills = dict(line.keywords), self.layout.fills(line)
        plain = [
            (word, self._plain(index, word, argument)) for word, argument in line.keywords
            if not fills and word in ("radius", "edge", "tilt", "lean", "turn")
        ]  # fmt: skip
        if line.kind in ROUND and "radius" not in arguments and not fills:
            plain.append(("radius", self._plain(index, "radius", self.layout.radius(line))))
        if "start" in arguments:
            keywords += [(word, self._point(index, word)) for word in POINTS if word in arguments]
            sizes = [(word, axis) for axis, word in enumerate(SIZES) if word in arguments]
            keywords += [(word, self._across(index, word, axis, float(arguments[word]))) for word, axis in sizes]  # type: ignore[arg-type]
        else:
            for axis in range(3):
                keywords += self._placed(self.layout.elements[index, "", axis])
        return replace(line, keywords=(*keywords, *plain))

    def _across(self, index: int, word: str, axis: int, size: float) -> Value:
        """A size of a bar: a number, or the extent of the whole less two equal clearances."""
        if self.anchors.get((index, "across", axis)) != (LOW, HIGH):
            return self._slot(index, word, "size", axis, LOW, size)
        value = self._slot(index, AXES[axis].low, "clearance", axis, LOW, (self.layout.extents[axis] - size) / 2)
        self._ends[index, "across", axis] = self._from(axis, LOW, value), self._from(axis, HIGH, value)
        return Binary("-", Name(SIZES[axis]), Binary("*", 2.0, value))

    def _from(self, axis: int, anchor: int, value: Name) -> Linear:
        """The coordinate that a number measures from an anchor."""
        extent, number = Linear.of(SIZES[axis]), Linear.of(value.name)
        return (number, extent / 2 + number, extent - number)[anchor]

    def _plain(self, index: int, word: str, argument: Argument) -> Argument:
        kind: Kind = "angle" if word in ANGLES else "length" if word == "lean" else word  # type: ignore[assignment]
        if isinstance(argument, tuple):
            first, second = (self._slot(index, f"{word}.{end}", kind, -1, LOW, float(argument[end])) for end in (0, 1))  # type: ignore[arg-type]
            return first, second
        return self._slot(index, word, kind, -1, LOW, float(argument))  # type: ignore[arg-type]

    def _group(self, index: int, line: Group) -> Group:
        arguments = dict(line.keywords)
        if line.kind == "translate":
            return replace(line, kind="row", keywords=(("last", self._point(index, "last")),))
        key = "plane" if line.kind == "mirror" else "centre"
        keywords: Keywords = self._point(index, key).keywords
        if "step" in arguments:
            keywords = (*keywords, ("step", self._plain(index, "step", arguments["step"])))
        return replace(line, keywords=keywords)

    def _point(self, index: int, key: str) -> Point:
        pairs: list[tuple[str, Value]] = []
        for axis, words in enumerate(AXES):
            element = self.layout.elements.get((index, key, axis))
            if element is None:
                continue
            (anchor,), extent = self.anchors[index, key, axis], self.layout.extents[axis]
            word = (words.low, words.offset, words.high)[anchor]
            distance = (element.low, element.middle - extent / 2, extent - element.high)[anchor]
            if key in ("plane", "centre") and anchor == MIDDLE and abs(distance) < ALIGNED:
                pairs += [(word, 0.0)] if key == "plane" else []
                continue
            value = self._slot(
                index, f"{key}.{word}", "offset" if anchor == MIDDLE else "clearance", axis, anchor, distance
            )
            self._ends[index, key, axis] = (self._from(axis, anchor, value),) * 2
            pairs.append((word, value))
        return Point(tuple(pairs))

    def _placed(self, element: Element) -> Iterator[tuple[str, Argument]]:
        """The keywords of an element: clearances, size and offset, by its anchors."""
        line, axis, words = element.line, element.axis, AXES[element.axis]
        extent, anchors = self.layout.extents[axis], self.anchors[line, element.key, axis]
        word = (words.low, words.offset, words.high)

        def measured(anchor: int, word: str, distance: float) -> tuple[Name, Linear]:
            value = self._slot(line, word, "offset" if anchor == MIDDLE else "clearance", axis, anchor, distance)
            return value, self._from(axis, anchor, value)

        if len(set(anchors)) == 1:
            anchor = anchors[0]
            distance = (element.low, element.middle - extent / 2, extent - element.high)[anchor]
            value, at = measured(anchor, word[anchor], distance)
            yield word[anchor], value
            if element.kind == "round":
                slot = self.index.get((line, "radius"), self.index.get((line, "radius.0"), 0))
                size = 2 * Linear.of(self.name(slot))
            else:
                given = self._slot(line, words.size, "size", axis, LOW, element.high - element.low)
                yield words.size, given
                size = Linear.of(given.name)
            low = (at, at - size / 2, at - size)[anchor]
            self._ends[line, element.key, axis] = low, low + size
            return
        ends = []
        for end, distance in enumerate((element.low, extent - element.high)):
            if anchors[end] == MIDDLE:  # half of the whole, and as much more or less
                value, at = measured(MIDDLE, words[end], distance - extent / 2)
                yield words[end], Binary("+", Binary("/", Name(SIZES[axis]), 2.0), value)
                ends.append(Linear.of(SIZES[axis]) - at if end else at)
            else:
                value, at = measured(anchors[end], words[end], distance)
                yield words[end], value
                ends.append(at)
        self._ends[line, element.key, axis] = ends[0], ends[1]
