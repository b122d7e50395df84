"""Signed distance of points to each primitive of a batch and to their union.

The union takes the nearest primitive.  Outside, that is the exact distance to the union; inside, where primitives
overlap, it is only a bound: the true depth below the common surface can be greater.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from shapeprog.arguments import check_tensor
from shapeprog.errors import ShapeProgError
from shapeprog.geometry import distance_kernels as kernels
from shapeprog.geometry.arrays import array, first_order, gradients, numbers, over_threads, table_of
from shapeprog.geometry.batch import Batch, check_batch
from shapeprog.geometry.primitive import SIZES
from shapeprog.geometry.primitives import primitives
from shapeprog.kernels.table import SIZE, WIDTH
from shapeprog.space import Array

Nearest = tuple[Int[Tensor, "*batch P"], Float[Tensor, "*batch P"]]
"""Slot of the nearest primitive of each point, and the signed distance to it."""


def each_distance(batch: Batch, points: Float[Tensor, "*shared P 3"]) -> Float[Tensor, "*batch P N"]:
    """Signed distance of every point to every primitive, negative inside, infinite for padding; exact."""
    flat, positions = _aligned(batch, points)
    result = positions.new_full((*flat.mask.shape, points.shape[-2]), torch.inf)
    for kind in flat.kinds:
        element, slot = (flat.mask & (flat.kind == kind)).nonzero(as_tuple=True)
        offset = positions[element] - flat.centre[element, slot][:, None]
        size = flat.size[element, slot][:, None].expand(*offset.shape[:2], SIZES)
        values = primitives[kind].distance(offset @ flat.rotation[element, slot], size)
        result = result.index_put((element, slot), values)
    return result.mT.reshape(*batch.batch_shape, points.shape[-2], flat.mask.shape[-1])


@torch.no_grad()
def nearest_primitive(batch: Batch, points: Float[Tensor, "*shared P 3"]) -> Nearest:
    """The slot with the smallest signed distance to each point, and that distance; without gradient."""
    flat, positions = _aligned(batch, points)
    shape = *batch.batch_shape, points.shape[-2]
    slots, values = _nearest(table_of(flat), positions)
    return slots.reshape(shape), values.reshape(shape)


def signed_distance(batch: Batch, points: Float[Tensor, "*shared P 3"]) -> Float[Tensor, "*batch P"]:
    """Signed distance of points to the union of each element, with gradient to points, sizes and poses.

    Outside, it is equation 2 of Liang (2022), of primitives posed as in equation 4.
    The nearest primitive is selected without gradient, and only its distance is differentiated: the gradient of the
    minimum over all primitives for one evaluation a point.  An empty union is infinitely far away.
    """
    flat, positions = _aligned(batch, points)
    data = flat, flat.size, flat.centre, flat.rotation, positions
    result: Tensor = _UnionDistance.apply(*data)  # type: ignore[no-untyped-call]
    return result.reshape(*batch.batch_shape, points.shape[-2])


def distance_and_slopes(batch: Batch, points: Float[Tensor, "B P 3"]) -> tuple[Tensor, Tensor, Tensor]:
    """Signed distance (B, P) of points to the union of each element of a batch (B, N), without gradient.

    Besides, the gradient of its sum by sizes, centres and rotations (B, N, 16) and by points (B, P, 3).
    """
    values, rows, to_points = _with_slopes(table_of(batch), points)
    return values, rows.reshape(*batch.mask.shape, WIDTH - SIZE), to_points


def slopes_to_slots(
    scene: Batch, slots: Int[Tensor, " P"], points: Float[Tensor, "P 3"]
) -> tuple[Float[Tensor, " P"], Float[Tensor, "P 16"], Float[Tensor, "P 3"]]:
    """Signed distances of points to the primitives in some slots of one scene, and gradients by each and by points."""
    values, rows, to_points = _with_slopes(table_of(scene)[array(slots)], points[:, None])
    return values[:, 0], rows, to_points[:, 0]


def _with_slopes(table: Array, points: Float[Tensor, "B P 3"]) -> tuple[Tensor, Tensor, Tensor]:
    slots, values = _nearest(table, points)
    to_table, to_points = _pulled(table, slots, points, torch.ones_like(values))
    return values, torch.from_numpy(to_table).to(points)[:, SIZE:], to_points


def _pulled(
    table: Array, slots: Int[Tensor, "B P"], points: Float[Tensor, "B P 3"], slope: Float[Tensor, "B P"]
) -> tuple[Array, Float[Tensor, "B P 3"]]:
    """Gradient by rows of the table and by points, given that by the distances to known primitives."""
    (scenes, count), per_scene = slots.shape, len(table) // max(len(slots), 1)
    to_table, to_points = np.zeros((len(table), WIDTH)), np.zeros((scenes * count, 3))
    data = (
        table, per_scene, numbers(points).reshape(-1, 3), count, array(slots).reshape(-1), numbers(slope).reshape(-1),
        to_table, to_points,
    )  # fmt: skip
    over_threads(partial(kernels.pull, *data), scenes)
    return to_table, torch.from_numpy(to_points.reshape(scenes, count, 3)).to(points)


class _UnionDistance(torch.autograd.Function):
    """The kernels as one differentiable step, on the CPU wherever the tensors are."""

    @staticmethod
    def forward(ctx: Any, batch: Batch, size: Tensor, centre: Tensor, rotation: Tensor, points: Tensor) -> Tensor:
        table = table_of(batch)
        slots, values = _nearest(table, points)
        ctx.save_for_backward(points, slots)
        ctx.table = table
        return values

    @staticmethod
    @first_order
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor | None, ...]:
        points, slots = ctx.saved_tensors
        to_table, to_points = _pulled(ctx.table, slots, points, slope)
        return None, *gradients(to_table, points, len(slots), len(ctx.table) // max(len(slots), 1)), to_points


def _aligned(batch: Batch, points: Tensor) -> tuple[Batch, Float[Tensor, "B P 3"]]:
    """Batch and points with one batch dimension."""
    check_batch(batch)
    check_tensor("points", points, "P", 3)
    given, shape, lead = points.shape[:-2], points.shape[-2:], tuple(batch.batch_shape)
    right = (one in (1, other) for one, other in zip(given[::-1], lead[::-1], strict=False))
    if len(given) > len(lead) or not all(right):
        cause = f"points of the shape {tuple(points.shape)} do not go with scenes of the shape {lead}"
        wanted = f"({', '.join(map(str, (*lead, 'P', 3)))}) or (P, 3)" if lead else "(P, 3), or unroll a list"
        raise ShapeProgError(cause, f"give the shape {wanted}")
    return batch.flatten(), points.expand(*lead, *shape).reshape(-1, *shape)


def _nearest(table: Array, points: Float[Tensor, "B P 3"]) -> Nearest:
    """The nearest of the primitives that are rows of the table."""
    scenes, count = points.shape[:-1]
    slots, values = np.empty((scenes, count), np.int64), np.empty((scenes, count))
    data = table, len(table) // max(scenes, 1), numbers(points).reshape(-1, 3), count, slots.ravel(), values.ravel()
    over_threads(partial(kernels.nearest, *data), slots.size, least=2048)
    return torch.from_numpy(slots).to(points.device), torch.from_numpy(values).to(points)


def projected(pairs: Batch, points: Float[Tensor, "C 3"], rounds: int) -> Float[Tensor, "C 3"]:
    """Points moved onto the second of two primitives (C, 2) and back onto the first, so many times, without gradient.

    Points inside a primitive stay where they are.  Where the two overlap the points end in both of them, else where the
    gap between them is narrow (von Neumann 1933).
    """
    moved = numbers(points).copy()
    over_threads(partial(kernels.project, table_of(pairs), moved, rounds), len(moved))
    return torch.from_numpy(moved).to(points)
