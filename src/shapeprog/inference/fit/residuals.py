"""Distances between the surfaces of a program and of a target, pair by pair, and the step that reduces them.

A point of the target and a sample of the program's surface are a pair when they are close and their normals fit.  The
residual of a pair is the distance from the point to the surface around the sample, along its normal: sliding along a
face costs nothing.  Points that no part explains have no partner nearby, and their weight vanishes (Geman & McClure
1987).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree
from torch import Tensor

from shapeprog.geometry.distance import distance_and_slopes, nearest_primitive
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import SurfaceSample, sample_surface
from shapeprog.inference.choice.bits import nearby
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.fit.tunable import Poses
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.space import FloatArray

NEVER = 1e9
"""Penalty of a pair whose normals are known to face opposite ways."""


class Pairs(NamedTuple):
    """Points of the target with their partners, which are samples of the surface of the program.

    Besides the distance along the normal, a pair is penalised for that along the surface, beyond the spacing of
    samples, and for the difference of the normals.
    """

    points: Float[Tensor, "R 3"]
    samples: Float[Tensor, "R 3"]
    normals: Float[Tensor, "R 3"]  # outward ones of the samples
    slots: Int[Tensor, " R"]  # the primitives that the samples lie on
    offset: Float[Tensor, " R"]  # squared penalty besides the distance along the normal
    weights: Float[Tensor, " R"]
    either: Bool[Tensor, " R"]  # the normals are parallel; on which side of its surface the point lies is not known
    anywhere: Bool[Tensor, " R"]  # the pair refers to the nearest point of the primitive, whatever its normal


System = tuple[Float[Tensor, " F"], Float[Tensor, "F F"]]
"""Half the slope of a sum of squares, and half its curvature by Gauss and Newton."""


class Target:
    """The evidence, ready to be paired with."""

    def __init__(self, evidence: Evidence) -> None:
        self.evidence = evidence
        arrays = evidence.points, evidence.normals, evidence.outward
        self._points, self._normals, self._sides = map(torch.from_numpy, arrays)
        self._order = np.argsort(nearby(evidence.points), kind="stable")
        self._shares = np.cumsum(evidence.weights[self._order])
        unsure = np.flatnonzero(~evidence.outward)
        self._owner = torch.from_numpy(np.concatenate([np.arange(len(self._sides)), unsure]))
        both = _joint(self._points, self._normals), _joint(self._points[unsure], -self._normals[unsure])
        self._tree = cKDTree(np.concatenate(both), 24, balanced_tree=False)  # faster than by default

    def pairs(self, scene: Scene, generator: torch.Generator) -> Pairs:
        """Pairs both ways, drawn at random: from points to the program, and from its surface to points.

        Plain distances of points to the union have little weight: they alone determine how far a part reaches along a
        sheet that has no edges.
        """
        sample = sample_surface(scene, FIT.pairs, generator)
        jitter = torch.rand(FIT.pairs, generator=generator, dtype=torch.float64).numpy()
        stratum = self._shares[-1] / FIT.pairs  # evenly over the surface
        thresholds = (np.arange(FIT.pairs) + jitter) * stratum
        place = np.searchsorted(self._shares, thresholds).clip(0, len(self._points) - 1)
        drawn = torch.from_numpy(self._order[place])
        points, normals = self._points[drawn], self._normals[drawn]
        tree = cKDTree(_joint(sample.points, sample.normals))
        candidates = _nearest(tree, points, normals)
        if len(unsure := (~self._sides[drawn]).nonzero()[:, 0]):
            behind = candidates.clone()
            behind[unsure] = _nearest(tree, points[unsure], -normals[unsure])
            candidates = torch.cat([candidates, behind], 1)
        there = self._closest(drawn[:, None], candidates, sample)
        owners = self._owner[_nearest(self._tree, sample.points, sample.normals)]
        back = self._closest(owners, torch.arange(FIT.pairs)[:, None], sample)
        paired, partner, offset = map(torch.cat, zip(there, back, strict=True))
        every = torch.cat([paired, drawn])
        facing = torch.cat([sample.normals[partner], normals])
        along = (self._normals[every] * facing).sum(1)
        ones, half = torch.ones(FIT.pairs, dtype=torch.float64), torch.full((FIT.pairs,), 0.5 / FIT.pairs).double()
        return Pairs(
            points=self._points[every],
            samples=torch.cat([sample.points[partner], points]),
            normals=facing,
            slots=torch.cat([sample.slot[partner], nearest_primitive(scene, points)[0]]),
            offset=torch.nn.functional.pad(offset, (0, FIT.pairs)),
            weights=torch.cat([ones / FIT.pairs, half, 0.03 * ones / FIT.pairs]),
            either=~self._sides[every] & (along.abs() >= FIT.same),
            anywhere=torch.arange(len(every)) >= len(paired),
        )

    def _closest(
        self, points: Int[Tensor, "R _"], samples: Int[Tensor, "R _"], sample: SurfaceSample
    ) -> tuple[Int[Tensor, " R"], Int[Tensor, " R"], Float[Tensor, " R"]]:
        """The best of several pairs (R, k) of points and samples, of which one may be the same for all, and its squared
        penalty besides the distance along the normal."""
        facing, normals = sample.normals[samples], self._normals[points]
        away = self._points[points] - sample.points[samples]
        plane, cosine = (away * facing).sum(-1), (normals * facing).sum(-1)
        spacing = 1.5 * math.sqrt(self.evidence.area / min(FIT.pairs, len(self._points)))
        along = ((away**2).sum(-1) - plane**2).clamp(min=0).sqrt() - spacing
        turned = torch.where(self._sides[points] & (cosine < 0), NEVER, 1 - cosine**2).clamp(min=0)
        known = (normals**2).sum(-1) > 0.25
        against = along.clamp(min=0) ** 2 + FIT.turned**2 * torch.where(known, turned, 0.0)
        best = (plane**2 + against).argmin(1, keepdim=True)
        point, partner, offset = (item.expand_as(against).gather(1, best)[:, 0] for item in (points, samples, against))
        return point, partner, offset


def of_target(poses: Poses, pairs: Pairs, width: float) -> System:
    """The misfit of pairs to second order in the numbers; residuals of ``width`` cells have a quarter of the weight."""
    parts = poses.scene[pairs.slots[:, None]]
    value, by_row, slope = (result[:, 0] for result in distance_and_slopes(parts, pairs.points[:, None]))
    cosine = (slope * pairs.normals).sum(1)
    plane = ((pairs.points - pairs.samples) * pairs.normals).sum(1)
    same = (cosine >= FIT.same) | pairs.anywhere
    residual = torch.where(same, value, plane)
    # The opposite side of a part explains the point: a sheet is evidence for one side of a board, not for both.
    explained = pairs.either & ~same & (value.abs() < plane.abs() / 2)
    if len(off_face := (~same).nonzero()[:, 0]):  # the nearest point is on another face: use the plane at the sample
        samples = (pairs.samples + 1e-3 * pairs.normals)[off_face, None]
        by_row[off_face] = distance_and_slopes(parts[off_face], samples)[1][:, 0]
    robust = (width**2 / (width**2 + residual**2 + pairs.offset)) ** 2
    weight = torch.where(explained, 0.0, pairs.weights * robust)
    order, by_number = torch.argsort(pairs.slots), poses.slopes
    counts = torch.bincount(pairs.slots, minlength=len(by_number)).tolist()
    columns = (column[order].split(counts) for column in (weight[:, None] * by_row, by_row, residual))
    systems = [(off @ weighted, weighted.T @ plain) for weighted, plain, off in zip(*columns, strict=True)]
    by_slot, curvature = map(torch.stack, zip(*systems, strict=True))
    return (by_number * by_slot[..., None]).sum((0, 1)), (by_number.mT @ curvature @ by_number).sum(0)


def _joint(points: Float[Tensor, "P 3"], normals: Float[Tensor, "P 3"]) -> FloatArray:
    """Points and normals (P, 6), in which distances combine those of positions and of directions."""
    return torch.cat([points, FIT.turned / math.sqrt(2) * normals], 1).numpy()


def _nearest(tree: cKDTree, points: Float[Tensor, "P 3"], normals: Float[Tensor, "P 3"]) -> Int[Tensor, "P k"]:
    """The nearest members of a tree to points with normals."""
    return torch.from_numpy(tree.query(_joint(points, normals), FIT.partners)[1])
