"""Structure from the surface: a program of few blocks that explains what is seen of a target.

Pieces of the target become candidates, those that are copies of each other loops; what explains most for the fewest
numbers is chosen, then once more among its neighbours.  Its numbers are adjusted together, parts that float are
connected, and all are named by what they are for.  All of it works on program objects and knows no statement by name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.data.shape import Shape
from shapeprog.inference.budget import NEVER, Deadline, Progress
from shapeprog.inference.candidates.calls import (
    Called,
    Part,
    drawn,
    moved,
    named,
    placed,
    program_of,
    regrouped,
    relations,
)
from shapeprog.inference.candidates.candidates import (
    as_unhinted,
    at_the_far_side,
    distinct,
    looks,
    plain,
    single_candidates,
)
from shapeprog.inference.candidates.images import images
from shapeprog.inference.candidates.neighbours import neighbours
from shapeprog.inference.candidates.recognition import proposed
from shapeprog.inference.candidates.repeating import repeated
from shapeprog.inference.choice.cell_coverage import choose_on_cells, cost_on_cells, covers_of_cells
from shapeprog.inference.choice.choice import Choice, choose, explained, missed, value
from shapeprog.inference.choice.connecting import connected
from shapeprog.inference.choice.coverage import Covers, Prices, covers
from shapeprog.inference.fit.adjustment import adjust, tidy
from shapeprog.inference.pieces.pieces import find_pieces
from shapeprog.inference.roles.roles import in_order
from shapeprog.inference.surface.evidence import Evidence, evidence_of
from shapeprog.language.free import numbers_outside
from shapeprog.language.program import Node, Program
from shapeprog.library.matching import Pattern

Flags = npt.NDArray[np.bool_]

MOST_CANDIDATES = 1_500
"""Most candidates that are compared; loops come first, then the most important pieces."""

ROUNDS = 1
"""Most rounds in which neighbours of what is chosen compete with it."""

ROUGH = 8
"""Steps of adjustment before such a round."""

HARM = 0.005
"""Share of the target beyond which a block is put back to where it was before its adjustment."""

REST = 200
"""Most of the candidates passed over that compete again: those that would add most."""


class TradeOff(NamedTuple):
    """The best program of so many blocks that was seen: numbers written, and share of the surface explained."""

    blocks: int
    numbers: int
    explained: float


LEAST_GAIN = 0.0005
"""Share of the surface that is worth telling."""


@dataclass(frozen=True)
class Assembly:
    """A program and what it was chosen from.

    Parameters
    ----------
    program
        The blocks chosen.
    explained
        Share of the visible surface that they explain, or of the cells of what is known by these alone.
    reason
        Why there are no more of them.
    trade_off
        The best of every number of blocks.
    evidence
        What the blocks were to explain.
    """

    program: Program
    explained: float
    reason: str
    trade_off: tuple[TradeOff, ...]
    evidence: Evidence = field(compare=False, repr=False)


def assemble(
    shape: Shape,
    *,
    blocks: int = 10,
    more: Sequence[Node] = (),
    functions: Sequence[Pattern] = (),
    prices: Prices | None = None,
    detail: float = 1.0,
    seed: int = 0,
    deadline: Deadline = NEVER,
    progress: Progress | None = None,
) -> Assembly:
    """A program of at most ``blocks`` blocks for a shape; the same for the same seed.

    Parameters
    ----------
    blocks
        Most blocks of the program.
    more
        Blocks from elsewhere that compete with those found here.
    functions
        Functions whose calls compete with blocks; each call counts as one.
    prices, detail
        What counts against a program; the prices of what is written are divided by ``detail``.
    deadline, progress
        As for :func:`shapeprog.inference.infer`.
    """

    def told(share: float) -> None:
        if progress:
            progress("finding structure", share)

    evidence = evidence_of(shape, seed)
    told(0.1)
    pieces = find_pieces(shape, seed)
    singles = single_candidates(pieces, seed)
    singles = [singles[place] for place in distinct(singles, looks(singles))] if singles else []
    told(0.5)
    elsewhere = [plain(node) for node in more]
    loops = [*repeated(singles), *images(singles, pieces.cloud.points)]
    loops = [loops[place] for place in distinct(loops, looks(loops))] if loops else []
    found = [*elsewhere, *singles[: MOST_CANDIDATES // 2], *loops][:MOST_CANDIDATES]
    several = [function for function in functions if function.blocks > 1]
    candidates = [*found, *proposed(several, [*found[len(elsewhere) :], *elsewhere], deadline)]
    told(0.7)
    if not candidates or evidence.area <= 0:
        return Assembly(Program(), 0.0, "there is no surface to speak of.", (), evidence)
    cost = prices or Prices()
    cost = replace(cost, **{name: getattr(cost, name) / detail for name in ("statement", "loop", "number")})
    told(1.0)
    if shape.points is None:
        return _of_cells(candidates, shape.voxels, evidence, cost, blocks, seed, deadline, progress)
    return _of_surface(candidates, functions, evidence, cost, blocks, seed, deadline, progress)


def _of_surface(
    candidates: Sequence[Part],
    functions: Sequence[Pattern],
    evidence: Evidence,
    prices: Prices,
    blocks: int,
    seed: int,
    deadline: Deadline,
    progress: Progress | None,
) -> Assembly:
    """What explains most points of a surface, chosen among neighbours too, adjusted, connected and named."""
    choice, candidates = _improved(candidates, functions, evidence, prices, blocks, seed, deadline)
    start = _connected(_chosen(candidates, choice.best.chosen), evidence, prices, seed)
    adjusted = _adjusted(start, evidence, seed=seed, deadline=deadline, progress=progress)
    unharmed = _unharmed(adjusted, start, evidence, prices, seed)
    parts = _connected(unharmed, evidence, prices, seed)
    program = in_order(named(parts, tidy(Program(tuple(at_the_far_side(plain(node)) for node in drawn(parts).body)))))
    seen = _seen(choice, candidates)
    share = explained(_covers(program.body, evidence, prices, seed), tuple(range(len(program.body))))
    reason = _reason(len(parts), share, seen, blocks, "surface")
    return Assembly(program, share, reason, seen, evidence)


def _of_cells(
    candidates: Sequence[Part],
    voxels: Flags,
    evidence: Evidence,
    prices: Prices,
    blocks: int,
    seed: int,
    deadline: Deadline,
    progress: Progress | None,
) -> Assembly:
    """What explains most cells, adjusted where that does not fit them worse: a surface is anywhere within its cells."""
    offered = [program_of(part) for part in candidates]
    choice = choose_on_cells(covers_of_cells(offered, voxels, evidence, prices), blocks, seed=seed)
    start = _chosen(candidates, choice.best.chosen)
    adjusted = _adjusted(start, evidence, seed=seed, deadline=deadline, progress=progress)
    found = [drawn(adjusted), tidy(drawn(start))]
    program = in_order(named(start, min(found, key=lambda each: cost_on_cells(each, voxels))))
    seen = _seen(choice, candidates)
    reason = _reason(len(start), choice.best.explained, seen, blocks, "cells")
    return Assembly(program, choice.best.explained, reason, seen, evidence)


def _improved(
    candidates: Sequence[Part],
    functions: Sequence[Pattern],
    evidence: Evidence,
    prices: Prices,
    blocks: int,
    seed: int,
    deadline: Deadline,
) -> tuple[Choice, Sequence[Part]]:
    """What is chosen, and from which candidates: also from neighbours of what was chosen before, while that pays."""
    made = _covers(candidates, evidence, prices, seed)
    choice = choose(made, blocks, seed=seed)
    for _ in range(ROUNDS):
        parts = _chosen(candidates, choice.best.chosen)
        if not parts or deadline.passed("another choice among neighbours"):
            break
        rest = [candidates[place] for place in missed(made, choice.best.chosen)[:REST]]
        adjusted = _adjusted(parts, evidence, steps=ROUGH, seed=seed, deadline=deadline)
        nodes = [*drawn(parts).body, *drawn(adjusted).body, *neighbours(drawn(adjusted))]
        near = list(dict.fromkeys([*parts, *adjusted, *nodes, *rest]))  # the parts first: the search goes on from them
        near += proposed(functions, [part for part in near if not isinstance(part, Called)], deadline)
        more = _covers(near, evidence, prices, seed)
        better = choose(more, blocks, start=range(len(parts)), seed=seed)
        if better.best.value <= choice.best.value + LEAST_GAIN:
            break
        made, choice, candidates = more, better, near
    return choice, candidates


def _adjusted(parts: Sequence[Part], evidence: Evidence, **options: Any) -> list[Part]:
    """The parts as they fit the evidence together; what a call draws moves as its function lets it."""
    program, calls = drawn(parts), placed(parts)
    held = relations(program, calls) if calls else None
    return moved(parts, adjust(program, evidence, relations=held, **options))


def _connected(parts: Sequence[Part], evidence: Evidence, prices: Prices, seed: int) -> list[Part]:
    """The parts with single blocks that float extended to others."""
    return regrouped(parts, connected(drawn(parts), evidence, prices, seed, _fixed(parts)))


def _fixed(parts: Sequence[Part]) -> set[Node]:
    """Nodes that stay as they are: what calls draw."""
    return {node for part in parts if isinstance(part, Called) for node in part.nodes}


def _unharmed(
    adjusted: Sequence[Part], start: Sequence[Part], evidence: Evidence, prices: Prices, seed: int
) -> list[Part]:
    """The adjusted parts, those where adjustment has clearly done harm as they were at the start, and those that a
    statement without a hint draws better as it does.

    Calls that no longer pay are left out: what one drew may be drawn by another since all have moved.
    """
    count = len(start)
    free = [(place, part) for place, part in enumerate(adjusted) if not isinstance(part, Called)]
    again = [(free[k][0], node) for k, node in as_unhinted([part for _, part in free], seed)]
    both = (*adjusted, *start, *(node for _, node in again))
    ways = [*((place, HARM) for place in range(count)), *((place, 0.0) for place, _ in again)]
    made = _covers(both, evidence, prices, seed)
    kept = tuple(range(count))
    for new, (place, least) in enumerate(ways, start=count):
        other = (*kept[:place], new, *kept[place + 1 :])
        if value(made, other) > value(made, kept) + least:
            kept = other
    for place in [place for place in kept if isinstance(both[place], Called)]:
        other = tuple(each for each in kept if each != place)
        if value(made, other) > value(made, kept):
            kept = other
    return _chosen(both, kept)


def _covers(parts: Sequence[Part], evidence: Evidence, prices: Prices, seed: int) -> Covers:
    return covers([program_of(part) for part in parts], evidence, prices, seed)


def _chosen(candidates: Sequence[Part], places: Sequence[int]) -> list[Part]:
    return [candidates[place] for place in places]


def _seen(choice: Choice, candidates: Sequence[Part]) -> tuple[TradeOff, ...]:
    """The best of every number of blocks, as it was chosen."""
    chosen = [(_chosen(candidates, option.chosen), option.explained) for option in choice.options]
    return tuple(
        TradeOff(len(parts), sum(numbers_outside(program_of(part)) for part in parts), share) for parts, share in chosen
    )


def _reason(used: int, share: float, seen: Sequence[TradeOff], allowed: int, of: str) -> str:
    told = f"{used} drawing statement{'s cover' if used != 1 else ' covers'} {share:.0%} of the {of}"
    if used >= allowed:
        return f"{told}; this is the maximum, raise --blocks for more."
    now = next((each for each in seen if each.blocks == used), None)
    more = next((each for each in seen if each.blocks == used + 1), None)
    if now is None or more is None or more.explained - share < LEAST_GAIN:
        return f"{told}; no other candidate would cover more."
    gain, cost = more.explained - share, max(more.numbers - now.numbers, 0)
    return f"{told}; one more would cover another {gain:.1%} with {cost} more numbers: raise --detail to add it."
