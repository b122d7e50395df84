"""The text of a tied program: names for shared numbers, expressions for dependent ones, no redundant keywords."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from shapeprog.inference.ties.anchored import Anchored
from shapeprog.inference.ties.expressions import Solution
from shapeprog.inference.ties.groups import grouped
from shapeprog.inference.ties.naming import Namer
from shapeprog.language.ast import (
    Argument,
    Assignment,
    Line,
    Part,
    Point,
    Source,
    changed_lines,
    values,
    with_values,
)
from shapeprog.language.evaluate import placed_source
from shapeprog.language.expression import (
    Binary,
    Expression,
    Linear,
    Name,
    Value,
    combined,
    names_in,
    replaced,
    value_at,
)
from shapeprog.language.merging import merged_lines
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import AXES, ROUND, SIZES
from shapeprog.space import FloatArray

DEGREES, CELLS = 1, 2
"""Decimals of angles and lengths."""

WIDE = 118
"""Letters of a line that names numbers, about."""


def written(anchored: Anchored, solution: Solution, numbers: FloatArray, *, group: bool = True) -> Source:
    """The program with names for its shared numbers and expressions for those that follow.

    Parameters
    ----------
    anchored
        The program.
    solution
        Which of its numbers are free, and how others follow.
    numbers
        Where the numbers are (P,).
    group
        Whether lines are grouped where that is shorter.
    """
    slots, factors, free = anchored.slots, solution.factors, solution.free
    rounded = [round(float(numbers[k]), DEGREES if slots[k].kind == "angle" else CELLS) + 0.0 for k in free]
    namer = Namer(anchored.layout, slots)
    users: dict[bytes, list[int]] = {}
    for p in range(3, len(slots)):
        if factors[p].any():
            users.setdefault(factors[p].round(6).tobytes(), []).append(p)
    terms: list[Value] = [0.0] * len(free)
    named: list[tuple[str, Value]] = []
    order = sorted(range(len(free)), key=lambda z: (slots[free[z]].line, free[z]))
    for z in order:
        k = free[z]
        unit = np.zeros(len(free))
        unit[z] = 1
        members = users.get(unit.tobytes(), [k])
        if k < 3:
            terms[z] = Name("diameter" if k < 2 and np.array_equal(factors[0], factors[1]) else SIZES[k])
        elif (factors[3:, z] != 0).sum() > 1:
            name = namer.name(members)
            named.append((name, to_float32(rounded[z])))
            terms[z] = Name(name)
        else:
            terms[z] = to_float32(rounded[z])
    table: dict[str, Value] = {}
    sums: list[tuple[str, Value]] = []
    for members in users.values():
        row = factors[members[0]]
        parts = sorted(((terms[z], float(row[z])) for z in np.flatnonzero(row)), key=lambda part: part[1] < 0)
        value = combined(0.0, parts)
        if len(members) > 1 and isinstance(value, Expression) and not isinstance(value, Name):
            name = namer.name(members)
            sums.append((name, value))
            value = Name(name)
        table |= dict.fromkeys((anchored.name(p) for p in members), value)
    for p in range(3, len(slots)):
        table.setdefault(anchored.name(p), 0.0)

    def final(line: Line) -> Line:
        new = (replaced(v, lambda n: table.get(n.name, n) if isinstance(n, Name) else n) for v in values(line))
        return _simplified(with_values(line, [_combined(v) if isinstance(v, Binary) else v for v in new]))

    extents: list[Value] = [to_float32(round(float(numbers[k]), CELLS)) for k in range(3)]
    height = extents[2]
    above: list[Assignment] = []
    if np.array_equal(factors[0], factors[1]):
        above = [Assignment((("diameter", extents[0]),))]
        extents[:2] = Name("diameter"), Name("diameter")
    sizes = Assignment(tuple(zip(SIZES, extents, strict=True)))
    header = (*above, sizes, *_assignments(named), *_assignments(sums))
    body = changed_lines([line for line in anchored.lines if not isinstance(line, Assignment)], final)
    lines = (*header, *(grouped(body, Source(header).evaluated_numbers()) if group else merged_lines(body)))
    scale = anchored.source.scale
    assert scale is not None
    assert isinstance(height, float)
    floor = -height * scale.cells_per_unit / 2
    return replace(placed_source(lines), scale=replace(scale, floor=floor), unit=anchored.source.unit)


def _assignments(named: list[tuple[str, Value]]) -> Iterator[Assignment]:
    """Names and their values on as many lines as it takes."""
    line: list[tuple[str, Value]] = []
    for pair in named:
        if line and sum(len(f"{name}{value}") + 4 for name, value in [*line, pair]) > WIDE:
            yield Assignment(tuple(line))
            line = []
        line.append(pair)
    if line:
        yield Assignment(tuple(line))


def _simplified(line: Line) -> Line:
    """The line without redundant keywords."""
    if not isinstance(line, Part):
        return line
    arguments = dict(line.keywords)
    keywords: list[tuple[str, Argument]] = []
    for word, argument in line.keywords:
        if isinstance(argument, Point):
            keywords.append((word, _simplified_point(word, argument, arguments)))
        elif not (_is_zero(argument) and (word in ("tilt", "lean", "turn") or _is_default(line, word, arguments))):
            keywords.append((word, argument))
    radius = dict(keywords).get("radius")
    if line.kind == "taper" and isinstance(radius, tuple) and radius[0] == radius[1]:
        return replace(line, kind="rod", keywords=tuple((w, radius[0] if w == "radius" else v) for w, v in keywords))
    return replace(line, keywords=tuple(keywords))


def _is_default(line: Part, word: str, arguments: dict[str, Argument]) -> bool:
    """Whether a keyword of an axis that is zero can be left out."""
    words = next((words for words in AXES if word in words), None)
    if words is None or word == words.size:
        return False
    if line.kind in ROUND and words != AXES[2] and "radius" in arguments:
        return word == words.offset
    if words.size in arguments:
        return word == words.offset if words != AXES[2] else word == words.low
    return True


def _simplified_point(word: str, point: Point, arguments: dict[str, Argument]) -> Point:
    if word == "start":
        pairs = tuple((w, v) for w, v in point.keywords if not (_is_zero(v) and w in ("x", "y", "bottom")))
        return Point(pairs)
    start = arguments["start"]
    assert isinstance(start, Point)
    before = dict(start.keywords)
    return Point(tuple((w, v) for w, v in point.keywords if before.get(w) != v))


def _is_zero(value: Argument) -> bool:
    return isinstance(value, float | int) and value == 0


def _combined(value: Value) -> Value:
    """The same sum with each name and number once."""
    form = value_at(value, {name: Linear.of(name) for name in names_in(value)})
    terms = sorted(form.factors, key=lambda term: term[1] < 0)
    return combined(to_float32(form.constant), [(Name(name), factor) for name, factor in terms])
