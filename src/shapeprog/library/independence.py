"""Linear independence of rows of factors."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from shapeprog.space import FloatArray

DEPENDENT = 1e-6  # relative residual below which a row is a combination of others: rounding errors are of this size


def beside(row: FloatArray, axes: FloatArray) -> FloatArray | None:
    """The direction (V,) of a row orthogonal to orthonormal axes (M, V); ``None`` if the row is in their span."""
    residual = row - axes.T @ (axes @ row)
    residual = residual - axes.T @ (axes @ residual)
    size = float(np.linalg.norm(residual))
    return residual / size if size > DEPENDENT * float(np.linalg.norm(row)) else None


def independent(rows: FloatArray, order: Iterable[int] | None = None) -> list[int]:
    """The indices of rows (M, V) that are independent of those before them in an order, by default that of the rows.

    The choice is greedy, so their number is the rank of the rows.
    """
    accepted: list[int] = []
    axes: FloatArray = np.zeros((0, rows.shape[1]))
    for index in range(len(rows)) if order is None else order:
        if (new := beside(rows[index], axes)) is not None:
            accepted.append(index)
            axes = np.vstack([axes, new])
    return accepted
