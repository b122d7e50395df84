"""The misfit of a program about its numbers to second order, and its numbers refitted while relations hold."""

from __future__ import annotations

import numpy as np
import torch

from shapeprog.inference.adjustment import EXPLAINED, GENTLE, PLACE, of_target
from shapeprog.inference.evidence import Evidence
from shapeprog.inference.joints import Joints, moved, needs
from shapeprog.inference.residuals import Target
from shapeprog.inference.tunable import Tunable
from shapeprog.space import Array, FloatArray

DRAWS = 4
"""Times that pairs of points are drawn for one curvature."""

STEPS = 4
"""Steps of Gauss and Newton of a refit."""

HOLD = 1e-2
"""Weight of a squared change of an extent of the whole, in cells: the box of the target is known."""

TOGETHER, CLOSED = 0.03, 0.2
"""Weights of a squared gap between parts that touched, and of one that is still open at the end."""

KNOWN = 0.1
"""Weight of a squared move in cells of a length or place that somebody wrote: it is known, even where it is hidden."""

FAR = 2.0
"""Farthest that relations move the surface by one number at once, in cells."""

FARTHEST = 0.5
"""Farthest that one step moves the surface by one number, in cells."""


class Misfit:
    """How far the surface of a program is from that of a target, about its numbers and the extents of the whole (V,).

    Parameters
    ----------
    known
        Whether the numbers themselves are known, and not only where the surface is.

    Attributes
    ----------
    numbers, low, far
        Where they are at the start, what they must not fall below, and how far relations may move them at once.
    """

    def __init__(self, tunable: Tunable, evidence: Evidence, seed: int, *, known: bool = False) -> None:
        self.tunable, self.target = tunable, Target(evidence)
        self.width = EXPLAINED * evidence.tolerance
        self.generator = torch.Generator().manual_seed(seed)
        surface = evidence.surface
        reach = np.maximum(np.abs(surface.min(0)), np.abs(surface.max(0))) if len(surface) else np.zeros(3)
        self.extents: FloatArray = 2 * reach
        self.numbers = np.concatenate([tunable.values.numpy(), self.extents])
        self.low = np.concatenate([tunable.low.numpy(), np.zeros(3)])
        self.far = FAR / np.append(tunable.scale.numpy(), np.ones(3))
        weights = [KNOWN if known and kind != "angle" else GENTLE.get(kind, PLACE) for kind in tunable.kinds]
        gentle = np.array(weights) * tunable.scale.numpy() ** 2
        self._gentle = np.concatenate([gentle, np.full(3, HOLD)])

    def at(
        self, numbers: FloatArray, draws: int = DRAWS, joints: Joints | None = None, together: float = TOGETHER
    ) -> tuple[FloatArray, FloatArray]:
        """Half the slope (V,) and half the curvature (V, V) of the mean squared distance, with what holds numbers to
        where they were at the start, and open joints together."""
        count = len(self.tunable.values)
        poses = self.tunable.poses(torch.from_numpy(numbers[:count]))
        slope, curvature = np.zeros(len(numbers)), np.zeros((len(numbers), len(numbers)))
        for _ in range(draws):
            pairs = self.target.pairs(poses.scene, self.generator)
            one, two = of_target(poses, pairs, self.width)
            slope[:count] += one.numpy() / draws
            curvature[:count, :count] += two.numpy() / draws
        if joints is not None and len(joints.first):
            gaps = needs(poses.scene, poses.slopes, moved(poses.scene, joints))
            wide = together * gaps.slopes
            slope[:count] += (wide.T @ gaps.residual).numpy()
            curvature[:count, :count] += (wide.T @ gaps.slopes).numpy()
        slope += self._gentle * (numbers - self.numbers)
        return slope, curvature + np.diag(self._gentle)


def refitted(
    misfit: Misfit, numbers: FloatArray, rows: FloatArray, joints: Joints | None, together: float = TOGETHER
) -> FloatArray:
    """The numbers (V,) of the least misfit for which relations (M, V) hold; parts that touched are kept together."""
    ways = ways_free(rows, len(numbers))
    numbers = ways @ (ways.T @ numbers)  # all but rounding of what is there
    farthest = np.concatenate([FARTHEST / misfit.tunable.scale.numpy(), np.full(3, FARTHEST)])
    low = np.minimum(misfit.low, numbers)
    for _ in range(STEPS):
        slope, curvature = misfit.at(numbers, 1, joints, together)
        move = ways @ -np.linalg.solve(ways.T @ curvature @ ways, ways.T @ slope)
        too_far = float(np.max(np.abs(move) / farthest, initial=1.0))
        onwards = numbers + move / too_far
        if (onwards < low).any():
            break
        numbers = onwards
    return numbers


def ways_free(rows: FloatArray, count: int) -> Array:
    """An orthonormal basis (V, Z) of the numbers for which independent relations (M, V) hold."""
    if not len(rows):
        return np.eye(count)
    axes, _ = torch.linalg.qr(torch.from_numpy(rows.T.copy()), mode="complete")
    return axes[:, len(rows) :].numpy()
