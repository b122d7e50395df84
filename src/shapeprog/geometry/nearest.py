"""Exact nearest neighbours between point clouds, found without gradient by what is fastest on the device."""

from __future__ import annotations

from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.autograd.function import once_differentiable

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import array, over_threads

Cloud = Float[Tensor, "*batch P 3"]

AT_ONCE = 1 << 26
"""Pairs of points that are compared together on a device without the kernel."""


def nearest(queries: Cloud, points: Cloud) -> Int[Tensor, "*batch P"]:
    """Index of the nearest of ``points`` (..., Q, 3) to each of ``queries``; exact, without gradient.

    On the CPU a uniform grid is searched by threads over the batch; elsewhere all pairs are compared in pieces.

    Raises
    ------
    ShapeProgError
        If there are no points, or the leading dimensions differ.
    """
    many, few = _pair(queries.detach(), points.detach())
    index = _by_grid(many, few)[0] if many.device.type == "cpu" else _by_pairs(many, few)
    return index.reshape(queries.shape[:-1])


def squared_distance(queries: Cloud, points: Cloud) -> Float[Tensor, "*batch P"]:
    """Squared distance of each query to its nearest point, with gradient to both.

    Neighbours are found without gradient; the gradient of the distance to them is that of the minimum.

    Raises
    ------
    ShapeProgError
        As :func:`nearest`.
    """
    many, few = _pair(queries, points)
    if many.device.type == "cpu":
        found: Tensor = _SquaredDistance.apply(many, few)  # type: ignore[no-untyped-call]
    else:
        index = _by_pairs(many.detach(), few.detach())
        found = ((many - few.gather(1, index[..., None].expand(-1, -1, 3))) ** 2).sum(-1)
    return found.reshape(queries.shape[:-1])


class _SquaredDistance(torch.autograd.Function):
    """The kernels as one differentiable step."""

    @staticmethod
    def forward(ctx: Any, queries: Tensor, points: Tensor) -> Tensor:
        index, squared = _by_grid(queries, points)
        ctx.save_for_backward(queries, points, index)
        return squared

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor, Tensor]:
        from shapeprog.geometry.neighbour_kernels import pull

        queries, points, index = ctx.saved_tensors
        to_queries, to_points = torch.empty_like(queries), torch.zeros_like(points)
        known = array(queries), array(points), array(index), array(slope)
        data = *known, to_queries.numpy(), to_points.numpy()
        over_threads(lambda first, last: pull(*data, first, last), len(index), least=8)
        return to_queries, to_points


def _pair(queries: Cloud, points: Cloud) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B Q 3"]]:
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


def _by_grid(
    queries: Float[Tensor, "B P 3"], points: Float[Tensor, "B Q 3"]
) -> tuple[Int[Tensor, "B P"], Float[Tensor, "B P"]]:
    from shapeprog.geometry.neighbour_kernels import neighbours

    index, squared = torch.empty(queries.shape[:2], dtype=torch.long), torch.empty_like(queries[..., 0])
    data = array(queries), array(points), index.numpy(), squared.numpy()
    over_threads(lambda first, last: neighbours(*data, first, last), len(index))
    return index, squared


def _by_pairs(queries: Float[Tensor, "B P 3"], points: Float[Tensor, "B Q 3"]) -> Int[Tensor, "B P"]:
    """Differences are taken before they are squared, which keeps small distances exact."""
    step = max(1, AT_ONCE // max(1, points.shape[0] * points.shape[1]))
    found = []
    for piece in queries.split(step, 1):
        squared = piece.new_zeros(())
        for axis in range(3):
            squared = squared + (piece[:, :, None, axis] - points[:, None, :, axis]) ** 2
        found.append(squared.argmin(-1))
    return torch.cat(found, 1) if found else torch.zeros(queries.shape[:2], dtype=torch.long, device=queries.device)
