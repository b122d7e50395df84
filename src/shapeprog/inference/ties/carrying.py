"""Free numbers chosen so that parts stay together when one of them changes.

To measure one free number from another leaves the shape as it is, and changes what follows from the other: with
``apron_drop = seat_drop + 0.96`` the apron goes where the seat goes.  These are elementary column operations, as in the
reduction of a lattice basis.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from shapeprog.geometry.separation import gaps, touching
from shapeprog.inference.ties.boxes import boxes_of
from shapeprog.inference.ties.expressions import Solution
from shapeprog.inference.ties.layout import HIGH, Slot
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
        for _ in range(TIES.operations):
            if not cost:
                break
            best = None
            for y, way in sorted(_carriable(factors, model, lost, z)):
                less, separated = contacts.cost(factors[:, z] + way * factors[:, y], values[z], cost)
                if less < cost:
                    best, cost, lost = (y, way), less, separated
            if best is None:
                break
            y, way = best
            factors[:, z] += way * factors[:, y]
            values[y] -= way * values[z]
    return replace(solution, factors=factors)


def _carriable(factors: FloatArray, model: Model, lost: set[int], z: int) -> set[tuple[int, float]]:
    """Free numbers that move one of these lines as another one does, and by which factor."""
    layout, slots = model.anchored.layout, model.slots
    result, lines = set(), {around for line in lost for around in (line, *layout.loops_around[line])}
    members = [slots[p] for p in np.flatnonzero(factors[:, z])]
    ways = {(slot.axis, way) for slot in members for way in _ways(slot)}
    for p, slot in enumerate(slots):
        used = np.flatnonzero(factors[p])
        if slot.line in lines and slot.kind in ("clearance", "offset", "size") and len(used) == 1 and used[0] != z:
            rows = factors[factors[:, used[0]] != 0]
            if len(np.unique(rows.round(6), axis=0)) == 1:
                result |= {(int(used[0]), a * b) for a in _ways(slot) for b in (1.0, -1.0) if (slot.axis, b) in ways}
    return result


def _ways(slot: Slot) -> tuple[float, ...]:
    """In which direction a number moves a part."""
    if slot.kind in ("clearance", "offset"):
        return (-1.0,) if slot.anchor == HIGH else (1.0,)
    return 1.0, -1.0


class _Contacts:
    """Which parts of a program touch, and which of them still do when its numbers change."""

    def __init__(self, model: Model, numbers: FloatArray) -> None:
        self.model, self.numbers = model, numbers
        scene = model.scene(numbers)
        count = len(scene.mask)
        parts = [k for k, line in enumerate(model.anchored.layout.lines) if isinstance(line, Part)]
        self._line = [parts[block] for block in scene.block.tolist()]
        self.first, self.second = touching(boxes_of(scene), TIES.touch)
        self.pieces = self._pieces(np.ones(len(self.first), bool), count)

    def cost(self, along: FloatArray, value: float, least: float = np.inf) -> tuple[float, set[int]]:
        """How many pieces more there are when a number of this value changes, counted up to the least so far, and the
        lines that lose contacts."""
        total, lost = 0.0, set[int]()
        for factor in TIES.changes:
            if total >= least:
                break
            scene = self.model.scene(self.numbers + (factor - 1) * value * along)
            invalid = (scene.bounds <= 0).any(1).numpy()
            kept = gaps(boxes_of(scene), self.first, self.second) < TIES.touch
            pieces = self._pieces(kept, len(invalid)) - self.pieces
            total += pieces + TIES.invalid * invalid.any()
            if pieces:
                lost |= {*self.first[~kept].tolist(), *self.second[~kept].tolist()}
            lost |= {*np.flatnonzero(invalid).tolist()}
        return total, {self._line[slot] for slot in lost}

    def _pieces(self, kept: Array, count: int) -> int:
        pairs = self.first[kept], self.second[kept]
        return int(connected_components(coo_array((np.ones(len(pairs[0])), pairs), (count, count)), directed=False)[0])
