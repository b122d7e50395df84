"""Structure from the surface: a program of few blocks that explains what is seen of a target.

Pieces of the target become candidates, those that are copies of each other loops; what explains most for the fewest
numbers is chosen, then once more among its neighbours.  Its numbers are adjusted together, parts that float are
connected, and all are named by what they are for.  All of it works on program objects and knows no statement by name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from shapeprog.data.shape import Shape
from shapeprog.inference.adjustment import adjust, tidy
from shapeprog.inference.budget import NEVER, Deadline
from shapeprog.inference.candidates import distinct, looks, plain, single_candidates
from shapeprog.inference.choice import Choice, choose, explained, missed, value
from shapeprog.inference.connecting import connected
from shapeprog.inference.coverage import Covers, Prices, covers
from shapeprog.inference.evidence import Evidence, evidence_of
from shapeprog.inference.neighbours import neighbours
from shapeprog.inference.pieces import find_pieces
from shapeprog.inference.repeating import repeated
from shapeprog.inference.roles import with_roles
from shapeprog.language.program import Node, Program
from shapeprog.language.text import numbers_written

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
        Share of the visible surface that they explain.
    reason
        Why there are no more of them.
    trade_off
        The best of every number of blocks.
    """

    program: Program
    explained: float
    reason: str
    trade_off: tuple[TradeOff, ...]


def assemble(
    shape: Shape,
    *,
    blocks: int = 10,
    more: Sequence[Node] = (),
    prices: Prices | None = None,
    detail: float = 1.0,
    seed: int = 0,
    deadline: Deadline = NEVER,
    progress: Callable[[str, float], None] | None = None,
) -> Assembly:
    """A program of at most ``blocks`` blocks for a shape; the same for the same seed.

    Parameters
    ----------
    blocks
        Most blocks of the program.
    more
        Blocks from elsewhere that compete with those found here.
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
    singles = single_candidates(find_pieces(shape, seed))
    singles = [singles[place] for place in distinct(singles, looks(singles))] if singles else []
    told(0.5)
    elsewhere = [plain(node) for node in more]
    candidates = [*elsewhere, *singles[: MOST_CANDIDATES // 2], *repeated(singles)][:MOST_CANDIDATES]
    told(0.7)
    if not candidates or evidence.area <= 0:
        return Assembly(Program(), 0.0, "there is no surface to speak of.", ())
    cost = prices or Prices()
    cost = replace(cost, **{name: getattr(cost, name) / detail for name in ("statement", "loop", "number")})
    choice, candidates = _improved(candidates, evidence, cost, blocks, seed, deadline)
    told(1.0)
    start = connected(_chosen(candidates, choice.best.chosen), evidence, cost, seed)
    adjusted = adjust(start, evidence, seed=seed, deadline=deadline, progress=progress)
    program = connected(_unharmed(adjusted, start, evidence, cost, seed), evidence, cost, seed)
    program = with_roles(tidy(Program(tuple(plain(node) for node in program.body))))
    seen = tuple(_trade_off(_chosen(candidates, option.chosen), option.explained) for option in choice.options)
    share = explained(_covers(program.body, evidence, cost, seed), tuple(range(len(program.body))))
    return Assembly(program, share, _reason(len(program.body), share, seen, blocks), seen)


def _improved(
    candidates: list[Node], evidence: Evidence, prices: Prices, blocks: int, seed: int, deadline: Deadline
) -> tuple[Choice, list[Node]]:
    """What is chosen, and from which candidates: also from neighbours of what was chosen before, while that pays."""
    made = _covers(candidates, evidence, prices, seed)
    choice = choose(made, blocks, seed=seed)
    for _ in range(ROUNDS):
        program = _chosen(candidates, choice.best.chosen)
        if not program.body or deadline.passed("another choice among neighbours"):
            break
        rest = [candidates[place] for place in missed(made, choice.best.chosen)[:REST]]
        adjusted = adjust(program, evidence, steps=ROUGH, seed=seed, deadline=deadline)
        near = list(dict.fromkeys([*program.body, *adjusted.body, *neighbours(adjusted), *rest]))
        more = _covers(near, evidence, prices, seed)
        better = choose(more, blocks, seed=seed)
        if better.best.value <= choice.best.value + LEAST_GAIN:
            break
        made, choice, candidates = more, better, near
    return choice, candidates


def _unharmed(adjusted: Program, start: Program, evidence: Evidence, prices: Prices, seed: int) -> Program:
    """The adjusted program, with blocks as they were at the start where adjustment has clearly done harm."""
    both, count = (*adjusted.body, *start.body), len(start.body)
    made = _covers(both, evidence, prices, seed)
    kept = tuple(range(count))
    for place in range(count):
        other = (*kept[:place], count + place, *kept[place + 1 :])
        if value(made, other) > value(made, kept) + HARM:
            kept = other
    return _chosen(both, kept)


def _covers(nodes: Sequence[Node], evidence: Evidence, prices: Prices, seed: int) -> Covers:
    return covers([Program((node,)) for node in nodes], evidence, prices, seed)


def _chosen(candidates: Sequence[Node], places: Sequence[int]) -> Program:
    return Program(tuple(candidates[place] for place in places))


def _trade_off(program: Program, share: float) -> TradeOff:
    return TradeOff(len(program.body), sum(numbers_written(node) for node in program.walk()), share)


def _reason(used: int, share: float, seen: Sequence[TradeOff], allowed: int) -> str:
    told = f"{used} block{'s' if used != 1 else ''} explain{'s' if used == 1 else ''} {share:.0%} of the surface"
    if used >= allowed:
        return f"{told} and every one of the {allowed} blocks is in use; allow more with --blocks."
    now = next(each for each in seen if each.blocks == used)
    more = next((each for each in seen if each.blocks == used + 1), None)
    if more is None or more.explained - share < LEAST_GAIN:
        return f"{told}, and no other block that was seen would explain more."
    gain, cost = more.explained - share, max(more.numbers - now.numbers, 0)
    return f"{told}; one more would explain {gain:.1%} for {cost} more numbers: raise --detail to have it."
