"""The function that draws a group of blocks, from the measures that are its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from shapeprog.language.ast import Draw, Function, Line, Loop, Source, used_names
from shapeprog.language.expression import Binary, Linear, Name, Value
from shapeprog.language.placement import BOX_IN_CELLS, RESERVED
from shapeprog.language.statement import language
from shapeprog.library.blocks import PAIR, Kind, solid_of
from shapeprog.library.independence import independent
from shapeprog.library.measures import Group, Measure, measures, within_box
from shapeprog.space import FloatArray

SAME = 1e-6
"""Difference below which factors are the same."""


class Basis(NamedTuple):
    """Measures that are parameters, their names, the factors (M, P) of the numbers of the group, the count of openings.

    Openings come last, and are zero by default.
    """

    parameters: tuple[Measure, ...]
    names: tuple[str, ...]
    factors: FloatArray
    openings: int


def basis(group: Group, box: FloatArray, typical: FloatArray, rows: FloatArray, openings: FloatArray) -> Basis | None:
    """The cheapest measures that determine a group with relations (R, M); ``None`` if their sums are not simple.

    The sides of its ``box`` (6, M) come first, ``openings`` (U, M) last.
    """
    every = sorted(within_box(measures(group, typical), box), key=lambda measure: (measure.price, measure.block))
    sides = [Measure(0, word, "length", -1, row, 0.0) for word, row in zip(BOX_IN_CELLS, box, strict=True)]
    last = [next(measure for measure in every if np.array_equal(measure.row, row)) for row in openings]
    offered = [*sides, *last, *every]
    stack = np.vstack([rows, *(measure.row for measure in offered)])
    accepted = independent(stack)
    if len(accepted) < group.size:
        return None
    selected = [offered[index - len(rows)] for index in accepted[len(rows) :]]
    factors = np.linalg.inv(stack[accepted])[:, len(rows) :]
    rounded = np.round(factors * 4) / 4
    if np.abs(factors - rounded).max(initial=0) > SAME:
        return None
    order = sorted(range(len(selected)), key=lambda k: (k >= 6, 6 <= k < 6 + len(last), selected[k].block, k))
    ordered = tuple(selected[k] for k in order)
    return Basis(ordered, _names(group, ordered), rounded[:, order] + 0.0, len(last))


def function(name: str, group: Group, made: Basis, draws: Sequence[tuple[str, str]]) -> Function:
    """The function of a group; ``draws`` are the statement and the role of each of its blocks."""
    counts = ["count"] if group.counts == 1 else [f"count_{number + 1}" for number in range(group.counts)]
    waiting = iter(counts)
    lines: list[Line] = []
    start = 0
    for kind, slots, (statement, role) in zip(group.kinds, group.slots, draws, strict=True):
        factors = made.factors[start : start + len(slots)]
        start += len(slots)
        lines.append(_block(kind, factors, made.names, waiting, statement, role))
    used = used_names(Source(tuple(lines)).walk())
    required = len(made.names) - made.openings
    box: list[tuple[str, float | None]] = [(word, None) for word in BOX_IN_CELLS]
    needed = [(word, None) for k, word in enumerate(made.names) if len(box) <= k < required and word in used]
    optional = [(word, 0.0) for k, word in enumerate(made.names) if k >= required and word in used]
    parameters = (*box, *needed, *((count, PAIR) for count in counts), *optional)
    return Function(name, parameters, tuple(lines))


def _block(
    kind: Kind, factors: FloatArray, names: Sequence[str], counts: Iterator[str], statement: str, role: str
) -> Draw | Loop:
    """The lines of one block whose numbers are the product of ``factors`` (M, P) and the parameters."""
    solid = solid_of(statement)
    first = len(factors) - kind.spans
    base = factors[:first].copy()
    inverse = np.round(np.linalg.pinv(solid.rows[:, :-1]), 9)  # the pseudoinverse has rounding errors instead of zeros
    mirrors: list[tuple[str, tuple[Value, ...]]] = []
    loops: list[tuple[str, tuple[Value, ...]]] = []

    for (axis, way), span in zip(kind.repeats, factors[first:], strict=False):
        if way == "mirror":
            mirrors.append(("mirror", (2.0, float(axis), _sum(span, names))))
            continue
        shift: list[Value] = [0.0, 0.0, 0.0]
        reach = span - factors[3 + axis] if solid.boxed else span
        middle = factors[axis] + span / 2
        if way == "pair" and (not middle.any() or np.array_equal(np.sort(middle)[::-1], np.eye(len(middle))[0])):
            base[axis] = base[axis] + reach  # the copy on the far side, which the mirror brings back
            loops.append(("mirror", (2.0, float(axis), _sum(middle, names))))
        else:
            number = Name(next(counts)) if way == "row" else 2.0
            step = _sum(reach, names)
            shift[axis] = Binary("/", step, number - 1.0) if isinstance(number, Name) else step
            loops.append(("translate", (number, *shift)))
    numbers = [_sum(row, names) for row in inverse @ base]
    line: Draw | Loop = Draw(statement, tuple(numbers), role)
    for loop, arguments in reversed([*mirrors, *loops]):
        line = Loop(loop, arguments, (line,))
    return line


def _names(group: Group, selected: Sequence[Measure]) -> tuple[str, ...]:
    """A name for each parameter; it begins with its part if several parts have the same measure."""
    words = [measure.word.removesuffix("_end") for measure in selected]
    for index, word in enumerate(words):
        stem = word.removeprefix("bottom_")
        if stem != word and f"upper_{stem}" not in words and stem not in words and stem not in RESERVED:
            words[index] = stem  # it is the same at both ends
    statements = language()
    names = [*BOX_IN_CELLS]
    used = {*statements.names, *statements.roles, *RESERVED, "tilt"}
    for measure, word in zip(selected[6:], words[6:], strict=True):
        qualified = word in RESERVED or (words.count(word) > 1 and len(group.kinds) > 1)
        base = f"{group.kinds[measure.block].word or 'part'}_{word}" if qualified else word
        name, number = base, 2
        while name in used:
            name, number = f"{base}_{number}", number + 1
        used.add(name)
        names.append(name)
    return tuple(names)


def _sum(row: FloatArray, names: Sequence[str]) -> Value:
    return Linear(0.0, tuple(zip(names, np.round(row, 6).tolist(), strict=True))).written()
