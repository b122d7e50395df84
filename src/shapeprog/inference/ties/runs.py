"""Runs of copies at equal steps, written by how many there are: with one more of them, all share the same span.

The step of n copies between two limits is what lies between these, divided by n - 1; by n or n + 1 where there is a gap
of the same length on one side or both.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import torch

from shapeprog.inference.ties.features import WHOLE, axis_of
from shapeprog.inference.ties.sums import SAME, Flags, cost_of_terms, nearest_quarter
from shapeprog.inference.tunable import Tunable
from shapeprog.language.program import Draw, Loop, Program
from shapeprog.language.statement import language
from shapeprog.space import FloatArray

FEWEST = 3
"""Copies that make a run; two are a pair."""


class Run(NamedTuple):
    """A loop that shifts its copies along one axis, all by the same step.

    Parameters
    ----------
    node, slot
        The number of its node, and which of its numbers says how many copies there are.
    copies
        How many there are.
    step
        Which number of the program the step is.
    starts
        The numbers that say where the first copy is along the axis; none where loops inside of it change what they say.
    """

    node: int
    slot: int
    copies: int
    step: int
    starts: tuple[int, ...]


def runs(tunable: Tunable, ways: FloatArray) -> Iterator[Run]:
    """The runs of a program; ``ways`` (V, Z) are those in which its numbers may move: steps tied to zero do not."""
    free = np.abs(ways).max(1, initial=0) > SAME
    for n, node in enumerate(tunable.nodes):
        if not isinstance(node, Loop) or node.count < FEWEST or not _even(node):
            continue
        steps = [
            f for f, (owner, _) in enumerate(tunable.moving) if owner == n and tunable.kinds[f] == "shift" and free[f]
        ]
        if len(steps) != 1:
            continue
        inside = range(n + 1, n + 1 + Program(node.body).statements)
        plain = all(isinstance(tunable.nodes[inner], Draw) for inner in inside)
        axis = axis_of(node, tunable.moving[steps[0]][1])
        starts = tuple(
            f
            for f, (owner, slot) in enumerate(tunable.moving)
            if owner in inside and tunable.kinds[f] == "position" and axis_of(tunable.nodes[owner], slot) == axis
        )
        slot = [quantity.kind for quantity in language()[node.name].quantities].index("count")
        yield Run(n, slot, node.count, steps[0], starts if plain and axis >= 0 else ())


def _even(node: Loop) -> bool:
    """Whether copy i is shifted by i steps, and nothing else happens to it."""
    declared = language()[node.name]
    copies = torch.arange(node.count, dtype=torch.float64)
    values = torch.tensor([node.values], dtype=torch.float64).expand(node.count, -1)
    assert declared.move is not None
    motion = declared.move(copies, torch.zeros(node.count, dtype=torch.bool), **declared.split(values))
    if motion.turn is not None or motion.signs is not None or motion.shift is None:
        return False
    return bool((motion.shift - copies[:, None] * motion.shift[1]).abs().max() < WHOLE)


class Shares(NamedTuple):
    """How a run is written: its step is a sum divided by ``copies + more``, and ``before`` steps lie before its first
    copy."""

    more: int
    before: int


WAYS = (Shares(-1, 0), Shares(0, 0), Shares(0, 1), Shares(1, 1))
"""From the first copy to the last; with a gap behind them; before them; and with both."""


def shares(run: Run, factors: FloatArray, steps: Flags) -> Shares | None:
    """How a run is written by its count, the simplest way; ``None`` where its step is a number of its own.

    Parameters
    ----------
    factors
        Of every number of the program, by how much it follows from each measure (V, Z).
    steps
        Which measures are steps (Z,).
    """
    step, starts = factors[run.step], factors[list(run.starts)]
    if (np.abs(step[steps]) > SAME).any():
        return None

    def cost(way: Shares) -> float:
        divided, placed = (run.copies + way.more) * step, starts - way.before * step
        whole = np.vstack([divided, placed]) if way.before else divided
        if np.abs(whole - nearest_quarter(whole)).max() > SAME:
            return np.inf
        return float(cost_of_terms(divided).sum() + cost_of_terms(placed).sum())

    possible = [way for way in WAYS if run.starts or not way.before]
    best = min(possible, key=cost)
    return best if np.isfinite(cost(best)) else None


def plural(word: str) -> str:
    """Several of a part: ``shelf`` and ``shelves``."""
    if word.endswith("foot"):
        return f"{word[:-4]}feet"
    if word.endswith("f"):
        return f"{word[:-1]}ves"
    if word.endswith(("s", "x", "ch", "sh")):
        return f"{word}es"
    if word.endswith("y") and word[-2:-1] not in "aeiou":
        return f"{word[:-1]}ies"
    return f"{word}s"
