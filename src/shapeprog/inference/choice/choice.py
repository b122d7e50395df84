"""Choosing few of many candidates: as much of the target explained as possible, for as little written as possible.

    value = share explained - unsupported surface - free space filled - price of what is written

all in shares of the target, see :class:`~shapeprog.inference.choice.coverage.Prices`.  A candidate that explains what
others explain gains nothing and costs its price; surface that lies inside another chosen one costs nothing, and
explains nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.inference.choice.bits import Bits
from shapeprog.inference.choice.choice_kernels import search
from shapeprog.inference.choice.coverage import CoverageTable
from shapeprog.space import Array, FloatArray

ROUNDS = 1000
"""Rounds of ruin and recreate."""

BLINK = 0.05
"""Probability with which a round overlooks a candidate."""

INTERIOR = (4.0, 1.0)
"""Penalties of points in interiors, in what these weigh, with which the search begins."""


class Option(NamedTuple):
    """The best set of one size that was found: indices of candidates, value, and share of the target explained."""

    chosen: tuple[int, ...]
    value: float
    explained: float


class Found(NamedTuple):
    """The best value of each number of blocks (M + 1,) that was found, and its candidates (M + 1, M)."""

    values: FloatArray
    sets: npt.NDArray[np.int64]

    @property
    def set(self) -> npt.NDArray[np.int64]:
        """The best of all; empty if there is none."""
        size = int(np.argmax(self.values))
        return self.sets[size, :size].copy()


class Choice(NamedTuple):
    """The best option, and the best of each number of blocks that was found: numbers against what is explained."""

    best: Option
    options: tuple[Option, ...]


def choose(
    table: CoverageTable, blocks: int, *, start: Sequence[int] = (), rounds: int = ROUNDS, seed: int = 0
) -> Choice:
    """The most valuable at most ``blocks`` of the candidates: greedily, then by ruin and recreate.

    A solid that holds what could be seen without it is a local optimum: greed takes it at once, and no exchange of a
    few leaves it.  So all points in interiors have a penalty at first, which falls while the search goes on from the
    best; a second search goes on from ``start``.
    """
    gains = np.bitwise_count(table.rows[:, : table.evidence]) @ table.weights[: table.evidence]
    bounds = gains - table.prices
    order = np.argsort(-bounds, kind="stable")
    order = order[bounds[order] > 0]
    words = *_words(table.rows[:, : len(table.weights)]), *_words(table.interior)
    searches = len(INTERIOR) + 2 if table.interior.any() else 1

    def searched(penalty: float, known: Array, found: Found) -> Found:
        search(
            table.rows, table.interior, table.weights, *words, table.own, table.sample_price, table.prices, penalty,
            bounds,
            order, rounds // searches, BLINK, seed, known, *found,
        )  # fmt: skip
        return found

    best = _nothing(blocks)
    if searches > 1:
        known = best.set
        for penalty in INTERIOR:
            known = searched(penalty, known, _nothing(blocks)).set
        best = searched(0.0, known, best)
    best = searched(0.0, np.array(start, np.int64), best)
    found = [
        Option(tuple(map(int, chosen[:size])), float(value), explained(table, chosen[:size]))
        for size, (value, chosen) in enumerate(zip(*best, strict=True))
        if np.isfinite(value)
    ]
    return Choice(max(found, key=lambda option: option.value), tuple(found))


def _nothing(blocks: int) -> Found:
    return Found(np.full(blocks + 1, -np.inf), np.full((blocks + 1, blocks), -1, np.int64))


def _words(rows: Bits) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The words that hold bits, row after row, and where those of each row begin."""
    row, words = np.nonzero(rows)
    return np.ascontiguousarray(words), np.searchsorted(row, np.arange(len(rows) + 1))


def explained(table: CoverageTable, chosen: Sequence[int] | Array) -> float:
    """Share of the target that some of the candidates explain together, and none has in its interior."""
    seen = _union(table.rows[:, : table.evidence], chosen) & ~_union(table.interior, chosen)
    return float(np.bitwise_count(seen) @ table.weights[: table.evidence])


def _union(rows: Bits, chosen: Sequence[int] | Array) -> Bits:
    """The bits that are set in any of the chosen rows."""
    found: Bits = np.bitwise_or.reduce(rows[list(chosen)], axis=0, initial=0)
    return found


def missed(table: CoverageTable, chosen: tuple[int, ...]) -> Array:
    """The candidates that are not chosen, those first that would explain most of what is not explained."""
    rows = table.rows[:, : table.evidence]
    done = _union(rows, chosen) | _union(table.interior, chosen)
    more = np.bitwise_count(rows & ~done) @ table.weights[: table.evidence] - table.prices
    order = np.argsort(-more, kind="stable")
    return order[~np.isin(order, chosen)]


def value(table: CoverageTable, chosen: tuple[int, ...]) -> float:
    """The value of a set of candidates, by its definition: what the kernel adds up piece by piece."""
    known, union = len(table.weights), _union(table.rows, chosen)
    union[: table.evidence] &= ~_union(table.interior, chosen)
    total = float(np.bitwise_count(union[:known]) @ table.weights)
    for one in chosen:
        total -= table.prices[one] + table.sample_price[one] * int(
            np.bitwise_count(table.own[one] & ~union[known + one])
        )
    return total
