"""Rewriting of programs with the functions of a library."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import (
    Call,
    Draw,
    Function,
    Line,
    Loop,
    Source,
    names_of,
)
from shapeprog.language.convert import named_cells, placed, placed_again
from shapeprog.language.dimensions import in_unit
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import Expression, rounded
from shapeprog.language.merging import merged_lines, separate_loops
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program, program_of
from shapeprog.library.blocks import ROWS
from shapeprog.library.length import length, statements, written
from shapeprog.library.matching import TOLERANCE, Form, Matcher, Pattern, forms
from shapeprog.library.store import Library, check_library


def with_library(program: Program, library: Library) -> Program:
    """The same program with calls of functions of a library where these are shorter; unchanged if none is.

    It draws the same within ``TOLERANCE`` cells.  The result contains the functions that it calls, below its
    assignments.  Arguments are expressions of its names for lengths; counts become numbers.  Comments are left out,
    groups and functions of its own written out, as are calls of another library: use ``joined`` libraries.  Its lengths
    stay in their unit.  A program with statements that have no placed form does not change, nor does one whose numbers
    are not linear in its names.
    """
    check_library(library)
    program = program_of(program)
    try:
        original = placed(program)
        cells = named_cells(original)
    except ShapeProgError:
        return program
    cells = replace(cells, lines=tuple(separate_loops(cells.lines)))  # one statement in each nest of loops
    names = names_of(cells)
    selected = _selected(cells, [pattern for pattern in library.patterns if pattern.function.name not in names])

    def written_with(some: Sequence[Offer]) -> tuple[float, Program]:
        try:
            result = placed_again(_rewritten(cells, some), _called(some, library)) if some else original
        except ShapeProgError:
            return np.inf, original
        return _length(result), result

    best = written_with(selected)
    for offer in reversed(selected):
        fewer = [candidate for candidate in selected if candidate is not offer]
        trial = written_with(fewer)
        if trial[0] <= best[0]:
            selected, best = fewer, trial
    if statements(best[1]) >= statements(original):
        return program
    before, result = source_of(original), source_of(in_unit(best[1], original.unit))
    return replace(evaluated(replace(result, unit=before.unit, scale=before.scale)), frame=program.frame)


def _length(program: Program) -> int:
    return length(line for line in source_of(program).lines if not isinstance(line, Function))


def _called(selected: Sequence[Offer], library: Library) -> list[Function]:
    """The placed functions that calls need, in the order of the library."""
    names = {offer.call.name for offer in selected}
    for function in reversed(library.source.functions.values()):
        if function.name in names:
            names |= {line.name for line in Source(function.body).walk() if isinstance(line, Call)}
    return [function for name, function in library.source.functions.items() if name in names]


class Offer(NamedTuple):
    """A call that could replace some lines of a program, inside the loops around the first of them.

    ``lines`` has the index of the line that each block of its function replaces; loops hold one statement each.
    """

    fewer: int
    gain: float
    call: Call
    lines: tuple[int, ...]
    around: tuple[Loop, ...]


def matchers_of(source: Source) -> Iterator[tuple[Matcher, tuple[Loop, ...]]]:
    """The blocks of a program that calls may replace: of all its lines, then of the bodies of equal loops.

    With each matcher come the loops around its lines, without bodies.  Stops if a number is not linear in the names.
    """
    numbers = source.evaluated_numbers()
    names = [name for name, value in source.numbers.items() if not isinstance(value, Expression)]
    free = {name: numbers[name] for name in names}

    def of(lines: Sequence[tuple[int, Line]], *around: Loop) -> Iterator[tuple[Matcher, tuple[Loop, ...]]]:
        readings: list[list[Form]] = [[] for _ in ROWS]
        units: list[int] = []
        inner: dict[Loop, list[tuple[int, Line]]] = {}
        for number, line in lines:
            if isinstance(line, Draw | Loop):
                for read in forms([line], numbers, names, ROWS):
                    units.append(number)
                    for some, form in zip(readings, read, strict=True):
                        some.append(form)
            if isinstance(line, Loop) and len(line.body) == 1:
                inner.setdefault(_frame(line), []).append((number, line.body[0]))
        for some in {tuple(form.block.kind for form in some): some for some in readings}.values():
            yield Matcher(some, units, free), around
        for loop, within_it in inner.items():
            if len(within_it) > 1 or isinstance(within_it[0][1], Loop):
                yield from of(within_it, *around, loop)

    try:
        yield from of(list(enumerate(source.lines)))
    except ShapeProgError:  # a product of names
        return


def _frame(loop: Loop) -> Loop:
    """A loop without its body, and its numbers without rounding errors of unit conversion."""
    return replace(loop, values=tuple(rounded(value, 4) for value in loop.values), body=())


def _selected(source: Source, patterns: Sequence[Pattern]) -> list[Offer]:
    """The calls that shorten a program most, in greedy order; no two of them share a line."""
    offered: list[Offer] = []
    for matcher, around in matchers_of(source):
        for pattern in patterns:
            for match in matcher.matches(pattern):
                lines = tuple(matcher.units[k] for k in match.blocks)
                before = [source.lines[k] for k in sorted({*lines})]
                call = Call(pattern.function.name, match.arguments, role=match.role)
                instead = [within(around, call)]
                fewer = written(before) - written(instead)
                gain = length(before) - length(instead) - match.error / TOLERANCE
                if fewer > 0 and gain > 0:
                    offered.append(Offer(fewer, gain, call, lines, around))
    used: set[int] = set()
    selected = []
    for offer in sorted(offered, key=lambda offer: (-offer.fewer, -offer.gain)):
        if not used & {*offer.lines}:
            used |= {*offer.lines}
            selected.append(offer)
    return selected


def within(around: Sequence[Loop], line: Line) -> Line:
    """A line in some loops, the outermost of which comes first."""
    for loop in reversed(around):
        line = replace(loop, body=(line,))
    return line


def _rewritten(source: Source, selected: Sequence[Offer]) -> Source:
    """The program in cells with calls, equal loops written once."""
    calls = {min(offer.lines): within(offer.around, offer.call) for offer in selected}
    gone = {number for offer in selected for number in offer.lines} - calls.keys()
    lines = [calls.get(number, line) for number, line in enumerate(source.lines) if number not in gone]
    return replace(source, lines=merged_lines(lines))
