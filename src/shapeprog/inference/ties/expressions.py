"""The numbers of a program as expressions of few free ones.

Relations are solved by Gauss-Jordan elimination, small and late numbers first: sizes stay free where clearances follow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shapeprog.inference.ties.layout import Slot
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


def solved(slots: list[Slot], rows: FloatArray) -> Solution:
    """The free numbers, and how all follow from them.

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

    columns = sorted(range(len(slots)), key=order)
    matrix, pivots = rows[:, columns].copy(), list[int]()
    for column in range(len(columns)):
        row = len(pivots)
        if row == len(matrix):
            break
        best = row + int(np.abs(matrix[row:, column]).argmax())
        if abs(matrix[best, column]) < NOTHING:
            continue
        matrix[[row, best]] = matrix[[best, row]]
        matrix[row] /= matrix[row, column]
        mask = np.arange(len(matrix)) != row
        matrix[mask] -= np.outer(matrix[mask, column], matrix[row])
        pivots.append(column)
    free_columns = [column for column in range(len(columns)) if column not in set(pivots)]
    factors = np.zeros((len(slots), len(free_columns)))
    factors[[columns[c] for c in free_columns], np.arange(len(free_columns))] = 1
    factors[[columns[c] for c in pivots]] = -matrix[: len(pivots), free_columns]
    return Solution(np.where(np.abs(factors) < NOTHING, 0.0, factors), [columns[c] for c in free_columns])
