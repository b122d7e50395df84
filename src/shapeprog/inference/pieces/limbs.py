"""Limbs: long or flat parts of a solid, straight or bent, detected from the balls that fit in it.

The largest ball inside a solid that touches its surface at a point (the shrinking ball of Ma, Bae and Choi 2012) has
its centre on the middle line of a bar and on the middle sheet of a board.  Where these centres continue in one
direction, their points are one limb; where a leg meets a seat, the direction ends.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from shapeprog.geometry.contacts import linked
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.surface.cloud import Cloud
from shapeprog.inference.surface.oriented import Boxes, boxes_around
from shapeprog.space import FloatArray, IntArray


def limbs(cloud: Cloud) -> Boxes:
    """Boxes around the limbs with the most points."""
    which: IntArray = np.arange(0, len(cloud.points), -(-len(cloud.points) // SETTINGS.tested))
    centre, radius = _inner_balls(cloud, which)
    fine = (radius > 0) & (radius < SETTINGS.ball_radius)
    which, centre, radius = which[fine], centre[fine], radius[fine]
    if not len(which):
        return boxes_around([])
    name, centre, radius = _merged(centre, radius)
    count = min(SETTINGS.limb_neighbours, len(centre))
    distance, nearest = cKDTree(centre).query(centre, k=range(1, count + 1), workers=2)
    reach = 2 * radius[:, None] + 2.5 * SETTINGS.merged
    close = (distance < reach) & (np.abs(np.log(radius[nearest] / radius[:, None])) < 2 * SETTINGS.merged)
    weight = close.astype(np.float64)[..., None]
    off = (centre[nearest] - (centre[nearest] * weight).sum(1, keepdims=True) / weight.sum(1, keepdims=True)) * weight
    spread, axes = np.linalg.eigh(off.transpose(0, 2, 1) @ off)
    spread = np.sqrt(np.maximum(spread, 0))
    line = spread[:, 1] < SETTINGS.linear * spread[:, 2]
    sheet = ~line & (spread[:, 0] < SETTINGS.linear * spread[:, 1])
    found: list[IntArray] = []
    for kind, direction in ((line, axes[:, :, 2]), (sheet, axes[:, :, 0])):
        facing = np.abs(np.einsum("nki,ni->nk", direction[nearest], direction)) > np.cos(np.radians(SETTINGS.bend))
        i, k = np.nonzero(close & facing & kind[:, None] & kind[nearest])
        of_point = linked(np.stack([i, nearest[i, k]], 1), len(nearest))[name]
        found += [which[of_point == label] for label in np.flatnonzero(np.bincount(of_point) >= SETTINGS.limb_points)]
    return boxes_around([cloud.points[limb] for limb in sorted(found, key=len, reverse=True)[: SETTINGS.limbs]])


def _merged(centre: FloatArray, radius: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Balls with about the same centre and radius merged: the new index of each, new centres and radii."""
    cells = np.column_stack([centre / SETTINGS.merged, np.log(radius) / SETTINGS.merged])
    _, name, count = np.unique(np.round(cells).astype(np.int64), axis=0, return_inverse=True, return_counts=True)
    name = name.reshape(-1)
    mean = [np.bincount(name, column) / count for column in (*centre.T, radius)]
    return name, np.stack(mean[:3], 1), mean[3]


def _inner_balls(cloud: Cloud, which: IntArray) -> tuple[FloatArray, FloatArray]:
    """Centres (N, 3) and radii (N,) of the largest empty balls that touch the surface at some of its points."""
    tree = cKDTree(cloud.points)
    points = np.concatenate([cloud.points[which]] * 2)
    normals = np.concatenate([cloud.normals[which], -cloud.normals[which]])
    radius = np.full(len(points), SETTINGS.ball_radius)
    for _ in range(8):  # shrunk until it is empty
        distance, nearest = tree.query(points - normals * radius[:, None], workers=2)
        off = points - cloud.points[nearest]
        along, square = np.einsum("ni,ni->n", off, normals), np.einsum("ni,ni->n", off, off)
        smaller = (distance < radius * 0.98 - 0.01) & (along > 0.15 * np.sqrt(square)) & (square > 1e-8)
        np.divide(square, 2 * along, out=radius, where=smaller)
    half = len(which)  # the smaller of the two balls at a point: normals have either sign, and furniture is thin
    better = np.where(radius[:half] <= radius[half:], 0, half) + np.arange(half)
    return points[better] - normals[better] * radius[better, None], radius[better]
