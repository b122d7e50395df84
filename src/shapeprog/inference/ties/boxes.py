"""Oriented boxes around primitives, and the gaps between them.

Vectors are those of a person in front of the whole: to the right, to the rear, upwards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shapeprog.geometry.scene import Scene
from shapeprog.inference.ties.settings import TIES
from shapeprog.space import Array, FloatArray


class Boxes(NamedTuple):
    """The centres (N, 3), and the vectors (N, 3, 3) from there to the middles of three faces, in cells."""

    centre: FloatArray
    edges: FloatArray


def boxes_of(scene: Scene) -> Boxes:
    """The boxes around the primitives of a scene (N,)."""
    edges = scene.rotation.transpose(1, 2) * scene.bounds[..., None]
    return Boxes(viewed(scene.centre.numpy()), viewed(edges.numpy()))


def viewed(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 3) along the axes of the grid as those of a person in front of the whole."""
    result: FloatArray = vectors[..., ::-1] * [-1, 1, 1]
    return result


def normals(boxes: Boxes, first: Array, second: Array) -> FloatArray:
    """Directions (C, 15, 3) of which one separates a pair of boxes if they are apart: normals of faces, and of pairs of
    edges, those that are parallel as zeros (separating axis theorem, Gottschalk, Lin and Manocha 1996)."""
    axes = boxes.edges / np.maximum(np.linalg.norm(boxes.edges, axis=2, keepdims=True), 1e-9)
    crosses = np.cross(axes[first][:, :, None], axes[second][:, None]).reshape(-1, 9, 3)
    length = np.linalg.norm(crosses, axis=2, keepdims=True)
    crosses = np.where(length > 1e-6, crosses / np.maximum(length, 1e-9), 0.0)
    return np.concatenate([axes[first], axes[second], crosses], 1)


def gaps(boxes: Boxes, first: Array, second: Array) -> FloatArray:
    """Gaps (C,) between pairs of boxes along the direction that separates them most, negative where they overlap."""
    along = normals(boxes, first, second)
    away = np.abs(np.einsum("cki,ci->ck", along, boxes.centre[second] - boxes.centre[first]))
    reach = sum(np.abs(np.einsum("cki,cai->cka", along, boxes.edges[pair])).sum(2) for pair in (first, second))
    result: FloatArray = np.where(along.any(2), away - reach, -np.inf).max(1)
    return result


def touching(boxes: Boxes) -> tuple[Array, Array]:
    """Pairs (C,) of boxes that touch."""
    reach = np.abs(boxes.edges).sum(1)
    apart = np.abs(boxes.centre[:, None] - boxes.centre) - reach[:, None] - reach
    first, second = np.nonzero(np.triu(apart.max(2) < TIES.touch, 1))
    touch = gaps(boxes, first, second) < TIES.touch
    return first[touch], second[touch]
