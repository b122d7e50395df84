"""Gaps between oriented boxes, by the separating axis theorem (Gottschalk, Lin and Manocha 1996)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shapeprog.geometry.arrays import array
from shapeprog.geometry.batch import Batch
from shapeprog.space import Array, FloatArray


class OrientedBoxes(NamedTuple):
    """The centres (N, 3) of boxes, and the vectors (N, 3, 3) from there to the middles of three faces, in cells."""

    centre: FloatArray
    edges: FloatArray


def boxes_of(batch: Batch) -> OrientedBoxes:
    """The boxes around the primitives of a batch, in the grid frame and in double precision."""
    edges = array(batch.rotation.double()).swapaxes(-1, -2) * array(batch.bounds.double())[..., None]
    return OrientedBoxes(array(batch.centre.double()), edges)


MOST_PAIRS = 20_000
"""Most pairs of boxes whose gaps are computed at once, which takes 50 MB."""


def gaps(boxes: OrientedBoxes, first: Array, second: Array) -> FloatArray:
    """Gaps (..., C) between pairs of boxes (..., N) along the direction that separates them most, negative where they
    overlap; that is normal to a face, or to an edge of each."""
    step = max(1, MOST_PAIRS // max(1, math.prod(boxes.centre.shape[:-2])))
    if len(first) > step:
        batches = [slice(start, start + step) for start in range(0, len(first), step)]
        return np.concatenate([gaps(boxes, first[batch], second[batch]) for batch in batches], -1)
    axes = boxes.edges / np.maximum(np.linalg.norm(boxes.edges, axis=-1, keepdims=True), 1e-9)
    axes, others = axes[..., first, :, :], axes[..., second, :, :]
    crosses = np.cross(axes[..., None, :], others[..., None, :, :])
    along = np.concatenate([axes, others, crosses.reshape(*crosses.shape[:-3], 9, 3)], -2)  # (..., C, 15, 3)
    away = (boxes.centre[..., second, :] - boxes.centre[..., first, :])[..., None, :]
    rows = np.concatenate([away, boxes.edges[..., first, :, :], boxes.edges[..., second, :, :]], -2)
    extents = np.abs(along @ rows.swapaxes(-1, -2))
    length = np.sqrt((along**2).sum(-1))  # zero for edges that are parallel
    gap = (extents[..., 0] - extents[..., 1:].sum(-1)) / np.maximum(length, 1e-9)
    result: FloatArray = np.where(length > 1e-6, gap, -np.inf).max(-1)
    return result


def touching(boxes: OrientedBoxes, within: float) -> tuple[Array, Array]:
    """Pairs (C,) of boxes with a gap less than ``within``."""
    reach = np.abs(boxes.edges).sum(1)
    apart = np.abs(boxes.centre[:, None] - boxes.centre) - reach[:, None] - reach
    first, second = np.nonzero(np.triu(apart.max(2) < within, 1))
    touch = gaps(boxes, first, second) < within
    return first[touch], second[touch]
