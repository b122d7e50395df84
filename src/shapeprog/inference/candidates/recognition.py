"""Recognition of calls of functions among single blocks.

For fixed counts, the numbers of the blocks of a function are linear in its measures.  Blocks of the right kinds give
the measures by least squares.  The residual decides whether the blocks belong to one call, and the measures give the
missing blocks.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shapeprog.inference.budget import NEVER, Deadline
from shapeprog.inference.candidates.calls import Called
from shapeprog.inference.candidates.drawings import solid_boxes
from shapeprog.inference.candidates.loops import rows_and_pairs
from shapeprog.inference.candidates.moments import moments_of
from shapeprog.inference.candidates.neighbours import CORNERS
from shapeprog.inference.fit.tunable import CELLS
from shapeprog.language.hints import Box
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Chain, Draw, Node, Program
from shapeprog.language.statement import language
from shapeprog.library.blocks import Kind, forms_of
from shapeprog.library.matching import Form, Pattern
from shapeprog.space import FloatArray

LOOSE = 0.6
"""Largest difference in cells between a block and the same block drawn by a function."""

MISSED = 0.3
"""Cost of a missing block, in cells of such a difference."""

FOLLOWED = 128
"""Most partial assignments of blocks to a function that are continued (beam width)."""

ALIKE = 400
"""Most blocks of one kind that are considered: the first ones."""

OFFERED, GUESSED = 48, 96
"""Most calls of one function that compete: those without missing blocks, and others."""

GUESSES = 2.0 * np.array([k for k in range(-12, 13) if k])
"""Values of a number that the blocks leave undetermined, in cells relative to its usual value."""

HIDDEN = 0.1
"""Largest protrusion in cells of a part that is hidden in another part."""

SAME = 0.05
"""Difference of arguments in cells below which two calls are the same."""


def proposed(patterns: Sequence[Pattern], nodes: Sequence[Node], deadline: Deadline = NEVER) -> list[Called]:
    """Calls of functions that draw nearly the same as some blocks, the nearest of each function first."""
    if not patterns or not nodes:
        return []
    pool = _Pool(nodes, patterns)
    calls = [call for pattern in patterns for call in _calls(pattern, pool, deadline)]
    boxes = iter(solid_boxes([node for call in calls for node in call.nodes]) if calls else ())
    solids = [[box for _ in call.nodes for box in next(boxes)] for call in calls]
    return [call for call, parts in zip(calls, solids, strict=True) if not _hides(parts)]


def _hides(parts: Sequence[Box]) -> bool:
    """Whether one of the parts of a call lies inside another, as a drawer in a case that describes a solid block."""
    corners = [part.centre + (CORNERS * part.half) @ part.rotation.T for part in parts]
    return any(
        bool((np.abs((corner - around.centre) @ around.rotation) <= around.half + HIDDEN).all())
        for first, corner in enumerate(corners)
        for second, around in enumerate(parts)
        if first != second
    )


class _Pool:
    """The numbers of blocks by kind, without role, and by counts.

    A function may draw a block by another statement than the best one for the single block, so the statements of the
    functions are applied to the boxes of all blocks.
    """

    def __init__(self, nodes: Sequence[Node], patterns: Sequence[Pattern]) -> None:
        self._rows: dict[tuple[Kind, tuple[int, ...]], dict[bytes, FloatArray]] = {}
        chains = Program(tuple(nodes)).chains
        for chain in chains:
            self._add(chain)
        hints = {name: hint for name in _pointed(patterns) if (hint := language()[name].hint) is not None}
        boxes = solid_boxes([chain[-1] for chain in chains]) if hints else []
        for chain, solids in zip(chains, boxes, strict=False):
            for name, hint in hints.items():
                if len(solids) == 1 and name != chain[-1].name:
                    for values in hint(solids[0]):
                        self._add((*chain[:-1], Draw(name, tuple(map(to_float32, values)))))
        self.counts = {counts for _, counts in self._rows}

    def _add(self, chain: Chain) -> None:
        for block in forms_of(chain):
            rows = self._rows.setdefault((replace(block.kind, word=""), block.counts), {})
            if len(rows) < ALIKE:
                rows.setdefault(np.round(block.values, CELLS).tobytes(), block.values)

    def like(self, form: Form) -> FloatArray:
        """The numbers (N, M) of the blocks with the kind of a form."""
        rows = self._rows.get((replace(form.block.kind, word=""), form.block.counts), {})
        return np.array([*rows.values()]).reshape(len(rows), len(form.constants))


def _pointed(patterns: Sequence[Pattern]) -> list[str]:
    """The statements in functions whose drawings do not follow from their bounding box."""
    forms = (form for pattern in patterns for form in pattern.forms_at(pattern.arguments))
    return sorted({form.block.kind.shape for form in forms if not form.block.kind.boxed})


def _calls(pattern: Pattern, pool: _Pool, deadline: Deadline) -> list[Called]:
    """The calls of one function that are nearest to blocks of a pool, and loops over them."""
    solutions: list[tuple[float, dict[str, float]]] = []
    for counts in pattern.choices(pool.counts):
        if deadline.passed("the search for calls of functions"):
            break
        usual = pattern.arguments | counts
        start = np.array([usual[name] for name in pattern.measures])
        for forms in pattern.forms(counts):
            offered = [pool.like(form) for form in forms]
            if pattern.counts and any(
                form.block.counts and not len(rows) for form, rows in zip(forms, offered, strict=True)
            ):
                continue  # counts follow from blocks of the pool only
            for cost, values in _nearest(forms, offered, start):
                solutions.append((cost, usual | dict(zip(pattern.measures, values, strict=True))))
    solutions.sort(key=lambda solution: solution[0])
    complete = _tidy(pattern, (numbers for cost, numbers in solutions if cost < MISSED), OFFERED)
    guessed = _tidy(pattern, (numbers for cost, numbers in solutions if cost >= MISSED), GUESSED)
    return [*complete, *_repeated(complete), *guessed]


def _tidy(pattern: Pattern, solutions: Iterable[dict[str, float]], limit: int) -> list[Called]:
    """The first calls with these numbers, without duplicates."""
    calls: list[Called] = []
    for numbers in solutions:
        call = Called.of(pattern, numbers)
        if call and not any(np.abs(np.subtract(call.numbers, existing.numbers)).max() < SAME for existing in calls):
            calls.append(call)
        if len(calls) == limit:
            break
    return calls


def _repeated(calls: Sequence[Called]) -> Iterator[Called]:
    """Loops over calls that are copies of each other: runs and mirror images."""
    stats = moments_of([call.program for call in calls]) if len(calls) > 1 else None
    for index, loop in rows_and_pairs(stats) if stats else ():
        yield replace(calls[index], around=(loop,))


class _Assignment(NamedTuple):
    """S assignments of blocks to some forms of a function: the numbers (S, M) of the blocks, and costs (S,)."""

    forms: tuple[int, ...]
    values: FloatArray
    costs: FloatArray


def _nearest(
    forms: Sequence[Form], offered: Sequence[FloatArray], start: FloatArray
) -> Iterator[tuple[float, list[float]]]:
    """The costs of assignments of offered blocks to the forms of a function, and the measures that follow from them.

    Measures that an assignment does not determine keep their values of ``start``.
    """
    ways = [_Assignment((), np.zeros((1, 0)), np.zeros(1))]
    for k, blocks in enumerate(offered):
        longer = [way._replace(costs=way.costs + MISSED) for way in ways]
        for way in ways if len(blocks) else ():
            indices = (*way.forms, k)
            old, new = np.repeat(way.values, len(blocks), 0), np.tile(blocks, (len(way.values), 1))
            values = np.hstack([old, new])
            _, off = _solved([forms[index] for index in indices], values, start)
            selected = np.flatnonzero(off <= LOOSE)
            longer.append(
                _Assignment(indices, values[selected], np.round(off[selected] + MISSED * (k - len(way.forms)), CELLS))
            )
        cheap = np.argsort(np.concatenate([way.costs for way in longer]), kind="stable")[:FOLLOWED]
        ends = np.cumsum([0, *(len(way.costs) for way in longer)])
        inside = [np.sort(cheap[(cheap >= low) & (cheap < high)]) - low for low, high in itertools.pairwise(ends)]
        ways = [
            _Assignment(way.forms, way.values[k], way.costs[k]) for way, k in zip(longer, inside, strict=True) if len(k)
        ]
    for way in ways:
        if way.forms:
            assigned = [forms[k] for k in way.forms]
            measures, _ = _solved(assigned, way.values, start)
            for cost, numbers in zip(way.costs.tolist(), measures, strict=True):
                yield from ((cost, guess.tolist()) for guess in (numbers, *(numbers + _undetermined(assigned))))


def _undetermined(forms: Sequence[Form]) -> FloatArray:
    """Changes (G, P) of the measures that forms do not determine, if these have one degree of freedom."""
    factors = np.concatenate([form.factors for form in forms])
    free = np.linalg.svd(factors)[2][np.linalg.matrix_rank(factors) :]
    return np.outer(GUESSES, free[0] / np.abs(free[0]).max()) if len(free) == 1 else np.zeros((0, factors.shape[1]))


def _solved(forms: Sequence[Form], values: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The least-squares measures (S, P), nearest to ``start``, for numbers (S, M) of blocks; largest residuals (S,)."""
    factors = np.concatenate([form.factors for form in forms])
    constants = np.concatenate([form.constants for form in forms])
    away = values - constants - factors @ start
    change = away @ np.linalg.pinv(factors).T
    return start + change, np.abs(change @ factors.T - away).max(1, initial=0)
