"""Programs written with the functions of a library."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import (
    Assignment,
    Call,
    Comment,
    Draw,
    Function,
    Line,
    Loop,
    Source,
    names_of,
    values,
)
from shapeprog.language.convert import in_cells, placed_if_possible
from shapeprog.language.dimensions import Counts, in_unit
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import Expression, Linear, Name, Value
from shapeprog.language.merging import merged
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program
from shapeprog.library.blocks import ROWS
from shapeprog.library.length import length, outside, statements, written
from shapeprog.library.matching import TOLERANCE, Form, Match, Matcher, Pattern, Sums, forms
from shapeprog.library.store import Library
from shapeprog.space import FloatArray

SAME = 1e-4
"""How far factors of two sums may be from each other where these are the same: written ones are rounded."""


def with_library(program: Program, library: Library) -> Program:
    """The same program with calls of functions of a library wherever that is shorter; itself if that is nowhere.

    It draws the same within ``TOLERANCE`` cells.  The functions that it calls stand in it, below the numbers that it
    names; ties are kept, as arguments are expressions of its names.  Its lengths stay in their unit.
    """
    if program.source is not None and program.source.placed:
        return _placed_with(program, library)
    if program.unit is not None:
        try:
            plain = in_unit(program, None)
        except ShapeProgError:  # one of its names is a length in one place only
            return program
        found = with_library(plain, library)
        return program if found is plain else in_unit(found, program.unit)
    chosen = offers(program, library)
    if not chosen:
        return program
    found = merged(_rewritten(_apart(program), chosen, library.functions))
    return found if statements(found) < statements(merged(program)) else program


def _placed_with(program: Program, library: Library) -> Program:
    """A placed program with those calls that make its own text shorter: loops may be shared by several parts."""
    cells = in_cells(program)
    try:
        cells = cells if cells.unit is None else in_unit(cells, None)
    except ShapeProgError:  # one of its names is a length in one place only
        return program
    source, chosen = _apart(cells), offers(cells, library)

    def written_with(some: Sequence[Offer]) -> tuple[float, Program]:
        found = placed_if_possible(merged(_rewritten(source, some, library.functions))) if some else program
        shorter = [line for line in source_of(found).lines if not isinstance(line, Function)]
        return length(shorter) if source_of(found).placed else np.inf, found

    best = written_with(chosen)
    for offer in reversed(chosen):
        fewer = [each for each in chosen if each is not offer]
        other = written_with(fewer)
        if other[0] <= best[0]:
            chosen, best = fewer, other
    if statements(best[1]) >= statements(program):
        return program
    own, found = source_of(program), source_of(in_unit(best[1], program.unit))
    return evaluated(replace(found, unit=own.unit, scale=own.scale))


def _apart(program: Program) -> Source:
    """A program as it is written, but with one statement in each nest of loops."""
    source = source_of(program)
    return replace(source, lines=tuple(separate_loops(source.lines)))


def separate_loops(lines: Sequence[Line]) -> Iterator[Line]:
    """The lines with each loop in cells around several statements as that loop around each, but for those with
    comments."""
    for line in lines:
        if not isinstance(line, Loop) or any(isinstance(inner, Comment) for inner in line.body):
            yield line
            continue
        for index, inner in enumerate(separate_loops(line.body)):
            yield replace(line, body=(inner,), note="" if index else line.note)


class Offer(NamedTuple):
    """A call that could replace some lines of a program, inside the loops around the first of them.

    ``lines`` has the index of the line that each block of its function replaces; loops hold one statement each.
    """

    fewer: int
    gain: float
    call: Call
    lines: tuple[int, ...]
    around: tuple[Loop, ...]


def offers(program: Program, library: Library) -> list[Offer]:
    """The calls of functions of a library that shorten a program most, none of which shares a line with another."""
    source = _apart(program)
    words = {*names_of(source), *source.functions}
    usable = [
        pattern
        for pattern in library.patterns
        if words.isdisjoint([pattern.function.name, *(each.name for each in pattern.others)])
        and source.functions.keys().isdisjoint(pattern.parameters)
    ]
    return _chosen(source, usable)


def matchers_of(source: Source) -> Iterator[tuple[Matcher, tuple[Loop, ...]]]:
    """The blocks of a program that calls may replace: of all its lines, then of what equal loops have inside of them.

    With each come the loops that stay around, without bodies.  None if its numbers are not linear in its names.
    """
    named = tuple(line for line in source.lines if isinstance(line, Assignment | Function))
    plain, free = _plain(source), _free(source)
    given = {name: Linear.of(name) for name in free}
    numbers = np.array([plain[name] for name in free])

    def of(lines: Sequence[tuple[int, Line]], *around: Loop) -> Iterator[tuple[Matcher, tuple[Loop, ...]]]:
        found: list[list[Form]] = [[] for _ in ROWS]
        units: list[int] = []
        inner: dict[Loop, list[tuple[int, Line]]] = {}
        for number, line in lines:
            if isinstance(line, Draw | Loop):
                for read in forms(Source((*named, line)), given, free, ROWS):
                    units.append(number)
                    for some, form in zip(found, read, strict=True):
                        some.append(form)
            if isinstance(line, Loop) and len(line.body) == 1:
                inner.setdefault(replace(line, body=(), note=""), []).append((number, line.body[0]))
        for some in {tuple(form.block.kind for form in some): some for some in found}.values():
            yield Matcher(some, units, numbers, sums), around
        for loop, within_it in inner.items():
            if len(within_it) > 1 or isinstance(within_it[0][1], Loop):
                yield from of(within_it, *around, loop)

    try:
        sums = Sums(free, _others(source, free))
        yield from of(list(enumerate(source.lines)))
    except ShapeProgError:  # a product of names
        return


def _others(source: Source, free: Sequence[str]) -> dict[str, FloatArray]:
    """The names that follow from those that are free, as rows of factors and a constant."""
    known = _known(source)
    return {name: _row(value, known, free) for name, value in source.numbers.items() if isinstance(value, Expression)}


def _known(source: Source) -> dict[str, Linear | float]:
    """What the names of a program stand for: numbers, or sums of those that are free."""
    known: dict[str, Linear | float] = {**_plain(source), **{name: Linear.of(name) for name in _free(source)}}
    for name, value in source.numbers.items():
        if isinstance(value, Expression):
            known[name] = value.at(known)
    return known


def _row(value: Value, known: Mapping[str, Linear | float], free: Sequence[str]) -> FloatArray:
    """A value as a row of factors of the free names and a constant."""
    form = value.at(known) if isinstance(value, Expression) else value
    form = form if isinstance(form, Linear) else Linear(form)
    factors = dict(form.factors)
    return np.array([*(factors.get(each, 0.0) for each in free), form.constant])


def _free(source: Source) -> list[str]:
    """The names of plain numbers that are no counts."""
    whole = Counts(source).outside
    return [name for name in _plain(source) if name not in whole]


def _plain(source: Source) -> dict[str, float]:
    """The names that stand for plain numbers."""
    return {name: value for name, value in source.numbers.items() if not isinstance(value, Expression)}


def _chosen(source: Source, patterns: Sequence[Pattern]) -> list[Offer]:
    """The calls that shorten a program most, one after another, none of which shares a line with another."""
    offered: list[Offer] = []
    for matcher, around in matchers_of(source):
        for pattern in patterns:
            for match in matcher.matches(pattern):
                lines = tuple(matcher.units[k] for k in match.blocks)
                before = [source.lines[k] for k in sorted({*lines})]
                arguments = tuple(_counted(source, before, pattern, match))
                call = Call(pattern.function.name, arguments, role=match.role)
                instead = [within(around, call)]
                fewer = written(before) - written(instead)
                gain = length(before) - length(instead) - match.error / TOLERANCE
                if fewer > 0 and gain > 0:
                    offered.append(Offer(fewer, gain, call, lines, around))
    taken: set[int] = set()
    chosen = []
    for offer in sorted(offered, key=lambda each: (-each.fewer, -each.gain)):
        if not taken & {*offer.lines}:
            taken |= {*offer.lines}
            chosen.append(offer)
    return chosen


def _counted(source: Source, lines: Sequence[Line], pattern: Pattern, match: Match) -> Iterator[tuple[str, Value]]:
    """The arguments of a match with the names that loops among some lines have for their counts.

    Steps that follow from such a count are as they are there: more copies share the same span.
    """
    plain = _plain(source)
    loops = [line for line in Source(tuple(lines)).walk() if isinstance(line, Loop)]
    counts = {
        plain[count.name]: count
        for count in (loop.values[0] for loop in loops)
        if isinstance(count, Name) and count.name in plain
    }
    named = {count.name for count in counts.values()}
    steps = [
        step for loop in loops for step in loop.values[1:]
        if isinstance(step, Expression) and named & {name.name for name in step.names()}
    ]  # fmt: skip
    shifts = {
        name.name
        for line in Source(pattern.function.body).walk() if isinstance(line, Loop)
        for value in line.values[1:] if isinstance(value, Expression)
        for name in value.names()
    }  # fmt: skip
    known, free = (_known(source), _free(source)) if steps else ({}, [])
    for word, value in match.arguments:
        if word in pattern.counts and isinstance(value, float):
            yield word, counts.get(value, value)
            continue
        if not steps or word not in shifts:
            yield word, value
            continue
        row = _row(value, known, free)
        same = (
            each
            for step in steps
            for each in (step, -step) if np.allclose(_row(each, known, free), row, atol=SAME)
        )  # fmt: skip
        yield word, next(same, value)


def within(around: Sequence[Loop], line: Line) -> Line:
    """A line in some loops, the outermost of which comes first."""
    for loop in reversed(around):
        line = replace(loop, body=(line,))
    return line


def _rewritten(source: Source, chosen: Sequence[Offer], functions: Sequence[Function]) -> Program:
    calls = {min(offer.lines): within(offer.around, offer.call) for offer in chosen}
    gone = {number for offer in chosen for number in offer.lines} - calls.keys()
    body = [calls.get(number, line) for number, line in enumerate(source.lines) if number not in gone]
    wanted = {offer.call.name for offer in chosen}
    for function in reversed(functions):  # those that they call
        if function.name in wanted:
            wanted |= {line.name for line in Source(function.body).walk() if isinstance(line, Call)}
    first = next(n for n, line in enumerate(body) if not isinstance(line, Assignment | Comment | Function))
    added: list[Line] = []
    for function in functions:
        if function.name in wanted:
            added += [Comment(), function]
    added += [Comment()]
    return evaluated(Source(tuple(_used([*body[:first], *added, *body[first:]]))))


def _used(lines: list[Line]) -> list[Line]:
    """The lines without names that nothing uses any more."""
    while True:
        used = {
            name.name for line in outside(lines) for value in values(line) if isinstance(value, Expression)
            for name in value.names()
        }  # fmt: skip
        kept: list[Line] = []
        for line in lines:
            if isinstance(line, Assignment):
                pairs = tuple(pair for pair in line.numbers if pair[0] in used)
                if pairs:
                    kept.append(line if len(pairs) == len(line.numbers) else Assignment(pairs, line.note))
            else:
                kept.append(line)
        if kept == lines:
            return kept
        lines = kept
