"""Calls of library functions among the blocks of a program.

For fixed counts, the numbers of the blocks that a function draws are linear in its measures.  So blocks of the right
kinds give the measures by least squares, and the largest residual decides whether they may be a call.  They move to
where the call draws them if the program loses little value, as a call costs less than the blocks that it replaces.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.inference.choice.choice import value
from shapeprog.inference.choice.connecting import floating
from shapeprog.inference.choice.coverage import Coverage
from shapeprog.inference.fit.tunable import CELLS, least
from shapeprog.language.ast import Call, Source
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Loop, Node, Program, nest
from shapeprog.language.statement import language
from shapeprog.library.blocks import Kind, forms_of
from shapeprog.library.matching import EXACT, Form, Pattern
from shapeprog.library.rewriting import within
from shapeprog.library.store import Library
from shapeprog.space import FloatArray

LOOSE = 0.6
"""Largest difference in cells between a number of a block and that of the call which replaces it."""

LOSS = 0.02
"""Largest loss of value by a call, as a share of the target: whoever gives functions wants to see them called."""

OFFERED = 48
"""Largest number of calls of one function that are compared: the nearest."""


class Candidate(NamedTuple):
    """A call as a program, the indices of the blocks that it replaces, in its order, and the largest difference."""

    program: Program
    replaced: tuple[int, ...]
    difference: float


class Option(NamedTuple):
    """A block of a program inside of some of its loops: its index, these loops and their numbers, its numbers (M,)."""

    place: int
    around: tuple[Loop, ...]
    outer: FloatArray
    values: FloatArray


Options = dict[tuple[Kind, tuple[int, ...], tuple[tuple[float | str, ...], ...]], list[Option]]
"""Blocks by kind, without role, by counts, and by the names and discrete numbers of the loops around."""


def with_calls(program: Program, libraries: Sequence[Library], coverage: Coverage) -> tuple[Program, frozenset[int]]:
    """The program with blocks moved to where calls of functions draw them, if it loses little value and nothing floats.

    Parameters
    ----------
    program
        A program in cells.
    libraries
        The functions.
    coverage
        Coverage of the target, which gives the value.

    Returns
    -------
    program, drawn
        One node for each block, and the indices of those that calls draw.
    """
    nodes = list(program.flat().body)
    options = _options(program)
    patterns = [pattern for library in libraries for pattern in library.patterns if pattern.shortens]
    candidates = [candidate for pattern in patterns for candidate in _candidates(pattern, options)]
    candidates.sort(key=lambda candidate: (-len(candidate.replaced), candidate.difference))
    table = coverage.table([*(Program((node,)) for node in nodes), *(candidate.program for candidate in candidates)])
    selected, drawn, loose = frozenset(range(len(nodes))), set[int](), len(floating(Program(tuple(nodes))))
    for index, candidate in enumerate(candidates, len(nodes)):
        trial = selected.difference(candidate.replaced) | {index}
        if not selected.issuperset(candidate.replaced) or value(table, (*trial,)) < value(table, (*selected,)) - LOSS:
            continue
        moved = dict(zip(candidate.replaced, _with_one_role(candidate, nodes), strict=True))
        together = [moved.get(place, node) for place, node in enumerate(nodes)]
        if len(floating(Program(tuple(together)))) <= loose:
            nodes, selected, drawn = together, trial, drawn.union(moved)
    return Program(tuple(nodes)), frozenset(drawn)


def _with_one_role(candidate: Candidate, nodes: Sequence[Node]) -> Iterator[Node]:
    """The blocks of a call; those without a role in its function get the commonest role of the blocks it replaces."""
    draws, before = candidate.program.draws, Program(tuple(nodes[place] for place in candidate.replaced)).draws
    is_open = [not (draw.role or language().own_role(draw.name)) for draw in draws]
    words = Counter(draw.word for draw, open_role in zip(before, is_open, strict=True) if open_role)
    for (*loops, _), draw, open_role in zip(candidate.program.chains, draws, is_open, strict=True):
        role = words.most_common(1)[0][0] if open_role else ""
        yield nest((*loops, replace(draw, role=role) if role and role != draw.name else draw))


def _options(program: Program) -> Options:
    options: Options = {}
    for index, chain in enumerate(program.chains):
        for depth in range(len(chain)):
            around = tuple(node for node in chain[:depth] if isinstance(node, Loop))
            discrete, outer = list[tuple[float | str, ...]](), list[float]()
            for loop in around:
                is_discrete = [quantity.discrete for quantity in language()[loop.name].quantities]
                discrete.append((loop.name, *itertools.compress(loop.values, is_discrete)))
                outer += itertools.compress(loop.values, np.logical_not(is_discrete))
            for block in forms_of(chain[depth:]):
                key = replace(block.kind, word=""), block.counts, tuple(discrete)
                options.setdefault(key, []).append(Option(index, around, np.array(outer), block.values))
    return options


def _candidates(pattern: Pattern, options: Options) -> list[Candidate]:
    """The calls of a function that draw nearly the same as some blocks, the nearest first."""
    candidates: list[Candidate] = []
    for around in {around for _, _, around in options}:
        for counts in pattern.choices(counts for _, counts, other in options if other == around):
            usual = pattern.arguments | counts
            start = np.array([usual[name] for name in pattern.measures])
            for forms in pattern.forms(counts) if pattern.blocks > 1 else ():
                keys = ((replace(form.block.kind, word=""), form.block.counts, around) for form in forms)
                for blocks in _assignments(forms, [options.get(key, []) for key in keys], start):
                    measures, difference = _solved(forms, blocks, start)
                    arguments = usual | dict(zip(pattern.measures, measures.tolist(), strict=True))
                    if (program := called(pattern, arguments, blocks[0].around)) is not None:
                        candidates.append(Candidate(program, tuple(block.place for block in blocks), difference))
    return sorted(candidates, key=lambda candidate: candidate.difference)[:OFFERED]


def _assignments(
    forms: Sequence[Form], options: Sequence[Sequence[Option]], start: FloatArray, *blocks: Option
) -> Iterator[tuple[Option, ...]]:
    """Blocks for all forms of a function, as near to those of one call as ``LOOSE``."""
    if len(blocks) == len(forms):
        yield blocks
        return
    for option in options[len(blocks)]:
        longer = (*blocks, option)
        if option.place not in {block.place for block in blocks} and _solved(forms, longer, start)[1] <= LOOSE:
            yield from _assignments(forms, options, start, *longer)


def _solved(forms: Sequence[Form], blocks: Sequence[Option], start: FloatArray) -> tuple[FloatArray, float]:
    """The measures of a call by least squares, and the largest difference of its blocks and of the loops around them.

    Measures that the first forms do not determine keep their values of ``start``.
    """
    factors = np.concatenate([form.factors for form in forms[: len(blocks)]])
    constants = np.concatenate([form.constants for form in forms[: len(blocks)]])
    away = np.concatenate([block.values for block in blocks]) - constants - factors @ start
    change = np.linalg.lstsq(factors, away, rcond=None)[0]
    outer = np.array([block.outer - blocks[0].outer for block in blocks])
    return start + change, float(max(np.abs(factors @ change - away).max(), np.abs(outer).max(initial=0)))


def called(pattern: Pattern, arguments: Mapping[str, float], loops: Sequence[Loop] = ()) -> Program | None:
    """The program of a call in loops without bodies; None where it draws nothing or parts without volume.

    Arguments are rounded, and left out where they equal their defaults.
    """
    rounded: dict[str, float] = {}
    for name, default in pattern.defaults.items():
        # Halves of even hundredths are hundredths, to which the text is rounded.
        rounded[name] = to_float32(2 * round(arguments[name] / 2, CELLS) + 0.0)
        if isinstance(default, float) and abs(arguments[name] - default) <= EXACT:
            rounded[name] = default
    given = tuple((name, number) for name, number in rounded.items() if number != pattern.defaults[name])
    try:
        drawn = Program(tuple(nest((*loops, *chain)) for chain in Program(pattern.drawn(rounded)).chains))
    except ShapeProgError:  # a number out of the range of its parameter
        return None
    solid = all(
        number >= least(quantity)
        for node in drawn.walk()
        for number, quantity in zip(node.values, language()[node.name].quantities, strict=True)
    )
    call = within(loops, Call(pattern.function.name, given))
    return replace(drawn, source=Source((pattern.function, call))) if drawn.body and solid else None
