"""Rounds of ruin and recreate (Schrimpf et al. 2000) on blocks of whole numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeprog.inference.cells.block_layout import WIDTH
from shapeprog.inference.cells.chance_kernels import below, shuffle, start, uniform
from shapeprog.inference.cells.descent_kernels import GAIN, statements
from shapeprog.inference.cells.drawing import Rows, cells_shared, draw_all, draw_each, places
from shapeprog.inference.cells.editing import Target, best_box, improve_block, polish, propose_form, value_of
from shapeprog.space import FloatArray

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


def _single(value: float) -> float:
    """A number rounded to single precision, as the weights are kept."""
    return float(np.float32(value))
