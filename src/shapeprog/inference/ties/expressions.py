"""The numbers of a program as expressions of few free ones.

The numbers that follow from others are chosen greedily.  Which stay free is improved by pivoting, as in the simplex
method, until no exchange of a free number for another makes the text shorter.

To measure one free number from another leaves the shape as it is, and changes what follows from the other: with
``apron_drop = seat_drop + 0.96`` the apron goes where the seat goes.  These are elementary column operations, as in the
reduction of a lattice basis.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from shapeprog.geometry.separation import gaps, touching
from shapeprog.inference.surface.components import linked
from shapeprog.inference.ties.elements import Slot, boxes_of
from shapeprog.inference.ties.layout import Layout
from shapeprog.inference.ties.settings import TIES
from shapeprog.library.independence import independent
from shapeprog.space import Array, FloatArray

ELIMINATED = {
    "clearance": 0, "offset": 0, "edge": 1, "gap": 1, "radius": 2, "size": 3, "length": 3, "angle": 3, "extent": 9
}  # fmt: skip
"""Which kinds of numbers rather follow from others: small ones first."""

DISTANCES = "clearance", "offset"  # kinds of numbers that are dropped near zero, and that may be measured from another
NOTHING = 1e-7  # factors up to this are zero


class Solution(NamedTuple):
    """Free numbers, and how all numbers follow from them."""

    factors: FloatArray  # of every number by how much it follows from each free one (P, Z)
    free: list[int]  # which numbers are free (Z,)


def solved(slots: list[Slot], rows: FloatArray) -> Solution:
    """The free ones of numbers (P,) for which the text is short, where relations (M, P) hold: the products of these
    independent rows with the numbers are zero."""

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


def _cost(factors: FloatArray, sizes: Array) -> float:
    """Number of operators of all different sums, and the cost of their repetitions."""
    used, negative = np.abs(factors) > NOTHING, factors < -NOTHING
    operators = np.maximum(used.sum(1) - 1, 0) + (used & (np.abs(np.abs(factors) - 1) > NOTHING)).sum(1)
    operators = operators + negative.sum(1) + TIES.negative * (sizes & negative.any(1))  # sums rather
    composite = np.flatnonzero(operators)
    _, first = np.unique(factors[composite].round(6), axis=0, return_index=True)
    return float(operators[composite[first]].sum() + TIES.repeated * (len(composite) - len(first)))


def carried(solution: Solution, layout: Layout, numbers: FloatArray) -> tuple[Solution, FloatArray]:
    """The numbers (P,) of a program as expressions of other free ones, so that fewer parts are separated when a shared
    one changes: at most one is measured from each; and the values of these (Z,)."""
    contacts, free = _Contacts(layout, numbers), solution.free
    factors, values = solution.factors.copy(), numbers[free]
    several = np.flatnonzero(np.count_nonzero(factors, axis=0) > 1).tolist()
    shared = [z for z in several if layout.slots[free[z]].kind not in ("extent", "angle")]
    changes = contacts.after((factors * values).T[shared])
    for n, z in enumerate(shared):
        cost, lost = changes[n]
        ways = [*product(_carriable(factors, free, layout, lost, z), (1.0, -1.0))] if cost else []
        others = contacts.after(np.array([(factors[:, z] + way * factors[:, y]) * values[z] for y, way in ways]))
        least, best = min(((more, index) for index, (more, _) in enumerate(others)), default=(cost, 0))
        if least < cost:
            y, way = ways[best]
            factors[:, z] += way * factors[:, y]
            values[y] -= way * values[z]
            changes = contacts.after((factors * values).T[shared])
    return Solution(factors, free), values


def _carriable(factors: FloatArray, free: list[int], layout: Layout, lost: set[int], z: int) -> list[int]:
    """Free distances that alone move one of these lines along an axis along which another free number moves parts."""
    slots = layout.slots
    lines = {around for line in lost for around in (line, *layout.loops_around[line])}
    axes = {slots[p].axis for p in np.flatnonzero(factors[:, z])} - {-1}
    result = set()
    for p, slot in enumerate(slots):
        used = np.flatnonzero(factors[p])
        if slot.line in lines and slot.axis in axes and len(used) == 1 and used[0] != z:
            rows = factors[factors[:, used[0]] != 0]
            if (rows == rows[0]).all() and slots[free[used[0]]].kind in DISTANCES:
                result.add(int(used[0]))
    return sorted(result)


class _Contacts:
    """Which parts of a program touch, and how many of them come apart when its numbers change."""

    def __init__(self, layout: Layout, numbers: FloatArray) -> None:
        self.layout, self.numbers = layout, numbers
        scene = layout.scene(numbers)
        self.line = np.array(layout.parts)[scene.block.numpy()]
        self.pairs = np.stack(touching(boxes_of(scene), TIES.touch), 1)
        self.pieces = self._pieces(np.ones((1, len(self.pairs)), bool))

    def after(self, parts: FloatArray) -> list[tuple[int, set[int]]]:
        """For parts (S, P) of the numbers, each of which a name multiplies: how many more pieces there are when that
        changes, and the lines that lose contacts."""
        if not len(parts):
            return []
        changes = np.multiply.outer(parts, np.subtract(TIES.changes, 1)).swapaxes(1, 2)  # (S, 2, P)
        changed = self.layout.values(self.numbers + changes.reshape(-1, changes.shape[-1]))
        # One batch of all might have more primitives than ``unroll`` takes.
        scenes = map(self.layout.tunable.scenes, changed.split(TIES.changed))
        kept = np.concatenate([gaps(boxes_of(scene), *self.pairs.T) for scene in scenes]) < TIES.touch
        more = (self._pieces(kept) - self.pieces).reshape(len(parts), -1).sum(1).tolist()
        lost = np.any(~kept.reshape(*changes.shape[:2], -1), 1)
        lines = self.line[self.pairs]
        return [(count, {*lines[of].ravel().tolist()}) for count, of in zip(more, lost, strict=True)]

    def _pieces(self, kept: Array) -> Array:
        """The numbers (S,) of pieces that contacts (S, C) leave."""
        count, (scene, pair) = len(self.line), np.nonzero(kept)
        labels = linked(count * scene[:, None] + self.pairs[pair], count * len(kept)).reshape(len(kept), count)
        return np.ptp(labels, axis=1) + 1  # those of one scene are numbered after those of another
