"""Exact nearest neighbours between point clouds: kernels search a uniform grid, by threads over the batch.

They run on the CPU, wherever the tensors are.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from shapeprog.arguments import check_tensor
from shapeprog.errors import ShapeProgError
from shapeprog.geometry import neighbour_kernels as kernels
from shapeprog.geometry.arrays import numbers, over_threads
from shapeprog.space import Array

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
    for cloud in (queries, points):
        check_tensor("cloud", cloud, "P", 3, empty=True)
    if not points.shape[-2]:
        raise ShapeProgError("there are no points to be near to", "give at least one point for each shape")
    if queries.shape[:-2] != points.shape[:-2]:
        message = f"clouds of shapes {tuple(queries.shape)} and {tuple(points.shape)} do not pair up"
        raise ShapeProgError(message, "both must be (..., points, 3) with the same leading dimensions")
    count = queries.shape[:-2].numel()
    source = queries.reshape(count, queries.shape[-2], 3).contiguous()
    return source, points.to(source).reshape(count, points.shape[-2], 3).contiguous()


def _neighbours(queries: Tensor, points: Tensor) -> Array:
    """Rows of the nearest points among those of all clouds (B, P), without gradient."""
    (clouds, source), count = queries.shape[:2], points.shape[1]
    index = np.empty(clouds * source, np.int64)
    data = numbers(queries).reshape(-1, 3), source, numbers(points).reshape(-1, 3), count, index
    over_threads(partial(kernels.neighbours, *data), clouds)
    return index.reshape(clouds, source)
