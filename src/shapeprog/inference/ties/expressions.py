"""The numbers of a program as expressions of few free ones.

The numbers that follow from others are chosen greedily.  Which stay free is improved by pivoting, as in the simplex
method, until no exchange of a free number for another makes the text shorter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shapeprog.inference.fit.tunable import DEGREES
from shapeprog.inference.ties.layout import Slot
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.parameters import to_float32
from shapeprog.library.independence import independent
from shapeprog.space import FloatArray

ELIMINATED = {"clearance": 0, "offset": 0, "edge": 1, "radius": 2, "size": 3, "length": 3, "angle": 3, "extent": 9}
"""Which kinds of numbers rather follow from others: small ones first."""

NOTHING = 1e-7
"""Factors up to this are zero."""


@dataclass(frozen=True)
class Solution:
    """Free numbers, and how all numbers follow from them.

    Parameters
    ----------
    factors
        Of every number (P,) by how much it follows from each free one (P, Z).
    free
        Which numbers are free (Z,).
    """

    factors: FloatArray
    free: list[int]

    def values(self, numbers: FloatArray) -> FloatArray:
        """The free numbers (Z,) that give these numbers (P,)."""
        values, *_ = np.linalg.lstsq(self.factors, numbers)
        return np.asarray(values, np.float64)

    def rounded(self, slots: list[Slot], numbers: FloatArray, decimals: int) -> FloatArray:
        """The free numbers (Z,) that give these numbers (P,), with so many decimals, angles with one."""
        pairs = zip(self.free, self.values(numbers).tolist(), strict=True)
        digits = ((DEGREES if slots[k].kind == "angle" else decimals, value) for k, value in pairs)
        return np.array([to_float32(round(value, count)) for count, value in digits])


def solved(slots: list[Slot], rows: FloatArray) -> Solution:
    """The free numbers for which the text is short.

    Parameters
    ----------
    slots
        The numbers (P,).
    rows
        Relations (M, P): independent rows whose products with the numbers are zero.
    """

    def order(k: int) -> tuple[int, bool, int, int]:
        slot = slots[k]
        return ELIMINATED[slot.kind], not slot.word.startswith(("last", "end", "through")), -slot.line, -k

    dependent = independent(rows.T, sorted(range(len(slots)), key=order))
    free = sorted({*range(len(slots))} - {*dependent}, key=order)
    factors = np.zeros((len(slots), len(free)))
    factors[free, np.arange(len(free))] = 1
    factors[dependent] = -np.linalg.solve(rows[:, dependent], rows[:, free])
    return _shortened(slots, factors, free)


def _shortened(slots: list[Slot], factors: FloatArray, free: list[int]) -> Solution:
    """Exchange free numbers for others while the text gets shorter."""
    sizes = np.array([slot.kind in ("size", "radius") for slot in slots])
    while True:
        factors = np.where(np.abs(factors) < NOTHING, 0.0, factors)
        best, exchange = _cost(factors, sizes), None
        single = np.abs(np.abs(factors) - 1) < NOTHING
        for p, z in np.argwhere(single & ((factors != 0).sum(1) > 1)[:, None]).tolist():
            column = factors[:, z] / factors[p, z]
            new = factors - np.outer(column, factors[p])
            new[:, z] = column
            if slots[free[z]].kind != "extent" and (cost := _cost(new, sizes)) < best - NOTHING:
                best, exchange = cost, (new, p, z)
        if exchange is None:
            return Solution(factors, free)
        factors, p, z = exchange
        free = [*free[:z], p, *free[z + 1 :]]


def _cost(factors: FloatArray, sizes: np.ndarray) -> float:
    """Number of operators of all different sums, and the cost of their repetitions."""
    used, negative = np.abs(factors) > NOTHING, factors < -NOTHING
    operators = np.maximum(used.sum(1) - 1, 0) + (used & (np.abs(np.abs(factors) - 1) > NOTHING)).sum(1)
    operators = operators + 0.5 * negative.sum(1) + TIES.negative * (sizes & negative.any(1))  # sums rather
    composite = np.flatnonzero(operators)
    _, first = np.unique(factors[composite].round(6), axis=0, return_index=True)
    return float(operators[composite[first]].sum() + TIES.repeated * (len(composite) - len(first)))
