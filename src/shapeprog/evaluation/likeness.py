"""How alike two surfaces look: F-scores at fine distances, normals, and outlines from all around.

All lengths are shares of the diagonal of the bounding box of the target.

F1
    F-score of points drawn uniformly by area from each surface, at .5 % and at 1 %.
Normals
    Mean absolute cosine between the normals of nearest points, mean of both ways.
Silhouette
    Mean IoU of 12 orthographic outlines of 256 x 256 pixels, drawn within the sphere about the target's box.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from shapeprog.data.sampling import sample_with_faces
from shapeprog.evaluation.outline_kernels import draw_outline
from shapeprog.geometry.mesh import triangle_normals
from shapeprog.geometry.nearest import nearest
from shapeprog.space import Array

POINTS = 20_000
"""Points drawn on each surface."""

HALF_PERCENT, PERCENT = 0.005, 0.01
"""Distances within which a point counts as found."""

VIEWS = [(turn, rise) for rise in (0.0, 0.5, -0.35) for turn in (0.0, math.pi / 2, 0.6, 2.2)]
"""Directions of view: turn about the upright axis and rise above the horizon, in radians."""

PIXELS = 256
"""Side of an outline in pixels."""

MARGIN = 2
"""Pixels left free around the sphere about the target."""


class Triangles(NamedTuple):
    """A mesh: vertices (V, 3) in the grid frame and triangles (F, 3)."""

    vertices: npt.NDArray[np.floating]
    faces: npt.NDArray[np.integer]


class Samples(NamedTuple):
    """Points (P, 3) of a surface, and their unit normals (P, 3) where these are known."""

    points: Array
    normals: Array | None = None


class Likeness(NamedTuple):
    """How alike two sampled surfaces are; see the module."""

    f1_half_percent: float
    f1_percent: float
    normals: float


NOTHING = Likeness(0.0, 0.0, 0.0)
"""The likeness of a prediction that has no surface."""


def box(points: Array) -> tuple[Array, float]:
    """Centre and diagonal of a bounding box."""
    low, high = points.min(0), points.max(0)
    return (low + high) / 2, float(np.linalg.norm(high - low))


def sampled(mesh: Triangles, seed: int, count: int = POINTS) -> Samples:
    """Points uniform by area on a mesh, with the normals of their triangles."""
    points, face = sample_with_faces(mesh.vertices, mesh.faces, count, seed)
    _, normals = triangle_normals(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)[face])
    return Samples(points.astype(np.float64), normals)


def likeness(predicted: Samples, target: Samples, diagonal: float) -> Likeness:
    """F-scores and agreement of normals of two sampled surfaces, ``diagonal`` being that of the target's box."""
    to_target, target_index = _nearest(predicted.points, target.points)
    to_predicted, predicted_index = _nearest(target.points, predicted.points)

    def f1(reach: float) -> float:
        precision, recall = ((distance <= reach * diagonal).mean() for distance in (to_target, to_predicted))
        return float(2 * precision * recall / (precision + recall)) if precision + recall else 0.0

    agreement = math.nan
    if predicted.normals is not None and target.normals is not None:
        cosines = (
            (predicted.normals * target.normals[target_index]).sum(1),
            (target.normals * predicted.normals[predicted_index]).sum(1),
        )
        agreement = float(np.mean([np.abs(cosine).mean() for cosine in cosines]))
    return Likeness(f1(HALF_PERCENT), f1(PERCENT), agreement)


def silhouette(predicted: Triangles, target: Triangles) -> float:
    """Mean IoU of the outlines of two meshes from all ``VIEWS``; axis 0 is up."""
    used = np.asarray(target.vertices, np.float64)[np.unique(target.faces)]
    centre, diagonal = box(used)
    ratios = []
    for turn, rise in VIEWS:
        towards = np.array([math.sin(rise), math.cos(rise) * math.cos(turn), math.cos(rise) * math.sin(turn)])
        across = np.cross([1.0, 0.0, 0.0], towards)
        across /= np.linalg.norm(across)
        axes = np.stack([across, np.cross(towards, across)], 1)
        first, second = (_outline(mesh, centre, axes, diagonal) for mesh in (predicted, target))
        ratios.append((first & second).sum() / max((first | second).sum(), 1))
    return float(np.mean(ratios))


def _outline(mesh: Triangles, centre: Array, axes: Array, diagonal: float) -> Array:
    scale = (PIXELS / 2 - MARGIN) / max(diagonal / 2, 1e-30)
    pixel_positions = (np.asarray(mesh.vertices, np.float64) - centre) @ axes * scale + PIXELS / 2
    pixels = np.zeros((PIXELS, PIXELS), np.uint8)
    draw_outline(np.ascontiguousarray(pixel_positions), np.ascontiguousarray(mesh.faces, np.int64), pixels)
    return pixels


def _nearest(queries: Array, points: Array) -> tuple[Array, Array]:
    """Distance and index of the nearest point of each query."""
    index = nearest(torch.from_numpy(queries), torch.from_numpy(points)).numpy()
    return np.linalg.norm(queries - points[index], axis=1), index
