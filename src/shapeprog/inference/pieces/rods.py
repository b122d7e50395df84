"""Round rods among points with normals."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.pieces.oriented import Boxes, join
from shapeprog.inference.pieces.patches import upright
from shapeprog.inference.pieces.rod_kernels import mark_rod, try_rods
from shapeprog.inference.surface.cloud import NOISY, Cloud, tolerance
from shapeprog.space import Array, FloatArray

TRIALS, STEPS = 1200, 8
"""Pairs of points tried, and the longest walk from one to the other."""

LARGEST = 5.0
"""Largest radius in cells."""

ROUND = 0.6
"""Smallest share of the sectors around a rod with points."""

DENSE = 0.5
"""Smallest number of points of a rod, as a share of the expected number on its surface."""

LEAST = 24
"""Points of the smallest rod."""

MOST = 60
"""Largest number of rods."""


def rods(cloud: Cloud, seed: int = 0) -> Boxes:
    """Boxes around round rods, best first; the first axis is that of the rod."""
    draws = np.random.default_rng(seed).integers(1 << 32, size=(TRIALS, STEPS))
    off, facing = tolerance(cloud), 0.85 if cloud.noise > NOISY else 0.94
    tried = np.zeros((TRIALS, 10))
    try_rods(cloud.points, cloud.normals, cloud.neighbours, draws, off, facing, LARGEST, tried)
    support, radius, length = tried[:, 0], tried[:, 7], 2 * tried[:, 8]
    expected = 2 * np.pi * radius * length * tried[:, 9] / cloud.spacing**2
    good = (support >= LEAST) & (tried[:, 9] >= ROUND) & (length > 2 * radius) & (support > DENSE * expected)
    order = np.flatnonzero(good)[np.argsort(-support[good], kind="stable")]
    used = np.zeros(len(cloud.points), np.bool_)
    result: list[Boxes] = []
    for row in tried[order]:
        if len(result) == MOST:
            break
        middle, axis, width, half = row[1:4], row[4:7], float(row[7]), float(row[8])
        inside = on_rod(cloud, middle, axis, width, half, off, facing)
        if len(inside) < LEAST or used[inside].mean() > 0.5:
            continue
        for _ in range(2):
            middle, axis, width, half = fitted(cloud, inside, axis)
            inside = on_rod(cloud, middle, axis, width, half + 0.5, off, facing)
            if len(inside) < LEAST:
                break
        else:
            middle, axis, width, half = fitted(cloud, inside, axis)
            used[inside] = True
            frame = upright(axis[None])[0][:, [2, 0, 1]]
            result.append(Boxes(middle[None], frame[None], np.array([[half, width, width]])))
    return join(result)


def on_rod(
    cloud: Cloud, middle: Array, axis: Array, radius: float, half: float, off: float, facing: float
) -> npt.NDArray[np.int64]:
    """The points on a cylinder that face across its axis."""
    inside = np.zeros(len(cloud.points), np.bool_)
    line = np.ascontiguousarray(middle), np.ascontiguousarray(axis)
    mark_rod(cloud.points, cloud.normals, *line, radius, half, off, facing, inside)
    return np.flatnonzero(inside)


def fitted(
    cloud: Cloud, inside: npt.NDArray[np.int64], axis: FloatArray
) -> tuple[FloatArray, FloatArray, float, float]:
    """Middle, axis, radius and half length of the cylinder that fits points best.

    The axis is the direction that the normals are least along; the circle is Kasa's (1976).
    """
    normals, points = cloud.normals[inside], cloud.points[inside]
    better = np.linalg.eigh(normals.T @ normals)[1][:, 0]
    better *= np.sign(better @ axis)
    frame = upright(better[None])[0]
    better, across = frame[:, 2], frame[:, :2]
    mean = points.mean(0)
    flat = (points - mean) @ across
    solved = np.linalg.lstsq(np.column_stack([2 * flat, np.ones(len(flat))]), (flat**2).sum(1), rcond=None)[0]
    radius = float(np.sqrt(max(solved[2] + solved[:2] @ solved[:2], 0.0)))
    along = (points - mean) @ better
    low, high = along.min(), along.max()
    return mean + across @ solved[:2] + better * (low + high) / 2, better, radius, float(high - low) / 2
