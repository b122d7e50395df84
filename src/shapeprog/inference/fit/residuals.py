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
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import SurfaceSample, sample_surface
from shapeprog.inference.choice.bits import nearby
from shapeprog.inference.fit import residual_kernels as kernels
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.fit.tunable import ROW
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.space import Array, FloatArray


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
        self._owner: Array = np.concatenate([np.arange(len(sides)), unsure])
        both = _joint(evidence.points, normals), _joint(evidence.points[unsure], -normals[unsure])
        self._tree = cKDTree(np.concatenate(both), 24, balanced_tree=False)  # faster than by default

    def pairs(self, scene: Scene, generator: torch.Generator) -> Pairs:
        """Pairs both ways, drawn at random: from points to the program, and from its surface to points.

        Plain distances of points to the union have little weight: they alone determine how far a part reaches along a
        sheet that has no edges.
        """
        sample = sample_surface(scene, FIT.samples, generator)
        samples, facing = sample.points, sample.normals
        spacing = 1.5 * math.sqrt(self.evidence.area / min(FIT.samples, len(self._points)))
        jitter = torch.rand(FIT.points, generator=generator, dtype=torch.float64).numpy()
        stratum = self._shares[-1] / FIT.points  # evenly over the surface
        thresholds = (np.arange(FIT.points) + jitter) * stratum
        selected = self._order[np.searchsorted(self._shares, thresholds).clip(0, len(self._points) - 1)]
        points, normals, sides = self._points[selected], self._normals[selected], self._sides[selected]
        tree = cKDTree(_joint(samples.numpy(), facing.numpy()))
        candidates = tree.query(_joint(points.numpy(), normals.numpy()), FIT.partners)[1]
        behind = candidates.copy()
        unsure = ~sides.numpy()
        behind[unsure] = tree.query(_joint(points.numpy()[unsure], -normals.numpy()[unsure]), FIT.partners)[1]
        candidates = np.concatenate([candidates, behind], 1)
        offset, best = self._closest(np.broadcast_to(selected[:, None], candidates.shape), candidates, sample, spacing)
        partner = np.take_along_axis(candidates, best, 1)[:, 0]
        back = self._owner[self._tree.query(_joint(samples.numpy(), facing.numpy()), FIT.partners)[1]]
        rows = np.broadcast_to(np.arange(len(back))[:, None], back.shape)
        back_offset, best = self._closest(back, rows, sample, spacing)
        back_partner = np.take_along_axis(back, best, 1)[:, 0]
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
        self, at: Array, candidates: Array, sample: SurfaceSample, spacing: float
    ) -> tuple[Float[Tensor, " R"], Array]:
        """The best (R, 1) of several pairs (R, k) of points and samples, and its squared penalty besides the distance
        along the normal."""
        offset, best = np.empty(len(at)), np.empty(len(at), np.int64)
        points = (tensor.numpy() for tensor in (self._points, self._normals, self._sides))
        samples = (sample.points.numpy(), sample.normals.numpy())
        at, candidates = np.ascontiguousarray(at), np.ascontiguousarray(candidates)
        kernels.closest(*points, at, *samples, candidates, spacing, FIT.turned, 1e9, offset, best)
        return torch.from_numpy(offset), best[:, None]


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
    rows = (tensor.contiguous().numpy() for tensor in (by_row, weight, residual, pairs.slots))
    kernels.gathered(*rows, *(tensor.numpy() for tensor in result))
    return result


def rows_of(scene: Scene, slots: Int[Tensor, " R"]) -> tuple[Batch, list[Tensor]]:
    """The primitives in some slots as a batch (R, 1), and its sizes, centres and rotations to differentiate by."""
    size, centre, rotation = (
        tensor[slots][:, None].clone().requires_grad_() for tensor in (scene.size, scene.centre, scene.rotation)
    )
    single = Batch(scene.kind[slots][:, None], size, centre, rotation, scene.mask[slots][:, None])
    return single, [size, centre, rotation]


def _joint(points: FloatArray, normals: FloatArray) -> FloatArray:
    """Points and normals (P, 6), in which distances combine those of positions and of directions."""
    return np.concatenate([points, FIT.turned / math.sqrt(2) * normals], 1)
