"""Exact nearest neighbours between point clouds, found without gradient by what is fastest on the device."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.autograd.function import once_differentiable

from shapeprog.errors import ShapeProgError
from shapeprog.geometry import neighbour_kernels as kernels
from shapeprog.geometry.arrays import by_kernel, cast, numbers, over_threads
from shapeprog.space import Array

Cloud = Float[Tensor, "*batch P 3"]
Other = Float[Tensor, "*batch Q 3"]

AT_ONCE = 1 << 26
"""Pairs of points that are compared together on a device without the kernel."""


def nearest(queries: Cloud, points: Other) -> Int[Tensor, "*batch P"]:
    """Index of the nearest of ``points`` (..., Q, 3) to each of ``queries``; exact, without gradient.

    On the CPU a uniform grid is searched by threads over the batch; elsewhere all pairs are compared in pieces.

    Raises
    ------
    ShapeProgError
        If there are no points, or the leading dimensions differ.
    """
    many, few = _pair(queries.detach(), points.detach())
    if by_kernel(many):
        rows, clouds = neighbours_by_kernel(many, few)[0], np.arange(len(few))[:, None]
        index = torch.from_numpy(rows - clouds * few.shape[1])
    else:
        index = neighbours(many, few)
    return index.reshape(queries.shape[:-1])


def squared_distance(queries: Cloud, points: Other) -> Float[Tensor, "*batch P"]:
    """Squared distance of each query to its nearest point, with gradient to both.

    Neighbours are found without gradient; the gradient of the distance to them is that of the minimum.

    Raises
    ------
    ShapeProgError
        As :func:`nearest`.
    """
    many, few = _pair(queries, points)
    if by_kernel(many):
        found: Tensor = _SquaredDistance.apply(many, few)  # type: ignore[no-untyped-call]
    else:
        index = neighbours(many.detach(), few.detach())
        found = ((many - few.gather(1, index[..., None].expand(-1, -1, 3))) ** 2).sum(-1)
    return found.reshape(queries.shape[:-1])


def mean_squared_distances(one: Cloud, two: Other) -> tuple[Float[Tensor, "*batch"], Float[Tensor, "*batch"]]:
    """Means of the squared distances from each cloud to the nearest points of the other, with gradient to both.

    Raises
    ------
    ShapeProgError
        As :func:`nearest`.
    """
    if not by_kernel(one) or not one.shape[-2]:
        return squared_distance(one, two).mean(-1), squared_distance(two, one).mean(-1)
    first, second = _pair(one, two)
    there, back = _Chamfer.apply(first, second)  # type: ignore[no-untyped-call]
    return there.reshape(one.shape[:-2]), back.reshape(one.shape[:-2])


class _SquaredDistance(torch.autograd.Function):
    """The kernels as one differentiable step."""

    @staticmethod
    def forward(ctx: Any, queries: Tensor, points: Tensor) -> Tensor:
        index, squared = neighbours_by_kernel(queries, points)
        ctx.save_for_backward(queries, points)
        ctx.index = index
        return torch.from_numpy(squared).to(queries.dtype)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor, Tensor]:
        queries, points = ctx.saved_tensors
        to_queries, to_points = np.zeros(queries.shape), np.zeros(points.shape)
        _pull(numbers(queries), numbers(points), ctx.index, numbers(slope), to_queries, to_points)
        return cast(to_queries, queries), cast(to_points, points)


class _Chamfer(torch.autograd.Function):
    """Both directions and their means in kernels and numpy.

    Torch would share such sums among threads that then wait for more, in the way of those of the kernels.
    """

    @staticmethod
    def forward(ctx: Any, one: Tensor, two: Tensor) -> tuple[Tensor, Tensor]:
        there, back = neighbours_by_kernel(one, two), neighbours_by_kernel(two, one)
        ctx.save_for_backward(one, two)
        ctx.index = there[0], back[0]
        return cast(there[1].mean(-1), one), cast(back[1].mean(-1), one)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, there: Tensor, back: Tensor) -> tuple[Tensor, Tensor]:
        one, two = ctx.saved_tensors
        to_one, to_two = np.zeros(one.shape), np.zeros(two.shape)
        first, second = numbers(one), numbers(two)
        _pull(first, second, ctx.index[0], numbers(there)[:, None] / one.shape[1], to_one, to_two)
        _pull(second, first, ctx.index[1], numbers(back)[:, None] / two.shape[1], to_two, to_one)
        return cast(to_one, one), cast(to_two, two)


def _pair(queries: Cloud, points: Other) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B Q 3"]]:
    if not points.shape[-2]:
        raise ShapeProgError("there are no points to be near to", "give at least one point for each shape")
    if queries.shape[:-2] != points.shape[:-2] or queries.shape[-1] != 3 or points.shape[-1] != 3:
        raise ShapeProgError(
            f"clouds of shapes {tuple(queries.shape)} and {tuple(points.shape)} do not pair up",
            "both must be (..., points, 3) with the same leading dimensions",
        )
    count = queries.shape[:-2].numel()
    many = queries.reshape(count, queries.shape[-2], 3).contiguous()
    return many, points.to(many).reshape(count, points.shape[-2], 3).contiguous()


def neighbours_by_kernel(queries: Tensor, points: Tensor) -> tuple[Array, Array]:
    """Rows of the nearest points among those of all clouds, and squared distances, (B, P) each."""
    (clouds, many), count = queries.shape[:2], points.shape[1]
    index, squared = np.empty(clouds * many, np.int64), np.empty(clouds * many)
    data = numbers(queries).reshape(-1, 3), many, numbers(points).reshape(-1, 3), count, index, squared
    over_threads(lambda first, last: kernels.neighbours(*data, first, last), clouds)
    return index.reshape(clouds, many), squared.reshape(clouds, many)


def _pull(queries: Array, points: Array, index: Array, slope: Array, to_queries: Array, to_points: Array) -> None:
    data = (
        queries.reshape(-1, 3), queries.shape[1], points.reshape(-1, 3), index.reshape(-1), slope,
        to_queries.reshape(-1, 3), to_points.reshape(-1, 3),
    )  # fmt: skip
    over_threads(lambda first, last: kernels.pull(*data, first, last), len(index), least=8)


def neighbours(queries: Float[Tensor, "B P 3"], points: Float[Tensor, "B Q 3"]) -> Int[Tensor, "B P"]:
    """Differences are taken before they are squared, which keeps small distances exact."""
    step = max(1, AT_ONCE // max(1, points.shape[0] * points.shape[1]))
    found = []
    for piece in queries.split(step, 1):
        squared = piece.new_zeros(())
        for axis in range(3):
            squared = squared + (piece[:, :, None, axis] - points[:, None, :, axis]) ** 2
        found.append(squared.argmin(-1))
    return torch.cat(found, 1) if found else torch.zeros(queries.shape[:2], dtype=torch.long, device=queries.device)
