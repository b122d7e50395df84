"""Selection of a few candidates that explain as much of the target as possible with as little text as possible.

    value = explained + .015 near + parts drawn - unsupported surface - free space filled - price of the text

all in shares of the target, see :class:`~shapeprog.inference.choice.coverage.Prices`.  A candidate that explains only
points of others gains nothing and costs its price.  Surface inside another selected candidate costs nothing and
explains nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.arrays import over_threads
from shapeprog.inference.choice.bits import Bits
from shapeprog.inference.choice.choice_kernels import search
from shapeprog.inference.choice.coverage import CoverageTable
from shapeprog.inference.choice.settings import SETTINGS
from shapeprog.space import Array, IntArray


def choose(
    table: CoverageTable, blocks: int, *, start: Sequence[int] = (), rounds: int = SETTINGS.rounds, seed: int = 0
) -> tuple[int, ...]:
    """Indices of the most valuable at most ``blocks`` candidates: greedily, then by ruin and recreate.

    The greedy step selects a solid with visible points inside, which an exchange of a few candidates cannot leave.  So
    all points in interiors have a penalty at first, which falls.  The last of several searches starts from ``start``.
    """
    last = len(table.weights)
    gains = np.bitwise_count(table.rows[:, :last]) @ np.maximum(table.weights, 0) - table.prices
    useful = gains > 0
    useful[list(start)] = True
    index = np.flatnonzero(useful)
    hidden = table.rows[np.ix_(index, last + index)]
    data = (
        *_words(table.rows[index, :last]), *_words(table.interior[index]), table.weights, hidden,
        np.ascontiguousarray(hidden.T), table.exposed[index], table.sample_price[index],
        table.prices[index] + SETTINGS.earlier * index / len(table.prices), gains[index],
    )  # fmt: skip
    levels = (*SETTINGS.interior, 0.0) if len(data[3]) else (0.0,)
    first = np.searchsorted(index, np.array(start, np.int64))
    searches = [(levels, first[:0])] * SETTINGS.restarts + [((0.0,), first)]
    steps, count = SETTINGS.restarts * len(levels) + 1, len(searches)
    values, sets = np.zeros(count), np.zeros((count, blocks), np.int64)

    def run(begin: int, end: int) -> None:
        for number in range(begin, end):
            penalties, selected = searches[number]
            for step, penalty in enumerate(penalties, steps * seed + len(levels) * number):
                values[number] = search(*data, penalty, rounds // steps, step, selected, sets[number])
                selected = sets[number][sets[number] >= 0]

    over_threads(run, count)
    selected = sets[values.argmax()]
    return tuple(np.sort(index[selected[selected >= 0]]).tolist())


def _words(rows: Bits) -> tuple[Bits, npt.NDArray[np.uint32], IntArray]:
    """The words that hold bits, row after row, their indices, and the first of each row."""
    row, words = np.nonzero(rows)
    return rows[row, words], words.astype(np.uint32), np.searchsorted(row, np.arange(len(rows) + 1))


def explained(table: CoverageTable, indices: Sequence[int] | Array) -> float:
    """Share of the target that some of the candidates explain together, and none has in its interior."""
    visible = _union(table, indices)[: table.evidence]
    return float(np.bitwise_count(visible) @ table.weights[: table.evidence])


def _union(table: CoverageTable, indices: Sequence[int] | Array) -> Bits:
    """What the selected candidates cover together, less the points in the interior of one."""
    selected = list(indices)
    union: Bits = np.bitwise_or.reduce(table.rows[selected], axis=0, initial=0)
    union[: table.interior.shape[1]] &= ~np.bitwise_or.reduce(table.interior[selected], axis=0, initial=0)
    return union


def missed(table: CoverageTable, indices: tuple[int, ...]) -> Array:
    """The candidates that are not selected, ordered by how much of the unexplained points they would explain, less
    their prices."""
    rows = table.rows[:, : table.evidence]
    done = np.bitwise_or.reduce((rows | table.interior[:, : table.evidence])[list(indices)], axis=0, initial=0)
    gains = np.bitwise_count(rows & ~done) @ table.weights[: table.evidence] - table.prices
    order = np.argsort(-gains, kind="stable")
    return order[~np.isin(order, indices)]


def value(table: CoverageTable, indices: tuple[int, ...]) -> float:
    """The value of a set of candidates, by its definition; the kernel adds it up incrementally."""
    selected, words, union = list(indices), len(table.weights), _union(table, indices)
    samples = np.bitwise_count(table.exposed[selected] & ~union[words:][selected])
    costs = table.prices[selected] + table.sample_price[selected] * samples
    return float(np.bitwise_count(union[:words]) @ table.weights - costs.sum())
