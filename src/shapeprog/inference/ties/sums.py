"""What sums of named numbers cost their reader, by the factors of their terms."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.space import FloatArray

Flags = npt.NDArray[np.bool_]

SAME = 1e-6
"""Difference below which factors are the same."""

FACTORS = {1.0: 1.0, 0.5: 1.2, 2.0: 1.3, 1 / 3: 1.5, 0.25: 2.0, 1.5: 2.0, 3.0: 2.0, 4.0: 2.0}
"""What a term of a sum costs a reader by its factor; others cost ``UGLY``."""

UGLY = 4.0

PARTS = 12
"""All of these factors are whole numbers of such parts."""

COSTS: FloatArray = np.full(1 + round(max(FACTORS) * PARTS), UGLY)
"""What a term costs by its factor in these parts; none at all is not written."""
COSTS[0] = 0.0
for factor, price in FACTORS.items():
    COSTS[round(factor * PARTS)] = price


def nearest_quarter(factors: FloatArray) -> FloatArray:
    """The quarters of whole numbers that are nearest to factors."""
    return np.round(factors * 4) / 4


def cost_of_terms(factors: FloatArray) -> FloatArray:
    """What the terms of sums cost a reader, by their factors."""
    size = np.abs(factors)
    near = np.round(size * PARTS)
    known = (np.abs(size - near / PARTS) < SAME) & (near < len(COSTS))
    found: FloatArray = np.where(known, COSTS[np.where(known, near, 0).astype(np.int64)], UGLY)
    return found
