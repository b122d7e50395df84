"""How much of the surface of a program lies near that of its target, and the other way round: the score of a change.

The squared misfit assumes that points are assigned to the right parts.  For thin parts and sheets they may not be; the
misfit can then fall while a part leaves its surface.
"""

from __future__ import annotations

import numpy as np
import torch
from scipy.spatial import cKDTree

from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.inference.ties.settings import TIES


class Closeness:
    """A target as points, ready to be compared with.

    Parameters
    ----------
    evidence
        The target.
    seed
        Of the points that are compared, and of the samples of programs: always the same.
    """

    def __init__(self, evidence: Evidence, seed: int) -> None:
        surface = evidence.surface
        self.seed, self.reach = seed, TIES.near * float(np.linalg.norm(np.ptp(surface, 0)))
        indices = np.random.default_rng(seed).integers(0, len(surface), TIES.points)
        self._points, self._tree = torch.from_numpy(surface[indices]), cKDTree(surface)

    def of(self, scene: Scene) -> float:
        """The F-score of the two surfaces."""
        recall = float((signed_distance(scene, self._points).abs() <= self.reach).double().mean())
        sample = sample_surface(scene, TIES.points, torch.Generator().manual_seed(self.seed))
        away = self._tree.query(sample.points.numpy(), distance_upper_bound=self.reach)[0]
        precision = float(np.isfinite(away).mean())
        return 2 * precision * recall / (precision + recall) if precision + recall else 0.0
