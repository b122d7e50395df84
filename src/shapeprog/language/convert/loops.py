"""The loops of cells as placed loops."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import Call, Draw, Function, Group, Keywords, Line, Loop, Part, Point, Source
from shapeprog.language.builtin import CELL_CENTRE
from shapeprog.language.convert.forms import EVEN, NOTHING, Spans, cost
from shapeprog.language.convert.parts import Converted, Parts, from_corner, ordered
from shapeprog.language.expression import Binary, Expression, Linear, Value
from shapeprog.language.merging import separate_loops
from shapeprog.language.placement import AXES, BOX_IN_CELLS, axis_of
from shapeprog.language.program import Node
from shapeprog.space import DEPTH, SIDE, UP

PIVOTED = ("line", "base_cross")
"""Statements that published rotations turn about themselves."""


class Loops(Parts):
    """The conversion of loops; ``rows`` is whether loops with fixed steps may become rows."""

    rows = True

    def line(self, line: Node | Call) -> Converted:
        """The placed lines of a statement, a loop or a call with a box; none for a part that draws nothing."""
        if isinstance(line, Draw):
            return self._draw(line)
        return self._call(line) if isinstance(line, Call) else self._loop(line)

    def lines(self, lines: Iterable[Node | Call]) -> Converted:
        """Some lines, in order."""
        return self._joined([self.line(line) for line in lines])

    def _joined(self, results: Sequence[Converted]) -> Converted:
        drawing = [result for result in results if result.lines]
        middles: list[Linear | None] = []
        for axis in range(3):
            first, *following = [result.middles[axis] for result in drawing] or [None]
            same = first is not None and all(middle is not None and self._zero(first - middle) for middle in following)
            middles.append(first if same else None)
        first_box = drawing[0].first if drawing else None
        return Converted(tuple(line for result in drawing for line in result.lines), first_box, tuple(middles))

    def _call(self, line: Call) -> Converted:
        """A call, whose first arguments in cells are its box."""
        forms = {word: self.form(value) for word, value in line.arguments}
        box = [forms.pop(word) for word in BOX_IN_CELLS]
        spans = from_corner(box[:3], box[3:])
        keywords = [pair for axis, span in enumerate(spans) for pair in self.interval(axis, span)]
        more = [(word, self.written(form, exact=True)) for word, form in forms.items()]
        return Converted((replace(line, arguments=(*keywords, *more)),), spans)  # type: ignore[arg-type]

    def _loop(self, line: Loop) -> Converted:
        if line.name == "rotate":
            return self._rotate(line)
        body = self.lines(line.body)
        if not body.lines:
            return body
        if line.name == "translate":
            return self._translate(body, line)
        v = [self.form(value) for value in line.values]
        match line.name:
            case "mirror":
                axis = {UP: 2, DEPTH: 1, SIDE: 0}[round(self.number(v[1]))]
                return self._mirror(line.body, axis, -v[2] if axis == 0 else v[2])
            case "tilt_about":
                return self._tilted(body, v)
            case "rotate_about":
                point = self.point((self.shift[0] - v[3], self.shift[1] + v[2], self.sizes[2] / -2.0)).keywords
                full = not (v[0].factors or v[1].factors) and abs(v[0].constant * v[1].constant - 360) < EVEN
                keywords = point if full else (*point, ("step", self.written(v[1])))
                return Converted((Group("rotate", keywords, body.lines, self.written(v[0])),))
        raise ShapeProgError(f"{line.name} has no placed form", "keep this program as statements in cells")

    def _tilted(self, body: Converted, v: list[Linear]) -> Converted:
        """A single part that is leaned about the bottom front edge of its box."""
        (part, *following), box = body.lines, body.first
        if isinstance(part, Part) and not following and box and not {"start", "tilt"} & dict(part.keywords).keys():
            at_edge = self._zero(box[1].low - v[3] - self.shift[1]) and self._zero(box[2].low - v[2] - self.shift[2])
            if at_edge and self._zero(v[0] - 1.0):
                part = replace(part, keywords=(*part.keywords, ("tilt", self.written(v[1]))))
                return Converted((part,), box, (body.middles[0], None, None))
        raise ShapeProgError("this tilt has no placed form", "keep this program as statements in cells")

    def _mirror(self, lines: Iterable[Node | Call], axis: int, plane: Linear) -> Converted:
        """A mirror; a part that may be on either side of it is written at the left, the front or the bottom."""
        plane = plane + self.shift[axis]
        results = []
        for inner in lines:
            result = self.line(inner)
            middle = result.middles[axis]
            if middle is not None and self.number(middle - plane) > NOTHING:
                before = self.shift
                away = (plane - middle) * 2.0
                self.shift = tuple(by + away if index == axis else by for index, by in enumerate(before))
                result = self.line(inner)
                self.shift = before
            results.append(result)
        body = self._joined(results)
        middles = tuple(plane if index == axis else middle for index, middle in enumerate(body.middles))
        group = Group("mirror", self._single(axis, plane), body.lines)
        return Converted((group,), body.first, middles)

    def _translate(self, body: Converted, line: Loop) -> Converted:
        """A loop with fixed steps, a row, or a mirror, whichever is shortest; a row where the count is a name.

        The steps are then the way to the last copy, divided by the count less one.
        """
        count, *steps = line.values
        number = None if isinstance(count, Expression) else max(0, round(count))
        up, depth, side = (self.form(s.left if number is None and isinstance(s, Binary) else s) for s in steps)
        by = (-side, depth, up)
        moving = [axis for axis in range(3) if not self._zero(by[axis])]
        middles: list[Linear | None] = list(body.middles)
        for axis in moving:
            middle, middles[axis] = middles[axis], None
            if middle is not None and number is not None and len(moving) == 1:
                middles[axis] = middle + by[axis] * ((number - 1) / 2)
        written, moved = self.written(self.form(count)), tuple(middles)
        options: list[Group] = []
        if number is not None:
            keywords = tuple(pair for axis in moving for pair in self._extra("xyz"[axis], by[axis]))
            options.append(Group("translate", keywords or (("x", 0.0),), body.lines, written))
        if body.first and moving and (number is None or (self.rows and number > 1)):
            ways = {axis: by[axis] * float(1 if number is None else number - 1) for axis in moving}
            options.append(Group("row", (("last", self._last(body.first, ways)),), body.lines, written))
        best = min(options, key=lambda group: cost(group.keywords))
        result = Converted((best,), body.first, moved)
        if number == 2 and len(moving) == 1 and (middle := body.middles[moving[0]]) is not None:
            mirror = self._mirror(line.body, moving[0], middle + by[moving[0]] / 2.0 - self.shift[moving[0]])
            group = mirror.lines[0]
            assert isinstance(group, Group)
            if cost(group.keywords) < cost(best.keywords):
                return mirror._replace(middles=moved)
        return result

    def _last(self, first: Spans, ways: Mapping[int, Linear]) -> Point:
        """The best keywords for the last copy of a row, which is so far from the first along each axis."""
        last: list[tuple[str, Value]] = []
        for axis, way in ways.items():
            span, half = first[axis], self.sizes[axis] / 2.0
            low, high = span.low + way + half, half - span.low - span.size - way
            sides = [((AXES[axis].low, low),), ((AXES[axis].high, high),)]
            if self.number(low) > self.number(high):
                sides.reverse()
            last += self._best([*sides, ((AXES[axis].offset, span.middle + way),)])  # type: ignore[arg-type]
        return Point(tuple(last))

    def _rotate(self, line: Loop) -> Converted:
        """A published rotation: about the axis of the whole, or about that of the statement inside."""
        draws = [draw for draw in Source(line.body).walk() if isinstance(draw, Draw)]
        pivots = [draw for draw in draws if draw.name in PIVOTED]
        if pivots and len(draws) > 1:
            apart = (inner for inner in separate_loops((line,)) if isinstance(inner, Loop))
            return Converted(tuple(placed for inner in apart for placed in self._rotate(inner).lines))
        body = self.lines(line.body).lines
        if not body:
            return Converted(())
        count, step = (self.form(value) for value in line.values)
        keywords: Keywords = ()
        for draw in pivots:
            shift = CELL_CENTRE if draw.name == "line" else 0.0
            _, depth, side = (self.form(value) + shift for value in draw.values[:3])
            keywords = self.point((-side, depth, self.sizes[2] / -2.0)).keywords
            if draw.name == "base_cross":
                keywords = (*keywords, ("step", self.written(step * 90.0)))
        return Converted((Group("rotate", keywords, body, self.written(count)),))


def with_joined_mirrors(lines: Iterable[Line]) -> tuple[Line, ...]:
    """Nested mirrors along different axes as one."""
    result: list[Line] = []
    for line in lines:
        if isinstance(line, Group | Function):
            line = replace(line, body=with_joined_mirrors(line.body))
        if isinstance(line, Group) and line.kind == "mirror" and len(line.body) == 1:
            (inner,) = line.body
            if isinstance(inner, Group) and inner.kind == "mirror" and not inner.note:
                axes = [axis_of(word) for word, _ in (*line.keywords, *inner.keywords)]
                if len(set(axes)) == len(axes):
                    line = replace(line, keywords=ordered((*line.keywords, *inner.keywords)), body=inner.body)
        result.append(line)
    return tuple(result)
