"""Structure from the surface: a program of few blocks that explains what is seen of a target.

Pieces of the target become candidates, those that are copies of each other loops; what explains most for the fewest
numbers is chosen, its numbers are adjusted together, and its parts are named by what they are for.  All of it works on
program objects and knows no statement by name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from shapeprog.data.shape import Shape
from shapeprog.inference.adjustment import adjust
from shapeprog.inference.budget import NEVER, Deadline
from shapeprog.inference.candidates import distinct, looks, plain, single_candidates
from shapeprog.inference.choice import Choice, choose
from shapeprog.inference.coverage import Prices, covers
from shapeprog.inference.evidence import Evidence, evidence_of
from shapeprog.inference.pieces import find_pieces
from shapeprog.inference.repeating import repeated
from shapeprog.inference.roles import with_roles
from shapeprog.language.program import Node, Program
from shapeprog.language.text import numbers_written

MOST_CANDIDATES = 1_500
"""Most candidates that are compared; loops come first, then the most important pieces."""


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
    evidence
        What the blocks were to explain.
    """

    program: Program
    explained: float
    reason: str
    trade_off: tuple[TradeOff, ...]
    evidence: Evidence


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
        return Assembly(Program(), 0.0, "there is no surface to speak of.", (), evidence)
    cost = prices or Prices()
    cost = replace(cost, **{name: getattr(cost, name) / detail for name in ("statement", "loop", "number")})
    choice = choose(covers([Program((node,)) for node in candidates], evidence, cost, seed), blocks, seed=seed)
    chosen = [Program(tuple(candidates[place] for place in option.chosen)) for option in choice.options]
    seen = tuple(
        TradeOff(len(program.body), sum(numbers_written(node) for node in program.walk()), option.explained)
        for program, option in zip(chosen, choice.options, strict=True)
    )
    program = Program(tuple(candidates[place] for place in choice.best.chosen))
    told(1.0)
    program = with_roles(adjust(program, evidence, seed=seed, deadline=deadline, progress=progress))
    return Assembly(program, choice.best.explained, _reason(choice, seen, blocks), seen, evidence)


def _reason(choice: Choice, seen: Sequence[TradeOff], allowed: int) -> str:
    used, share = len(choice.best.chosen), choice.best.explained
    told = f"{used} block{'s' if used != 1 else ''} explain{'s' if used == 1 else ''} {share:.0%} of the surface"
    if used >= allowed:
        return f"{told} and every one of the {allowed} blocks is in use; allow more with --blocks."
    now = next(each for each in seen if each.blocks == used)
    more = next((each for each in seen if each.blocks == used + 1), None)
    if more is None or more.explained - share < LEAST_GAIN:
        return f"{told}, and no other block that was seen would explain more."
    gain, cost = more.explained - share, max(more.numbers - now.numbers, 0)
    return f"{told}; one more would explain {gain:.1%} for {cost} more numbers: raise --detail to have it."
