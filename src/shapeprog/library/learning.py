"""Learning of the functions that shorten many programs most, from the blocks that these have in common.

Blocks of one program that occur together in many are a group.  The relations that hold for it in most of these leave
few measures open, which become the parameters of a function.  Of all groups and all their sets of relations, the one
that shortens the programs most becomes a function.  Its blocks are removed from the programs, and the search repeats.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shapeprog.arguments import check_number
from shapeprog.language.ast import Assignment, Call, Comment, Function, Line, Source
from shapeprog.language.convert import in_cells, placed_function, placed_if_possible
from shapeprog.language.evaluate import evaluated, placed_source
from shapeprog.language.placement import BOX_IN_CELLS, SIZES
from shapeprog.language.printer import format_source, source_of
from shapeprog.language.program import Program, programs_of
from shapeprog.library.blocks import Block, Kind
from shapeprog.library.groups import LEAST_PROGRAMS, NEAR, Candidate, Corpus, Unit, candidates, statement_of, units_of
from shapeprog.library.length import statements
from shapeprog.library.measures import Group
from shapeprog.library.rewriting import with_library
from shapeprog.library.store import Library, library_of
from shapeprog.library.words import name_of
from shapeprog.library.writing import basis, function

MOST = 12
"""Most functions of a library."""

OWN = 0.9
"""Least share of parts of one role among the uses of a function for it to get this role."""

BOARD = 24.0
"""Sides of the object in the placed text of functions, which has to declare them; calls have their own boxes."""


class Learned(NamedTuple):
    """A function, and a call of it with typical arguments."""

    function: Function
    example: Call


def learn(given: Iterable[Program], most: int = MOST) -> Library:
    """The library of the functions that shorten programs most; empty if none does.  The same for the same programs.

    Comments show how often the programs use each function, and a typical call.  A ``ShapeProgError`` if ``given``
    are no programs, or ``most`` is no number.
    """
    check_number("most", most, 0, whole=True)
    given = programs_of(given)
    results = list(_functions([in_cells(program) for program in given], most))
    if not results:
        return Library(Source())
    given = [placed_if_possible(program) for program in given]
    library, written, users = _used(given, _library(results))
    if len(frequent := [item for item in results if len(users[item.function.name]) >= LEAST_PROGRAMS]) < len(results):
        if not frequent:
            return Library(Source())
        library, written, users = _used(given, _library(frequent))
    before, after = sum(map(statements, given)), sum(map(statements, written))
    summary = f"Learned from {len(given)} programs: {before} statements, {after} with these functions"
    lines: list[Line] = [Comment(summary), *(line for line in library.source.lines if isinstance(line, Assignment))]
    for learned in library.source.functions.values():
        where = users[learned.name]
        used = f"used {sum(where)} times, by {len(where)} programs, such as"
        lines += [Comment(), Comment(used), *map(Comment, library.comments[learned.name]), learned]
    return library_of(evaluated(replace(library.source, lines=tuple(lines))))


def _used(programs: Sequence[Program], library: Library) -> tuple[Library, list[Program], dict[str, list[int]]]:
    """A library, the programs written with it, and how often each of its functions is called by those that call it."""
    written = [with_library(program, library) for program in programs]
    users: dict[str, list[int]] = defaultdict(list)
    for program in written:
        for name, times in Counter(line.name for line in source_of(program).walk() if isinstance(line, Call)).items():
            users[name].append(times)
    return library, written, users


def _library(learned: Sequence[Learned]) -> Library:
    """The functions as placed text, each below a typical call."""
    functions = []
    for entry in learned:
        defaults = {name: value for name, value in entry.function.parameters if isinstance(value, float)}
        typical = {name: value for name, value in entry.example.arguments if isinstance(value, float)}
        functions.append(placed_function(entry.function, defaults | typical))
    source = placed_source((Assignment(tuple((size, BOARD) for size in SIZES)), *functions))
    lines: list[Line] = [*source.lines[:1]]
    for entry, written in zip(learned, functions, strict=True):
        arguments = tuple(pair for pair in entry.example.arguments if pair[0] not in BOX_IN_CELLS[:3])
        call = replace(entry.example, arguments=arguments)
        text = format_source(replace(source, lines=(*source.lines, call))).splitlines()[-1]
        lines += [Comment(), Comment(text), written]
    return Library(replace(source, lines=tuple(lines)))


def _functions(programs: Sequence[Program], limit: int) -> Iterator[Learned]:
    corpus: Corpus = [units_of(program) for program in programs]
    names: set[str] = set()
    while len(names) < limit:
        offered = sorted(candidates(corpus), key=lambda candidate: -candidate.gain)
        pairs = ((best, _made(best, corpus, names)) for best in (_owned(candidate, corpus) for candidate in offered))
        best, made = next(((best, made) for best, made in pairs if made is not None), (None, None))
        if best is None or made is None:
            return
        yield made
        names.add(made.function.name)
        for use in best.uses:
            for index in use.blocks:
                corpus[use.program][index] = None


def _owned(best: Candidate, corpus: Corpus) -> Candidate:
    """The candidate restricted to parts of one role if nearly all of its uses have that role."""
    kind = best.group.kinds[0]
    if len(best.group.kinds) > 1 or kind.word:
        return best
    words = [_unit(corpus, use.program, use.blocks[0]).forms[0].kind.word for use in best.uses]
    word, count = Counter(words).most_common(1)[0]
    if not word or count < OWN * len(words):
        return best
    uses = tuple(use for use, role in zip(best.uses, words, strict=True) if role == word)
    return replace(best, group=Group((replace(kind, word=word),), best.group.slots), uses=uses)


def _unit(corpus: Corpus, program: int, index: int) -> Unit:
    unit = corpus[program][index]
    assert unit is not None
    return unit


def _made(best: Candidate, corpus: Corpus, names: set[str]) -> Learned | None:
    """The function of a candidate, with its most central use as the example; ``None`` if its sums are not simple."""
    values = np.array([use.values for use in best.uses])
    typical = best.uses[int(np.abs(values - np.median(values, 0)).sum(1).argmin())]
    made = basis(best.group, best.box, typical.values, best.rows, best.openings)
    if made is None:
        return None
    kinds = best.group.kinds
    units = [_unit(corpus, typical.program, index) for index in typical.blocks]
    draws = [
        (unit.draw.name, unit.draw.role) if kind.word else (statement_of(kind.shape), "")
        for kind, unit in zip(kinds, units, strict=True)
    ]
    written = function(name_of(kinds, names), best.group, made, draws)
    counts = (count for kind, unit in zip(kinds, units, strict=True) for count in _counts(kind, unit))
    numbers = {
        name: float(measure.row @ typical.values) for name, measure in zip(made.names, made.parameters, strict=True)
    }
    arguments: list[tuple[str, float]] = []
    for name, default in written.parameters:
        value = round(numbers[name], 2) + 0.0 if name in numbers else float(next(counts))
        if not isinstance(default, float) or abs(value - default) > NEAR:
            arguments.append((name, value))
    role = "" if kinds[0].word else units[0].forms[0].kind.word
    return Learned(written, Call(written.name, tuple(arguments), role=role))


def _counts(kind: Kind, unit: Unit) -> Iterator[int]:
    """The counts of the rows of a block."""
    yield from (count for (_, way), count in zip(kind.repeats, _form(kind, unit).counts, strict=True) if way == "row")


def _form(kind: Kind, unit: Unit) -> Block:
    return next(form for form in unit.forms if replace(form.kind, word=kind.word) == kind)
