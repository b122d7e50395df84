"""What can be measured of a program: numbers that are linear in those it writes, such as the top of a seat.

Every feature is a row of factors for the numbers of the program (F) and three more, the extents of the whole along the
axes of the grid, whose middle is the origin.  Only what is exactly linear is listed: a tilted part has the ends that
its statement names, and sides only across the axes that it lies along.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import torch

from shapeprog.geometry.primitive import SIZES
from shapeprog.geometry.scene import Scene
from shapeprog.inference.tunable import Poses, Tunable, bounds
from shapeprog.language.program import Draw, Node
from shapeprog.language.statement import language
from shapeprog.space import HALF, FloatArray

ALIGNED = 1e-9
"""How far from whole the entries of a rotation may be for sides to lie along the axes of the grid."""

WHOLE = 1e-6
"""How far a factor may be from a quarter of a whole number."""

Kind = Literal["low", "high", "middle", "before", "behind", "place", "length", "radius", "shift", "angle", "extent"]


@dataclass(frozen=True)
class Feature:
    """One measure.

    Parameters
    ----------
    kind
        What it is: a side or the middle of a part (or of all its copies together), the high side of a copy before the
        first of a run or the low side of one behind the last, a coordinate or a number that a statement writes, or an
        extent of the whole.
    axis
        The axis of the grid that it is measured along; -1 where there is none.
    node
        The number of the node, in the order of the text, that it is of; -1 for extents.
    all
        Whether all copies are meant, or else the first.
    row
        Factors (F + 3,).
    """

    kind: Kind
    axis: int
    node: int
    all: bool
    row: FloatArray

    def at(self, numbers: FloatArray) -> float:
        """Its value where the numbers, extents included, are these (F + 3,)."""
        return float(self.row @ numbers)


def features(tunable: Tunable, poses: Poses) -> list[Feature]:
    """All features of a program, none twice."""
    found: dict[tuple[object, ...], Feature] = {}
    for feature in _all_features(tunable, poses):
        group = "place" if feature.kind in ("low", "high") else feature.kind
        key = group, feature.axis if group in ("place", "middle", "before", "behind") else -1, feature.row.tobytes()
        found.setdefault(key, feature)
    return list(found.values())


def _all_features(tunable: Tunable, poses: Poses) -> Iterator[Feature]:
    count = len(tunable.values)
    for axis in range(3):
        row = np.zeros(count + 3)
        row[count + axis] = 1
        yield Feature("extent", axis, -1, True, row)
    yield from _sides(tunable, poses)
    yield from _written(tunable)


def _sides(tunable: Tunable, poses: Poses) -> Iterator[Feature]:
    """Sides and middles of parts, of the first copy and of all of them; sides only where they lie across an axis.

    A board that leans back still has a left and a right side, and a rod between two points its middle.
    """
    scene = poses.scene
    value, slope = ends_of(scene)
    rows = torch.einsum("enr,nrf->enf", slope, poses.slopes).numpy()
    aligned = ((scene.rotation - scene.rotation.round()).abs().amax(-1) < ALIGNED).numpy()
    drawn = [n for n, node in enumerate(tunable.nodes) if isinstance(node, Draw)]
    for block, node in enumerate(drawn):
        slots = (scene.block == block).nonzero()[:, 0].numpy()
        if not len(slots):
            continue
        for axis in range(3):
            low, high = value[axis, slots].numpy(), value[3 + axis, slots].numpy()
            flat = bool(aligned[slots, axis].all())
            centre = poses.slopes[slots, SIZES + axis].numpy()
            for which in (False, True) if len(slots) > 1 else (False,):
                one, two = (int(low.argmin()), int(high.argmax())) if which else (0, 0)
                ends = rows[axis, slots[one]], rows[3 + axis, slots[two]]
                known = {"low": ends[0], "high": ends[1], "middle": (ends[0] + ends[1]) / 2}
                if flat and which and (step := _step(tunable, rows[axis, slots], low)) is not None:
                    known |= {"before": rows[3 + axis, slots[one]] - step, "behind": rows[axis, slots[two]] + step}
                for kind, row in (known if flat else {"middle": (centre[one] + centre[two]) / 2}).items():
                    near = np.round(4 * row) / 4
                    if np.abs(row - near).max(initial=0) < WHOLE and near.any():
                        yield Feature(kind, axis, node, which, np.append(near, np.zeros(3)))  # type: ignore[arg-type]


def _step(tunable: Tunable, rows: FloatArray, low: FloatArray) -> FloatArray | None:
    """The factors (F,) of the step between the copies of a run, whose low sides are these; none where no loop shifts
    them."""
    steps = len(np.unique(low.round(6))) - 1
    step: FloatArray = (rows[low.argmax()] - rows[low.argmin()]) / max(steps, 1)
    shifts = (tunable.are("shift").numpy() & (np.abs(step) > WHOLE)).sum()
    return step if steps and shifts == 1 and (np.abs(step) > WHOLE).sum() == 1 else None


def ends_of(scene: Scene) -> tuple[torch.Tensor, torch.Tensor]:
    """Low and high ends of primitives along the axes (6, N), and their slopes (6, N, 16) by sizes, centre, rotation."""
    leaves = [each.clone().requires_grad_() for each in (scene.size, scene.centre, scene.rotation)]
    half = bounds(replace(scene, size=leaves[0]))
    reach = (leaves[2].abs() @ half[..., None])[..., 0]
    ends = torch.cat([leaves[1] - reach, leaves[1] + reach], -1).T
    slopes = []
    for end in ends:
        parts = torch.autograd.grad(end.sum(), leaves, retain_graph=True, allow_unused=True)
        filled = [torch.zeros_like(leaf) if part is None else part for part, leaf in zip(parts, leaves, strict=True)]
        slopes.append(torch.cat([part.flatten(1) for part in filled], 1))
    return ends.detach(), torch.stack(slopes)


def _written(tunable: Tunable) -> Iterator[Feature]:
    """The numbers themselves: coordinates, full lengths, radii, shifts, angles."""
    count = len(tunable.values)
    for f, (n, slot) in enumerate(tunable.moving):
        node: Node = tunable.nodes[n]
        quantity = language()[node.name].quantities[slot]
        axis = axis_of(node, slot)
        row = np.zeros(count + 3)
        row[f] = 1
        if quantity.kind == "length" and quantity.high == HALF and axis < 0:
            yield Feature("radius", -1, n, False, row)
        elif quantity.kind == "length":
            yield Feature("length", axis, n, False, row * (2 if quantity.high == HALF else 1))
        elif quantity.kind == "position":
            yield Feature("place", axis, n, False, row)
        elif quantity.kind == "shift":
            yield Feature("shift", axis, n, False, row)
        elif quantity.kind == "angle":
            yield Feature("angle", -1, n, False, row)


def axis_of(node: Node, slot: int) -> int:
    """The axis of the grid that a number of a node is measured along; -1 where there is none."""
    declared = language()[node.name]
    parameter = declared.parameter_at(slot)
    if declared.is_loop and parameter.quantity.width == 1:  # the plane of a mirror lies across the axis of its loop
        axes = [each.start for each in declared.parameters if each.quantity.kind == "axis"]
        return int(node.values[axes[0]]) if axes else -1
    words = parameter.quantity.each.split(", ")
    word = words[slot - parameter.start] if len(words) > slot - parameter.start else ""
    return {"up": 0, "depth": 1, "left-right": 2}.get(word, -1)
