"""Structure search: voxels to blocks of whole numbers that maximise IoU minus price x statements.

Blocks are first added one by one, each the repeated box with the largest gain on uncovered cells.  Then rounds of ruin
and recreate (Schrimpf et al. 2000) remove some and insert others, including discs and sheared backs.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.budget import NEVER, Deadline, Progress
from shapeprog.inference.cells.block_kernels import GAIN, WIDTH, draw_all
from shapeprog.inference.cells.blocks import to_program
from shapeprog.inference.cells.editing import Target, Whole, best_box, best_form, polish, value_of
from shapeprog.inference.cells.settings import Settings
from shapeprog.language.program import Program
from shapeprog.space import FloatArray


def search_structure(
    voxels: npt.NDArray[np.bool_],
    settings: Settings,
    *,
    seed: int = 0,
    deadline: Deadline = NEVER,
    progress: Progress | None = None,
) -> tuple[FloatArray, str]:
    """Blocks (K, 16) for a solid of cells (32, 32, 32), and why the search stopped.

    They are the same for the same seed unless the deadline cuts the search short.

    Parameters
    ----------
    deadline
        When no further round starts.
    progress
        Called with the name of the current step and the completed share of it.
    """
    target = Target.of(voxels, settings)
    starts = [polish(greedy(target, waste, target.table), target) for waste in settings.starts]
    best = max(starts, key=lambda blocks: value_of(blocks, target))
    best_value = value_of(best, target)
    random = np.random.default_rng(seed)
    gained, reason = 0, f"all {settings.rounds} rounds"
    for done in range(settings.rounds):
        if done - gained >= settings.patience:
            reason = f"{done - gained} rounds without improvement"
            break
        if deadline.passed(f"the search after {done} of {settings.rounds} rounds"):
            reason = f"{done} of {settings.rounds} rounds, at the time limit"
            break
        trial = rebuilt(best, target, random)
        value = value_of(trial, target)
        if value > best_value + GAIN:
            gained = done + 1
        if value >= best_value:
            best, best_value = trial, value
        if progress:
            progress("searching structure", (done + 1) / settings.rounds)
    return best, reason


def greedy_boxes(voxels: npt.NDArray[np.bool_], boxes: int = 10) -> Program:
    """At most ``boxes`` boxes, each with the largest count of newly covered occupied minus empty cells.

    No learning, no loops, no search beyond the exact maximum-sum box: a baseline for programs of equal size.
    """
    target = Target.of(voxels, Settings(blocks=boxes, price=0.0))
    return to_program(greedy(target, 1.0, target.table[:1]))


def greedy(target: Target, waste: float, table: Whole) -> FloatArray:
    """The repeated boxes with the largest gains, one after another, for one weight of an empty cell."""
    blocks: FloatArray = np.zeros((0, WIDTH))
    while len(blocks) < target.settings.blocks:
        gain, block = best_box(draw_all(blocks), waste, table, target)
        if gain <= 0:
            break
        blocks = np.concatenate([blocks, block[None]])
    return blocks


def rebuilt(blocks: FloatArray, target: Target, random: np.random.Generator) -> FloatArray:
    """Ruin and recreate: the blocks without up to three of them, and with up to one more new ones, after descent.

    Each new block is the best of some proposals on the cells that no other block covers.
    """
    settings, drops = target.settings, 1 + int(3 * random.random() ** 2)  # mostly one
    blocks = np.delete(blocks, random.permutation(len(blocks))[:drops], 0)
    count, waste = drops + 1, random.uniform(0.6, 1.1)
    if random.random() < 0.25:  # sometimes search for thin boards, and for more of them
        count, waste = count + int(random.integers(3)), random.uniform(1.0, 4.0)
    for _ in range(min(count, settings.blocks - len(blocks))):
        covered = draw_all(blocks)
        picks = random.permutation(len(target.table))[: settings.families]
        picks[0] = 0  # the single box
        gain, block = best_box(covered, waste, target.table[picks], target)
        if gain > 0 and random.random() < settings.forms:
            form_gain, form_block = best_form(covered, waste, block, target)
            if form_gain > gain:
                block = form_block
        if gain <= 0:
            break
        blocks = np.concatenate([blocks, block[None]])
    return polish(blocks, target)
