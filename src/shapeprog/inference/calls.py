"""Calls of library functions among the blocks of a program.

For fixed counts, the numbers of the blocks that a function draws are linear in its measures.  So blocks of the right
kinds give the measures by least squares, and the largest residual decides whether they may be a call.  They move to
where the call draws them if the program loses little value, as a call costs less than the blocks that it replaces.
"""

from __future__ import annotations

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
from shapeprog.library.blocks import Block, forms_of
from shapeprog.library.matching import EXACT, Form, Pattern
from shapeprog.library.rewriting import within
from shapeprog.library.store import Library
from shapeprog.space import FloatArray

LOOSE = 0.6  # largest difference in cells between a number of a block and that of the call which replaces it
LOSS = 0.02
"""Largest loss of value by a call, as a share of the target: whoever gives functions wants to see them called."""

OFFERED = 48  # largest number of calls of one function that are compared: the nearest


class Candidate(NamedTuple):
    """A call as a program, the indices of the blocks that it replaces, in its order, and the largest difference."""

    program: Program
    replaced: tuple[int, ...]
    difference: float


class Option(NamedTuple):
    """A block of a program inside of some of its loops: its index, these loops, and its form."""

    place: int
    around: tuple[Loop, ...]
    block: Block


def with_calls(program: Program, library: Library, coverage: Coverage) -> tuple[Program, frozenset[int]]:
    """A program in cells with blocks moved to where calls of functions draw them, if it loses little value and nothing
    floats: one node for each block, and the indices of those that calls draw."""
    nodes = list(program.flat().body)
    options = [
        Option(index, tuple(node for node in chain[:depth] if isinstance(node, Loop)), block)
        for index, chain in enumerate(program.chains)
        for depth in range(len(chain)) for block in forms_of(chain[depth:])
    ]  # fmt: skip
    patterns = [item for item in library.patterns if item.shortens and item.blocks > 1]
    candidates = [candidate for pattern in patterns for candidate in _candidates(pattern, options)]
    candidates.sort(key=lambda candidate: (-len(candidate.replaced), candidate.difference))
    table = coverage.table([*nodes, *(candidate.program for candidate in candidates)])
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


def _candidates(pattern: Pattern, options: Sequence[Option]) -> list[Candidate]:
    """The calls of a function that draw nearly the same as some blocks, the nearest first."""
    candidates: list[Candidate] = []
    for counts in pattern.choices(option.block.counts for option in options):
        usual = pattern.arguments | counts
        start = np.array([usual[name] for name in pattern.measures])
        for forms in pattern.forms(counts):
            for blocks in _assigned(forms, options, start):
                measures, difference = _solved(forms, blocks, start)
                arguments = usual | dict(zip(pattern.measures, measures.tolist(), strict=True))
                if (program := called(pattern, arguments, blocks[0].around)) is not None:
                    candidates.append(Candidate(program, tuple(block.place for block in blocks), difference))
    return sorted(candidates, key=lambda candidate: candidate.difference)[:OFFERED]


def _assigned(forms: Sequence[Form], options: Sequence[Option], start: FloatArray) -> list[tuple[Option, ...]]:
    """Blocks for all forms of a function, as near to those of one call as ``LOOSE``."""
    assigned: list[tuple[Option, ...]] = [()]
    for form in forms:
        kind, counts = form.block.kind, form.block.counts
        alike = [option for option in options if replace(option.block.kind, word=kind.word) == kind]
        fitting = [option for option in alike if option.block.counts == counts]
        longer = ((*blocks, option) for blocks in assigned for option in fitting)
        assigned = [blocks for blocks in longer if _solved(forms, blocks, start)[1] <= LOOSE]
    return assigned


def _solved(forms: Sequence[Form], blocks: Sequence[Option], start: FloatArray) -> tuple[FloatArray, float]:
    """The measures of a call by least squares, and the largest difference of its blocks and of the loops around them.

    Measures that the first forms do not determine keep their values of ``start``.  The difference is infinite if a
    block occurs twice or its loops are of other kinds; counts and axes of loops differ by 1, more than ``LOOSE``.
    """
    kinds = {tuple(loop.name for loop in option.around) for option in blocks}
    if len({option.place for option in blocks}) < len(blocks) or len(kinds) > 1:
        return start, np.inf
    pairs = [*zip(forms, blocks, strict=False)]
    factors = np.concatenate([form.factors for form, _ in pairs])
    away = np.concatenate([option.block.values - form.constants for form, option in pairs]) - factors @ start
    change = np.linalg.lstsq(factors, away, rcond=None)[0]
    outer = np.array([[value for loop in option.around for value in loop.values] for option in blocks])
    return start + change, float(max(np.abs(factors @ change - away).max(), np.abs(outer - outer[0]).max(initial=0)))


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
