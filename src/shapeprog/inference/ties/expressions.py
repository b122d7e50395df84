"""The numbers of a program as expressions of few free ones.

The numbers that follow from others are chosen greedily.  Which stay free is improved by pivoting, as in the simplex
method, until no exchange of a free number for another makes the text shorter.

To measure one free number from another leaves the shape as it is, and changes what follows from the other: with
``apron_drop = seat_drop + 0.96`` the apron goes where the seat goes.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from shapeprog.geometry.contacts import linked
from shapeprog.geometry.separation import gaps, touching
from shapeprog.inference.ties.elements import Slot, boxes_of
from shapeprog.inference.ties.layout import Layout
from shapeprog.inference.ties.settings import TIES
from shapeprog.library.independence import independent
from shapeprog.space import Array, FloatArray

ELIMINATED = {
    "clearance": 0, "offset": 0, "edge": 1, "gap": 1, "radius": 2, "size": 3, "length": 3, "angle": 3, "extent": 9
}  # fmt: skip
"""Which kinds of numbers rather follow from others: those of the lowest rank first."""

DISTANCES = "clearance", "offset"  # kinds of numbers that may be measured from another
NOTHING = 1e-7  # factors up to this are zero


class Solution(NamedTuple):
    """Free numbers, and how all numbers follow from them: as ``factors @ chained() @ offsets``."""

    factors: FloatArray  # coefficients (P, Z) of the free numbers in every number
    free: list[int]  # indices (Z,) of the free numbers
    measured: FloatArray  # coefficients (Z, Z), whole, of those that each free number is measured from; else zero

    def chained(self) -> FloatArray:
        """The matrix (Z, Z) from offsets, free numbers less those that they are measured from, to the free numbers."""
        return np.rint(np.linalg.inv(np.eye(len(self.free)) - self.measured)).astype(np.float64)


def solved(slots: list[Slot], rows: FloatArray) -> Solution:
    """The free ones of numbers (P,) for which the text is short, where relations (M, P) hold: the products of these
    independent rows with the numbers are zero."""

    def order(k: int) -> tuple[int, bool, int]:
        slot = slots[k]
        return ELIMINATED[slot.kind], not slot.word.startswith(("last", "end", "through")), -k

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
            return Solution(factors, free, np.zeros((len(free), len(free))))
        factors, p, z = exchange
        free = [*free[:z], p, *free[z + 1 :]]


def _cost(factors: FloatArray, sizes: Array) -> float:
    """Number of operators of all different sums, and the cost of their repetitions."""
    used, negative = np.abs(factors) > NOTHING, factors < -NOTHING
    operators = np.maximum(used.sum(1) - 1, 0) + (used & (np.abs(np.abs(factors) - 1) > NOTHING)).sum(1)
    operators = operators + negative.sum(1) + TIES.negative * (sizes & negative.any(1))  # sums rather
    composite = np.flatnonzero(operators)
    _, first = np.unique(factors[composite].round(6), axis=0, return_index=True)
    return float(operators[composite[first]].sum() + TIES.repeated * (len(composite) - len(first)))


def carried(solution: Solution, layout: Layout, numbers: FloatArray) -> tuple[Solution, FloatArray]:
    """The solution with free numbers measured from others, so that fewer parts are separated when a shared one changes;
    and the offsets (Z,), given all numbers (P,)."""
    factors, free, measured = solution
    pairs = np.stack(touching(boxes_of(layout.scene(numbers)), TIES.zero), 1)
    together = _pieces(layout, numbers, pairs, np.zeros((1, len(numbers))))
    slots = [layout.slots[k] for k in free]
    for z in sorted(np.flatnonzero(np.count_nonzero(factors, axis=0) > 1).tolist(), key=lambda z: free[z]):
        way = int(slots[z].kind not in ("extent", "angle") and not measured[z].any())
        while way:
            chained = solution.chained()
            parts, value = (factors @ chained).T, numbers[free[z]]
            if _pieces(layout, numbers, pairs, parts[[z]] * value) == together:
                break
            axes = {layout.slots[p].axis for p in np.flatnonzero(parts[z])}  # -1 for radii
            near = [y for y, slot in enumerate(slots) if slot.kind in DISTANCES and {slot.axis, -1} & axes]
            ways = [(z, 0), *product([y for y in near if not chained[z, y]], (1, -1))]
            changed = np.array([parts[z] + way * parts[y] for y, way in ways])
            y, way = ways[np.argmin(_pieces(layout, numbers, pairs, changed * value))]
            measured[y, z] += way
    return solution, numbers[free] - measured @ numbers[free]


def _pieces(layout: Layout, numbers: FloatArray, pairs: Array, parts: FloatArray) -> list[int]:
    """How many pieces the contacts of pairs of primitives (C, 2) leave of a program with these numbers (P,), in all,
    when a name is changed in two ways that multiplies such parts of them; for each of several parts (S, P)."""
    changed = numbers + np.multiply.outer(parts, np.subtract(TIES.changes, 1)).swapaxes(1, 2)  # (S, 2, P)
    # One batch of all might have more primitives than ``unroll`` takes.
    batches = layout.values(changed.reshape(-1, len(numbers))).split(TIES.changed)
    boxes = [boxes_of(layout.tunable.scenes(batch)) for batch in batches]
    scene, pair = np.nonzero(np.concatenate([gaps(each, *pairs.T) for each in boxes]) < TIES.zero)
    count, scenes = boxes[0].centre.shape[1], changed.size // len(numbers)
    labels = linked(count * scene[:, None] + pairs[pair], count * scenes).reshape(len(parts), -1)
    pieces: list[int] = (np.ptp(labels, axis=1) + 1).tolist()  # those of one scene are numbered after those of another
    return pieces
