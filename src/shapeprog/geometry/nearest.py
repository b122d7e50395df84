"""Exact nearest neighbours between point clouds, by trees and with threads over the batch.

They are found on the CPU, wherever the tensors are.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial import cKDTree
from torch import Tensor

from shapeprog.arguments import check_tensor
from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import numbers, over_threads
from shapeprog.space import Array

FAR = 1e150  # coordinates are searched up to here: their squares are finite

Cloud = Float[Tensor, "*batch P 3"]
Other = Float[Tensor, "*batch Q 3"]


def nearest(queries: Cloud, points: Other) -> Int[Tensor, "*batch P"]:
    """Index of the nearest of the points to each query, exact, without gradient.

    A ``ShapeProgError`` if there are no points, or the leading dimensions differ.
    """
    source, few = _pair(queries, points)
    index = _neighbours(source, few) - np.arange(len(few))[:, None] * few.shape[1]
    return torch.from_numpy(index).reshape(queries.shape[:-1]).to(queries.device)


def squared_distance(queries: Cloud, points: Other) -> Float[Tensor, "*batch P"]:
    """Squared distance of each query to its nearest point, with gradient to both; raises what :func:`nearest` does.

    Neighbours are found without gradient; the gradient of the distance to them is that of the minimum.
    """
    source, few = _pair(queries, points)
    index = torch.from_numpy(_neighbours(source, few)).to(source.device)
    nearest_points = few.flatten(0, 1).index_select(0, index.flatten()).reshape(source.shape)
    return (source - nearest_points).square().sum(-1).reshape(queries.shape[:-1])


def _pair(queries: Cloud, points: Other) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B Q 3"]]:
    """Both clouds with one batch dimension and of one type."""
    check_tensor("points", queries, "P", 3, empty=True)
    check_tensor("target", points, "P", 3, empty=True)
    if not points.shape[-2]:
        raise ShapeProgError("there are no points to be near to", "give at least one point for each shape")
    if queries.shape[:-2] != points.shape[:-2]:
        message = f"points of the shape {tuple(queries.shape)} and a target of {tuple(points.shape)} do not pair up"
        cure = "give (..., P, 3) and (..., Q, 3) with equal leading dimensions; cloud.expand(B, -1, -1) repeats (P, 3)"
        raise ShapeProgError(message, cure)
    count = queries.shape[:-2].numel()
    source = queries.reshape(count, queries.shape[-2], 3).contiguous()
    return source, points.to(source).reshape(count, points.shape[-2], 3).contiguous()


def _neighbours(queries: Tensor, points: Tensor) -> Array:
    """Rows of the nearest points among those of all clouds (B, P), without gradient; no number is far away."""
    sources, clouds = (
        np.nan_to_num(numbers(cloud), nan=FAR, posinf=FAR, neginf=-FAR).clip(-FAR, FAR) for cloud in (queries, points)
    )
    rows = np.empty(sources.shape[:2], np.int64)

    def search(first: int, last: int) -> None:
        for cloud in range(first, last):
            rows[cloud] = cKDTree(clouds[cloud]).query(sources[cloud])[1] + cloud * clouds.shape[1]

    over_threads(search, len(clouds))
    return rows
