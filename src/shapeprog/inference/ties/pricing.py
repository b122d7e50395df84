"""Which relations are worth having: those whose price in fit is below that of the number they save.

Near its optimum the misfit of a program is quadratic.  With H its curvature and p the numbers, imposing c p = 0 costs
(c p)^2 / (c H^-1 c'), so thousands of relations are priced without a refit; the cheapest is imposed, H^-1 and p follow
by one elimination, and so on.
"""

from __future__ import annotations

import numpy as np

from shapeprog.inference.ties.relations import Relation
from shapeprog.space import FloatArray

HELD = 1e-9
"""Share of its freedom below which a relation holds already, or contradicts what does."""


def worthwhile(
    candidates: list[Relation], numbers: FloatArray, curvature: FloatArray, price: float, fixed: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Relations (M, V) that are worth having, those that are fixed first; and where the numbers move to (V,).

    Parameters
    ----------
    numbers, curvature
        The optimum (V,), and half the curvature (V, V) of the misfit there.
    price
        What a number is worth, in the unit of the misfit.
    fixed
        Relations (M, V) that hold in any case.
    """
    free, moved = np.linalg.inv(curvature), numbers.copy()
    kept = [row for row in fixed]
    for row in kept:
        free, moved = _imposed(free, moved, row)
    if not candidates:
        return np.array(kept).reshape(-1, len(numbers)), moved
    rows = np.stack([each.row for each in candidates])
    worth = price * np.array([each.trust for each in candidates])
    first = np.einsum("kv,vw,kw->k", rows, np.linalg.inv(curvature), rows)
    while True:
        spread = np.einsum("kv,kv->k", rows @ free, rows)
        off = rows @ moved
        open_ = spread > HELD * first
        cost = np.where(open_, off**2 / np.where(open_, spread, 1.0), np.inf)
        gain = worth - cost
        best = int(np.argmax(gain))
        if gain[best] <= 0:
            return np.array(kept).reshape(-1, len(numbers)), moved
        kept.append(rows[best])
        free, moved = _imposed(free, moved, rows[best])


def _imposed(free: FloatArray, numbers: FloatArray, row: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Freedom and optimum once a relation holds."""
    along = free @ row
    spread = float(row @ along)
    if spread <= 0:
        return free, numbers
    return free - np.outer(along, along) / spread, numbers - along * float(row @ numbers) / spread
