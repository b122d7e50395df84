"""The function that draws a group of blocks, from the measures that are its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from shapeprog.language.expression import Binary, Expression, Name, Value, combined
from shapeprog.language.source import Function, Line, Source, WrittenDraw, WrittenLoop, values
from shapeprog.language.statement import language
from shapeprog.library.blocks import Kind, solid_of
from shapeprog.library.measures import LINES, SPACINGS, STEPS, Group, Measure, measures
from shapeprog.space import DEPTH, SIDE, UP, FloatArray

SAME = 1e-6
"""Difference below which factors are the same."""

ORDER = ("bottom", "height", "rise", "front", "depth", "left", "width")
"""Parameters in the order in which they are given, after counts; all others follow."""


class Basis(NamedTuple):
    """Measures that are parameters, their names, the numbers of the group by them (M, P), and how many are openings.

    These come last, and are zero by default.
    """

    chosen: tuple[Measure, ...]
    names: tuple[str, ...]
    factors: FloatArray
    openings: int


def basis(group: Group, typical: FloatArray, rows: FloatArray, openings: FloatArray) -> Basis | None:
    """The cheapest measures that tell a group for which relations (R, M) hold; none if sums of them are no simple ones.

    ``openings`` (U, M) are among them.
    """
    every = sorted(measures(group, typical), key=lambda each: (each.price, each.block))
    last = [next(each for each in every if np.array_equal(each.row, row)) for row in openings]
    stack, chosen = list(rows), []
    for each in [*last, *every]:
        if len(stack) < group.size and np.linalg.matrix_rank([*stack, each.row], tol=SAME) > len(stack):
            stack.append(each.row)
            chosen.append(each)
    if len(stack) < group.size:
        return None
    factors = np.linalg.inv(np.stack(stack))[:, len(rows) :]
    near = np.round(factors * 4) / 4
    if np.abs(factors - near).max(initial=0) > SAME:
        return None
    order = sorted(
        range(len(chosen)),
        key=lambda k: (k < len(last), chosen[k].sort == "step", _rank(chosen[k].word), chosen[k].block, k),
    )
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
    parameters: list[tuple[str, float | None]] = []
    for place, word in enumerate(made.names):
        if word in SPACINGS:  # how often something is repeated, and how far apart
            parameters.append((LINES[SPACINGS.index(word)], 1.0))
        if word in STEPS and group.kinds[0].grid and not any(name == "steps" for name, _ in parameters):
            parameters.append(("steps", 1.0))
        if word in used:
            parameters.append((word, None if place < said else 0.0))
    return Function(name, (*((count, None) for count in counts), *parameters), tuple(lines))


def _block(
    kind: Kind, own: FloatArray, names: Sequence[str], counts: Iterator[str], statement: str, role: str
) -> WrittenDraw | WrittenLoop:
    """The lines of one block whose numbers follow from the parameters by ``own`` (M, P)."""
    solid = solid_of(statement)
    first = len(own) - kind.spans
    base = own[:first].copy()
    place = np.round(np.linalg.pinv(solid.rows[:, :-1]), 9)  # which leaves traces where it has zeros
    before: dict[int, list[tuple[Value, float]]] = {}
    mirrors: list[tuple[str, tuple[Value, ...]]] = []
    loops: list[tuple[str, tuple[Value, ...]]] = []

    def starts_before(axis: int, count: Name, step: Value) -> None:
        """What copies on either side of the middle take away from where the first begins."""
        slot = int(np.flatnonzero(place[:, axis])[0])
        before.setdefault(slot, []).append(((count - 1.0) * step, -0.5))

    if kind.grid and solid.boxed:
        base[1:3] -= own[4:6] / 2  # of the middle
    if kind.steps:
        times = Name("steps") if kind.grid else Name(next(counts))
        steps = [_sum(row, names) for row in own[-3:]]
        loops.append(("translate", (times, *steps)))
        for axis in (DEPTH, SIDE) if kind.grid and solid.boxed else ():
            if isinstance(steps[axis], Expression):
                starts_before(axis, times, steps[axis])
    for (axis, way), span in zip(kind.repeats, own[first:], strict=False):
        if way == "mirror":
            mirrors.append(("mirror", (2.0, float(axis), _sum(span, names))))
            continue
        shift: list[Value] = [0.0, 0.0, 0.0]
        if way == "grid":
            count, shift[axis] = Name(LINES[axis]), _sum(span, names)
            loops.append(("translate", (count, *shift)))
            if solid.boxed and axis != UP:
                starts_before(axis, count, shift[axis])
            continue
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
    numbers = [_sum(row, names, *before.get(slot, ())) for slot, row in enumerate(place @ base)]
    line: WrittenDraw | WrittenLoop = WrittenDraw(statement, tuple(numbers), role)
    for loop, given in reversed([*mirrors, *loops]):
        line = WrittenLoop(loop, given, (line,))
    return line


def _rank(word: str) -> int:
    return ORDER.index(word) if word in ORDER else len(ORDER)


def _names(group: Group, chosen: Sequence[Measure]) -> tuple[str, ...]:
    """A name for each parameter, which begins with its part where several parts have the like."""
    words = [each.word.removesuffix("_end") for each in chosen]
    for place, word in enumerate(words):
        stem = word.removeprefix("bottom_")
        if stem != word and f"upper_{stem}" not in words and stem not in words:
            words[place] = stem  # it is the same above
    if sum(word.startswith("middle_") for word in words) == 1:
        words = ["middle" if word.startswith("middle_") else word for word in words]
    known = language()
    taken = {*known.names, *known.roles}
    names: list[str] = []
    for each, word in zip(chosen, words, strict=True):
        base = f"{group.kinds[each.block].word}_{word}" if words.count(word) > 1 and len(group.kinds) > 1 else word
        name, number = base, 2
        while name in taken:
            name, number = f"{base}_{number}", number + 1
        taken.add(name)
        names.append(name)
    return tuple(names)


def _sum(row: FloatArray, names: Sequence[str], *more: tuple[Value, float]) -> Value:
    parts = [(Name(name), float(factor)) for name, factor in zip(names, np.round(row, 6) + 0.0, strict=True) if factor]
    return combined(0.0, [*sorted(parts, key=lambda part: part[1] < 0), *more])
