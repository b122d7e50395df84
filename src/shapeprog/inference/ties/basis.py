"""The few measures that all numbers of a program follow from, chosen so that what follows reads simply.

Relations leave a space of numbers that is free.  Any independent measures of as many span it; of these the ones are
chosen, by exchange of one for another, from which every number is the shortest sum.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from shapeprog.inference.ties.features import Feature
from shapeprog.inference.ties.fitting import ways_free
from shapeprog.space import DEPTH, SIDE, UP, Array, FloatArray

SAME = 1e-6
"""Difference below which factors are the same."""

FACTORS = {1.0: 1.0, 0.5: 1.2, 2.0: 1.3, 0.25: 2.0, 1.5: 2.0, 3.0: 2.0, 4.0: 2.0}
"""What a term of a sum costs a reader by its factor; others cost ``UGLY``."""

UGLY = 4.0

FLOOR = 0.4
"""What half the height below the middle costs, which has a short name of its own."""

Word = Literal["extent", "top", "bottom", "inset", "length", "radius", "shift", "angle", "side", "place"]

NAMED: dict[Word, float] = {
    "extent": -1.0, "length": 0.8, "radius": 0.8, "top": 0.9, "bottom": 1.2, "inset": 1.2, "shift": 1.0, "angle": 1.0,
    "side": 1.8, "place": 2.0,
}  # fmt: skip
"""What a name costs its reader by what it measures; a number that is used once needs none."""


@dataclass(frozen=True)
class Measure:
    """What a name may stand for: a word for what is measured, along which axis and of which node, and its factors."""

    word: Word
    feature: Feature
    row: FloatArray


@dataclass(frozen=True)
class Basis:
    """Measures that all numbers follow from.

    Parameters
    ----------
    chosen
        The measures (Z), each with all others that always agree with it.
    factors
        Of every number of the program, and of the extents, by how much it follows from each (V, Z).
    values
        Where the measures are (Z,).
    """

    chosen: list[list[Measure]]
    factors: FloatArray
    values: FloatArray


def measures(known: list[Feature]) -> Iterator[Measure]:
    """What names may stand for; heights are above the floor, and insets from the sides of the whole."""
    whole = {each.axis: each.row for each in known if each.kind == "extent"}
    for each in known:
        if each.kind in ("extent", "length", "radius", "shift", "angle", "place"):
            yield Measure(each.kind, each, each.row)  # type: ignore[arg-type]
        if each.kind in ("low", "high"):
            yield Measure("side", each, each.row)
        if each.axis == UP and each.kind in ("low", "high", "place"):
            yield Measure("bottom" if each.kind == "low" else "top", each, each.row + whole[UP] / 2)
        if each.axis in (DEPTH, SIDE) and each.kind in ("low", "high"):
            sign = 1 if each.kind == "low" else -1
            yield Measure("inset", each, whole[each.axis] / 2 + sign * each.row)


def simplest(known: list[Feature], numbers: FloatArray, rows: FloatArray) -> Basis:
    """The measures from which every number of the program is the simplest sum.

    Parameters
    ----------
    numbers
        The numbers and extents (V,), for which the relations hold.
    rows
        The relations (M, V).
    """
    ways = ways_free(rows, len(numbers))
    every = list(measures(known))
    seen = np.stack([each.row for each in every]) @ ways
    groups = _together(seen, every)
    heads = np.array([group[0] for group in groups])
    prices = np.array([min(NAMED[every[k].word] for k in group) for group in groups])
    chosen = _independent(seen[heads], np.argsort(prices, kind="stable"))
    written, up = len(numbers) - 3, len(numbers) - 3 + UP
    height = next((h for h, k in enumerate(heads) if every[k].feature.row[up] and every[k].word == "extent"), -1)
    factors = ways @ np.linalg.inv(seen[heads[chosen]])
    total = _cost(factors[:written], prices[chosen], chosen.index(height) if height in chosen else -1)
    while True:
        best, swap = total - 1e-9, None
        inner = seen[heads] @ np.linalg.inv(seen[heads[chosen]])  # every measure by those chosen
        for k, row in enumerate(inner):
            if k in chosen:
                continue
            for place in np.flatnonzero(np.abs(row) > SAME):
                change = row.copy()
                change[place] -= 1
                changed = factors - np.outer(factors[:, place], change / row[place])
                others = [*chosen[:place], k, *chosen[place + 1 :]]
                cost = _cost(changed[:written], prices[others], others.index(height) if height in others else -1)
                if cost < best:
                    best, swap = cost, (int(place), k)
        if swap is None:
            break
        chosen[swap[0]] = swap[1]
        factors, total = ways @ np.linalg.inv(seen[heads[chosen]]), best
    factors[np.abs(factors) < SAME] = 0
    near = np.round(factors * 4) / 4
    factors = np.where(np.abs(factors - near) < SAME, near, factors)
    values = np.array([every[heads[k]].row @ numbers for k in chosen])
    return Basis([[every[k] for k in groups[c]] for c in chosen], factors, values)


def _together(seen: FloatArray, every: list[Measure]) -> list[list[int]]:
    """Measures that always agree, the one with the cheapest word first; those that are always zero are left out."""
    groups: dict[bytes, list[int]] = {}
    for k, row in enumerate(seen):
        if np.abs(row).max(initial=0) > SAME:
            groups.setdefault((np.round(row, 6) + 0.0).tobytes(), []).append(k)
    return [sorted(group, key=lambda k: NAMED[every[k].word]) for group in groups.values()]


def _independent(rows: FloatArray, order: Array) -> list[int]:
    """As many rows as are independent, the first in an order."""
    kept: list[int] = []
    basis = np.zeros((0, rows.shape[1]))
    for k in order.tolist():
        rest = rows[k] - basis.T @ (basis @ rows[k])
        rest = rest - basis.T @ (basis @ rest)
        if np.linalg.norm(rest) > 1e-6 * max(np.linalg.norm(rows[k]), 1e-9):
            kept.append(k)
            basis = np.vstack([basis, rest / np.linalg.norm(rest)])
    return kept


def _cost(factors: FloatArray, prices: FloatArray, height: int) -> float:
    """What it costs to read all sums, and the names in them; ``height`` is the place of the height of the whole."""
    size = np.abs(factors)
    used = size > SAME
    terms = np.where(used, UGLY, 0.0)
    for factor, price in FACTORS.items():
        terms[np.abs(size - factor) < SAME] = price
    if height >= 0:
        terms[np.abs(factors[:, height] + 0.5) < SAME, height] = FLOOR
    single = (used.sum(0) == 1) & (size.sum(0) < 1 + SAME)
    return float(terms.sum() + prices[~single & used.any(0)].sum())
