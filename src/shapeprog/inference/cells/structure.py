"""Structure search: voxels to blocks of whole numbers that maximise IoU minus price x statements.

Blocks are first added one by one, each the repeated box with the largest gain on uncovered cells.  Then rounds of ruin
and recreate remove some and insert others, including discs, sheared backs, bars, stars and crosses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.cells import pack, words_of
from shapeprog.inference.budget import NEVER, Deadline, Progress
from shapeprog.inference.cells.block_layout import WIDTH
from shapeprog.inference.cells.families import families
from shapeprog.space import FloatArray

if TYPE_CHECKING:
    from shapeprog.inference.cells.editing import Target

PLANES = 3
"""Mirror planes nearest the middle that may pair a second loop with a first."""

MOST_COPIES = 8
"""Largest number of copies of one loop that the search proposes; descent may add more."""

KEPT = 12
"""Number of latest programs whose blocks the search may reuse."""

STARTS = (0.9, 2.0, 5.0)
"""Weights of an empty cell against an occupied one, from which greedy starts are made; the best start is kept.

A light weight finds solid bodies, a heavy one the boards of a shelf that a single filled box would swallow."""


@dataclass(frozen=True)
class Settings:
    """Limits and prices of the structure search; chosen on val.

    Parameters
    ----------
    blocks
        Largest number of blocks.
    price
        Price of a statement in IoU.
    rounds
        Largest number of rounds of ruin and recreate.
    chunk
        Rounds with the same heat, between two checks of the deadline.
    families
        Number of random ways of repeating a box that one proposal tries.
    forms
        Share of proposals that also try a form other than a box.
    heat
        Largest loss of the objective that a first round may accept; it cools linearly.
    recall
        Share of proposals that use a block of earlier programs of the search, if one gains, instead of a new search.
    patience
        Rounds without a gain after which the search stops.
    """

    blocks: int = 10
    price: float = 0.001
    rounds: int = 400
    chunk: int = 20
    families: int = 200
    forms: float = 0.3
    heat: float = 0.004
    recall: float = 0.5
    patience: int = 120


@dataclass(frozen=True)
class Structure:
    """Blocks (K, 20), their IoU, and why the search stopped."""

    blocks: FloatArray
    iou: float
    reason: str


def search_structure(
    voxels: npt.NDArray[np.bool_],
    settings: Settings,
    *,
    seed: int = 0,
    deadline: Deadline = NEVER,
    progress: Progress | None = None,
) -> Structure:
    """Blocks for a solid of cells (32, 32, 32); the same for the same seed unless the deadline cuts it short.

    Parameters
    ----------
    deadline
        When no further round starts.
    progress
        Called with the name of the current step and the completed share of it.
    """
    from shapeprog.inference.cells import editing, ruin

    cells = np.argwhere(voxels)
    low, high = cells.min(0), cells.max(0) + 1
    table = families((high - low).tolist(), PLANES, MOST_COPIES)
    target = editing.Target(words_of(pack(voxels)).reshape(-1), low, high, table, settings.price, len(cells))
    rough = greedy_starts(target, settings.blocks)
    starts = [editing.polish(blocks, target, 1, 3) for blocks in rough]
    best = max(starts, key=lambda blocks: editing.value_of(blocks, target))
    best_value = editing.value_of(best, target)
    earlier = [*rough, *starts]
    done, gained, reason = 0, 0, f"all {settings.rounds} rounds"
    while done < settings.rounds:
        if done - gained >= settings.patience:
            reason = f"{done - gained} rounds without improvement"
            break
        if deadline.passed(f"the search after {done} of {settings.rounds} rounds"):
            reason = f"{done} of {settings.rounds} rounds, at the time limit"
            break
        rounds = min(settings.chunk, settings.rounds - done)
        heat = settings.heat * (1 - done / settings.rounds)
        pool = ruin.Pool.of(earlier[-KEPT:], target)
        plan = ruin.Plan(
            settings.blocks, min(settings.families, len(table)), settings.forms, heat, settings.recall, pool
        )
        blocks, value = ruin.rebuild(best, target, plan, rounds, seed + done)
        done += rounds
        if value > best_value:
            earlier.append(blocks)
            gained = done
        if value >= best_value:
            best, best_value = blocks, value
        if progress:
            progress("searching structure", done / settings.rounds)
    polished = editing.polish(best, target, 3, 5)
    return Structure(polished, editing.iou(polished, target), reason)


def greedy_starts(target: Target, max_blocks: int) -> list[FloatArray]:
    """For each weight of an empty cell, the repeated boxes with the largest gains, one after another."""
    from shapeprog.inference.cells.drawing import draw_all
    from shapeprog.inference.cells.editing import best_box

    everything = np.arange(len(target.table))
    starts = []
    for waste in STARTS:
        blocks: FloatArray = np.zeros((0, WIDTH))
        while len(blocks) < max_blocks:
            gain, block = best_box(draw_all(blocks), float(np.float32(waste)), everything, target)
            if gain <= 0:
                break
            blocks = np.concatenate([blocks, block[None]])
        starts.append(blocks)
    return starts
