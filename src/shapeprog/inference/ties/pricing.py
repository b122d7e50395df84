"""Selection of relations: those whose price in fit is below that of the number they save.

Near its optimum the misfit of a program is quadratic.  With H its curvature and p the numbers, imposing c p = 0 costs
(c p)^2 / (c H^-1 c'), so thousands of relations are priced without a refit; the cheapest is imposed, H^-1 and p follow
by one elimination, and so on.  Parts that meet along two axes would touch along an edge alone, so a relation by which
they would is not imposed.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.ties.relations import Relation
from shapeprog.library.independence import beside
from shapeprog.space import FloatArray

HOLDS = 1e-6
"""Deviation up to which a relation holds."""


def worthwhile(
    candidates: list[Relation],
    numbers: FloatArray,
    curvature: FloatArray,
    price: float,
    *,
    fixed: FloatArray,
    low: FloatArray,
    far: FloatArray | float = np.inf,
) -> tuple[FloatArray, FloatArray]:
    """The selected relations (M, V), those that are fixed first; and the optimum (V,) where they hold.

    Parameters
    ----------
    numbers, curvature
        The optimum (V,), and half the curvature (V, V) of the misfit there.
    price
        Price of a number, in the unit of the misfit.
    fixed
        Relations (M, V) that hold in any case.
    low
        Lower bounds of the numbers (V,), which no relation may violate.
    far
        Farthest that relations together may move a number (V,): the quadratic model is valid near the optimum alone.
    """
    rows: FloatArray = np.array([*fixed, *(relation.row for relation in candidates)]).reshape(-1, len(numbers))
    if not len(rows):
        return fixed, numbers
    imposed, free, low, start = [*fixed], np.linalg.inv(curvature), np.minimum(low, numbers), numbers
    axes: FloatArray = np.linalg.qr(fixed.T)[0].T
    meeting = [(k, *pair) for k, relation in enumerate(candidates, len(fixed)) for pair in relation.meetings]
    edges = 0
    spread, off = np.einsum("kv,vw,kw->k", rows, free, rows, optimize=True), rows @ numbers
    benefit = price * np.array([np.inf] * len(fixed) + [relation.trust for relation in candidates])
    # Below this share of its freedom a relation holds already: for numbers that nothing determines, rounding alone
    # leaves more, so independence is tested on the rows themselves.
    minimum = 1e-9 * spread
    while True:
        gain = np.where(spread > minimum, benefit - off**2 / np.maximum(spread, minimum), -np.inf)
        best = int(np.argmax(gain))
        if gain[best] <= 0:
            return np.array(imposed).reshape(-1, len(numbers)), numbers
        along = free @ rows[best]
        moved = numbers - along * off[best] / spread[best]
        across = rows @ along
        off_then, spread_then = off - across * off[best] / spread[best], spread - across**2 / spread[best]
        edges_then = _edges(meeting, (spread_then <= minimum) & (np.abs(off_then) < HOLDS))
        if best >= len(fixed):
            new = beside(rows[best], axes)
            if new is None or (moved < low).any() or (np.abs(moved - start) > far).any() or edges_then > edges:
                spread[best] = 0.0
                continue
            imposed.append(rows[best])
            axes = np.vstack([axes, new])
        free = free - np.outer(along, along) / spread[best]
        numbers, off, spread, edges = moved, off_then, spread_then, edges_then
        spread[best] = 0.0


def _edges(meetings: list[tuple[int, int, int, int]], holds: npt.NDArray[np.bool_]) -> int:
    """How many pairs of lines meet along more than one axis, by relations that hold."""
    axes: dict[tuple[int, int], set[int]] = {}
    for index, first, second, axis in meetings:
        if holds[index]:
            axes.setdefault((first, second), set()).add(axis)
    return sum(len(along) > 1 for along in axes.values())
