"""Which rows of factors are independent of each other."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from shapeprog.space import FloatArray

DEPENDENT = 1e-6  # share of its length below which a row is a combination of others: rounding alone leaves that much


def beside(row: FloatArray, axes: FloatArray) -> FloatArray | None:
    """The direction (V,) of what orthonormal axes (M, V) leave of a row; none if they leave nothing."""
    residual = row - axes.T @ (axes @ row)
    residual = residual - axes.T @ (axes @ residual)
    size = float(np.linalg.norm(residual))
    return residual / size if size > DEPENDENT * float(np.linalg.norm(row)) else None


def independent(rows: FloatArray, order: Iterable[int] | None = None) -> list[int]:
    """The places of rows (M, V) that are independent of those before them, in an order; in their own if none is given.

    Each that can be kept is, so as many are as the rows have dimensions.
    """
    accepted: list[int] = []
    axes: FloatArray = np.zeros((0, rows.shape[1]))
    for index in range(len(rows)) if order is None else order:
        if (new := beside(rows[index], axes)) is not None:
            accepted.append(index)
            axes = np.vstack([axes, new])
    return accepted
