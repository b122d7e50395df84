"""A surface as points with normals and nearest neighbours.

In a clean scan, more points resolve thin parts and edges better.  In a noisy one, points closer to each other than the
noise give no direction, so fewer are better.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from shapeprog.data.shape import Shape
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.space import Array, FloatArray, IntArray


class Cloud(NamedTuple):
    """Points (N, 3) on a surface with unit normals (N, 3) of either sign, nearest neighbours (N, k), spacing and noise.

    ``spacing`` is the square root of the area per point; ``noise`` the distance of points from their planes, in cells.
    """

    points: FloatArray
    normals: FloatArray
    neighbours: npt.NDArray[np.int32]
    spacing: float
    noise: float

    @property
    def tolerance(self) -> float:
        """Distance in cells within which a point is on a plane or a cylinder."""
        return float(np.clip(2.5 * self.noise, 0.06, 0.4))


def cloud_of(points: Array, normals: Array | None = None) -> Cloud:
    """The cloud of points in cells, at least one.

    Without normals, they are those of planes through nearest neighbours, and noise is the distance from these planes;
    else it is that from the planes of neighbours with similar normals.
    """
    points = np.ascontiguousarray(points, np.float64)
    around = (SURFACE.around if normals is None else SURFACE.nearest) + 1
    distance, neighbours = cKDTree(points).query(points, k=range(1, min(around, len(points)) + 1), workers=2)
    spacing = max(float(np.median(distance[:, -1])) * (np.pi / neighbours.shape[1]) ** 0.5, SURFACE.closest)
    nearest = neighbours[:, 1 : SURFACE.nearest + 1]
    if normals is None:
        normals, squared = planes(points, neighbours)
        noise = np.sqrt(np.median(squared) / neighbours.shape[1])
    else:
        parallel = np.abs(np.einsum("nki,ni->nk", normals[nearest], normals)) > 0.98
        off = np.abs(np.einsum("nki,ni->nk", points[nearest] - points[:, None], normals))[parallel]
        noise = np.median(off) if len(off) else 0.0
    return Cloud(points, normals, np.ascontiguousarray(nearest, np.int32), spacing, float(noise))


def projected(points: FloatArray) -> FloatArray:
    """Points (N, 3) projected repeatedly onto weighted planes through their neighbours (Alexa et al. 2003)."""
    for _ in range(2):
        distance, neighbours = cKDTree(points).query(points, k=min(24, len(points)))
        normals, _ = planes(points, neighbours)
        weight = np.exp(-((distance / np.maximum(distance[:, -1:] / 2, SURFACE.closest)) ** 2))[..., None]
        middle = (points[neighbours] * weight).sum(1) / weight.sum(1)
        points = points - ((points - middle) * normals).sum(1)[:, None] * normals
    return points


def planes(points: FloatArray, neighbours: IntArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (N, 3) of the best planes through neighbours (N, k), and sums (N,) of squared distances."""
    off = points[neighbours]
    off -= off.mean(1, keepdims=True)
    squared, axes = np.linalg.eigh(off.transpose(0, 2, 1) @ off)
    return np.ascontiguousarray(axes[:, :, 0]), np.maximum(squared[:, 0], 0)


def points_of_scan(shape: Shape) -> FloatArray:
    """The points (P, 3) of a shape given as points: all of a clean scan, the default number of others."""
    clean = shape.scan is not None and is_clean(np.asarray(shape.scan, np.float64))
    return np.asarray(shape.scan if clean else shape.points, np.float64)


def is_clean(points: FloatArray) -> bool:
    """Whether the flattest tenth of points (P, 3) lies within .02 cells of planes with seven neighbours."""
    if len(points) <= 8:
        return False
    _, squared = planes(points, cKDTree(points).query(points, k=8)[1])
    return bool(np.quantile(np.sqrt(squared / 5), 0.1) < 0.02)


def spiral(height: FloatArray) -> FloatArray:
    """Unit vectors (N, 3) whose first coordinates are evenly spaced heights (N,), spread evenly (Vogel 1979)."""
    turn = np.arange(len(height)) * np.pi * (3 - 5**0.5)
    around = np.sqrt(1 - height**2)
    return np.stack([height, around * np.cos(turn), around * np.sin(turn)], 1)
