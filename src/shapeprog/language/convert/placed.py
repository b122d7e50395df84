"""Programs in cells with their parts placed from the sides of the whole.

Positions are linear forms of the names of a program, measured from the middle of the whole: every side, size and offset
is then another linear form, and the way of writing that needs the fewest operators is found by trying all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import array
from shapeprog.geometry.primitive import primitives
from shapeprog.language.ast import Assignment, Call, Comment, Draw, Function, Line, Loop, Scale, Source
from shapeprog.language.convert.forms import Triple
from shapeprog.language.convert.loops import Loops, with_joined_mirrors
from shapeprog.language.convert.names import NOTHING, with_legal_names, with_names, without_unused
from shapeprog.language.convert.parts import Converted, from_corner
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import Expression, Linear, Value, names_in, value_at
from shapeprog.language.merging import merged_lines
from shapeprog.language.parameters import shortest, to_float32
from shapeprog.language.placement import BOX_IN_CELLS, SIZES
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program
from shapeprog.language.tensors import encode
from shapeprog.language.unit import Unit
from shapeprog.language.unroll import on_numpy_if_shipped, unroll
from shapeprog.lazy_torch import torch
from shapeprog.space import DEPTH, SIDE, UP


def placed(program: Program, *, merge: bool = True) -> Program:
    """The same shape with its parts placed from the sides of the whole.

    The whole is the box that the names ``width``, ``depth`` and ``height`` give, or else the bounding box.  Names that
    nothing uses afterwards are left out; names that are words of the language are changed.

    Parameters
    ----------
    program
        The program, in either notation.
    merge
        Whether loops that repeat in the same way become one; otherwise lines keep their order.

    Raises
    ------
    ShapeProgError
        If a statement or loop has no placed form, as those that users declare, or a part has no thickness.
    """
    source = source_of(program)
    return program if source.placed else evaluated(_Converter(program, with_legal_names(source)).source(merge=merge))


def placed_if_possible(program: Program) -> Program:
    """The placed program, or the same one if something in it has no placed form."""
    try:
        return placed(program)
    except ShapeProgError:
        return program


class _Converter(Loops):
    """The conversion of one program, whose names are legal."""

    def __init__(self, program: Program, source: Source) -> None:
        super().__init__(source)
        self.sizes = self._sizes(program)
        for name, value in source.numbers.items():
            if isinstance(value, Expression) and self._zero(self.form(value) + self.sizes[2] / 2.0):
                self.inlined[name] = self.sizes[2] / -2.0
        self.versions: dict[str, dict[tuple[object, ...], Function]] = {}
        self.calls = 0

    def source(self, *, merge: bool) -> Source:
        """The placed program, with equal loops merged or in the order of its lines."""
        named_lines = self._whole()
        lines: list[Line] = []
        for line in named_lines:
            if isinstance(line, Function):
                self.versions.setdefault(line.name, {})
                lines.append(line)
            else:
                lines += self.line(line, "").lines
        called = {line.name for line in self.original.walk() if isinstance(line, Call)}
        for function in self.original.functions.values():
            if function.name not in called:
                self._version(function, {}, "")
        result: list[Line] = []
        for line in lines:
            result += self.versions[line.name].values() if isinstance(line, Function) else [line]
        height = self.number(self.sizes[2])
        cells = 1 / self.per_cell
        unit = self.original.unit
        scale = Scale(cells, -height * cells / 2)
        joined = with_joined_mirrors(result)
        return Source(
            without_unused(merged_lines(joined) if merge else joined),
            Unit(unit.name if unit else "", self.per_cell),
            scale,
        )

    # ---- the whole ----------------------------------------------------------------------------------------------

    def _sizes(self, program: Program) -> Triple:
        """Width, depth and height of the whole, as names where the program has them."""
        extents: list[float] = []
        result = []
        for axis, word in enumerate(SIZES):
            if self.names.get(word, 0) > NOTHING:
                result.append(Linear.of(word))
                continue
            extents = extents or _extents(program)
            number = to_float32(float(f"{extents[axis] * self.per_cell:.7g}")) or 1.0
            result.append(Linear(float(shortest(number))))
        return result[0], result[1], result[2]

    def _whole(self) -> list[Line]:
        """The lines of the program in cells with one line that names the sizes of the whole, above all that draws."""
        lines = list(self.original.lines)
        for line in lines:
            if not isinstance(line, Assignment | Comment):
                break
            if isinstance(line, Assignment) and set(SIZES) <= dict(line.numbers).keys():
                return lines
        numbers = self.original.numbers
        named = {word for word, size in zip(SIZES, self.sizes, strict=True) if size.factors}
        following = set(named)  # what follows from a size is written out on the line of the sizes
        for name, value in numbers.items():
            if following & {*names_in(value)}:
                following.add(name)

        def written_out(name: str) -> Value:
            value = numbers[name]
            return with_names(value, {part: written_out(part) for part in following & {*names_in(value)}})

        sizes = []
        for word, size in zip(SIZES, self.sizes, strict=True):
            form = self.form(written_out(word)) if word in named else size
            sizes.append((word, self.written(form, exact=True)))
        needed, pending = set[str](), {name for _, value in sizes for name in names_in(value)}
        while pending:
            needed.add(name := pending.pop())
            pending |= {*names_in(numbers[name])} - needed
        above: list[Line] = []
        below: list[Line] = []
        started = False
        for line in lines:
            if isinstance(line, Comment) and not started:
                above.append(line)
                continue
            started = True
            if not isinstance(line, Assignment):
                below.append(line)
                continue
            first = tuple(pair for pair in line.numbers if pair[0] in needed and pair[0] not in named)
            later = tuple(pair for pair in line.numbers if pair[0] not in needed and pair[0] not in named)
            above += [Assignment(first, "" if later else line.note)] if first else []
            below += [replace(line, numbers=later)] if later else []
        self.names |= {word: value_at(value, self.names) for word, value in sizes}
        self.scope = dict(self.names)
        return [*above, Assignment(tuple(sizes)), *below]

    # ---- lines --------------------------------------------------------------------------------------------------

    def line(self, line: Line, role: str) -> Converted:
        """The placed lines of one line; none for a part that draws nothing."""
        match line:
            case Assignment():
                return Converted((self._assignment(line),))
            case Call():
                return self._call(line, role)
            case Draw():
                return self._draw(line, role)
            case Loop("rotate"):
                return self._rotate(line, role)
            case Loop():
                return self._loop(line, role)
        return Converted((line,))

    def _assignment(self, line: Assignment) -> Line:
        new = {name: value_at(value, self.scope) for name, value in line.numbers}
        pairs = tuple((name, self.written(self.form(value), exact=True)) for name, value in line.numbers)
        self.scope |= new
        return replace(line, numbers=pairs)

    def _call(self, line: Call, role: str) -> Converted:
        function = self.original.functions[line.name]
        numbers = {name: value_at(value, self.scope) for name, value in line.arguments}
        name = self._version(function, numbers, line.role or role)
        self.decisions.append(name)
        if not function.box:
            arguments = tuple((word, self.written(self.form(value), exact=True)) for word, value in line.arguments)
            return Converted((replace(line, name=name, arguments=arguments),))
        forms = {word: self.form(value) for word, value in line.arguments}
        box = [forms.pop(word) for word in BOX_IN_CELLS]
        spans = from_corner(box[:3], box[3:])
        keywords = [pair for axis, span in enumerate(spans) for pair in self.interval(axis, span)]
        more = [(word, self.written(form, exact=True)) for word, form in forms.items()]
        return Converted((replace(line, name=name, arguments=(*keywords, *more)),), spans)  # type: ignore[arg-type]

    def _version(self, function: Function, numbers: Mapping[str, float], role: str) -> str:
        """The name of a function with the parts of a call with these numbers, converted where there is none."""
        outer, decided, sizes, inlined = self.scope, self.decisions, self.sizes, self.inlined
        inner = dict(numbers)
        for name, default in function.parameters:
            if name not in inner:
                inner[name] = 1.0 if default is None else value_at(default, self.names)
        self.scope, self.decisions = {**self.names, **inner}, []
        if function.box:  # its body is written relative to its own width, depth and height
            self.sizes = Linear.of("width"), Linear.of("depth"), Linear.of("height")
            low = dict(zip(BOX_IN_CELLS[:3], (self.sizes[2], self.sizes[1], self.sizes[0]), strict=True))
            self.inlined = {name: size / -2.0 for name, size in low.items()}
            if min(inner[size] for size in SIZES) <= 0:
                raise ShapeProgError(f"{function.name} has a box without extent", "give it a positive size")
            self.scope |= {name: inner[size] / -2 for name, size in zip(low, BOX_IN_CELLS[3:], strict=True)}
        try:
            self.calls += 1
            if self.calls > 1 << 12:
                raise ShapeProgError("too many calls to convert", "write some of them out")
            body = self.lines(function.body, role).lines
            key = tuple(self.decisions)
        finally:
            self.scope, self.decisions, self.sizes, self.inlined = outer, decided, sizes, inlined
        versions = self.versions.setdefault(function.name, {})
        if key not in versions:
            name, number = function.name, len(versions)
            while number and (number == len(versions) or name in self.original.functions):
                number += 1
                name = f"{function.name}_{number}"
            parameters = tuple(
                (word, None if value is None else self.written(self.form(value), exact=True))
                for word, value in function.parameters[len(BOX_IN_CELLS) * function.box :]
            )
            versions[key] = replace(function, name=name, parameters=parameters, body=body, box=False)
        return versions[key].name


def _extents(program: Program) -> list[float]:
    """Width, depth and height in cells of the smallest box about the middle of the grid that holds a program."""
    reach = np.zeros(3)
    with on_numpy_if_shipped(program):
        scene = unroll(encode(program, dtype=torch.float64))
        for kind in scene.kinds:
            selected = scene.mask & (scene.kind == kind)
            half = primitives[kind].bound(scene.size[selected])
            corners = (scene.rotation[selected].abs() @ half[..., None])[..., 0] + scene.centre[selected].abs()
            reach = np.maximum(reach, array(corners).max(0))
    return [float(2 * reach[axis]) for axis in (SIDE, DEPTH, UP)]
