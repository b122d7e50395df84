"""The few measures that all numbers of a program follow from, chosen so that what follows reads simply.

Relations leave a space of numbers that is free.  Any independent measures of as many span it; of these the ones are
chosen, by exchange of one for another, from which every number is the shortest sum.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from shapeprog.inference.ties.features import Feature
from shapeprog.inference.ties.following import Following
from shapeprog.inference.ties.sums import SAME, Flags, cost_of_terms, nearest_quarter
from shapeprog.library.independence import independent
from shapeprog.space import DEPTH, SIDE, UP, Array, FloatArray

FLOOR = 0.4
"""What half the height below the middle costs, which has a short name of its own."""

SENSITIVE, DIFFERENCE = 3.0, 3.0
"""A length that is the difference of numbers so many times as large is lost when one of them is changed; what each such
number costs."""

PLACED = 2.0
"""Price of a name from which it measures a place."""

LOST = 40.0
"""What it costs that a change of a measure by a fifth parts all that touches."""

TRIED = 32
"""Exchanges, the most readable, of which it is seen at once what they part."""

AT_ONCE = 1 << 22
"""Factors that are looked at together."""

OFFSET = 3.0
"""Cells between sides of parts that touch, at most, that may be a measure."""

Word = Literal["extent", "top", "bottom", "inset", "length", "radius", "shift", "angle", "side", "place", "offset"]

NAMED: dict[Word, float] = {
    "extent": -25.0, "length": 0.8, "radius": 0.8, "top": 0.9, "bottom": 1.2, "inset": 1.2, "shift": 1.0,
    "angle": 1.0, "side": 9.0, "place": 8.0, "offset": 1.5,
}  # fmt: skip
"""What a name costs its reader by what it measures, and by how much the extents of the whole are preferred.  A number
that is used once needs no name; but a place, measured from the middle, stays behind when the whole is changed."""


@dataclass(frozen=True)
class Measure:
    """A quantity that a name can denote: its word, axis and node, its linear factors, and the origin of an offset."""

    word: Word
    feature: Feature
    row: FloatArray
    origin: int = -1


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


def measures(known: list[Feature], numbers: FloatArray, touching: set[tuple[int, int]]) -> Iterator[Measure]:
    """What names may stand for; heights are above the floor, insets from the nearest side of the whole, and offsets
    between sides of parts that touch."""
    whole = {each.axis: each.row for each in known if each.kind == "extent"}
    for each in known:
        if each.kind in ("extent", "length", "radius", "shift", "angle", "place"):
            yield Measure(each.kind, each, each.row)
        if each.kind in ("low", "high"):
            yield Measure("side", each, each.row)
        if each.axis == UP and each.kind in ("low", "high", "place"):
            yield Measure("bottom" if each.kind == "low" else "top", each, each.row + whole[UP] / 2)
        if each.axis in (DEPTH, SIDE) and each.kind in ("low", "high", "place"):
            nearest = 1 if each.at(numbers) < 0 else -1
            yield Measure("inset", each, whole[each.axis] / 2 + nearest * each.row)
    sides = [each for each in known if each.kind in ("low", "high", "place")]
    for one, two in combinations(sides, 2):
        pair = (min(one.node, two.node), max(one.node, two.node))
        if one.axis == two.axis and pair in touching:
            far = two.at(numbers) - one.at(numbers)
            if 0 < abs(far) <= OFFSET:
                yield Measure("offset", two, np.sign(far) * (two.row - one.row), one.node)


def simplest(
    known: list[Feature],
    numbers: FloatArray,
    ways: FloatArray,
    lengths: Flags,
    touching: set[tuple[int, int]],
    following: Following | None,
) -> Basis:
    """The measures from which every number of the program is the simplest sum.

    Parameters
    ----------
    numbers
        The numbers and extents (V,), for which the relations hold.
    ways
        A basis (V, Z) of the numbers for which they hold.
    lengths
        Which numbers are lengths (V,).
    touching
        Pairs of nodes, the smaller first, whose parts touch.
    following
        Tells what changes of measures part.
    """
    every = list(measures(known, numbers, touching))
    seen = np.stack([each.row for each in every]) @ ways
    groups = _together(seen, every)
    heads = [every[group[0]] for group in groups]
    seen = seen[[group[0] for group in groups]]
    reader = _Reader(heads, numbers, lengths, following)
    chosen: Array = np.array(independent(seen, np.argsort(reader.prices, kind="stable").tolist()), np.int64)
    factors = ways @ np.linalg.inv(seen[chosen])
    total = float((reader.reading(factors[None], chosen[None]) + reader.parting(factors[None], chosen[None]))[0])
    while (better := reader.exchanged(seen, factors, chosen, total)) is not None:
        chosen, total = better
        factors = ways @ np.linalg.inv(seen[chosen])
    near = nearest_quarter(factors)
    factors = np.where(np.abs(factors - near) < SAME, near, factors)
    return Basis([[every[k] for k in groups[c]] for c in chosen.tolist()], factors, reader.values[chosen])


class _Reader:
    """What it costs to read a program whose numbers are sums of some measures."""

    def __init__(
        self,
        heads: list[Measure],
        numbers: FloatArray,
        lengths: Flags,
        following: Following | None,
    ) -> None:
        self.following = following
        self.prices = np.array([NAMED[each.word] for each in heads])
        self.values: FloatArray = np.array([each.row @ numbers for each in heads])
        count = len(numbers) - 3
        self.small: FloatArray = np.where(lengths[:count], SENSITIVE * np.abs(numbers[:count]), np.inf)
        heights = (h for h, each in enumerate(heads) if each.word == "extent" and each.feature.axis == UP)
        self.height = next(heights, -1)

    def exchanged(
        self, seen: FloatArray, factors: FloatArray, chosen: Array, total: float
    ) -> tuple[Array, float] | None:
        """The measures (Z,) with one exchanged for another, which makes the cost least, and that cost; none if it falls
        by nothing.

        Parameters
        ----------
        seen
            All measures by the ways that are free (M, Z).
        factors, chosen, total
            The sums (V, Z) as they are, of which measures, and what they cost.
        """
        inner = seen @ np.linalg.inv(seen[chosen])  # every measure by those chosen
        inner[chosen] = 0
        new, place = np.nonzero(np.abs(inner) > SAME)
        best, found = total - 1e-9, None
        for some in np.array_split(np.arange(len(new)), 1 + len(new) * factors.size // AT_ONCE):
            k, z = new[some], place[some]
            rows = np.arange(len(some))
            change = inner[k]
            change[rows, z] -= 1
            changed = factors - factors.T[z][:, :, None] * (change / inner[k, z][:, None])[:, None]
            others = np.tile(chosen, (len(some), 1))
            others[rows, z] = k
            costs = self.reading(changed, others)
            order = np.argsort(costs, kind="stable")
            for first in range(0, len(order), TRIED):
                cheap = order[first : first + TRIED]
                cheap = cheap[costs[cheap] < best]  # what parts nothing costs as much at least
                if not len(cheap):
                    break
                whole = costs[cheap] + self.parting(changed[cheap], others[cheap])
                least = int(whole.argmin())
                if whole[least] < best:
                    best = float(whole[least])
                    found = others[cheap[least]], best
        return found

    def reading(self, factors: FloatArray, chosen: Array) -> FloatArray:
        """What sums (C, V, Z) of some measures (C, Z) cost a reader, and the names of these (C,)."""
        factors = factors[:, : len(self.small)]
        prices = self.prices[chosen]
        size = np.abs(factors)
        used = size > SAME
        terms = cost_of_terms(factors)
        floor = (chosen == self.height)[:, None] & (np.abs(factors + 0.5) < SAME)
        terms[floor] = FLOOR
        terms += DIFFERENCE * (size * np.abs(self.values[chosen])[:, None] > self.small[:, None])
        literal = (used.sum(1) == 1) & (size.sum(1) < 1 + SAME) & (prices < PLACED)
        found: FloatArray = terms.sum((1, 2)) + np.where(~literal & used.any(1), prices, 0).sum(1)
        return found

    def parting(self, factors: FloatArray, chosen: Array) -> FloatArray:
        """What it costs (C,) that changes of some measures (C, Z), from which numbers (C, V, Z) follow, part what
        touches."""
        if self.following is None:
            return np.zeros(len(chosen))
        return LOST * self.following.lost(factors[:, : len(self.small)], self.values[chosen])


def _together(seen: FloatArray, every: list[Measure]) -> list[list[int]]:
    """Measures that always agree, the one with the cheapest word first; those that are always zero are left out."""

    def order(k: int) -> tuple[float, int]:
        return NAMED[every[k].word], -every[k].feature.axis  # a square seat has a width

    groups: dict[bytes, list[int]] = {}
    for k, row in enumerate(seen):
        if np.abs(row).max(initial=0) > SAME:
            groups.setdefault((np.round(row, 6) + 0.0).tobytes(), []).append(k)
    return [sorted(group, key=order) for group in groups.values()]
