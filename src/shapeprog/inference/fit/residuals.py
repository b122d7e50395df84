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

from shapeprog.geometry.batch import Batch
from shapeprog.geometry.distance import distance_and_slopes, nearest_primitive
from shapeprog.geometry.primitive import SIZES
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import SurfaceSample, sample_surface
from shapeprog.inference.choice.bits import nearby
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.fit.tunable import ROW
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.space import FloatArray

NEVER = 1e9
"""Penalty of a pair whose normals are known to face opposite ways."""


class Pairs(NamedTuple):
    """Points of the target (R, 3) with their partners on the surface of the program.

    Parameters
    ----------
    points, samples, normals, slots
        The points, the samples and their outward normals (R, 3), and the primitives (R,) that the samples lie on.
    offset
        Squared penalty of the pair (R,) besides the distance along the normal: the distance of the two along the
        surface, beyond the spacing of samples, and the difference of their normals.
    weights
        Weights of the pairs (R,).
    either
        Whether the normals are parallel and it is not known on which side of its surface the point lies (R,).
    anywhere
        Whether the pair refers to the nearest point of the primitive (R,), whatever its normal.
    """

    points: Float[Tensor, "R 3"]
    samples: Float[Tensor, "R 3"]
    normals: Float[Tensor, "R 3"]
    slots: Int[Tensor, " R"]
    offset: Float[Tensor, " R"]
    weights: Float[Tensor, " R"]
    either: Bool[Tensor, " R"]
    anywhere: Bool[Tensor, " R"]


class Pull(NamedTuple):
    """Sum of weighted squared residuals to second order in the numbers of each primitive, by Gauss and Newton."""

    slope: Float[Tensor, "N 16"]
    curvature: Float[Tensor, "N 16 16"]


class Target:
    """The evidence, ready to be paired with."""

    def __init__(self, evidence: Evidence) -> None:
        self.evidence = evidence
        self._points = torch.from_numpy(evidence.points)
        normals, sides = evidence.normals, evidence.outward
        self._normals, self._sides = torch.from_numpy(normals), torch.from_numpy(sides)
        self._order = np.argsort(nearby(evidence.points), kind="stable")
        self._shares = np.cumsum(evidence.weights[self._order])
        unsure = np.flatnonzero(~sides)
        self._owner = torch.from_numpy(np.concatenate([np.arange(len(sides)), unsure]))
        both = _joint(self._points, self._normals), _joint(self._points[unsure], -self._normals[unsure])
        self._tree = cKDTree(np.concatenate(both), 24, balanced_tree=False)  # faster than by default

    def pairs(self, scene: Scene, generator: torch.Generator) -> Pairs:
        """Pairs both ways, drawn at random: from points to the program, and from its surface to points.

        Plain distances of points to the union have little weight: they alone determine how far a part reaches along a
        sheet that has no edges.
        """
        sample = sample_surface(scene, FIT.samples, generator)
        samples, facing = sample.points, sample.normals
        jitter = torch.rand(FIT.points, generator=generator, dtype=torch.float64).numpy()
        stratum = self._shares[-1] / FIT.points  # evenly over the surface
        thresholds = (np.arange(FIT.points) + jitter) * stratum
        place = np.searchsorted(self._shares, thresholds).clip(0, len(self._points) - 1)
        selected = torch.from_numpy(self._order[place])
        points, normals, sides = self._points[selected], self._normals[selected], self._sides[selected]
        tree = cKDTree(_joint(samples, facing))
        candidates = _nearest(tree, points, normals)
        if len(unsure := (~sides).nonzero()[:, 0]):
            behind = candidates.clone()
            behind[unsure] = _nearest(tree, points[unsure], -normals[unsure])
            candidates = torch.cat([candidates, behind], 1)
        best, offset = self._closest(selected[:, None], candidates, sample)
        partner = candidates.gather(1, best)[:, 0]
        back = self._owner[_nearest(self._tree, samples, facing)]
        best, back_offset = self._closest(back, torch.arange(len(back))[:, None], sample)
        back_partner = back.gather(1, best)[:, 0]
        union = nearest_primitive(scene, points)[0]
        along = torch.cat([(normals * facing[partner]).sum(1), (self._normals[back_partner] * facing).sum(1)])
        either = ~torch.cat([sides, self._sides[back_partner]]) & (along.abs() >= FIT.same)
        zeros, ones = torch.zeros(FIT.points, dtype=torch.float64), torch.ones(FIT.points, dtype=torch.float64)
        back_weights = torch.full((FIT.samples,), 0.5 / FIT.samples).double()
        return Pairs(
            torch.cat([points, self._points[back_partner], points]),
            torch.cat([samples[partner], samples, points]),
            torch.cat([facing[partner], facing, normals]),
            torch.cat([sample.slot[partner], sample.slot, union]),
            torch.cat([offset, back_offset, zeros]),
            torch.cat([ones / FIT.points, back_weights, 0.03 * ones / FIT.points]),
            torch.cat([either, torch.zeros(FIT.points).bool()]),
            torch.cat([torch.zeros(FIT.points + FIT.samples), ones]).bool(),
        )

    def _closest(
        self, at: Int[Tensor, "R k"], candidates: Int[Tensor, "R k"], sample: SurfaceSample
    ) -> tuple[Int[Tensor, "R 1"], Float[Tensor, " R"]]:
        """Which (R, 1) of several pairs (R, k) of points and samples is the best, and its squared penalty besides the
        distance along the normal."""
        facing, normals = sample.normals[candidates], self._normals[at]
        away = self._points[at] - sample.points[candidates]
        plane, cosine = (away * facing).sum(-1), (normals * facing).sum(-1)
        spacing = 1.5 * math.sqrt(self.evidence.area / min(FIT.samples, len(self._points)))
        along = ((away**2).sum(-1) - plane**2).clamp(min=0).sqrt() - spacing
        turned = torch.where(self._sides[at] & (cosine < 0), NEVER, 1 - cosine**2).clamp(min=0)
        known = (normals**2).sum(-1) > 0.25
        against = along.clamp(min=0) ** 2 + FIT.turned**2 * torch.where(known, turned, 0.0)
        best = (plane**2 + against).argmin(1, keepdim=True)
        return best, against.gather(1, best)[:, 0]


