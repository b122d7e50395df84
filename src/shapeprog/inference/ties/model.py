"""A placed program as a function of its numbers: its primitives, its misfit, and refits while relations hold."""

from __future__ import annotations

import numpy as np
import torch

from shapeprog.geometry.scene import Scene
from shapeprog.inference.fit.adjustment import of_target
from shapeprog.inference.fit.joints import Joints, moved, needs
from shapeprog.inference.fit.residuals import Target
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.fit.tunable import THINNEST, Poses, Tunable
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.inference.ties.anchored import Anchored
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.evaluate import expanded, symbolic
from shapeprog.language.expression import Linear
from shapeprog.language.program import Program
from shapeprog.space import FloatArray

PRIOR = {
    "clearance": 1e-4,
    "offset": 1e-4,
    "size": 3e-4,
    "radius": 3e-4,
    "edge": 1e-3,
    "length": 1e-4,
    "angle": 1e-3,
    "extent": 1e-2,
}
"""Weights of a squared move from the start, by kind: numbers that nothing determines do not change."""


class Model:
    """A placed program as a function of its numbers (P,), those of :class:`Anchored`.

    Attributes
    ----------
    numbers
        Where they are at the start (P,).
    low
        Lower bounds (P,).
    """

    def __init__(self, anchored: Anchored) -> None:
        self.anchored, self.slots = anchored, anchored.slots
        self.numbers: FloatArray = np.array([slot.value for slot in self.slots])
        self.tunable = Tunable(Program(expanded(anchored.source)))
        nodes = list(Program(symbolic(anchored.source, anchored.forms, anchored.forms["height"] * -0.5)).walk())
        forms = [Linear() + nodes[n].values[slot] for n, slot in self.tunable.moving]
        self.jacobian: FloatArray = np.array([anchored.row(form) for form in forms]).reshape(-1, len(self.slots))
        self._offset = np.array([form.constant for form in forms])
        smallest = {"size": THINNEST, "radius": THINNEST / 2, "edge": 0.0}
        self.low: FloatArray = np.array([smallest.get(slot.kind, -np.inf) for slot in self.slots])

    def values(self, numbers: FloatArray) -> torch.Tensor:
        """The numbers of the statements in cells (F,)."""
        return torch.from_numpy(self.jacobian @ numbers + self._offset)

    def scene(self, numbers: FloatArray) -> Scene:
        """The primitives (N,)."""
        return self.tunable.scene(self.values(numbers))

    def poses(self, numbers: FloatArray) -> Poses:
        """The primitives, and their slopes (N, 16, P) by the numbers."""
        poses = self.tunable.poses(self.values(numbers))
        return Poses(poses.scene, poses.slopes @ torch.from_numpy(self.jacobian))


class Misfit:
    """How far the surface of a model is from that of a target, about its numbers.

    Parameters
    ----------
    model
        The program.
    evidence
        The target.
    seed
        Of the pairs of points that are drawn.
    minimum
        Minimum weight (P,) of a squared move of every number; infinite for numbers that are held.
    """

    def __init__(self, model: Model, evidence: Evidence, seed: int, minimum: FloatArray) -> None:
        self.model, self.target = model, Target(evidence)
        self.width = FIT.explained * evidence.tolerance
        self.generator = torch.Generator().manual_seed(seed)
        self.start = model.numbers
        self.scale: FloatArray = np.maximum(model.tunable.scale.numpy() @ np.abs(model.jacobian), 1e-3)
        prior = np.maximum([PRIOR[slot.kind] for slot in model.slots], np.minimum(minimum, 1e6))
        angles = np.array([slot.kind == "angle" for slot in model.slots])
        self.prior: FloatArray = np.where(angles, prior * self.scale**2, prior)

    def at(
        self, numbers: FloatArray, draws: int = TIES.draws, joints: Joints | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Half the slope (P,) and half the curvature (P, P) of the mean squared distance, with the prior and joints."""
        poses = self.model.poses(numbers)
        systems = [of_target(poses, self.target.pairs(poses.scene, self.generator), self.width) for _ in range(draws)]
        slope, curvature = (sum(parts).numpy() / draws for parts in zip(*systems, strict=True))
        if joints is not None and len(joints.first):
            gaps = needs(poses.scene, poses.slopes, moved(poses.scene, joints))
            wide = TIES.together * gaps.slopes
            slope = slope + (wide.T @ gaps.residual).numpy()
            curvature = curvature + (wide.T @ gaps.slopes).numpy()
        return slope + self.prior * (numbers - self.start), curvature + np.diag(self.prior)

    def refitted(self, numbers: FloatArray, free: FloatArray, joints: Joints | None) -> FloatArray:
        """The numbers (P,) of the least misfit that differ from these along directions (P, Z) only; parts that touched
        are kept together."""
        if not free.shape[1]:
            return numbers
        farthest = TIES.farthest / np.maximum(self.scale, 1.0)
        low = np.minimum(self.model.low, numbers)
        for _ in range(TIES.steps):
            slope, curvature = self.at(numbers, 1, joints)
            move = free @ -np.linalg.solve(free.T @ curvature @ free, free.T @ slope)
            onwards = numbers + move / float(np.max(np.abs(move) / farthest, initial=1.0))
            if (onwards < low).any():
                break
            numbers = onwards
        return numbers
