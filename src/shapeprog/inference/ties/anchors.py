"""From which side of the whole every face is measured.

A face that is measured from the low side stays where that side is when the whole is made larger, one measured from the
high side moves with that.  The anchors decide how a program follows ``width``, ``depth`` and ``height``: a part near a
side should keep its clearance, a part that spans should grow, any other should keep its size, and parts that touch
should still do so.  This is a labelling of few faces with three labels, solved for each axis alone by iterated
conditional modes (Besag 1986) from several starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from shapeprog.inference.fit.joints import Joints, depths, moved
from shapeprog.inference.ties.layout import ALIGNED, CENTRED, HIGH, LOW, MIDDLE, Anchors, Element
from shapeprog.inference.ties.model import Model
from shapeprog.language.placement import AXES
from shapeprog.space import Array, FloatArray


@dataclass(frozen=True)
class AnchorSettings:
    """Costs of anchors; chosen on validation shapes.

    Parameters
    ----------
    separated
        A pair of parts that touch and would be separated.
    pressed
        A pair that would be pressed into each other, or be separated when the whole shrinks.
    side
        A copy of a part near a side of the whole that does not move with it.
    reaching
        The same for one that reaches the side.
    resized, rigid
        A part shorter than ``spanning`` of the whole that changes its size, times how much shorter it is; and a copy of
        one that is longer and keeps it.
    middle
        An end measured from the middle, where the middle of the part is not that of the whole.
    farther, hanging
        An end measured from the farther side, times the difference of the distances as a share of the whole; and a
        height measured from the top, times the distance as a share of the whole, less a tenth.
    reach, beyond, spanning
        Shares of the whole: up to this a face reaches a side; parts wholly beyond this share of the half are near that
        side; and from this on they span.
    """

    separated: float = 5.0
    pressed: float = 0.6
    side: float = 2.0
    reaching: float = 8.0
    resized: float = 2.0
    rigid: float = 5.0
    middle: float = 0.5
    farther: float = 1.0
    hanging: float = 0.3
    reach: float = 0.02
    beyond: float = 0.3
    spanning: float = 0.6


SHIFTS = np.array([0.0, 0.5, 1.0])
"""By how much of what the whole grows an anchor moves, seen from the low side."""

TOUCH = 0.1
"""Largest gap between parts that touch, in cells."""

STEP = 0.3
"""Cells between the first and last copy of a row up to which it does not run along an axis."""

MOST = 6
"""Most choices of an element."""

ROUNDS = 8
"""Most passes over all elements."""


class Contacts(NamedTuple):
    """Pairs of primitives that touch, and how the gaps of those of which one leans follow from the elements of an axis.

    Parameters
    ----------
    first, second
        The primitives (C,).
    leaning
        Which of the pairs lean (L,).
    gaps
        The gaps of these (L,), negative where they overlap.
    slopes, base
        How these follow from the low and high coordinate of every element (L, K, 2), and from the extent (L,).
    """

    first: Array
    second: Array
    leaning: Array
    gaps: FloatArray
    slopes: FloatArray
    base: FloatArray


class AxisAnchors:
    """The anchors of all elements of one axis.

    Parameters
    ----------
    elements
        The elements (K,) of the axis.
    axis
        Which axis.
    extent
        The extent of the whole.
    ends
        Low and high ends (2, N) of all primitives, from the low side of the whole.
    slopes
        How they follow from the low and high coordinate of every element (2, N, K, 2).
    base
        How they move with the high side of the whole while all coordinates stay (2, N): mirror images do.
    contacts
        Pairs of primitives that touch.
    loops
        For every element that is the last copy of a row, the element of its first.
    settings
        The costs.
    """

    def __init__(
        self, elements: list[Element], axis: int, extent: float, ends: FloatArray, slopes: FloatArray,
        base: FloatArray, contacts: Contacts, loops: dict[int, int], settings: AnchorSettings,
    ) -> None:  # fmt: skip
        self.loops = loops
        index = {(element.line, element.key): k for k, element in enumerate(elements)}
        self.spans: list[tuple[int, int, float]] = []  # both ends of a rod, and the cost of different anchors
        for (line, key), k in index.items():
            if key in ("end", "through") and (line, "start") in index:
                start = index[line, "start"]
                length = abs(elements[k].low - elements[start].low) / extent
                self.spans.append((start, k, settings.resized * max(0.0, 1 - length / settings.spanning)))
        self.elements, self.axis, self.extent, self.settings = elements, axis, extent, settings
        self.slopes, self.base = slopes, base
        self.choices: list[Sequence[Anchors]] = [self._choices(element) for element in elements]
        for start, end, _ in self.spans:  # ends at equal distances from the middle stay so
            if axis < 2 and abs(elements[start].low + elements[end].low - extent) < 2 * CENTRED * extent:
                wide = abs(elements[start].low - elements[end].low) < settings.spanning * extent
                low, high = ((LOW,), (HIGH,)) if elements[start].low < elements[end].low else ((HIGH,), (LOW,))
                self.choices[start], self.choices[end] = ([(MIDDLE,)], [(MIDDLE,)]) if wide else ([low], [high])
        self.costs = np.full((len(elements), MOST), np.inf)
        self.shifts = np.zeros((len(elements), MOST, 2))  # how low and high coordinates move with each choice
        for k, (element, choices) in enumerate(zip(elements, self.choices, strict=True)):
            self.costs[k, : len(choices)] = [self._unary(element, anchors) for anchors in choices]
            self.shifts[k, : len(choices)] = [(SHIFTS[ends[0]], SHIFTS[ends[-1]]) for ends in choices]
        low, high = ends
        half = extent / 2
        self.at_low = (low <= settings.reach * extent) | (high <= half - settings.beyond * half)
        self.at_high = (high >= (1 - settings.reach) * extent) | (low >= half + settings.beyond * half)
        if axis == 2:
            self.at_low, self.at_high = low <= settings.reach * extent, high >= 0.9 * extent
        self.reaches_low, self.reaches_high = low <= settings.reach * extent, high >= (1 - settings.reach) * extent
        self.share = np.stack([low, high]) / extent
        self.long = high - low >= settings.spanning * extent
        first, second = contacts.first, contacts.second
        self.contacts, self.ends, self._passed = contacts, ends, set[bytes]()
        self.overlap = self._overlaps(low, high)
        moved_by = (np.abs(slopes).max((0, 3)) > 0).astype(int)  # (N, K)
        shared = moved_by[first].T @ moved_by[second] if len(first) else np.zeros((len(elements),) * 2)
        shared = shared + shared.T + (moved_by.T @ moved_by)
        self.together = [  # elements whose parts touch: they are often better changed together
            (int(a), int(b)) for a, b in np.argwhere(np.triu(shared, 1) > 0)
        ]

    def _choices(self, element: Element) -> Sequence[Anchors]:
        centred = abs(element.middle - self.extent / 2) < CENTRED * self.extent and self.axis < 2
        if element.kind != "interval":
            if self.axis == 2 and element.key != "plane":
                return [(LOW,), (HIGH,)]
            return [(MIDDLE,)] if centred and element.key != "last" else [(LOW,), (MIDDLE,), (HIGH,)]
        if centred:
            return [(LOW, HIGH), (MIDDLE, MIDDLE)]
        pairs = [(LOW, LOW), (LOW, HIGH), (HIGH, HIGH)]
        return pairs + ([(MIDDLE, MIDDLE), (LOW, MIDDLE), (MIDDLE, HIGH)] if self.axis < 2 else [])

    def _unary(self, element: Element, anchors: Anchors) -> float:
        s, extent = self.settings, self.extent
        ends = (element.low, element.high) if element.kind == "interval" else (element.middle,)
        cost = 0.0
        for end, anchor in zip(ends, anchors, strict=True):
            if anchor == MIDDLE:
                cost += s.middle * (abs(end - extent / 2) > CENTRED * extent or len(set(anchors)) > 1)
            else:
                distance = end if anchor == LOW else extent - end
                if self.axis == 2 and element.key != "last":  # heights are measured from the floor
                    cost += s.hanging * (anchor == HIGH) * max(0.0, distance / extent - 0.1)
                else:
                    cost += s.farther * max(0.0, 2 * distance / extent - 1)
        if element.kind == "interval":
            size = (element.high - element.low) / extent
            if anchors[0] != anchors[1]:
                cost += s.resized * max(0.0, 1 - size / s.spanning)
        return cost

    def solved(self) -> list[Anchors]:
        """The anchors of every element."""
        order = np.argsort(self.costs, axis=1, kind="stable")
        last = np.array([len(choices) - 1 for choices in self.choices], np.int64)
        starts = [order[np.arange(len(order)), np.minimum(rank, last)] for rank in range(3)]
        for side in (LOW, HIGH):  # all faces measured from one side
            one_sided = ([set(choice) == {side} for choice in choices] for choices in self.choices)
            starts.append(np.array([flags.index(True) if any(flags) else 0 for flags in one_sided], np.int64))
        best = min((self._descent(start) for start in starts), key=lambda result: round(result[0], 6))
        return [choices[k] for choices, k in zip(self.choices, best[1], strict=True)]

    def _descent(self, state: Array) -> tuple[float, Array]:
        """The cost and state (K,) from which no change of an element, or of two that touch, is cheaper."""
        total = float(self._costs(state[None])[0])
        for _ in range(ROUNDS):
            before = total
            if state.tobytes() in self._passed:  # the descent from another start came through here
                break
            self._passed.add(state.tobytes())
            for group in (*([k] for k in range(len(state))), *self.together):
                options = np.array([*product(*(range(len(self.choices[k])) for k in group))])
                trials = np.repeat(state[None], len(options), 0)
                trials[:, group] = options
                costs = self._costs(trials)
                if costs.min() < total - 1e-9:
                    state, total = trials[costs.argmin()], float(costs.min())
            if total >= before - 1e-9:
                break
        return total, state

    def _overlaps(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """How far pairs (..., C) of primitives that touch overlap along the axis, from their ends (..., N)."""
        first, second = self.contacts.first, self.contacts.second
        return np.minimum(high[..., first], high[..., second]) - np.maximum(low[..., first], low[..., second])

    def _costs(self, states: Array) -> FloatArray:
        """The costs (S,) of choices of anchors (S, K)."""
        s, elements = self.settings, np.arange(states.shape[1])
        shifts, cost = self.shifts[elements, states], self.costs[elements, states].sum(1)  # (S, K, 2), (S,)
        for start, end, penalty in self.spans:
            cost += penalty * (states[:, start] != states[:, end])
        for last, first in self.loops.items():  # a row gives a side or the middle of its last copy
            shifts[:, last] -= shifts[:, last, :1] * (shifts[:, first, 1:] - shifts[:, first, :1])
        low, high = (self.base[end] + np.tensordot(shifts, self.slopes[end], ((1, 2), (1, 2))) for end in (0, 1))
        far = 0.25 * self.extent
        # A face near a side moves with it, or keeps its proportion.
        ask_low = self.at_low & (np.abs(low - np.clip(low, -0.13, np.maximum(self.share[0], 0) + 0.13)) > 1e-9)
        ask_high = self.at_high & (np.abs(high - np.clip(high, np.minimum(self.share[1], 1) - 0.13, 1.13)) > 1e-9)
        rigid = self.long & (high - low < self.share[1] - self.share[0] - 0.5)
        per_copy = ask_low @ np.where(self.reaches_low, s.reaching, s.side) + s.rigid * rigid.sum(1)
        per_copy += ask_high @ np.where(self.reaches_high, s.reaching, s.side)
        if len(self.contacts.first):
            contacts = self.contacts
            grown = self._overlaps(self.ends[0] + far * low, self.ends[1] + far * high) - self.overlap
            separated = self.overlap + grown < np.minimum(self.overlap, 0) - TOUCH
            pressed = (grown > 1e-9) & (self.overlap < 1.5 * TOUCH)
            opened = contacts.base + np.tensordot(shifts, contacts.slopes, ((1, 2), (1, 2)))
            separated[:, contacts.leaning] |= contacts.gaps + far * opened > np.maximum(contacts.gaps, 0) + TOUCH
            per_copy += s.separated * separated.sum(1) + s.pressed * pressed.sum(1)
        return cost + per_copy / max(1.0, low.shape[1] / len(elements))


def anchors_of(model: Model, joints: Joints | None, settings: AnchorSettings) -> dict[tuple[int, str, int], Anchors]:
    """The anchors of all elements of a program.

    Parameters
    ----------
    model
        The program with all faces measured from the low side.
    joints
        Where its parts touch.
    settings
        The costs.
    """
    layout = model.anchored.layout
    ends, rows = model.ends(model.numbers)
    gaps, gap_rows, pairs, leaning = _leaning(model, joints)
    result: dict[tuple[int, str, int], Anchors] = {}
    for axis in range(3):
        elements = [element for element in layout.elements.values() if element.axis == axis]
        index = {(element.line, element.key): k for k, element in enumerate(elements)}
        loops = {k: index[layout.first(line)] for (line, key), k in index.items() if key == "last"}
        extent = layout.extents[axis]
        slopes = np.moveaxis(_by_element(model, elements, rows[:, axis]), 0, 2)
        contacts = Contacts(
            pairs[0], pairs[1], leaning, gaps, np.moveaxis(_by_element(model, elements, gap_rows), 0, 1),
            gap_rows[:, axis],
        )  # fmt: skip
        solver = AxisAnchors(
            elements, axis, extent, ends[:, axis] + extent / 2, slopes, rows[:, axis, :, axis] + 0.5, contacts, loops,
            settings,
        )  # fmt: skip
        for element, anchors in zip(elements, solver.solved(), strict=True):
            result[element.line, element.key, axis] = anchors
        for last, first in loops.items():
            copy, original = elements[last], elements[first]
            if abs(copy.low - original.low) < STEP:  # a row that does not run along this axis
                result[copy.line, copy.key, axis] = result[original.line, original.key, axis][:1]
    return result


def _by_element(model: Model, elements: list[Element], rows: FloatArray) -> FloatArray:
    """Slopes (..., P) by the numbers of a program as those by the low and high coordinates of elements (K, ..., 2)."""
    index = model.anchored.index
    slopes = np.zeros((len(elements), *rows.shape[:-1], 2))
    for k, element in enumerate(elements):
        words = AXES[element.axis]
        if element.kind == "interval":
            slopes[k, ..., 1] = rows[..., index[element.line, words.size]]
            slopes[k, ..., 0] = -slopes[k, ..., 1]
        if element.key != "across":
            low = f"{element.key}.{words.low}" if element.key else words.low
            slopes[k, ..., 0] += rows[..., index[element.line, low]]
    return slopes


def _leaning(model: Model, joints: Joints | None) -> tuple[FloatArray, FloatArray, tuple[Array, Array], Array]:
    """The gaps (L,) of touching pairs of which one leans, their slopes (L, P), all pairs, and which of these lean."""
    count = len(model.numbers)
    if joints is None or not len(joints.first):
        nothing = np.zeros(0, np.int64)
        return np.zeros(0), np.zeros((0, count)), (nothing, nothing), nothing
    poses = model.poses(model.numbers)
    rotation = poses.scene.rotation
    turned = ((rotation - rotation.round()).abs().amax((1, 2)) > ALIGNED).numpy()
    first, second = joints.first.numpy(), joints.second.numpy()
    leaning = np.flatnonzero(turned[first] | turned[second])
    reach = depths(poses.scene, poses.slopes, moved(poses.scene, joints))
    slopes = reach.slopes.nan_to_num(0).numpy()[leaning]
    return reach.residual.numpy()[leaning], slopes, (first, second), leaning
