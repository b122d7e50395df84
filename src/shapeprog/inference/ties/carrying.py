"""Free numbers chosen so that parts stay together when one of them changes.

To measure one free number from another leaves the shape as it is, and changes what follows from the other: with
``apron_drop = seat_drop + 0.96`` the apron goes where the seat goes.  These are elementary column operations, as in the
reduction of a lattice basis.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from shapeprog.geometry.separation import gaps, touching
from shapeprog.inference.ties.boxes import boxes_of
from shapeprog.inference.ties.expressions import Solution
from shapeprog.inference.ties.model import Model
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Part
from shapeprog.space import Array, FloatArray


def carried(solution: Solution, model: Model, numbers: FloatArray) -> Solution:
    """The same numbers as expressions of other free ones, so that fewer parts are separated when a shared one changes.

    Parameters
    ----------
    solution
        Free numbers, and how all numbers follow from them.
    model, numbers
        The program, and where its numbers are (P,).
    """
    contacts, slots = _Contacts(model, numbers), model.slots
    factors, values = solution.factors.copy(), solution.values(numbers)
    for z, k in enumerate(solution.free):
        alone = np.count_nonzero(factors[k]) == 1  # not measured from another one
        if slots[k].kind in ("extent", "angle") or (factors[:, z] != 0).sum() < 2 or not alone:
            continue
        cost, lost = contacts.cost(factors[:, z], values[z])
        for _ in range(TIES.operations if cost else 0):
            best = None
            for y, way in product(_carriable(factors, model, lost, z), (1.0, -1.0)):
                less, separated = contacts.cost(factors[:, z] + way * factors[:, y], values[z], cost)
                if less < cost:
                    best, cost, lost = (y, way), less, separated
            if best is None:
                break
            y, way = best
            factors[:, z] += way * factors[:, y]
            values[y] -= way * values[z]
    return replace(solution, factors=factors)


def _carriable(factors: FloatArray, model: Model, lost: set[int], z: int) -> list[int]:
    """Free numbers that alone move one of these lines along an axis along which another free number moves parts."""
    layout, slots = model.anchored.layout, model.slots
    lines = {around for line in lost for around in (line, *layout.loops_around[line])}
    axes = {slots[p].axis for p in np.flatnonzero(factors[:, z])}
    result = set()
    for p, slot in enumerate(slots):
        used = np.flatnonzero(factors[p])
        if slot.line in lines and slot.axis in axes and slot.axis >= 0 and len(used) == 1 and used[0] != z:
            rows = factors[factors[:, used[0]] != 0]
            if (rows == rows[0]).all():
                result.add(int(used[0]))
    return sorted(result)


class _Contacts:
    """Which parts of a program touch, and how many of them come apart when its numbers change."""

    def __init__(self, model: Model, numbers: FloatArray) -> None:
        self.model, self.numbers = model, numbers
        scene = model.scene(numbers)
        parts = np.array([k for k, line in enumerate(model.anchored.layout.lines) if isinstance(line, Part)])
        self.line = parts[scene.block.numpy()]
        self.first, self.second = touching(boxes_of(scene), TIES.touch)
        self.pieces = self._pieces(np.ones(len(self.first), bool))

    def cost(self, along: FloatArray, value: float, least: float = np.inf) -> tuple[float, set[int]]:
        """How many pieces more there are when a number of this value changes, and how many primitives without length,
        counted up to the least so far; and the lines that lose contacts or length."""
        total, lost = 0.0, np.zeros(len(self.line), bool)
        for factor in TIES.changes:
            if total < least:
                scene = self.model.scene(self.numbers + (factor - 1) * value * along)
                invalid = (scene.bounds <= 0).any(1).numpy()
                kept = gaps(boxes_of(scene), self.first, self.second) < TIES.touch
                total += self._pieces(kept) - self.pieces + invalid.sum()
                lost |= invalid
                lost[self.first[~kept]] = lost[self.second[~kept]] = True
        return total, {*self.line[lost].tolist()}

    def _pieces(self, kept: Array) -> int:
        """The number of pieces that these contacts leave."""
        count, pairs = len(self.line), (self.first[kept], self.second[kept])
        return int(connected_components(coo_array((np.ones(len(pairs[0])), pairs), (count, count)), directed=False)[0])
