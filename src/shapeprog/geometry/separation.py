"""Gaps between oriented boxes, by the separating axis theorem (Gottschalk, Lin and Manocha 1996)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shapeprog.space import Array, FloatArray


class OrientedBoxes(NamedTuple):
    """The centres (N, 3) of boxes, and the vectors (N, 3, 3) from there to the middles of three faces, in cells."""

    centre: FloatArray
    edges: FloatArray


def normals(boxes: OrientedBoxes, first: Array, second: Array) -> FloatArray:
    """Directions (C, 15, 3) of which one separates a pair of boxes if they are apart: normals of faces, and of pairs of
    edges, those that are parallel as zeros."""
    axes = boxes.edges / np.maximum(np.linalg.norm(boxes.edges, axis=2, keepdims=True), 1e-9)
    crosses = np.cross(axes[first][:, :, None], axes[second][:, None]).reshape(-1, 9, 3)
    length = np.linalg.norm(crosses, axis=2, keepdims=True)
    crosses = np.where(length > 1e-6, crosses / np.maximum(length, 1e-9), 0.0)
    return np.concatenate([axes[first], axes[second], crosses], 1)


def gaps(boxes: OrientedBoxes, first: Array, second: Array) -> FloatArray:
    """Gaps (C,) between pairs of boxes along the direction that separates them most, negative where they overlap."""
    along = normals(boxes, first, second)
    away = np.abs(np.einsum("cki,ci->ck", along, boxes.centre[second] - boxes.centre[first]))
    reach = sum(np.abs(np.einsum("cki,cai->cka", along, boxes.edges[pair])).sum(2) for pair in (first, second))
    result: FloatArray = np.where(along.any(2), away - reach, -np.inf).max(1)
    return result


def touching(boxes: OrientedBoxes, within: float) -> tuple[Array, Array]:
    """Pairs (C,) of boxes with a gap less than ``within``."""
    reach = np.abs(boxes.edges).sum(1)
    apart = np.abs(boxes.centre[:, None] - boxes.centre) - reach[:, None] - reach
    first, second = np.nonzero(np.triu(apart.max(2) < within, 1))
    touch = gaps(boxes, first, second) < within
    return first[touch], second[touch]
