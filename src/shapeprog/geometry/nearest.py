"""Exact nearest neighbours between point clouds: kernels search a uniform grid, by threads over the batch.

They run on the CPU, wherever the tensors are.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.autograd.function import once_differentiable

from shapeprog.errors import ShapeProgError
from shapeprog.geometry import neighbour_kernels as kernels
from shapeprog.geometry.arrays import cast, numbers, over_threads
from shapeprog.space import Array

Cloud = Float[Tensor, "*batch P 3"]
Other = Float[Tensor, "*batch Q 3"]


def nearest(queries: Cloud, points: Other) -> Int[Tensor, "*batch P"]:
    """Index of the nearest of the points to each query, exact, without gradient.

    A ``ShapeProgError`` if there are no points, or the leading dimensions differ.
    """
    source, few = _pair(queries.detach(), points.detach())
    index = torch.from_numpy(_neighbours(source, few)[0] - np.arange(len(few))[:, None] * few.shape[1])
    return index.reshape(queries.shape[:-1]).to(queries.device)


def squared_distance(queries: Cloud, points: Other) -> Float[Tensor, "*batch P"]:
    """Squared distance of each query to its nearest point, with gradient to both; raises what :func:`nearest` does.

    Neighbours are found without gradient; the gradient of the distance to them is that of the minimum.
    """
    (results,) = _Squared.apply(*_pair(queries, points), False)  # type: ignore[no-untyped-call]
    squared: Tensor = results.reshape(queries.shape[:-1])
    return squared


def mean_squared_distances(cloud: Cloud, other: Other) -> tuple[Float[Tensor, "*batch"], Float[Tensor, "*batch"]]:
    """Means of the squared distances from each cloud to the nearest points of the other, with gradient to both."""
    if not cloud.shape[-2]:
        return squared_distance(cloud, other).mean(-1), squared_distance(other, cloud).mean(-1)
    outward, back = _Squared.apply(*_pair(cloud, other), True)  # type: ignore[no-untyped-call]
    return outward.reshape(cloud.shape[:-2]), back.reshape(cloud.shape[:-2])


class _Squared(torch.autograd.Function):
    """The kernels as one differentiable step: squared distances one way, or the means of those both ways.

    Torch would share such means among threads that then wait for more, in the way of those of the kernels.
    """

    @staticmethod
    def forward(ctx: Any, cloud: Tensor, other: Tensor, means: bool) -> tuple[Tensor, ...]:
        ways = [(cloud, other), (other, cloud)] if means else [(cloud, other)]
        results = [_neighbours(*way) for way in ways]
        ctx.save_for_backward(cloud, other)
        ctx.means, ctx.index = means, [index for index, _ in results]
        return tuple(cast(squared.mean(-1) if means else squared, cloud) for _, squared in results)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor | None, ...]:
        clouds = [numbers(item) for item in ctx.saved_tensors]
        results = [np.zeros(item.shape) for item in clouds]
        for way, (index, slope) in enumerate(zip(ctx.index, slopes, strict=True)):
            count = clouds[way].shape[1]
            weight = numbers(slope)[:, None] / count if ctx.means else numbers(slope)
            data = (
                clouds[way].reshape(-1, 3), count, clouds[1 - way].reshape(-1, 3), index.reshape(-1), weight,
                results[way].reshape(-1, 3), results[1 - way].reshape(-1, 3),
            )  # fmt: skip
            over_threads(partial(kernels.pull, *data), len(index), least=8)
        return *(cast(item, cloud) for item, cloud in zip(results, ctx.saved_tensors, strict=True)), None


def _pair(queries: Cloud, points: Other) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B Q 3"]]:
    """Both clouds with one batch dimension and of one type."""
    if not points.shape[-2]:
        raise ShapeProgError("there are no points to be near to", "give at least one point for each shape")
    if queries.shape[:-2] != points.shape[:-2] or queries.shape[-1] != 3 or points.shape[-1] != 3:
        message = f"clouds of shapes {tuple(queries.shape)} and {tuple(points.shape)} do not pair up"
        raise ShapeProgError(message, "both must be (..., points, 3) with the same leading dimensions")
    count = queries.shape[:-2].numel()
    source = queries.reshape(count, queries.shape[-2], 3).contiguous()
    return source, points.to(source).reshape(count, points.shape[-2], 3).contiguous()


def _neighbours(queries: Tensor, points: Tensor) -> tuple[Array, Array]:
    """Rows of the nearest points among those of all clouds, and squared distances, (B, P) each."""
    (clouds, source), count = queries.shape[:2], points.shape[1]
    index, squared = np.empty(clouds * source, np.int64), np.empty(clouds * source)
    data = numbers(queries).reshape(-1, 3), source, numbers(points).reshape(-1, 3), count, index, squared
    over_threads(partial(kernels.neighbours, *data), clouds)
    return index.reshape(clouds, source), squared.reshape(clouds, source)
