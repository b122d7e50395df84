"""The drawing statements of cells as placed parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import Argument, Draw, Keywords, Line, Part
from shapeprog.language.builtin import ARM_HALF_WIDTH, CELL_CENTRE
from shapeprog.language.convert.forms import Cost, Forms, Span, Spans, Triple, cost
from shapeprog.language.expression import Linear
from shapeprog.language.lowering import SMALLEST
from shapeprog.language.placement import AXES, SIZES
from shapeprog.language.statement import language
from shapeprog.space import DEPTH, SIDE, UP

_LOW_CORNER = ("leg", "horizontal_bar", "vertical_board", "locker", "chair_beam", "back_support")
_ROUND = ("top_circle", "base_circle", "support_cylinder", "cylinder")


class Converted(NamedTuple):
    """The placed lines of a line.

    ``first`` is the box of the first element, to which a row refers; ``middles`` the coordinate along each axis about
    which all of it is symmetric.
    """

    lines: tuple[Line, ...]
    first: Spans | None = None
    middles: tuple[Linear | None, ...] = (None, None, None)


class Parts(Forms):
    """The conversion of drawing statements; ``shift`` is the offset of all coordinates."""

    shift: Triple = (Linear(), Linear(), Linear())

    def _draw(self, line: Draw) -> Converted:
        name, v = line.name, [self.form(value) for value in line.values]
        role = line.role or language().own_role(name)
        keywords: Keywords = ()
        kind = "box"
        straight = (True, True, True)
        match name:
            case "box" | "board" | "cushion" | "back" | "leaning_box":
                spans = from_corner(v[:3], v[3:6])
                if name == "cushion":
                    kind, keywords = "cushion", (("edge", self.written(v[6])),)
                    if self.number(v[6]) < 0:
                        kind, keywords, role = "box", (), role or "cushion"
                elif name != "box":
                    keywords = self._extra("tilt" if name == "board" else "lean", v[6])
                    straight = (True, not keywords, not keywords)
            case _ if name in _LOW_CORNER:
                spans = from_corner(v[:3], v[3:6])
            case "top_rectangle" | "layer":
                spans = _on_bottom(v[:3], v[3], v[4], v[5])
            case "top_square" | "base_square" | "support_cuboid":
                spans = _on_bottom(v[:3], v[3], v[4], v[4])
            case "sideboard":
                spans = from_corner([v[0], v[1] - v[4], v[2]], [v[3], v[4] * 2.0, v[5]])
            case "base_cross":
                spans = self._arm(v)
            case _ if name in _ROUND:
                return self._round(role, (-v[2], v[1]), Span(v[0], v[3]), v[4])
            case "line" | "rod" | "taper" | "bent_rod" | "bar" | "beam":
                shift = CELL_CENTRE if name == "line" else 0.0
                count = 3 if name == "bent_rod" else 2
                points = [self._end([coordinate + shift for coordinate in v[3 * i : 3 * i + 3]]) for i in range(count)]
                return self._between(line, role, points, v[3 * count :])
            case _:
                raise ShapeProgError(f"{name} has no placed form", "keep this program as statements in cells")
        if any(self._draws_nothing(span.size) for span in spans):
            return Converted(())
        moved = tuple(Span(span.low + by, span.size) for span, by in zip(spans, self.shift, strict=True))
        return self._box(kind, moved, keywords, role, straight)

    def _box(
        self, kind: str, spans: Spans, keywords: Keywords, role: str, straight: Sequence[bool] = (True, True, True)
    ) -> Converted:
        placed = [pair for axis, span in enumerate(spans) for pair in self.interval(axis, span)]
        middles = tuple(span.middle if is_straight else None for span, is_straight in zip(spans, straight, strict=True))
        return Converted((Part(kind, (*placed, *keywords), role),), spans, middles)

    def _end(self, at: Sequence[Linear]) -> Triple:
        """A point along x, y, z from one along up, depth, side."""
        up, depth, side = at
        return self.shift[0] - side, depth + self.shift[1], up + self.shift[2]

    def _draws_nothing(self, size: Linear, *, zero: bool = False) -> bool:
        """Whether a length is negative, so that the part is not drawn; a length of zero has no placed form."""
        if not zero and 0 <= self.number(size) < SMALLEST:
            raise ShapeProgError("a part without thickness has no placed form", "make it a little thicker")
        return self.number(size) < 0

    def _arm(self, v: list[Linear]) -> Spans:
        """The box of an arm of a cross base."""
        turn = round(self.number(v[5])) % 4
        low, long = v[1:3], v[4]
        along, ahead = (0, turn == 1) if turn % 2 else (1, turn == 2)
        start = [coordinate - ARM_HALF_WIDTH for coordinate in low]
        size = [Linear(2 * ARM_HALF_WIDTH)] * 2
        start[along], size[along] = low[along] if ahead else low[along] - long, long
        return from_corner([v[0], *start], [v[3], *size])

    def _round(self, role: str, middle: tuple[Linear, Linear], vertical: Span, radius: Linear) -> Converted:
        """An upright cylinder."""
        if self._draws_nothing(radius) or self._draws_nothing(vertical.size):
            return Converted(())
        middle = (middle[0] + self.shift[0], middle[1] + self.shift[1])
        vertical = Span(vertical.low + self.shift[2], vertical.size)
        spans = (*(Span(coordinate - radius, radius * 2.0) for coordinate in middle), vertical)
        keywords = self._upright(middle, spans[:2], (("radius", self.written(radius)),), radius, sized=True)
        part = Part("cylinder", (*keywords, *self.interval(2, vertical)), role)
        part = replace(part, keywords=ordered(part.keywords))
        middles = (*middle, vertical.middle)
        return Converted((part,), spans, middles)

    def _upright(
        self, middle: Sequence[Linear], spans: Sequence[Span], radius: Keywords, largest: Linear | None, *, sized: bool
    ) -> Keywords:
        """The best keywords for the place of an upright round solid and its radius."""
        single = [
            () if self._zero(coordinate) else self._single(axis, coordinate, largest)
            for axis, coordinate in enumerate(middle)
        ]
        options: list[Keywords] = [(*single[0], *single[1], *radius)]
        for axis in range(2) if sized else ():
            keywords = self.interval(axis, spans[axis])
            words = {word for word, _ in keywords}
            if AXES[axis].size in words or {AXES[axis].low, AXES[axis].high} <= words:
                options.append((*keywords, *single[1]) if axis == 0 else (*single[0], *keywords))
        return min(options, key=cost)

    def _between(self, line: Draw, role: str, points: list[Triple], sizes: list[Linear]) -> Converted:
        """A solid between points."""
        start, end = points[0], points[-1]
        kind = "rod" if line.name == "line" else "bar" if line.name == "beam" else line.name
        if all(abs(self.number(a - b)) <= SMALLEST for a, b in zip(start, end, strict=True)):
            raise ShapeProgError(f"{line.name} starts where it ends, and has no placed form", "move one of its ends")
        straight = [all(self._zero(point[axis] - start[axis]) for point in points) for axis in range(3)]
        middles = tuple(start[axis] if straight[axis] else None for axis in range(3))
        first = tuple(Span(coordinate, Linear()) for coordinate in start)
        words: list[tuple[str, Argument]] = [("start", self.point(start))]
        words += [("through", self.point(points[1], start))] if len(points) == 3 else []
        words.append(("end", self.point(end, start)))
        if kind == "bar":
            return self._bar(line, role, points, sizes, words, straight)
        if any(self._draws_nothing(radius, zero=True) for radius in sizes):
            return Converted(())
        if max(self.number(radius) for radius in sizes) < SMALLEST:
            raise ShapeProgError("a rod without thickness has no placed form", "make it a little thicker")
        if len(sizes) == 2 and self._zero(sizes[1] - sizes[0]):
            kind, sizes = "rod", sizes[:1]
        radii = [self.written(radius) for radius in sizes]
        radius: Argument = radii[0] if len(radii) == 1 else (radii[0], radii[1])
        part = Part(kind, (*words, ("radius", radius)), role)
        result = Converted((part,), first, middles)
        if kind in ("rod", "taper") and straight[0] and straight[1]:
            rises = self.number(end[2] - start[2]) > 0
            if kind == "rod" or rises:
                result = min(result, self._standing(part, points, sizes, rises), key=_cost_of)
        return result

    def _standing(self, part: Part, points: list[Triple], radii: list[Linear], rises: bool) -> Converted:
        """An upright rod or taper, placed by its box."""
        (x, y, low), (_, _, high) = points if rises else points[::-1]
        vertical = Span(low, high - low)
        largest = radii[0]
        if len(radii) == 2:
            largest = max(radii, key=self.number)
        spans = (Span(x - largest, largest * 2.0), Span(y - largest, largest * 2.0), vertical)
        keywords = self._upright((x, y), spans[:2], (part.keywords[-1],), largest, sized=len(radii) == 1)
        part = replace(part, keywords=ordered((*keywords, *self.interval(2, vertical))))
        return Converted((part,), spans, (x, y, None if len(radii) == 2 else vertical.middle))

    def _bar(
        self,
        line: Draw,
        role: str,
        points: list[Triple],
        numbers: list[Linear],
        words: list[tuple[str, Argument]],
        straight: list[bool],
    ) -> Converted:
        """A bar, whose two sizes across its direction are named."""
        if any(self._draws_nothing(size) for size in numbers[:2]):
            return Converted(())
        start, end = points
        if line.name == "beam":
            axis, turn = round(self.number(numbers[2])), numbers[3]
        else:
            ends = np.array([self.number(self.form(value)) for value in line.values[:6]], np.float32)
            axis, turn = int(np.abs(ends[3:] - ends[:3]).argmax()), numbers[2]
        main = {UP: 2, DEPTH: 1, SIDE: 0}[axis]
        across = [
            (2 - grid_axis, size) for grid_axis, size in zip([a for a in range(3) if a != axis], numbers, strict=False)
        ]
        across.sort(key=lambda pair: pair[0])
        sizes = [(SIZES[index], self.written(size)) for index, size in across]
        keywords = (*words, *sizes, *self._extra("turn", -turn if main == 0 else turn))
        turned = not self._zero(turn)
        middles = tuple(None if turned or not straight[a] else start[a] for a in range(3))
        first = tuple(Span(coordinate, Linear()) for coordinate in start)
        bar = Converted((Part("bar", keywords, role),), first, middles)
        if turned or not all(straight[a] for a in range(3) if a != main):
            return bar
        forward = self.number(end[main] - start[main]) > 0
        low, high = (start, end) if forward else (end, start)
        spans = [Span(low[main], high[main] - low[main])] * 3
        for index, size in across:
            spans[index] = Span(start[index] - size / 2.0, size)
        return min(bar, self._box("box", tuple(spans), (), role), key=_cost_of)


def _cost_of(converted: Converted) -> Cost:
    (part,) = converted.lines
    assert isinstance(part, Part)
    operators, words = cost(part.keywords)
    return operators, words + (part.kind != "box")


def from_corner(at: Sequence[Linear], size: Sequence[Linear]) -> Spans:
    """A box along x, y, z from its low corner and size along up, depth, side; side points against x."""
    up, depth, side = at
    height, length, width = size
    return Span(-side - width, width), Span(depth, length), Span(up, height)


def _on_bottom(at: Sequence[Linear], height: Linear, half_depth: Linear, half_side: Linear) -> Spans:
    low = [at[0], at[1] - half_depth, at[2] - half_side]
    return from_corner(low, [height, half_depth * 2.0, half_side * 2.0])


def ordered(keywords: Keywords) -> Keywords:
    """Keywords of the axes in order, then the others."""
    order = {word: index for index, words in enumerate(AXES) for word in words}
    return tuple(sorted(keywords, key=lambda pair: order.get(pair[0], 3)))
