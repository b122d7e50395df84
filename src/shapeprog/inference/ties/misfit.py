"""The distance of a placed program from the target, and refits of its numbers while relations hold."""

from __future__ import annotations

import numpy as np
import torch

from shapeprog.inference.fit.joints import Joints, moved, needs
from shapeprog.inference.fit.planes import faces_of
from shapeprog.inference.fit.residuals import Target, of_target
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.inference.ties.elements import Kind
from shapeprog.inference.ties.layout import Layout
from shapeprog.inference.ties.relations import HOLDS
from shapeprog.inference.ties.settings import TIES
from shapeprog.space import FloatArray

PRIOR: dict[Kind, float] = {"clearance": 2e-4, "offset": 2e-4, "length": 2e-4, "extent": 1e-2}
"""Weights of a squared move from the start, by kind, else 1e-3: numbers that nothing determines do not change."""


class Misfit:
    """How far the surface of a program is from that of a target, about its numbers; a refit keeps joints together.

    Moves are those from the numbers of the layout, and ``minimum`` is the least weight (P,) of the square of each.
    """

    def __init__(self, layout: Layout, evidence: Evidence, joints: Joints, minimum: FloatArray, seed: int) -> None:
        self.layout, self.target, self.joints = layout, Target(evidence), joints
        self.width = FIT.explained * evidence.tolerance
        self.generator = torch.Generator().manual_seed(seed)
        scale = np.maximum(layout.tunable.scale.numpy() @ np.abs(layout.jacobian), 1e-3)
        self.reach: FloatArray = np.maximum(scale, 1.0)  # cells that the surface moves for one unit of every number
        prior = np.maximum([PRIOR.get(slot.kind, 1e-3) for slot in layout.slots], minimum)
        self.prior: FloatArray = prior * np.where([slot.kind == "angle" for slot in layout.slots], scale**2, 1.0)
        self.together: FloatArray = np.full(len(joints.pairs), TIES.together)  # weights of the squared gaps (C,)
        # Faces on planes of a mesh: their squared distances, weighted by area, are quadratic in the numbers; half the
        # slope where all numbers are 0 (P,), and half the curvature (P, P).
        count = len(layout.slots)
        self.planes: tuple[FloatArray, FloatArray] = np.zeros(count), np.zeros((count, count))
        if evidence.mesh is not None:
            poses = layout.poses(layout.numbers)
            faces = faces_of(poses.scene, evidence.mesh)
            residuals, moves = faces.residuals(poses)
            weighted = np.where(np.abs(residuals) < FIT.on_plane, faces.weight, 0.0)[:, None] * moves
            self.planes = weighted.T @ (residuals - moves @ layout.numbers), weighted.T @ moves

    def at(self, numbers: FloatArray, draws: int, *, joined: bool = False) -> tuple[FloatArray, FloatArray]:
        """Half the slope (P,) and half the curvature (P, P) of the mean squared distance where the numbers are these
        (P,), with the prior, faces on planes, and gaps at joints if joined; pairs of points are drawn so many times."""
        poses = self.layout.poses(numbers)
        systems = [of_target(poses, self.target.pairs(poses.scene, self.generator), self.width) for _ in range(draws)]
        slope, curvature = (sum(parts).numpy() / draws for parts in zip(*systems, strict=True))
        if joined and len(self.joints.pairs):
            residual, slopes = needs(poses, moved(poses.scene, self.joints))
            wide = torch.from_numpy(self.together[:, None]) * slopes
            slope = slope + (wide.T @ residual).numpy()
            curvature = curvature + (wide.T @ slopes).numpy()
        slope, curvature = slope + self.planes[0] + self.planes[1] @ numbers, curvature + self.planes[1]
        return slope + self.prior * (numbers - self.layout.numbers), curvature + np.diag(self.prior)

    def refitted(self, numbers: FloatArray, rows: FloatArray) -> FloatArray:
        """The numbers (P,) of the least misfit that differ from these only so that relations (M, P) hold as before.

        What a step would take below its bound is fixed, and the step is solved again (an active set).
        """
        farthest, bounded = TIES.farthest / self.reach, self.layout.bounded
        low = np.minimum(self.layout.low, bounded @ numbers) - HOLDS
        for _ in range(TIES.steps):
            slope, curvature = self.at(numbers, 1, joined=True)
            while True:
                free = np.linalg.qr(rows.T, mode="complete")[0][:, len(rows) :]  # orthonormal directions
                move = free @ -np.linalg.solve(free.T @ curvature @ free, free.T @ slope)
                onwards = numbers + move / float(np.max(np.abs(move) / farthest, initial=1.0))
                thin = ~(bounded @ onwards >= low)  # also where a part without length has no slopes
                if not thin.any():
                    break
                rows = np.vstack([rows, bounded[thin]])
            numbers = onwards
        return numbers
