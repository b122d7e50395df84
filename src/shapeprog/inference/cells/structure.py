"""Structure search: voxels to blocks of whole numbers that maximise IoU minus price x statements.

Blocks are first added one by one, each the repeated box with the largest gain on uncovered cells.  Then rounds of ruin
and recreate remove some and insert others, including discs and sheared backs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shapeprog.inference.budget import NEVER, Deadline, Progress
from shapeprog.inference.cells.block_layout import WIDTH
from shapeprog.inference.cells.blocks import to_program
from shapeprog.inference.cells.drawing import draw_all
from shapeprog.inference.cells.editing import Target, best_box, iou, polish, value_of
from shapeprog.inference.cells.ruin import Pool, rebuild
from shapeprog.inference.cells.settings import Settings
from shapeprog.language.program import Program
from shapeprog.space import FloatArray


@dataclass(frozen=True)
class Structure:
    """Blocks (K, 16), their IoU, and why the search stopped."""

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
    target = Target.of(voxels, settings)
    rough = greedy_starts(target)
    starts = [polish(blocks, target, 1, 3) for blocks in rough]
    best = max(starts, key=lambda blocks: value_of(blocks, target))
    best_value = value_of(best, target)
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
        pool = Pool.of(earlier[-settings.kept :], target)
        blocks, value = rebuild(best, target, pool, rounds, heat, np.random.default_rng((seed, done)))
        done += rounds
        if value > best_value:
            earlier.append(blocks)
            gained = done
        if value >= best_value:
            best, best_value = blocks, value
        if progress:
            progress("searching structure", done / settings.rounds)
    polished = polish(best, target, 3, 5)
    return Structure(polished, iou(polished, target), reason)


def greedy_starts(target: Target) -> list[FloatArray]:
    """For each weight of an empty cell, the repeated boxes with the largest gains, one after another."""
    everything = np.arange(len(target.table))
    starts = []
    for waste in target.settings.starts:
        blocks: FloatArray = np.zeros((0, WIDTH))
        while len(blocks) < target.settings.blocks:
            gain, block = best_box(draw_all(blocks), float(np.float32(waste)), everything, target)
            if gain <= 0:
                break
            blocks = np.concatenate([blocks, block[None]])
        starts.append(blocks)
    return starts


def greedy_boxes(voxels: npt.NDArray[np.bool_], boxes: int = 10) -> Program:
    """At most ``boxes`` boxes, each with the largest count of newly covered occupied minus empty cells.

    No learning, no loops, no search beyond the exact maximum-sum box: a baseline for programs of equal size.
    """
    target = Target.of(voxels, Settings(blocks=boxes, price=0.0, starts=(1.0,)))
    return to_program(greedy_starts(replace(target, table=target.table[:1]))[0])
