"""Strands: thin stretches of a scan, found by how its points lie and not by their normals, which noise spoils.

Around a point on a thin leg all points within some distance lie along one direction.  Where neighbours agree on it,
they are one strand.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from shapeprog.inference.surface.cloud import Cloud
from shapeprog.space import FloatArray

COUNT = 4000
"""Points that may belong to strands."""

REACHES = (1.5, 3.0)
"""Distances in cells within which points are looked at: thin legs, and thicker ones."""

LINEAR = 0.4
"""Standard deviation across a strand, as a share of that along it, at most."""

BEND = 15.0
"""Degrees between the directions of neighbours in one strand, at most."""

LEAST = 16
"""Points of the smallest strand."""

GAP, ASIDE = 6.0, 0.6
"""Cells between the ends of two strands, and between the lines that they lie on, up to which they may be one."""


def strands(cloud: Cloud) -> list[npt.NDArray[np.int64]]:
    """The points of each strand, as indices of the cloud, largest first."""
    which = np.arange(0, len(cloud.points), -(-len(cloud.points) // COUNT), dtype=np.int64)
    points = cloud.points[which]
    tree, found = cKDTree(points), list[npt.NDArray[np.int64]]()
    for reach in REACHES:
        pairs = tree.query_pairs(reach, output_type="ndarray")
        one, two = np.concatenate([pairs, pairs[:, ::-1]]).T
        count = np.bincount(one, minlength=len(points)) + 1.0
        off = points[two] - points[one]
        middle = np.stack([np.bincount(one, column, len(points)) for column in off.T], 1) / count[:, None]
        square = np.stack([np.bincount(one, off[:, i] * off[:, k], len(points)) for i in range(3) for k in range(3)], 1)
        spread, axes = np.linalg.eigh(
            square.reshape(-1, 3, 3) / count[:, None, None] - middle[:, :, None] * middle[:, None]
        )
        thin = np.sqrt(np.maximum(spread[:, 1], 0)) < LINEAR * np.sqrt(np.maximum(spread[:, 2], 0))
        along = axes[:, :, 2]
        same = np.abs(np.einsum("pi,pi->p", along[pairs[:, 0]], along[pairs[:, 1]])) > np.cos(np.radians(BEND))
        first, second = pairs[same & thin[pairs].all(1)].T
        graph = coo_matrix((np.ones(len(first), np.bool_), (first, second)), shape=(len(points), len(points)))
        _, label = connected_components(graph, directed=False)
        mine = [which[label == each] for each in np.flatnonzero(np.bincount(label) >= LEAST)]
        found += [*mine, *in_line(cloud.points, mine)]
    return sorted(found, key=len, reverse=True)


def in_line(points: FloatArray, found: Sequence[npt.NDArray[np.int64]]) -> list[npt.NDArray[np.int64]]:
    """Stretches that continue each other, as one: a rail or a shelf may meet a leg half-way up."""
    if len(found) < 2:
        return []
    lines = [_line(points[each]) for each in found]
    middle, along = (np.stack([line[k] for line in lines]) for k in (0, 1))
    half = np.array([line[2] for line in lines])
    away = middle[None] - middle[:, None]
    ahead = np.einsum("ijc,ic->ij", away, along)
    aside = np.linalg.norm(away - ahead[..., None] * along[:, None], axis=2)
    straight = np.abs(along @ along.T) > np.cos(np.radians(BEND))
    one, two = np.nonzero(np.triu(straight & (np.maximum(aside, aside.T) < ASIDE), 1))
    near = np.abs(ahead[one, two]) - half[one] - half[two] < GAP
    edges = np.ones(near.sum(), np.bool_), (one[near], two[near])
    _, label = connected_components(coo_matrix(edges, shape=(len(found),) * 2), directed=False)
    many = np.flatnonzero(np.bincount(label, minlength=1) > 1)
    return [np.concatenate([found[k] for k in np.flatnonzero(label == each).tolist()]) for each in many]


def _line(points: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """The middle of points, the direction in which they lie, and how far they reach."""
    middle = points.mean(0)
    along = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    return middle, along, float(np.abs((points - middle) @ along).max())
