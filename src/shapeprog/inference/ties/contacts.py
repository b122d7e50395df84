"""Parts that hold together must not fall apart for the sake of a relation.

Two parts hold together where they overlap or share a face, or some of one; parts that meet along an edge or at a point
are one piece to the eye, but two to a printer and to every edit.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.scene import Scene
from shapeprog.inference.joints import FIRST, Joints, between, moved, needs, places_of
from shapeprog.inference.residuals import rows_of
from shapeprog.inference.ties.fitting import CLOSED, ways_free
from shapeprog.inference.tunable import Tunable
from shapeprog.space import Array, FloatArray

LOOKED, AROUND = 32, 0.6
"""Places around a joint that are looked at, and how far away in cells they are at most."""

CLOSING = 2
"""Steps in which gaps are closed."""

APART, NARROW = 0.02, 0.006
"""Cells between parts that are apart; and the standard deviation, across its length, of the places of a contact that is
but an edge."""


def holding(scene: Scene, joints: Joints) -> Bool[Tensor, " C"]:
    """Which joints hold: places around them are drawn onto both parts, and should then fill some of a plane."""
    if not len(joints.first):
        return torch.zeros(0, dtype=torch.bool)
    drawn = AROUND * (2 * torch.rand(LOOKED, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) - 1)
    points = (places_of(scene, joints)[:, None] + drawn).flatten(0, 1)
    first, second = (slots.repeat_interleave(LOOKED) for slots in (joints.first, joints.second))
    points = between(scene, first, second, points, FIRST)
    gap = signed_distance(rows_of(scene, second)[0], points[:, None])[:, 0].detach().clamp(min=0)
    spread = points.unflatten(0, (-1, LOOKED))
    wide = torch.linalg.svdvals(spread - spread.mean(1, keepdim=True))[:, 1] / np.sqrt(LOOKED)
    return (gap.unflatten(0, (-1, LOOKED)).amin(1) <= APART) & (wide >= NARROW)


class Contacts:
    """The joints of a program, and which of them hold for which numbers."""

    def __init__(self, tunable: Tunable, joints: Joints) -> None:
        self.tunable, self.joints = tunable, joints

    def hold(self, numbers: FloatArray, before: FloatArray) -> bool:
        """Whether all joints hold that did where the numbers were others."""
        return bool((self.at(numbers) | ~self.at(before)).all())

    def at(self, numbers: FloatArray) -> Array:
        """Which joints hold (C,) where the numbers and extents of the whole are these (V,)."""
        scene = self.tunable.scene(torch.from_numpy(numbers[: len(self.tunable.values)]))
        return holding(scene, self.joints).numpy()

    def kept(
        self, rows: FloatArray, fixed: int, numbers: FloatArray, curvature: FloatArray, price: float
    ) -> tuple[FloatArray, FloatArray]:
        """The relations (M, V), in the order in which they were found to be worth having, without those that part what
        holds together; and the optimum (V,) where they hold.

        Parts are moved together again as far as relations allow and evidence does not mind: the end of a part that is
        hidden inside another may well lie elsewhere.

        Parameters
        ----------
        fixed
            How many of them, the first, are not in question.
        numbers, curvature
            The optimum without relations, and half the curvature of the misfit there.
        price
            By how much moving parts together may raise the misfit at most.
        """
        free, left = np.linalg.inv(curvature), rows
        least = np.minimum(self.tunable.low.numpy(), numbers[: len(self.tunable.values)])
        needed = self.at(_optimum(left[:fixed], numbers, free))

        @cache
        def slopes() -> Float[Tensor, "N 16 F"]:
            """Those of the poses at the optimum: they are needed only where something comes apart."""
            return self.tunable.poses(torch.from_numpy(numbers[: len(least)])).slopes

        def placed(first: int) -> tuple[FloatArray, bool]:
            """The optimum where the first relations hold, and whether all does that should hold together."""
            best = _optimum(left[:first], numbers, free)
            if (best[: len(least)] < least).any():
                return best, False
            if self.at(best)[needed].all():
                return best, True
            closed = self._closed(best, left[:first], curvature, least, slopes())
            dear = (closed - best) @ curvature @ (closed - best) > price
            return (best, False) if dear or not self.at(closed)[needed].all() else (closed, True)

        sure = fixed
        best, holds = placed(len(left))
        while not holds:
            # With the first ``low`` relations all hold together, with the first ``high`` they do not.
            low, high = sure, len(left)
            while high - low > 1:
                middle = (low + high) // 2
                low, high = (middle, high) if placed(middle)[1] else (low, middle)
            if low == len(left):
                break
            left = np.delete(left, low, axis=0)
            sure = low
            best, holds = placed(len(left))
        return left, best

    def _closed(
        self,
        numbers: FloatArray,
        rows: FloatArray,
        curvature: FloatArray,
        least: FloatArray,
        slopes: Float[Tensor, "N 16 F"],
    ) -> FloatArray:
        """The numbers (V,) with gaps between parts closed while relations (M, V) hold, and the misfit rises least; none
        of those of the program falls below its least (F,).

        The slopes of the poses may be those of numbers close by: of parts that do not turn they are the same.
        """
        count, ways, start = len(self.tunable.values), ways_free(rows, len(numbers)), numbers
        for _ in range(CLOSING):
            scene = self.tunable.scene(torch.from_numpy(numbers[:count]))
            gaps = needs(scene, slopes, moved(scene, self.joints))
            wide = np.pad(gaps.slopes.numpy(), [(0, 0), (0, len(numbers) - count)])
            slope = curvature @ (numbers - start) + CLOSED * wide.T @ gaps.residual.numpy()
            inner = ways.T @ (curvature + CLOSED * wide.T @ wide) @ ways
            closer = numbers - ways @ np.linalg.solve(inner, ways.T @ slope)
            if (closer[:count] < least).any():
                break
            numbers = closer
        return numbers


def _optimum(rows: FloatArray, numbers: FloatArray, free: Array) -> FloatArray:
    """The numbers (V,) of the least misfit for which relations hold; ``free`` is the inverse of its curvature."""
    along = free @ rows.T
    found: FloatArray = numbers - along @ np.linalg.solve(rows @ along, rows @ numbers)
    return found
