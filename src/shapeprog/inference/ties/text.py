"""The text of a tied program: names for shared numbers, expressions for dependent ones, no redundant keywords."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from shapeprog.inference.ties.expressions import Solution
from shapeprog.inference.ties.groups import grouped, simplified
from shapeprog.inference.ties.layout import Layout
from shapeprog.inference.ties.naming import named
from shapeprog.language.ast import Assignment, Line, Source, changed_lines, changed_values, values
from shapeprog.language.evaluate import placed_source
from shapeprog.language.expression import Expression, Linear, Name, Value, combined, names_in, replaced, value_at
from shapeprog.language.merging import merged_lines
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import SIZES
from shapeprog.space import FloatArray


def written(layout: Layout, solution: Solution, free: FloatArray, *, group: bool = True) -> Source:
    """The program with names for its shared numbers and expressions for those that follow.

    Parameters
    ----------
    layout
        The program.
    solution
        Which of its numbers are free, and how others follow.
    free
        The values of the free numbers (Z,).
    group
        Whether lines are grouped where that is shorter.
    """
    shared, table = _expressions(layout, solution, free)
    header: list[Assignment] = []
    extents: list[Value] = (solution.factors[:3] @ free).tolist()
    if np.array_equal(solution.factors[0], solution.factors[1]):
        header.append(Assignment((("diameter", extents[0]),)))
        extents[:2] = [Name("diameter")] * 2
    header.append(Assignment(tuple(zip(SIZES, extents, strict=True))))
    known = Source((*header, Assignment(tuple(shared.items())))).evaluated_numbers()
    body = changed_lines(_changed(layout.body, table), simplified)
    body = grouped(body, known) if group else merged_lines(body)
    uses = Counter(name for line in Source(body).walk() for value in values(line) for name in names_in(value))
    uses += Counter(name for value in shared.values() for name in names_in(value))
    once: dict[str, Value] = {}
    for name, value in shared.items():  # sums come last
        if uses[name] < 2:
            once[name] = _with(value, once)
    shared = {name: _with(value, once) for name, value in shared.items() if name not in once}
    body = _changed(body, once)
    names = named(body, shared, known)
    final: dict[str, Value] = {provisional: Name(name) for provisional, name in names.items()}
    pairs = [(names[name], _with(value, final)) for name, value in shared.items()]
    for sums in (False, True):
        header += _assignments([pair for pair in pairs if isinstance(pair[1], Expression) == sums])
    scale = layout.source.scale
    assert scale is not None
    floor = -float(known["height"]) * scale.cells_per_unit / 2
    result = placed_source((*header, *_changed(body, final)))
    return replace(result, scale=replace(scale, floor=floor), unit=layout.source.unit)


def _expressions(layout: Layout, solution: Solution, at_free: FloatArray) -> tuple[dict[str, Value], dict[str, Value]]:
    """The numbers and sums that several numbers of a program share, by provisional name, and all of its numbers."""
    slots, names, factors, free = layout.slots, layout.names, solution.factors, solution.free
    alike: dict[bytes, list[int]] = {}  # numbers that follow from the free ones in the same way
    for p in range(3, len(slots)):
        alike.setdefault(factors[p].round(6).tobytes(), []).append(p)
    rows = factors[[members[0] for members in alike.values()]]
    single = np.array([len(members) == 1 for members in alike.values()])
    terms: list[Value] = [0.0] * len(free)
    shared: dict[str, Value] = {}
    for z in sorted(range(len(free)), key=lambda z: (slots[free[z]].line, free[z])):
        k = free[z]
        terms[z] = float(at_free[z]) + 0.0
        if k < 3:
            terms[z] = Name("diameter" if k < 2 and np.array_equal(factors[0], factors[1]) else SIZES[k])
        elif (used := rows[:, z] != 0).sum() > 1 or (used & ~single & ((rows != 0).sum(1) == 1)).any():
            shared[names[k]], terms[z] = terms[z], Name(names[k])
    table: dict[str, Value] = {}
    for members in alike.values():
        row, name = factors[members[0]], names[members[0]]
        value = combined(0.0, sorted(((terms[z], float(row[z])) for z in np.flatnonzero(row)), key=lambda t: t[1] < 0))
        if len(members) > 1 and isinstance(value, Expression) and not isinstance(value, Name):
            shared[name], value = value, Name(name)
        table |= {names[k]: value for k in members}
    return shared, table


def _with(value: Value, table: Mapping[str, Value]) -> Value:
    """A number or an expression with names replaced; a sum has each name and number once."""
    new = replaced(value, lambda each: table.get(each.name, each) if isinstance(each, Name) else each)
    if not isinstance(new, Expression):
        return new
    form = value_at(new, {name: Linear.of(name) for name in names_in(new)})
    terms = sorted(form.factors, key=lambda term: term[1] < 0)
    return combined(to_float32(form.constant), [(Name(name), factor) for name, factor in terms])


def _changed(lines: tuple[Line, ...], table: Mapping[str, Value]) -> tuple[Line, ...]:
    """Lines with names replaced."""
    return changed_lines(lines, lambda line: changed_values(line, lambda value: _with(value, table)))


def _assignments(named: list[tuple[str, Value]]) -> Iterator[Assignment]:
    """Names and their values on as many lines as it takes."""
    line: list[tuple[str, Value]] = []
    for pair in named:
        if line and sum(len(f"{name}{value}") + 4 for name, value in [*line, pair]) > 118:
            yield Assignment(tuple(line))
            line = []
        line.append(pair)
    if line:
        yield Assignment(tuple(line))
