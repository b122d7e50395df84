"""Editing whole programs of blocks: take some out, put better ones in, keep what pays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeprog.inference.cells.block_layout import COUNT1, ROTATE, SHIFT1, WIDTH
from shapeprog.inference.cells.chance_kernels import below, shuffle, start, uniform
from shapeprog.inference.cells.descent_kernels import GAIN, MOST_MOVES, descend, statements
from shapeprog.inference.cells.drawing import Rows, Whole, cells_shared, draw_all, draw_each, places
from shapeprog.inference.cells.fold_kernels import VOLUMES
from shapeprog.inference.cells.form_kernels import guess
from shapeprog.inference.cells.proposal_kernels import propose
from shapeprog.inference.cells.raster_kernels import ROWS
from shapeprog.space import RESOLUTION, FloatArray

GUESSES = 30
"""Rough blocks of a form from which one descent starts."""

FEWEST = 4
"""Uncovered cells from which a form other than a box is tried."""


@dataclass(frozen=True)
class Target:
    """What a search works towards.

    Parameters
    ----------
    occupied
        The solid as rows of bits (1024).
    low, high
        Bounding box of its cells, in cells of the grid from 0.
    table
        The ways of repeating a box.
    price
        IoU that one statement has to earn.
    cells
        Number of occupied cells.
    """

    occupied: Rows
    low: Whole
    high: Whole
    table: Whole
    price: float
    cells: int


def value_of(blocks: FloatArray, target: Target) -> float:
    """IoU minus price x statements."""
    return iou(blocks, target) - target.price * int(statements(blocks.T).sum())


def iou(blocks: FloatArray, target: Target) -> float:
    """IoU of the cells that blocks draw with those of the target."""
    return _iou(draw_all(blocks), target)


def _iou(drawn: Rows, target: Target) -> float:
    """IoU of rows (1024) with the target."""
    inter, beyond = cells_shared(drawn[None], target.occupied, ~target.occupied)[0].tolist()
    return float(inter / (target.cells + beyond))


def improve_block(block: FloatArray, occupied: Rows, others: Rows, price: float, far: int) -> tuple[FloatArray, float]:
    """A block after descent on IoU minus price x statements, the other blocks fixed, and the value it comes to.

    Parameters
    ----------
    occupied, others
        The solid, and what the other blocks cover, as rows (1024).
    price
        IoU that one statement has to earn.
    far
        Most cells that one move goes.
    """
    better, rows, around = block.copy(), np.empty((3, ROWS), np.uint32), np.empty((MOST_MOVES, WIDTH))
    words = rows.view(np.uint64)
    value = descend(better, occupied.view(np.uint64), others.view(np.uint64), price, far, rows, words, around)
    return better, value


def polish(blocks: FloatArray, target: Target, far: int, sweeps: int) -> FloatArray:
    """Blocks after descent, one after another until nothing changes; a block that no longer pays is dropped.

    Parameters
    ----------
    far
        Most cells that one move goes.
    sweeps
        Most passes over all blocks.
    """
    blocks = blocks.copy()
    drawn = draw_each(blocks)
    settled = np.zeros(len(blocks), np.bool_)
    for _ in range(sweeps):
        changed = False
        for k in range(len(blocks)):
            if settled[k]:
                continue
            better, _value = improve_block(blocks[k], target.occupied, _union(drawn, k), target.price, far)
            settled[k] = True
            if not np.array_equal(better, blocks[k]):
                changed = True
                settled[:] = False
                settled[k] = True
                blocks[k] = better
                drawn[k] = draw_all(better[None])
        if not changed:
            break
    k, whole = 0, _iou(_union(drawn, len(drawn)), target)
    while k < len(blocks):
        without = _iou(_union(drawn, k), target)
        if without >= whole - target.price * statements(blocks[k]):
            blocks, drawn, whole = np.delete(blocks, k, 0), np.delete(drawn, k, 0), without
        else:
            k += 1
    return blocks


def _union(drawn: Rows, left_out: int) -> Rows:
    """Rows of all blocks but one."""
    before = np.bitwise_or.reduce(drawn[:left_out], axis=0)
    return np.asarray(before | np.bitwise_or.reduce(drawn[left_out + 1 :], axis=0))


def propose_form(form: int, covered: Rows, waste: float, box: FloatArray, target: Target) -> tuple[float, FloatArray]:
    """The best of several guesses of one form on what is not covered, improved by descent: its gain and the block.

    Parameters
    ----------
    form
        ``DISC``, ``BACK``, ``LINE``, ``CROSS``, or one more for a star of lines.
    waste
        Weight of an empty cell against an occupied one.
    box
        The box proposed for the same place, from which some guesses start.
    """
    price = target.price * target.cells
    gained, wasted = target.occupied & ~covered, ~target.occupied & ~covered
    cells = places(gained)
    if len(cells) < FEWEST:
        return 0.0, np.zeros(WIDTH)
    rough: FloatArray = np.empty((GUESSES, WIDTH))
    rough = rough[: guess(form, cells, box, rough)]
    if not len(rough):
        return 0.0, np.zeros(WIDTH)
    best = rough[int(_nets(rough, gained, wasted, waste).argmax())]
    block, _value = improve_block(best, target.occupied, covered, target.price, 2)
    looped = _repeated(block, gained, wasted, waste, price)
    if looped[COUNT1] > block[COUNT1]:
        block, _value = improve_block(looped, target.occupied, covered, target.price, 1)
    return float(_nets(block[None], gained, wasted, waste)[0] - price * statements(block)), block


def _nets(blocks: FloatArray, gained: Rows, wasted: Rows, waste: float) -> FloatArray:
    """Cells of ``gained`` that each block covers, minus ``waste`` times those of ``wasted``."""
    counts = cells_shared(draw_each(blocks), gained, wasted)
    return counts[:, 0] - waste * counts[:, 1]


def _loops() -> FloatArray:
    """The translation loops of two to four copies along one axis: rows of a count and a shift."""
    return np.array([
        (count, *(step * (axis == other) for other in range(3)))
        for axis in range(3) for step in range(-23, 24) if step for count in range(2, 5)
        if (count - 1) * abs(step) <= 24
    ], np.float64)  # fmt: skip


LOOPS = _loops()


def _repeated(block: FloatArray, gained: Rows, wasted: Rows, waste: float, price: float) -> FloatArray:
    """The block in its best translation loop of two to four copies along one axis, if that gains."""
    if block[COUNT1] > 1 or block[ROTATE] > 0:
        return block
    trials = np.repeat(block[None], 1 + len(LOOPS), 0)
    trials[1:, COUNT1 : SHIFT1 + 3] = LOOPS
    values = _nets(trials, gained, wasted, waste) - price * statements(trials.T)
    return trials[int(values.argmax())]


CLUSTERS = 0.25
"""Share of the rounds that take out a block together with its nearest neighbours."""

CLUSTER, MOST_DROPPED = 3, 6
"""Fewest and most blocks that such a round takes out."""

CLUSTER_FORMS = 0.7
"""Share of the proposals of such a round that also try a form other than a box."""


@dataclass(frozen=True)
class Pool:
    """Blocks of earlier programs of the search (P, 20), their cells as rows (P, 1024), and the cells each has to gain.

    On 24 chairs of ModelNet40 it is worth .006 +- .003 IoU, and it saves a quarter of the time.
    """

    blocks: FloatArray
    drawn: Rows
    prices: FloatArray

    @classmethod
    def of(cls, programs: Sequence[FloatArray], target: Target) -> Pool:
        """The blocks of all programs, each once."""
        blocks = np.unique(np.concatenate(programs), axis=0)
        return cls(blocks, draw_each(blocks), target.price * target.cells * statements(blocks.T))

    def best(self, covered: Rows, waste: float, target: Target) -> tuple[float, FloatArray]:
        """The block that gains most on what is not covered, and its gain in cells; zero when none gains."""
        if not len(self.blocks):
            return 0.0, np.zeros(WIDTH)
        counts = cells_shared(self.drawn, target.occupied & ~covered, ~target.occupied & ~covered)
        gains = counts[:, 0] - waste * counts[:, 1] - self.prices
        return max(float(gains.max()), 0.0), self.blocks[int(gains.argmax())]


@dataclass(frozen=True)
class Plan:
    """How rounds of ruin and recreate go about it.

    Parameters
    ----------
    most
        Most blocks.
    families
        Ways of repeating a box that one proposal tries, drawn at random.
    forms
        Share of proposals that also try a form other than a box.
    heat
        Largest loss of the objective that the first round may accept; it cools linearly.
    recall
        Share of proposals that are taken from the pool where one of its blocks gains, instead of sought anew.
    pool
        Blocks of earlier programs.
    """

    most: int
    families: int
    forms: float
    heat: float
    recall: float = 0.0
    pool: Pool | None = None


def rebuild(blocks: FloatArray, target: Target, plan: Plan, rounds: int, seed: int) -> tuple[FloatArray, float]:
    """Ruin and recreate: drop some blocks, propose others on what is left uncovered, keep the result if it pays.

    Returns
    -------
    blocks, value
        The best that the rounds met, which may be those they began with.
    """
    start(seed)
    here, here_value = blocks, value_of(blocks, target)
    best, best_value = here, here_value
    for turn in range(rounds):
        if len(here) >= CLUSTER and uniform() < CLUSTERS:
            trial = recreate(*ruin_cluster(here), target, replace(plan, forms=CLUSTER_FORMS))
        else:
            trial = recreate(*ruin(here, plan), target, plan)
        trial = polish(trial, target, 1, 3)
        value = value_of(trial, target)
        if value > here_value - plan.heat * (1 - turn / rounds) * uniform():
            here, here_value = trial, value
            if value > best_value + GAIN:
                best, best_value = trial, value
    return best, best_value


def ruin(blocks: FloatArray, plan: Plan) -> tuple[FloatArray, int]:
    """The blocks without up to three of them, mostly one, and how many to put in at most: as many and one more."""
    drops = 0
    if len(blocks):
        chance = uniform()
        drops = min(len(blocks), 1 + int(chance * chance * 3))
        if len(blocks) < plan.most and uniform() < 0.3:
            drops -= 1
    for _ in range(drops):
        blocks = np.delete(blocks, below(len(blocks)), 0)
    return blocks, drops + 1


def ruin_cluster(blocks: FloatArray) -> tuple[FloatArray, int]:
    """The blocks without one and its nearest neighbours, and how many to put in: stairs of boxes become one slope."""
    centres = np.stack([_centre(block) for block in blocks])
    around = np.linalg.norm(centres - centres[below(len(blocks))], axis=1)
    drops = CLUSTER + below(min(len(blocks), MOST_DROPPED) - CLUSTER + 1)
    return np.delete(blocks, np.argsort(around, kind="stable")[:drops], 0), drops


def _centre(block: FloatArray) -> FloatArray:
    """Mean position of the cells of a block."""
    cells = places(draw_all(block[None]))
    return cells.mean(0) if len(cells) else np.zeros(3)


def recreate(blocks: FloatArray, wanted: int, target: Target, plan: Plan) -> FloatArray:
    """The blocks and up to ``wanted`` new ones, each the best found for what is uncovered and improved by descent."""
    waste = _single(0.6 + 0.5 * uniform())
    if uniform() < 0.25:  # sometimes look for thin boards, and for more of them
        waste = _single(1.0 + 3.0 * uniform())
        wanted += below(3)
    for _ in range(min(wanted, plan.most - len(blocks))):
        covered, gain = draw_all(blocks), 0.0
        if plan.pool is not None and uniform() < plan.recall:
            gain, block = plan.pool.best(covered, waste, target)
        if gain <= 0:
            gain, block = _sought(covered, waste, target, plan)
        if uniform() < plan.forms:
            other_gain, other = propose_form(1 + below(5), covered, waste, block, target)
            if other_gain > gain or (other_gain > 0 and uniform() < 0.3):
                gain, block = other_gain, other
        if gain <= 0:
            break
        better, _value = improve_block(block, target.occupied, covered, target.price, 1)
        blocks = np.concatenate([blocks, better[None]])
    return blocks


def _sought(covered: Rows, waste: float, target: Target, plan: Plan) -> tuple[float, FloatArray]:
    """The repeated box that gains most among families drawn at random, the single box always among them."""
    picks = np.arange(len(target.table))
    shuffle(picks)
    picks[0] = 0
    return best_box(covered, waste, picks[: plan.families], target)


def best_box(covered: Rows, waste: float, picks: Whole, target: Target) -> tuple[float, FloatArray]:
    """The repeated box that gains most on what is not covered, and its gain in cells; zero when none gains.

    Parameters
    ----------
    waste
        Weight of an empty cell against an occupied one.
    picks
        Numbers of the families to try.
    """
    block, volumes = np.zeros(WIDTH), np.empty((VOLUMES, RESOLUTION**3), np.float32)
    gain = propose(
        target.occupied, covered, waste, target.low, target.high, target.table, picks, target.price * target.cells,
        volumes, block,
    )  # fmt: skip
    return gain, block


def _single(value: float) -> float:
    """A number rounded to single precision, as the weights are kept."""
    return float(np.float32(value))
