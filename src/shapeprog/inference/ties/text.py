"""The text of a tied program: names for shared numbers, expressions for dependent ones, no redundant keywords."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from shapeprog.inference.ties.anchored import Anchored
from shapeprog.inference.ties.expressions import Solution
from shapeprog.inference.ties.groups import grouped
from shapeprog.inference.ties.naming import named
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
    alike: dict[bytes, list[int]] = {}  # numbers that follow from the free ones in the same way
    for p in range(3, len(slots)):
        if factors[p].any():
            alike.setdefault(factors[p].round(6).tobytes(), []).append(p)
    sizes = ["diameter" if k < 2 and np.array_equal(factors[0], factors[1]) else SIZES[k] for k in range(3)]
    terms: list[Value] = [0.0] * len(free)
    shared: dict[str, Value] = {}
    for z in sorted(range(len(free)), key=lambda z: (slots[free[z]].line, free[z])):
        k = free[z]
        number = to_float32(round(float(numbers[k]), DEGREES if slots[k].kind == "angle" else CELLS) + 0.0)
        terms[z] = Name(sizes[k]) if k < 3 else number
        if k >= 3 and (factors[3:, z] != 0).sum() > 1:
            terms[z] = Name(anchored.name(k))
            shared[anchored.name(k)] = number
    table: dict[str, Value] = {anchored.name(p): 0.0 for p in range(3, len(slots))}
    for members in alike.values():
        row = factors[members[0]]
        value = combined(0.0, sorted(((terms[z], float(row[z])) for z in np.flatnonzero(row)), key=lambda t: t[1] < 0))
        if len(members) > 1 and isinstance(value, Expression) and not isinstance(value, Name):
            shared[anchored.name(members[0])] = value
            value = Name(anchored.name(members[0]))
        table |= dict.fromkeys((anchored.name(p) for p in members), value)

    extents: list[Value] = [to_float32(round(float(numbers[k]), CELLS)) for k in range(3)]
    height = extents[2]
    above: list[Assignment] = []
    if sizes[0] == "diameter":
        above = [Assignment((("diameter", extents[0]),))]
        extents[:2] = Name("diameter"), Name("diameter")
    header = (*above, Assignment(tuple(zip(SIZES, extents, strict=True))))
    known = Source((*header, Assignment(tuple(shared.items())))).evaluated_numbers()
    body = changed_lines(
        [line for line in anchored.lines if not isinstance(line, Assignment)],
        lambda line: _simplified(_changed(line, table)),
    )
    body = grouped(body, known) if group else merged_lines(body)
    uses = Counter(name for line in Source(body).walk() for value in values(line) for name in names_in(value))
    uses += Counter(name for value in shared.values() for name in names_in(value))
    once = {name: value for name, value in shared.items() if uses[name] < 2}
    for name, value in once.items():  # sums come last
        once[name] = _with(value, once)
    shared = {name: _with(value, once) for name, value in shared.items() if name not in once}
    body = changed_lines(body, lambda line: _changed(line, once))
    names = named(body, shared, known)
    final: dict[str, Value] = {provisional: Name(name) for provisional, name in names.items()}
    pairs = [(names[name], _with(value, final)) for name, value in shared.items()]
    plain, sums = ([pair for pair in pairs if isinstance(pair[1], Expression) == is_sum] for is_sum in (False, True))
    lines = (
        *header,
        *_assignments(plain),
        *_assignments(sums),
        *changed_lines(body, lambda line: _changed(line, final)),
    )
    scale = anchored.source.scale
    assert scale is not None
    assert isinstance(height, float)
    floor = -height * scale.cells_per_unit / 2
    return replace(placed_source(lines), scale=replace(scale, floor=floor), unit=anchored.source.unit)


def _with(value: Value, table: Mapping[str, Value]) -> Value:
    """A number or an expression with names replaced, and with each name and number once."""
    new = replaced(value, lambda each: table.get(each.name, each) if isinstance(each, Name) else each)
    return _combined(new) if isinstance(new, Binary) else new


def _changed(line: Line, table: Mapping[str, Value]) -> Line:
    return with_values(line, [_with(value, table) for value in values(line)])


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
