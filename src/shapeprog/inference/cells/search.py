"""Structure search: voxels to blocks of whole numbers that maximise IoU minus price x statements.

Blocks are first added one by one, each the repeated box with the largest gain on uncovered cells.  Then rounds of ruin
and recreate (Schrimpf et al. 2000) remove some and insert others, including discs and sheared backs.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shapeprog.inference.budget import NEVER, Deadline, Progress
from shapeprog.inference.cells import block_kernels as kernels
from shapeprog.inference.cells.block_kernels import BACK, DISC, EXTENT, FIRST, FORM, GAIN, RADIUS, TILT, WIDTH, Words
from shapeprog.inference.cells.blocks import to_program
from shapeprog.inference.cells.proposal_kernels import families, propose
from shapeprog.inference.cells.settings import Settings
from shapeprog.language.program import Program
from shapeprog.space import HALF, Array, BoolArray, FloatArray


class Target:
    """Target and objective of a search."""

    def __init__(self, voxels: BoolArray, settings: Settings) -> None:
        self.settings = settings
        self.cells: Words = np.packbits(voxels, bitorder="little").view(np.uint64)  # the solid as words (512)
        occupied = np.argwhere(voxels)
        self.statement = settings.price * len(occupied)  # the price of a statement in cells
        low, high = occupied.min(0), occupied.max(0) + 1
        # The low corner of the box around the solid, in the grid frame, its slices of the grid, and the solid in it.
        self.low, self.box = low - HALF, tuple(map(slice, low, high))
        self.inside = voxels[self.box]
        self.table = families(self.inside.shape, settings.copies)  # the ways of repeating a box


def search_structure(
    voxels: BoolArray,
    settings: Settings,
    *,
    seed: int = 0,
    deadline: Deadline = NEVER,
    progress: Progress | None = None,
) -> tuple[FloatArray, str]:
    """Blocks (K, 16) for a solid of cells (32, 32, 32), and why the search stopped.

    They are the same for the same seed unless the deadline cuts the search short.
    """
    target = Target(voxels, settings)
    starts = [polish(greedy(target, waste, target.table), target) for waste in settings.starts]
    best = max(starts, key=lambda blocks: value_of(blocks, target))
    best_value = value_of(best, target)
    random = np.random.default_rng(seed)
    gained = 0
    for done in range(settings.rounds):
        if done - gained >= settings.patience:
            return best, f"{done - gained} rounds without improvement"
        if deadline.passed(f"the search after {done} of {settings.rounds} rounds"):
            return best, f"{done} of {settings.rounds} rounds, at the time limit"
        trial = rebuilt(best, target, random)
        value = value_of(trial, target)
        if value > best_value + GAIN:
            gained = done + 1
        if value >= best_value:
            best, best_value = trial, value
        if progress:
            progress("searching structure", (done + 1) / settings.rounds)
    return best, f"all {settings.rounds} rounds"


def greedy_boxes(voxels: BoolArray, boxes: int = 10) -> Program:
    """At most ``boxes`` boxes, each with the largest count of newly covered occupied minus empty cells.

    No learning, no loops, no search beyond the exact maximum-sum box: a baseline for programs of equal size.
    """
    target = Target(voxels, Settings(blocks=boxes, price=0.0))
    return to_program(greedy(target, 1.0, target.table[:1]))


def greedy(target: Target, waste: float, table: Array) -> FloatArray:
    """The repeated boxes with the largest gains, one after another, for one weight of an empty cell."""
    none = np.zeros((0, WIDTH))
    return extended(none, target.settings.blocks, lambda covered: best_box(covered, waste, table, target))


def rebuilt(blocks: FloatArray, target: Target, random: np.random.Generator) -> FloatArray:
    """Ruin and recreate: the blocks without up to three of them, and with up to one more new ones, after descent.

    Each new block is the best of some proposals on the cells that no other block covers.
    """
    settings, drops = target.settings, 1 + int(3 * random.random() ** 2)  # mostly one
    blocks = np.delete(blocks, random.permutation(len(blocks))[:drops], 0)
    count, waste = drops + 1, random.uniform(0.6, 1.1)
    if random.random() < 0.25:  # sometimes search for thin boards, and for more of them
        count, waste = count + int(random.integers(3)), random.uniform(1.0, 4.0)

    def proposed(covered: Words) -> tuple[float, FloatArray]:
        picks = random.permutation(len(target.table))[: settings.families]
        picks[0] = 0  # the single box
        best = best_box(covered, waste, target.table[picks], target)
        if best[0] > 0 and random.random() < settings.forms:
            best = max(best, best_form(covered, waste, best[1], target), key=lambda proposal: proposal[0])
        return best

    return polish(extended(blocks, min(count, settings.blocks - len(blocks)), proposed), target)


def extended(blocks: FloatArray, count: int, proposed: Callable[[Words], tuple[float, FloatArray]]) -> FloatArray:
    """Blocks and up to ``count`` more, each proposed for the cells that are covered so far, while these gain."""
    for _ in range(count):
        gain, block = proposed(kernels.draw_all(blocks))
        if gain <= 0:
            break
        blocks = np.concatenate([blocks, block[None]])
    return blocks


def value_of(blocks: FloatArray, target: Target) -> float:
    """IoU minus price x statements."""
    cells = kernels.draw_all(blocks)
    shared, union = (np.bitwise_count(words).sum() for words in (cells & target.cells, cells | target.cells))
    return float(shared / union - target.settings.price * kernels.statements(blocks.T).sum())


def improved(block: FloatArray, covered: Words, target: Target) -> FloatArray:
    """A block after descent on the value, with the other blocks fixed, which cover so many cells."""
    better = block.copy()
    kernels.descend(better, target.cells, covered, target.settings.price)
    return better


def polish(blocks: FloatArray, target: Target) -> FloatArray:
    """Blocks after descent, three times one after another; a block that no longer pays is dropped."""
    blocks, settled = blocks.copy(), np.zeros(len(blocks), np.bool_)
    for k in [*range(len(blocks))] * 3:
        if not settled[k]:
            better = improved(blocks[k], kernels.draw_all(np.delete(blocks, k, 0)), target)
            settled &= np.array_equal(better, blocks[k])
            blocks[k], settled[k] = better, True
    value = value_of(blocks, target)
    for k in reversed(range(len(blocks))):
        fewer = np.delete(blocks, k, 0)
        if (without := value_of(fewer, target)) >= value:
            blocks, value = fewer, without
    return blocks


def best_box(covered: Words, waste: float, table: Array, target: Target) -> tuple[float, FloatArray]:
    """The repeated box with the largest gain on uncovered cells, after its gain in cells; that is zero if none gains.

    An empty cell weighs ``waste``, an occupied one 1.
    """
    block, done = np.zeros(WIDTH), kernels.cells_of(covered)[target.box]
    weights = np.where(done, 0, np.where(target.inside, 1, -waste)).astype(np.float32)
    gain = propose(weights, table, target.statement, block)
    block[FIRST:EXTENT] += target.low
    return gain, block


def best_form(covered: Words, waste: float, box: FloatArray, target: Target) -> tuple[float, FloatArray]:
    """The disc or sheared back with the largest gain in place of a box, after descent, after its gain in cells.

    The disc is as wide as the box on average; the backs are sheared by up to five cells to either side.
    """

    def gains(blocks: FloatArray) -> FloatArray:
        """Gain in cells of each block (P,)."""
        new = kernels.draw_each(blocks) & ~covered
        shared, wasted = (np.bitwise_count(words).sum(1) for words in (new & target.cells, new & ~target.cells))
        return np.asarray(shared - waste * wasted - target.statement * kernels.statements(blocks.T))

    forms, across = np.repeat(box[None], 11, 0), box[EXTENT + 1 : EXTENT + 3]
    forms[0, FORM], forms[0, RADIUS], forms[0, RADIUS + 1] = DISC, max(1, np.rint(across.sum() / 4)), 0
    forms[0, FIRST + 1 : EXTENT] = np.rint(box[FIRST + 1 : EXTENT] + across / 2)
    forms[1:, FORM], forms[1:, TILT] = BACK, [-5, -4, -3, -2, -1, 1, 2, 3, 4, 5]
    better = improved(forms[gains(forms).argmax()], covered, target)
    return float(gains(better[None])[0]), better