def pull(scene: Scene, pairs: Pairs, width: float) -> Pull:
    """Slope and curvature of the misfit, where residuals of ``width`` cells have a quarter of the weight."""
    fields = (scene.kind, scene.size, scene.centre, scene.rotation, scene.mask)
    single = Batch(*(field[pairs.slots][:, None] for field in fields))
    value, by_row, slope = (result[:, 0] for result in distance_and_slopes(single, pairs.points[:, None]))
    cosine = (slope * pairs.normals).sum(1)
    plane = ((pairs.points - pairs.samples) * pairs.normals).sum(1)
    same = (cosine >= FIT.same) | pairs.anywhere
    residual = torch.where(same, value, plane)
    # The opposite side of a part explains the point: a sheet is evidence for one side of a board, not for both.
    explained = pairs.either & ~same & (value.abs() < plane.abs() / 2)
    if len(off_face := (~same).nonzero()[:, 0]):  # the nearest point is on another face: use the plane at the sample
        samples = (pairs.samples + 1e-3 * pairs.normals)[off_face, None]
        by_row[off_face] = distance_and_slopes(single[off_face], samples)[1][:, 0]
    robust = (width**2 / (width**2 + residual**2 + pairs.offset)) ** 2
    weight = torch.where(explained, 0.0, pairs.weights * robust)
    count = len(scene.mask)
    result = Pull(by_row.new_zeros(count, ROW), by_row.new_zeros(count, ROW, ROW))
    order = torch.argsort(pairs.slots)
    counts = torch.bincount(pairs.slots, minlength=count).tolist()
    weighted = (weight[:, None] * by_row)[order].split(counts)
    for slot, (left, right, off) in enumerate(
        zip(weighted, by_row[order].split(counts), residual[order].split(counts), strict=True)
    ):
        result.slope[slot], result.curvature[slot] = off @ left, left.T @ right
    return result


def rows_of(scene: Scene, slots: Int[Tensor, " R"]) -> tuple[Batch, Float[Tensor, "R 16"]]:
    """The primitives in some slots as a batch (R, 1), and the sizes, centres and rotations to differentiate it by."""
    rows = torch.cat([scene.size, scene.centre, scene.rotation.flatten(-2)], -1)[slots].requires_grad_()
    size, centre, rotation = rows[:, None].split([SIZES, 3, 9], -1)
    kind, mask = scene.kind[slots][:, None], scene.mask[slots][:, None]
    return Batch(kind, size, centre, rotation.unflatten(-1, (3, 3)), mask), rows


def _joint(points: Float[Tensor, "P 3"], normals: Float[Tensor, "P 3"]) -> FloatArray:
    """Points and normals (P, 6), in which distances combine those of positions and of directions."""
    return torch.cat([points, FIT.turned / math.sqrt(2) * normals], 1).numpy()


def _nearest(tree: cKDTree, points: Float[Tensor, "P 3"], normals: Float[Tensor, "P 3"]) -> Int[Tensor, "P k"]:
    """The nearest members of a tree to points with normals."""
    return torch.from_numpy(tree.query(_joint(points, normals), FIT.partners)[1])
