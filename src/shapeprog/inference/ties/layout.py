"""A placed program in which every face is measured from its anchor, and every number has a name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import torch
from torch import Tensor

from shapeprog.geometry.scene import Scene
from shapeprog.inference.fit.tunable import Poses, Tunable
from shapeprog.inference.ties.elements import HIGH, LOW, MIDDLE, Anchors, Element, ElementKind, Key, Kind, Slot
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Argument, Assignment, Group, Line, Part, Point, Source, changed_lines
from shapeprog.language.convert.divisions import divided
from shapeprog.language.evaluate import expanded, symbolic
from shapeprog.language.expression import Name, Value
from shapeprog.language.placement import AXES, POINTS, ROUND, SIZES, ends_of
from shapeprog.language.program import Program
from shapeprog.space import FloatArray

ALIGNED = 1e-5  # cells by which coordinates may differ that are the same

KINDS: dict[str, Kind] = {
    "radius": "radius", "edge": "edge", "gap": "gap", "lean": "length",
    "tilt": "angle", "turn": "angle", "step": "angle",
}  # fmt: skip
"""What keywords measure that are not measured from a side."""


class Layout:
    """A placed program as a function of its numbers: all parts are placed in the whole and measured from anchors.

    Parameters
    ----------
    source
        A placed program of plain numbers, without groups, functions and names but the sizes of the whole.
    anchors
        The anchors of all elements; by default the low side.
    divide
        Whether neighbours become divisions of a box; outer mirrors about the middle, and outer loops with such
        neighbours, are then around one line each.
    """

    def __init__(self, source: Source, anchors: Mapping[Key, Anchors] | None = None, *, divide: bool = True) -> None:
        self._numbers: dict[str, float] = source.evaluated_numbers()  # by name, at the start
        division = partial(divided, numbers=self._numbers, touch=TIES.touch, gap=TIES.gap)
        drawing: list[Line] = []
        for line in source.lines:
            match line:
                case Group("mirror" | "translate", keywords, body) if divide:
                    # Each may become a division, or move into a box, alone; the text joins other mirrors again.
                    alone = [replace(line, body=(inner,)) for inner in body]
                    middle = {*keywords} <= {("x", 0.0), ("y", 0.0)}
                    drawing += alone if middle or any(division(each) is not each for each in alone) else [line]
                case Part() | Group():
                    drawing.append(line)
        tree = changed_lines(changed_lines(drawing, division) if divide else drawing, self._with_radius)
        # The parts and loops, in the order of the text, and the words of parts by the number of their line.  A division
        # stands for its part.
        self.lines = [line for line in Source(tree).walk() if isinstance(line, Part | Group)]
        parts = [(index, line) for index, line in enumerate(self.lines) if isinstance(line, Part)]
        self.words = {index - self._divided(index): line.word for index, line in parts}
        self.parts = [*self.words]
        behind = [index + sum(1 for _ in Source((line,)).walk()) for index, line in enumerate(self.lines)]
        self.loops_around = [[loop for loop in range(n) if n < behind[loop]] for n in range(len(self.lines))]
        # Cylinders that fill the whole, to which ``_with_radius`` gave no radius: the whole then has one diameter.
        self._filling = [
            index for index, line in parts if line.kind == "cylinder" and "radius" not in dict(line.keywords)
        ]
        if self._filling:
            self._numbers["depth"] = self._numbers["width"]
        self.extents = tuple(self._numbers.values())
        self.elements: dict[Key, Element] = {}
        self._anchors = anchors or {}
        # The numbers (P,), the three sizes of the whole first, and that of every line and keyword.
        self.slots = [Slot(-1, word, "extent", axis, self.extents[axis]) for axis, word in enumerate(SIZES)]
        self.index: dict[tuple[int, str], int] = {}
        self._named: list[Part | Group] = []
        self.body = changed_lines(tree, self._with_names)
        self.names = [*self._numbers]
        self.numbers: FloatArray = np.array([*self._numbers.values()])  # at the start (P,)
        # What each name is (P + 1,) where one of all numbers is 1 and the others are 0, and where all are 0: a linear
        # function of the numbers is given by these values of it.
        self._forms = dict(zip(self.names, np.eye(len(self.names) + 1), strict=False))
        self.source = Source((Assignment(tuple(self._numbers.items())), *self.body), source.unit, source.scale)
        self.tunable = Tunable(Program(expanded(self.source)))
        assert source.scale is not None
        self.scale = scale = source.scale
        floor = scale.floor + (self.extents[2] - self._forms["height"]) * 0.5  # the middle of the whole stays
        nodes = list(Program(symbolic(self.source, self._forms, (floor, scale.middle))).walk())
        none = np.zeros(len(self.slots) + 1)
        values = np.array([none + nodes[n].values[slot] for n, slot in self.tunable.moving]).reshape(-1, len(none))
        # How the numbers of its statements in cells follow from those of the text (F, P), up to constants.
        self.jacobian: FloatArray = values[:, :-1] - values[:, -1:]
        self._offset = values[:, -1]
        # Rows (G, P) and lower bounds (G,) of their products with the numbers: no part may become thinner than
        # ``THINNEST``, no rod less than half as long, and no end of a part may leave the whole.
        rods = [self._along(line) for line in self._named if "end" in dict(line.keywords)]
        unit, ends = np.eye(len(self.slots)), [end for end in self.ends() if end[0].key not in ("plane", "centre")]
        inside = [side for element, low, high in ends for side in (low, unit[element.axis] - high)]
        self.bounded: FloatArray = np.vstack([self.jacobian, *rods, *inside])
        lowest = [float(rod @ self.numbers) / 2 for rod in rods] + [0.0] * len(inside)
        self.low: FloatArray = np.append(self.tunable.low.numpy() - self._offset, lowest)

    def _along(self, line: Part | Group) -> FloatArray:
        """How the length of a rod along the axis that it runs along most follows from the numbers (P,)."""
        ends = (
            [ends_of(line, key, axis, self._numbers, self._forms)[0] for axis in range(3)] for key in ("start", "end")
        )
        ways = np.array([end - start for start, end in zip(*ends, strict=True)])[:, :-1]
        lengths = ways @ self.numbers
        longest = np.abs(lengths).argmax()
        return ways[longest] * np.sign(lengths[longest])

    def values(self, numbers: FloatArray) -> Tensor:
        """The numbers of the statements in cells (..., F) where those of the text are these (..., P)."""
        return torch.from_numpy(numbers @ self.jacobian.T + self._offset)

    def scene(self, numbers: FloatArray) -> Scene:
        """The primitives (N,)."""
        return self.tunable.scene(self.values(numbers))

    def poses(self, numbers: FloatArray) -> Poses:
        """The primitives, and their slopes (N, 16, P) by the numbers."""
        poses = self.tunable.poses(self.values(numbers))
        return Poses(poses.scene, poses.slopes @ torch.from_numpy(self.jacobian))

    def first(self, loop: int) -> tuple[int, str]:
        """The first part inside of a loop, and the key of its elements: a row is measured by it."""
        index = next(index for index in self.parts if index > loop)
        return index, "start" if "start" in dict(self.lines[index].keywords) else ""

    def fixed(self) -> FloatArray:
        """Relations (M, P) that always hold: equal width, depth and clearances of a round part that fills the whole."""
        pairs = [(0, 1)] if self._filling else []
        for line in self._filling:
            sides = [k for k, slot in enumerate(self.slots) if slot.line == line and slot.kind == "clearance"]
            pairs += [(sides[0], side) for side in sides[1:] if self.slots[side].axis < 2]
        unit = np.eye(len(self.slots))
        return np.array([unit[a] - unit[b] for a, b in pairs]).reshape(-1, len(self.slots))

    def ends(self) -> Iterator[tuple[Element, FloatArray, FloatArray]]:
        """Every element that is measured by numbers, and how its low and high coordinate from the low side of the whole
        follow from them (P,)."""
        for (index, key, axis), element in self.elements.items():
            if key == "across" and element.anchors != (LOW, HIGH):
                continue
            low, high = ends_of(self._named[index], key, axis, self._numbers, self._forms)
            if low[3:].any():
                yield element, low[:-1], high[:-1]

    def _divided(self, index: int) -> bool:
        """Whether a line is a part that fills a division; the division has the box of the part, and stands for it."""
        return self.lines[index - 1].kind == "divide"

    def _with_radius(self, line: Line) -> Line:
        """An upright round part with a radius in place of a width and depth; a cylinder that fills the whole has these
        two and no radius, and is in its middle."""
        if not isinstance(line, Part) or line.kind not in ROUND or "start" in dict(line.keywords):
            return line
        width, depth = self._numbers["width"], self._numbers["depth"]
        (left, right), (front, rear) = (ends_of(line, "", axis, self._numbers) for axis in range(2))
        size = min(right - left, rear - front)
        off = max(abs(left + right - width) / 2, abs(front + rear - depth) / 2, abs(width - depth))
        sizes: dict[str, Argument] = {"radius": dict(line.keywords).get("radius", size / 2)}
        left_out = {*SIZES[:2], "radius"}
        if line.kind == "cylinder" and size > TIES.fills * width and off < TIES.off_middle * width:
            left_out, sizes = {*AXES[0], *AXES[1], "radius"}, {"width": size, "depth": size}
        return replace(line, keywords=(*(pair for pair in line.keywords if pair[0] not in left_out), *sizes.items()))

    def _elements(self, index: int, key: str, axes: Iterable[int] = range(3)) -> Iterator[Element]:
        """The elements of a line along axes; none where a point is not given."""
        line = self.lines[index]
        keywords = dict(line.keywords)
        for axis in axes:
            low, high = ends_of(line, key, axis, self._numbers)
            given = key not in ("plane", "centre") or not keywords.keys().isdisjoint(AXES[axis])
            if key == "last":
                assert isinstance(line, Group)
                away = max(1, round(float(line.count)) - 1) * float(keywords.get("xyz"[axis], 0.0))  # type: ignore[arg-type]
                first, inner = self.first(index)
                low, high = (end + away for end in ends_of(self.lines[first], inner, axis, self._numbers))
                given = away != 0
            elif key in ("through", "end"):
                given = abs(low - ends_of(line, "start", axis, self._numbers)[0]) > ALIGNED
            if given:
                kind: ElementKind = "interval" if key in ("", "across") else "coordinate"
                if kind == "interval" and axis < 2 and "radius" in keywords:
                    kind = "round"
                anchors = self._anchors.get((index, key, axis), (LOW, LOW) if kind == "interval" else (LOW,))
                self.elements[index, key, axis] = Element(index, key, axis, kind, low, high, anchors)
                yield self.elements[index, key, axis]

    def _with_names(self, line: Line) -> Line:
        """A line with a name for every number, measured from the anchors; lines are given in the order of the text."""
        assert isinstance(line, Part | Group)
        index, kind = len(self._named), "row" if line.kind == "translate" else line.kind
        plain = [(word, self._plain(index, word, argument)) for word, argument in line.keywords if word in KINDS]
        keywords = sorted((*self._placed(index), *plain), key=lambda pair: pair[0] != "gap")
        self._named.append(replace(line, kind=kind, keywords=tuple(keywords)))
        return self._named[-1]

    def _placed(self, index: int) -> Iterator[tuple[str, Argument]]:
        """The keywords of a line that are measured from sides, or across a bar."""
        line = self.lines[index]
        given = dict(line.keywords)
        if line.kind == "translate":
            yield "last", Point(tuple(self._measured(index, "last")))
        elif line.kind in ("mirror", "rotate"):
            yield from self._measured(index, "plane" if line.kind == "mirror" else "centre")
        elif "start" in given:
            yield from ((word, Point(tuple(self._measured(index, word)))) for word in POINTS if word in given)
            yield from ((word, self._across(index, axis)) for axis, word in enumerate(SIZES) if word in given)
        elif not self._divided(index):
            yield from self._measured(index, "")

    def _measured(self, index: int, key: str) -> Iterator[tuple[str, Value]]:
        """The keywords of a box or a point: distances from its anchors, and sizes."""
        for element in self._elements(index, key):
            axis, words, extent = element.axis, AXES[element.axis], self.extents[element.axis]
            for anchor in sorted({*element.anchors}):
                word = (words.low, words.offset, words.high)[anchor]
                value = (element.low, element.middle - extent / 2, extent - element.high)[anchor]
                kind: Kind = "offset" if anchor == MIDDLE else "clearance"
                at_middle = key == "plane" and anchor == MIDDLE and abs(value) < ALIGNED
                yield word, 0.0 if at_middle else self._slot(index, f"{key}.{word}".lstrip("."), kind, axis, value)
            if element.kind == "interval" and len({*element.anchors}) == 1:
                yield words.size, self._slot(index, words.size, "size", axis, element.high - element.low)

    def _across(self, index: int, axis: int) -> Value:
        """A size of a bar: a number, or the extent of the whole less two equal clearances."""
        bar, extent = self.lines[index], self.extents[axis]
        straight = abs(float(dict(bar.keywords).get("turn", 0))) <= TIES.degrees  # type: ignore[arg-type]
        off = max(abs(ends_of(bar, key, axis, self._numbers)[0] - extent / 2) for key in ("start", "end"))
        low, high = ends_of(bar, "across", axis, self._numbers)
        if axis < 2 and straight and off < TIES.off_middle * extent:
            (element,) = self._elements(index, "across", (axis,))
            if element.anchors == (LOW, HIGH):
                value = self._slot(index, AXES[axis].low, "clearance", axis, (extent - (high - low)) / 2)
                return Name(SIZES[axis]) - 2.0 * value
        return self._slot(index, SIZES[axis], "size", axis, high - low)

    def _plain(self, index: int, word: str, argument: Argument) -> Argument:
        """A number, or a pair of radii, that is not measured from a side."""
        numbers = argument if isinstance(argument, tuple) else (argument,)
        names = tuple(self._slot(index, word, KINDS[word], -1, float(number)) for number in numbers)  # type: ignore[arg-type]
        return names[0] if len(names) == 1 else names  # type: ignore[return-value]

    def _slot(self, line: int, word: str, kind: Kind, axis: int, value: float) -> Name:
        name = Name(f"n{len(self.slots)}")
        self._numbers[name.name], self.index[line, word] = value, len(self.slots)
        self.slots.append(Slot(line, word, kind, axis, value))
        return name
