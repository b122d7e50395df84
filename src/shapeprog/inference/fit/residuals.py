"""Distances between the surfaces of a program and of a target, pair by pair, and the step that reduces them.

A point of the target and a sample of the program's surface are a pair when they are close and their normals fit.  The
residual of a pair is the distance from the point to the surface around the sample, along its normal: sliding along a
face costs nothing.  Points that no part explains have no partner nearby, and their weight vanishes (Geman & McClure
1987).
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree
from torch import Tensor

from shapeprog.geometry.distance import nearest_primitive, signed_distance, slopes_to_slots
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.choice.bits import nearby
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.fit.tunable import Poses
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.space import FloatArray, IntArray

NEVER = 1e9  # penalty of a pair whose normals are known to face opposite ways

Vectors = TypeVar("Vectors", FloatArray, Tensor)


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
        self._known = _dot(evidence.normals, evidence.normals) > 0.25
        self._order = np.argsort(nearby(evidence.points), kind="stable")
        self._shares = np.cumsum(evidence.weights[self._order])
        unsure = np.flatnonzero(~evidence.outward)
        self._owner = np.concatenate([np.arange(len(evidence.points)), unsure])
        both = (evidence.points, evidence.normals), (evidence.points[unsure], -evidence.normals[unsure])
        # Faster than by default.
        self._tree = cKDTree(np.concatenate([_joint(*pair) for pair in both]), 24, balanced_tree=False)

    def pairs(self, scene: Scene, generator: torch.Generator) -> Pairs:
        """Pairs both ways, drawn at random: from points to the program, and from its surface to points.

        Plain distances of points have little weight: they alone fix how far a part reaches along an endless sheet.
        """
        evidence, count = self.evidence, FIT.pairs
        sample = sample_surface(scene, count, generator)
        samples, facing = sample.points.numpy(), sample.normals.numpy()
        jitter = torch.rand(count, generator=generator, dtype=torch.float64).numpy()
        stratum = self._shares[-1] / count  # evenly over the surface
        place = np.searchsorted(self._shares, (np.arange(count) + jitter) * stratum).clip(0, len(self._order) - 1)
        drawn = self._order[place]
        points, normals = evidence.points[drawn], evidence.normals[drawn]
        tree = cKDTree(_joint(samples, facing))
        candidates = _nearest(tree, points, normals)
        if len(unsure := np.flatnonzero(~evidence.outward[drawn])):
            behind = candidates.copy()
            behind[unsure] = _nearest(tree, points[unsure], -normals[unsure])
            candidates = np.concatenate([candidates, behind], 1)
        there = self._closest(drawn[:, None], candidates, samples, facing)
        owners = self._owner[_nearest(self._tree, samples, facing)]
        back = self._closest(owners, np.arange(count)[:, None], samples, facing)
        paired, partner, offset = map(np.concatenate, zip(there, back, strict=True))
        every, normals = np.concatenate([paired, drawn]), np.concatenate([facing[partner], normals])
        along = _dot(evidence.normals[every], normals)
        nearest = nearest_primitive(scene, torch.from_numpy(points))[0].numpy()
        weights = np.array([1 / count, 0.5 / count, 0.03 / count])
        fields = {
            "points": evidence.points[every],
            "samples": np.concatenate([samples[partner], points]),
            "normals": normals,
            "slots": np.concatenate([sample.slot.numpy()[partner], nearest]),
            "offset": np.pad(offset, (0, count)),
            "weights": np.repeat(weights, count),
            "either": ~evidence.outward[every] & (np.abs(along) >= FIT.same),
            "anywhere": np.arange(len(every)) >= len(paired),
        }
        return Pairs(**{name: torch.from_numpy(values) for name, values in fields.items()})

    def _closest(
        self, points: IntArray, samples: IntArray, places: FloatArray, facing: FloatArray
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """The best of pairs (R, k) of points and of samples, at ``places`` (S, 3) and ``facing`` (S, 3) that way, and
        its squared penalty besides the distance along the normal.  One of a pair may be the same for all."""
        evidence = self.evidence
        normals, sides = evidence.normals.take(points, 0), facing.take(samples, 0)
        away = evidence.points.take(points, 0) - places.take(samples, 0)
        plane, cosine = _dot(away, sides), _dot(normals, sides)
        spacing = 1.5 * math.sqrt(evidence.area / min(FIT.pairs, len(evidence.points)))
        along = np.sqrt(np.maximum(_dot(away, away) - plane**2, 0)) - spacing
        turned = np.where(evidence.outward[points] & (cosine < 0), NEVER, np.maximum(1 - cosine**2, 0))
        against = np.maximum(along, 0) ** 2 + FIT.turned**2 * np.where(self._known[points], turned, 0.0)
        best = np.arange(len(against)), (plane**2 + against).argmin(1)
        point, partner = (np.broadcast_to(item, against.shape)[best] for item in (points, samples))
        return point, partner, against[best]


def of_target(poses: Poses, pairs: Pairs, width: float) -> System:
    """The misfit of pairs to second order in the numbers; residuals of ``width`` cells have a quarter of the weight."""
    value, by_row, slope = slopes_to_slots(poses.scene, pairs.slots, pairs.points)
    cosine = _dot(slope, pairs.normals)
    plane = _dot(pairs.points - pairs.samples, pairs.normals)
    same = (cosine >= FIT.same) | pairs.anywhere
    residual = torch.where(same, value, plane)
    # The opposite side of a part explains the point: a sheet is evidence for one side of a board, not for both.
    explained = pairs.either & ~same & (value.abs() < plane.abs() / 2)
    if len(off_face := (~same).nonzero()[:, 0]):  # the nearest point is on another face: use the plane at the sample
        samples = (pairs.samples + 1e-3 * pairs.normals)[off_face]
        by_row[off_face] = slopes_to_slots(poses.scene, pairs.slots[off_face], samples)[1]
    robust = (width**2 / (width**2 + residual**2 + pairs.offset)) ** 2
    weight = torch.where(explained, 0.0, pairs.weights * robust)
    order, by_number = torch.argsort(pairs.slots), poses.slopes
    counts = torch.bincount(pairs.slots, minlength=len(by_number)).tolist()
    columns = (column[order].split(counts) for column in (weight[:, None] * by_row, by_row, residual))
    systems = [(off @ weighted, weighted.T @ plain) for weighted, plain, off in zip(*columns, strict=True)]
    by_slot, curvature = map(torch.stack, zip(*systems, strict=True))
    return (by_number * by_slot[..., None]).sum((0, 1)), (by_number.mT @ curvature @ by_number).sum(0)


def closeness(scene: Scene, surface: cKDTree, seed: int) -> float:
    """The F-score of the surfaces of a scene and of a target: how much of each lies near the other.

    The squared misfit assumes that points are assigned to the right parts.  For thin parts and sheets they may not be;
    the misfit can then fall while a part leaves its surface.  The points of both are the same for the same seed.
    """
    reach = FIT.near * float(np.linalg.norm(surface.maxes - surface.mins))
    points = torch.from_numpy(surface.data[np.random.default_rng(seed).integers(0, surface.n, FIT.compared)])
    recall = float((signed_distance(scene, points).abs() <= reach).double().mean())
    sample = sample_surface(scene, FIT.compared, torch.Generator().manual_seed(seed))
    precision = float(np.isfinite(surface.query(sample.points.numpy(), distance_upper_bound=reach)[0]).mean())
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def _dot(first: Vectors, second: Vectors) -> Vectors:
    """Dot products of vectors (..., 3), in a fifth of the time of sums over short rows."""
    product = first * second
    return product[..., 0] + product[..., 1] + product[..., 2]


def _joint(points: FloatArray, normals: FloatArray) -> FloatArray:
    """Points and normals (P, 6), in which distances combine those of positions and of directions."""
    return np.concatenate([points, FIT.turned / math.sqrt(2) * normals], 1)


def _nearest(tree: cKDTree, points: FloatArray, normals: FloatArray) -> IntArray:
    """The nearest members (P, k) of a tree to points with normals."""
    return np.asarray(tree.query(_joint(points, normals), FIT.partners)[1])
