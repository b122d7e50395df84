"""Structure from the surface: a program of few blocks that explains what is seen of a target.

Pieces of the target become candidates, those that are copies of each other loops; what explains most for the fewest
numbers is chosen.  The search works on program objects: it knows no statement by name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from shapeprog.data.shape import Shape
from shapeprog.inference.budget import NEVER, Deadline
from shapeprog.inference.candidates import distinct, looks, single_candidates
from shapeprog.inference.choice import Choice, choose
from shapeprog.inference.coverage import Covers, Prices, covers
from shapeprog.inference.evidence import Evidence, evidence_of
from shapeprog.inference.pieces import find_pieces
from shapeprog.inference.repeating import repeated
from shapeprog.language.program import Node, Program

MOST_CANDIDATES = 1_500
"""Most candidates that are compared; loops come first, then the most important pieces."""


@dataclass(frozen=True)
class Assembly:
    """A program and what it was chosen from.

    Parameters
    ----------
    program
        The blocks chosen.
    evidence
        What was known of the target.
    choice
        The best sets of every number of blocks.
    """

    program: Program
    evidence: Evidence
    choice: Choice


def assemble(
    shape: Shape,
    *,
    blocks: int = 10,
    more: Sequence[Node] = (),
    prices: Prices | None = None,
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
    prices
        What counts against a program.
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
    candidates = [*more, *singles[: MOST_CANDIDATES // 2], *repeated(singles)][:MOST_CANDIDATES]
    told(0.7)
    cost = prices or Prices()
    choice, program = _chosen(candidates, evidence, cost, blocks, seed)
    told(1.0)
    return Assembly(program, evidence, choice)


def _chosen(
    candidates: Sequence[Node], evidence: Evidence, prices: Prices, blocks: int, seed: int
) -> tuple[Choice, Program]:
    pool = [Program((node,)) for node in candidates]
    covered: Covers = covers(pool, evidence, prices, seed)
    choice = choose(covered, blocks, seed=seed)
    return choice, Program(tuple(candidates[place] for place in choice.best.chosen))
