"""The function that draws a group of blocks, from the measures that are its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from shapeprog.language.ast import Draw, Function, Line, Loop, Source, values
from shapeprog.language.expression import Binary, Expression, Name, Value, combined
from shapeprog.language.placement import BOX_IN_CELLS, RESERVED
from shapeprog.language.statement import language
from shapeprog.library.blocks import PAIR, Kind, solid_of
from shapeprog.library.measures import Group, Measure, measures, within_box
from shapeprog.space import FloatArray

SAME = 1e-6
"""Difference below which factors are the same."""


class Basis(NamedTuple):
    """Measures that are parameters, their names, the numbers of the group by them (M, P), and how many are openings.

    These come last, and are zero by default.
    """

    chosen: tuple[Measure, ...]
    names: tuple[str, ...]
    factors: FloatArray
    openings: int


def basis(group: Group, box: FloatArray, typical: FloatArray, rows: FloatArray, openings: FloatArray) -> Basis | None:
    """The cheapest measures that tell a group for which relations (R, M) hold; none if sums of them are no simple ones.

    The sides of its ``box`` (6, M) come first, ``openings`` (U, M) last.
    """
    every = sorted(within_box(measures(group, typical), box), key=lambda each: (each.price, each.block))
    sides = [Measure(0, word, "length", -1, row, 0.0) for word, row in zip(BOX_IN_CELLS, box, strict=True)]
    last = [next(each for each in every if np.array_equal(each.row, row)) for row in openings]
    stack, chosen = list(rows), list[Measure]()
    for each in [*sides, *last, *every]:
        if len(stack) < group.size and np.linalg.matrix_rank([*stack, each.row], tol=SAME) > len(stack):
            stack.append(each.row)
            chosen.append(each)
    if len(stack) < group.size:
        return None
    factors = np.linalg.inv(np.stack(stack))[:, len(rows) :]
    near = np.round(factors * 4) / 4
    if np.abs(factors - near).max(initial=0) > SAME:
        return None
    order = sorted(range(len(chosen)), key=lambda k: (k >= 6, 6 <= k < 6 + len(last), chosen[k].block, k))
    ordered = tuple(chosen[k] for k in order)
    return Basis(ordered, _names(group, ordered), near[:, order] + 0.0, len(last))


def function(name: str, group: Group, made: Basis, draws: Sequence[tuple[str, str]]) -> Function:
    """The function of a group; ``draws`` are the statement and the role of each of its blocks."""
    counts = ["count"] if group.counts == 1 else [f"count_{number + 1}" for number in range(group.counts)]
    waiting = iter(counts)
    lines: list[Line] = []
    start = 0
    for kind, slots, (statement, role) in zip(group.kinds, group.slots, draws, strict=True):
        own = made.factors[start : start + len(slots)]
        start += len(slots)
        lines.append(_block(kind, own, made.names, waiting, statement, role))
    used = {
        name.name for line in Source(tuple(lines)).walk() for value in values(line)
        if isinstance(value, Expression) for name in value.names()
    }  # fmt: skip
    said = len(made.names) - made.openings
    box: list[tuple[str, float | None]] = [(word, None) for word in BOX_IN_CELLS]
    needed = [(word, None) for k, word in enumerate(made.names) if len(box) <= k < said and word in used]
    others = [(word, 0.0) for k, word in enumerate(made.names) if k >= said and word in used]
    parameters = (*box, *needed, *((count, PAIR) for count in counts), *others)
    return Function(name, parameters, tuple(lines))


def _block(
    kind: Kind, own: FloatArray, names: Sequence[str], counts: Iterator[str], statement: str, role: str
) -> Draw | Loop:
    """The lines of one block whose numbers follow from the parameters by ``own`` (M, P)."""
    solid = solid_of(statement)
    first = len(own) - kind.spans
    base = own[:first].copy()
    place = np.round(np.linalg.pinv(solid.rows[:, :-1]), 9)  # which leaves traces where it has zeros
    mirrors: list[tuple[str, tuple[Value, ...]]] = []
    loops: list[tuple[str, tuple[Value, ...]]] = []

    for (axis, way), span in zip(kind.repeats, own[first:], strict=False):
        if way == "mirror":
            mirrors.append(("mirror", (2.0, float(axis), _sum(span, names))))
            continue
        shift: list[Value] = [0.0, 0.0, 0.0]
        reach = span - own[3 + axis] if solid.boxed else span
        middle = own[axis] + span / 2
        if way == "pair" and (not middle.any() or np.array_equal(np.sort(middle)[::-1], np.eye(len(middle))[0])):
            base[axis] = base[axis] + reach  # the copy on the far side, which the mirror brings back
            loops.append(("mirror", (2.0, float(axis), _sum(middle, names))))
        else:
            number = Name(next(counts)) if way == "row" else 2.0
            step = _sum(reach, names)
            shift[axis] = Binary("/", step, number - 1.0) if isinstance(number, Name) else step
            loops.append(("translate", (number, *shift)))
    numbers = [_sum(row, names) for row in place @ base]
    line: Draw | Loop = Draw(statement, tuple(numbers), role)
    for loop, given in reversed([*mirrors, *loops]):
        line = Loop(loop, given, (line,))
    return line


def _names(group: Group, chosen: Sequence[Measure]) -> tuple[str, ...]:
    """A name for each parameter, which begins with its part where several parts have the like."""
    words = [each.word.removesuffix("_end") for each in chosen]
    for place, word in enumerate(words):
        stem = word.removeprefix("bottom_")
        if stem != word and f"upper_{stem}" not in words and stem not in words and stem not in RESERVED:
            words[place] = stem  # it is the same above
    known = language()
    names = [*BOX_IN_CELLS]
    taken = {*known.names, *known.roles, *RESERVED, "tilt"}
    for each, word in zip(chosen[6:], words[6:], strict=True):
        own = word in RESERVED or (words.count(word) > 1 and len(group.kinds) > 1)
        base = f"{group.kinds[each.block].word or 'part'}_{word}" if own else word
        name, number = base, 2
        while name in taken:
            name, number = f"{base}_{number}", number + 1
        taken.add(name)
        names.append(name)
    return tuple(names)


def _sum(row: FloatArray, names: Sequence[str]) -> Value:
    parts = [(Name(name), float(factor)) for name, factor in zip(names, np.round(row, 6) + 0.0, strict=True) if factor]
    return combined(0.0, [*sorted(parts, key=lambda part: part[1] < 0)])
