"""From which side of the whole every face is measured.

A face that is measured from the low side stays where that side is when the whole is made larger, one measured from the
high side moves with that.  The anchors decide how a program follows ``width``, ``depth`` and ``height``: a part near a
side should keep its clearance, a part that spans should grow, any other should keep its size, and parts that touch
should still do so.  This is a labelling of few faces with three labels, solved for each axis alone by iterated
conditional modes (Besag 1986) from several starts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shapeprog.geometry.separation import OrientedBoxes, gaps, touching
from shapeprog.inference.fit.tunable import STEP
from shapeprog.inference.ties.elements import HIGH, LOW, MIDDLE, Anchors, Element, Key, boxes_of
from shapeprog.inference.ties.layout import Layout
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.placement import AXES, POINTS
from shapeprog.space import Array, FloatArray


class _AxisAnchors:
    """The anchors of the K elements of one axis, for a program with all faces measured from the low side.

    It is given with the boxes of its primitives (N,) from the low corner of the whole, and the slots of pairs of
    primitives that touch (C,), (C,).
    """

    def __init__(self, layout: Layout, axis: int, boxes: OrientedBoxes, pairs: tuple[Array, Array]) -> None:
        self.layout, self.axis, self.extent, self.pairs = layout, axis, layout.extents[axis], pairs
        aslant = np.any(np.sort(np.abs(boxes.edges))[..., 1] > 1e-6, axis=1)  # others separate along the axis alone
        self.leaning = np.flatnonzero(aslant[pairs[0]] | aslant[pairs[1]])
        self.elements = [element for element in layout.elements.values() if element.axis == axis]
        index = {(element.line, element.key): k for k, element in enumerate(self.elements)}
        self.rows = {k: index[layout.first(line)] for (line, key), k in index.items() if key == "last"}
        self.choices: list[Sequence[Anchors]] = [self._choices(element) for element in self.elements]
        # Ends of rods, with the cost of different anchors; those of a symmetric rod mirror the choice of its start.
        self.spans: dict[tuple[int, int], float] = {}
        self.chosen_by = np.arange(len(self.elements))
        for (line, key), end in index.items():
            if key in ("end", "through"):
                pair = index[line, "start"], end
                left, right = sorted(pair, key=lambda k: self.elements[k].low)
                low, high = self.elements[left].low, self.elements[right].low
                if axis < 2 and abs(low + high - self.extent) < 2 * TIES.off_middle * self.extent:
                    self.choices[left], self.choices[right] = ([(MIDDLE,), (side,)] for side in (LOW, HIGH))
                    self.spans = {other: cost for other, cost in self.spans.items() if pair[0] not in other}
                    self.chosen_by[end] = pair[0]
                self.spans[pair] = TIES.resized * max(0.0, 1 - (high - low) / (TIES.spanning * self.extent))
        count, most = len(self.elements), max(map(len, self.choices), default=1)
        self.costs = np.full((count, most), np.inf)
        # By which share of the growth of the whole low and high ends move.
        self.shifts = np.full((count, most, 2), np.nan)
        # How the numbers (P,) follow from the size of the whole and from the ends of the elements (1 + 2 K).
        moves = np.zeros((1 + 2 * count, len(layout.slots)))
        moves[0, axis] = 1
        for k, (element, choices) in enumerate(zip(self.elements, self.choices, strict=True)):
            self.costs[k, : len(choices)] = [self._unary(element, anchors) for anchors in choices]
            self.shifts[k, : len(choices)] = [(anchors[0] / HIGH, anchors[-1] / HIGH) for anchors in choices]
            if element.kind == "interval":
                moves[2 * k + 1 : 2 * k + 3, layout.index[element.line, AXES[axis].size]] = -1, 1
            if element.key != "across":
                moves[2 * k + 1, layout.index[element.line, f"{element.key}.{AXES[axis].low}".lstrip(".")]] = 1
        images = np.flatnonzero(self.chosen_by != np.arange(count))
        self.costs[np.append(images, self.chosen_by[images]), :2] = 0.0
        # What the boxes follow from (Q = 2 + 2 K): from one, which gives them at the start, from growth of the whole
        # while all coordinates stay, as mirror images move with its high side, and from moves of the ends of elements.
        moved = (layout.values(layout.numbers + way * moves) for way in (-STEP, STEP))
        back, forth = (boxes_of(layout.tunable.scenes(values)) for values in moved)
        slopes = [np.moveaxis(after - before, 0, -1) / (2 * STEP) for before, after in zip(back, forth, strict=True)]
        slopes[0][:, axis, 0] += 0.5  # of the centres, from the low corner: the middle of the whole stays in the grid
        at_start = [part[..., None] for part in boxes]
        self.boxes = OrientedBoxes(*(np.concatenate(parts, -1) for parts in zip(at_start, slopes, strict=True)))
        self.along = self.boxes.centre[:, axis].copy(), self.boxes.edges[:, :, axis].copy()
        start = np.eye(2 + 2 * count, 1)
        self.ends, self.gaps = self._ends(start), [self._gaps(start, exact=exact) for exact in (False, True)]
        low, high = self.ends[..., 0]
        self.long = high - low >= TIES.spanning * self.extent
        reach, near = TIES.reach * self.extent, (1 - TIES.beyond) * self.extent / 2
        reaches = np.stack([low <= low.min() + reach, high >= high.max() - reach])
        beyond = np.stack([high <= near, low >= self.extent - near])
        if axis == 2:
            beyond = np.stack([reaches[0], high >= high.max() - TIES.below * self.extent])
        self.weights = TIES.side * (reaches | beyond)  # of faces that do not move

    def _is_thickness(self, element: Element) -> bool:
        """Whether a part is a board across the axis: a person expects it to keep its thickness."""
        if element.key or self.layout.lines[element.line].kind == "divide":
            return False
        box = [self.layout.elements[element.line, "", axis] for axis in range(3)]
        least, second, _ = sorted(each.high - each.low for each in box)
        return element.high - element.low <= least <= TIES.board * second

    def _choices(self, element: Element) -> Sequence[Anchors]:
        off = max(TIES.off_middle * self.extent, TIES.within * (element.kind != "interval"))
        centred = abs(element.middle - self.extent / 2) < off and self.axis < 2
        middle = [MIDDLE] if self.axis < 2 or element.key == "plane" else []
        if element.kind != "interval":
            # Ends of rods near the middle may still go with a side, where the parts that they join do.
            only_middle = centred and element.key not in ("last", *POINTS)
            return [(MIDDLE,)] if only_middle else [(anchor,) for anchor in (LOW, *middle, HIGH)]
        # No part has one face at a side and one at the middle: that is almost never chosen.
        one_sided = [] if centred else [(LOW, LOW), (HIGH, HIGH)]
        return [(LOW, HIGH), *one_sided, *((anchor, anchor) for anchor in middle)]

    def _unary(self, element: Element, anchors: Anchors) -> float:
        extent = self.extent
        cost, centred = 0.0, abs(element.middle - extent / 2) <= TIES.off_middle * extent
        ends = (element.low, element.high) if len(anchors) > 1 else (element.middle,)
        for end, anchor in zip(ends, anchors, strict=True):
            if anchor == MIDDLE:
                cost += TIES.middle * (not centred)
                continue
            cost += TIES.middle / 2 * (centred and element.kind == "coordinate" and element.key != "last")
            share = (end if anchor == LOW else extent - end) / extent
            if self.axis < 2 or element.key == "last":
                cost += TIES.farther * max(0.0, 2 * share - 1)
            elif share > min(TIES.changes):  # any other height may be measured from either side
                cost += TIES.outside
            elif anchor == HIGH and share > TIES.below:
                cost += TIES.from_top
        if len(set(anchors)) > 1:
            cost += TIES.resized * max(0.0, 1 - (element.high - element.low) / extent / TIES.spanning)
            cost += TIES.thicker * self._is_thickness(element)
        return cost

    def solved(self) -> list[Anchors]:
        """The anchors of every element."""
        # The cheapest choices, those nearest to either side, and each end from the nearer side.
        high = np.array([(each.low, each.high) for each in self.elements]).reshape(-1, 1, 2) > self.extent / 2
        away = (np.nan_to_num(np.abs(self.shifts - side), nan=np.inf).sum(2) for side in (0, 1, high))
        states = np.array([self._descent(scores.argmin(1)) for scores in (self.costs, *away)])
        costs = self._costs(states, exact=len(self.leaning) > 0).round(6)
        best = states[costs.argmin()]
        if len(self.leaning) and costs.min() >= TIES.separated:  # only then, as it takes ten times as long
            best = self._descent(best, exact=True)
        return [choices[k] for choices, k in zip(self.choices, best[self.chosen_by], strict=True)]

    def _descent(self, state: Array, *, exact: bool = False) -> Array:
        """The state (K,) from which no change of an element is cheaper."""
        total, before, (count, most) = np.inf, None, self.costs.shape
        while total != before:
            before = total
            for k in range(count):
                trials = np.tile(state, (most, 1))
                trials[:, k] = np.arange(most)
                costs = self._costs(trials, exact=exact)
                if costs.min() < total - 1e-9:
                    state, total = trials[costs.argmin()], float(costs.min())
        return state

    def _costs(self, states: Array, *, exact: bool = False) -> FloatArray:
        """The costs (S,) of choices of anchors (S, K); for ``exact`` see :meth:`_gaps`."""
        states, elements, growth = states[:, self.chosen_by], np.arange(states.shape[1]), TIES.growth * self.extent
        shifts, cost = self.shifts[elements, states], self.costs[elements, states].sum(1)  # (S, K, 2), (S,)
        for (start, end), penalty in self.spans.items():
            cost += penalty * (shifts[:, start, 0] != shifts[:, end, 0])
        for last, first in self.rows.items():  # a row gives a side or the middle of its last copy
            shifts[:, last] -= shifts[:, last, :1] * (shifts[:, first, 1:] - shifts[:, first, :1])
        amounts = np.full((2 * states.shape[1] + 2, len(states)), growth)
        amounts[0] = 1
        amounts[2:] *= shifts.reshape(len(states), -1).T
        low, high = (self._ends(amounts) - self.ends) / growth
        # A face near a side moves with it, or keeps its proportion.
        low_share, high_share = self.ends / self.extent
        stays = np.abs(low - np.clip(low, -0.13, np.maximum(low_share, 0) + 0.13)) > 1e-9
        lags = np.abs(high - np.clip(high, np.minimum(high_share, 1) - 0.13, 1.13)) > 1e-9
        rigid = self.long[:, None] & (high - low < high_share - low_share - 0.5)
        cost += self.weights[0] @ stays + self.weights[1] @ lags + TIES.rigid * rigid.sum(0)
        apart = self._gaps(amounts, exact=exact) > np.maximum(self.gaps[exact], 0) + TIES.touch
        return cost + TIES.separated * apart.sum(0)

    def _ends(self, amounts: FloatArray) -> FloatArray:
        """The low and high ends (2, N, S) of boxes along the axis, for amounts (Q, S) of what they follow from."""
        centre, edges = (part @ amounts for part in self.along)
        reach = np.abs(edges).sum(1)
        return np.stack([centre - reach, centre + reach])

    def _gaps(self, amounts: FloatArray, *, exact: bool) -> FloatArray:
        """Gaps (C, S) between pairs of boxes, for such amounts: along the axis, or, if ``exact``, in any direction for
        pairs with a part that leans."""
        (low, high), (first, second) = self._ends(amounts), self.pairs
        result: FloatArray = np.maximum(low[first], low[second]) - np.minimum(high[first], high[second])
        if exact:
            boxes = OrientedBoxes(*(np.moveaxis(part @ amounts, -1, 0) for part in self.boxes))
            result[self.leaning] = gaps(boxes, first[self.leaning], second[self.leaning]).T
        return result


def anchors_of(layout: Layout) -> dict[Key, Anchors]:
    """The anchors of all elements of a program, given with all faces measured from the low side."""
    (width, depth, _), scale = layout.extents, layout.scale
    boxes = boxes_of(layout.scene(layout.numbers))
    pairs = touching(boxes, TIES.touch)
    boxes = boxes._replace(centre=boxes.centre - [-width / 2, scale.middle - depth / 2, scale.floor])
    solvers = [_AxisAnchors(layout, axis, boxes, pairs) for axis in range(3)]
    solved = (pair for solver in solvers for pair in zip(solver.elements, solver.solved(), strict=True))
    return {(element.line, element.key, element.axis): anchors for element, anchors in solved}
