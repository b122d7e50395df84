"""Which parts that touch would still do so if one measure were changed, to first order.

Programs are the better to edit the fewer contacts a change of one named number parts, and that is up to which measures
are free: a top has a width of its own, or is as wide as the whole less two insets, and follows it.
"""

from __future__ import annotations

import numpy as np
import torch

from shapeprog.inference.joints import Joints, depths, moved
from shapeprog.inference.ties.features import ALIGNED, ends_of
from shapeprog.inference.ties.sums import Flags
from shapeprog.inference.tunable import Tunable
from shapeprog.space import FloatArray

CHANGE = 0.2
"""Share by which a measure is changed, up and down."""

TOUCHING = 0.1
"""Cells between parts that touch, at most."""


class Following:
    """The contacts of a program, and how its numbers move them.

    Parts that touch overlap along all axes, or nearly do; where one of them leans, its box says little, and the place
    that lies deepest in both must stay near the second, too.
    """

    def __init__(self, tunable: Tunable, joints: Joints, numbers: FloatArray) -> None:
        poses = tunable.poses(torch.from_numpy(numbers[: len(tunable.values)]))
        value, slope = ends_of(poses.scene)
        rotation = poses.scene.rotation
        turned = ((rotation - rotation.round()).abs().amax((1, 2)) > ALIGNED).numpy()
        self.first, self.second = joints.first.numpy(), joints.second.numpy()
        self.ends: FloatArray = value.numpy()
        self.slopes: FloatArray = torch.einsum("enr,nrf->enf", slope, poses.slopes).numpy()
        self.leaning = np.flatnonzero(turned[self.first] | turned[self.second])
        reach = depths(poses.scene, poses.slopes, moved(poses.scene, joints))
        self.depth = reach.residual.numpy()[self.leaning, None]
        self.depth_slopes = reach.slopes.nan_to_num(0).numpy()[self.leaning]
        self._least = np.minimum(self._overlaps(self.ends[..., None]), 0) - TOUCHING
        self._known: dict[bytes, float] = {}

    def lost(self, factors: FloatArray, values: FloatArray) -> FloatArray:
        """The share of contacts that changes of measures part, each up and down, summed over all (C,).

        Parameters
        ----------
        factors
            Of every number (C, F, Z) by how much it follows from each measure, in several cases.
        values
            Where the measures are (C, Z).
        """
        moves = (CHANGE * np.abs(values)[:, :, None] * factors.swapaxes(1, 2)).round(9) + 0.0
        moves = np.ascontiguousarray(moves).reshape(-1, factors.shape[1])
        size, written = moves.itemsize * moves.shape[1], moves.tobytes()
        keys = [written[start : start + size] for start in range(0, size * len(moves), max(size, 1))]
        new = {key: row for row, key in enumerate(keys) if key not in self._known}  # most are those of other sums
        if new:
            self._known |= zip(new, self._lost(moves[list(new.values())].T).tolist(), strict=True)
        found: FloatArray = np.array([self._known[key] for key in keys]).reshape(values.shape).sum(1)
        return found

    def _lost(self, moves: FloatArray) -> FloatArray:
        """The share of contacts (Z,) that moves of all numbers (F, Z) part, forwards and backwards together."""
        ends, depth = self.slopes @ moves, self.depth_slopes @ moves
        found = np.zeros(moves.shape[1])
        for sign in (1, -1):
            overlaps = self._overlaps(self.ends[..., None] + sign * ends)
            parted: Flags = np.any(overlaps < self._least, 0)
            away = self.depth + sign * depth > np.maximum(self.depth, 0) + TOUCHING
            found += parted.sum(0) + (away & ~parted[self.leaning]).sum(0)
        return found / max(len(self.first), 1)

    def _overlaps(self, ends: FloatArray) -> FloatArray:
        """How far the boxes of touching parts overlap along the axes (3, C, Z), of the ends of all parts (6, N, Z)."""
        high = np.minimum(ends[3:, self.first], ends[3:, self.second])
        low = np.maximum(ends[:3, self.first], ends[:3, self.second])
        found: FloatArray = high - low
        return found
