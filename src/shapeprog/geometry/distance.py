"""Signed distance of points to each primitive of a scene and to their union.

The union takes the nearest primitive.  Outside, that is the exact distance to the union; inside, where primitives
overlap, it is only a bound: the true depth below the common surface can be greater.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.autograd.function import once_differentiable

from shapeprog.geometry.arrays import ROW, declared_kinds, numbers, over_threads, slopes, solids
from shapeprog.geometry.primitive import SIZES, primitives
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.take import take
from shapeprog.space import Array

AT_ONCE = 1 << 22
"""Pairs of point and primitive that are looked at together where no kernel helps."""


def each_distance(scene: Scene, points: Float[Tensor, "*batch P 3"]) -> Float[Tensor, "*batch P N"]:
    """Signed distance of every point to every primitive, negative inside, infinite for padding; exact.

    Parameters
    ----------
    points
        Grid positions; leading dimensions as those of the scene.
    """
    flat, lead = scene.flatten(), scene.batch_shape
    points = points.expand(*lead, *points.shape[-2:])
    found = torch.full((*flat.mask.shape, points.shape[-2]), torch.inf, dtype=points.dtype, device=points.device)
    positions = points.reshape(-1, *points.shape[-2:])
    for kind in _kinds(flat):
        program, slot = (flat.mask & (flat.kind == kind)).nonzero(as_tuple=True)
        offset = positions[program] - flat.centre[program, slot][:, None]
        size = flat.size[program, slot][:, None].expand(*offset.shape[:2], SIZES)
        values = primitives[kind].distance(offset @ flat.rotation[program, slot], size)
        found = found.index_put((program, slot), values)
    return found.mT.reshape(*lead, points.shape[-2], flat.mask.shape[-1])


def nearest_slot(scene: Scene, points: Float[Tensor, "*batch P 3"]) -> Int[Tensor, "*batch P"]:
    """The primitive with the smallest signed distance to each point; found without gradient."""
    return _nearest(scene, points)[0]


def union_distance(scene: Scene, points: Float[Tensor, "*batch P 3"]) -> Float[Tensor, "*batch P"]:
    """The values of :func:`signed_distance` without gradient."""
    return _nearest(scene, points)[1]


def signed_distance(scene: Scene, points: Float[Tensor, "*batch P 3"]) -> Float[Tensor, "*batch P"]:
    """Signed distance of points to the union of each scene, with gradient to points, sizes and poses.

    The nearest primitive is selected without gradient, its numbers are gathered, and only its distance is
    differentiated: the gradient of the minimum over all primitives for one evaluation a point.  Inside the union the
    value is a bound (see above).  An empty scene is infinitely far away.
    """
    lead = scene.batch_shape
    points = points.expand(*lead, *points.shape[-2:])
    if not scene.mask.shape[-1]:
        return torch.full(points.shape[:-1], torch.inf, dtype=points.dtype, device=points.device)
    flat = scene.flatten()
    positions = points.reshape(-1, *points.shape[-2:])
    if positions.device.type == "cpu" and not declared_kinds(flat):
        found: Tensor = _UnionDistance.apply(  # type: ignore[no-untyped-call]
            flat, flat.size, flat.centre, flat.rotation, positions
        )
    else:
        found = _gathered_distance(flat, positions)
    return found.reshape(points.shape[:-1])


def _gathered_distance(flat: Scene, positions: Float[Tensor, "B P 3"]) -> Float[Tensor, "B P"]:
    """The same from the declarations, for any kind of primitive on any device; the twin of the kernels."""
    slot = _nearest(flat, positions)[0]
    table = torch.cat([flat.size, flat.centre, flat.rotation.flatten(-2)], -1)
    size, centre, rotation = take(table, slot).split([SIZES, 3, 9], -1)
    offset = positions - centre
    local = (offset[..., :, None] * rotation.unflatten(-1, (3, 3))).sum(-2)
    kinds = _kinds(flat)
    if len(kinds) == 1:
        found = primitives[kinds[0]].distance(local, size)
    else:
        found = torch.full_like(local[..., 0], torch.inf)
        kind = flat.kind.gather(-1, slot)
        for each in kinds:
            here = (kind == each).nonzero(as_tuple=True)
            found = found.index_put(here, primitives[each].distance(local[here], size[here]))
    return torch.where(flat.mask.any(-1, keepdim=True), found, torch.inf)


class _UnionDistance(torch.autograd.Function):
    """The kernels as one differentiable step."""

    @staticmethod
    def forward(ctx: Any, scene: Scene, size: Tensor, centre: Tensor, rotation: Tensor, points: Tensor) -> Tensor:
        table = solids(scene)
        slots, values = _nearest_kernel(scene, points, table)
        ctx.save_for_backward(points, slots)
        ctx.table = table
        return values

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor | None, ...]:
        from shapeprog.geometry import solid_kernels as kernels

        points, slots = ctx.saved_tensors
        (scenes, count), many = slots.shape, len(ctx.table) // max(len(slots), 1)
        to_solids, to_points = np.zeros((len(ctx.table), ROW)), np.zeros((scenes * count, 3))
        data = (
            ctx.table, many, numbers(points).reshape(-1, 3), count, slots.numpy().reshape(-1),
            numbers(slope).reshape(-1), to_solids, to_points,
        )  # fmt: skip
        over_threads(lambda first, last: kernels.pull(*data, first, last), scenes)
        to_points = to_points.reshape(scenes, count, 3)
        return None, *slopes(to_solids, points, scenes, many), torch.from_numpy(to_points).to(points)


def _kinds(scene: Scene) -> list[int]:
    kinds: list[int] = torch.unique(scene.kind[scene.mask]).tolist()
    return kinds


@torch.no_grad()
def _nearest(scene: Scene, points: Tensor) -> tuple[Tensor, Tensor]:
    """Slot and signed distance of the nearest primitive, by the kernel where there is one."""
    lead, shape = scene.batch_shape, points.shape[-2:]
    flat = scene.flatten()
    positions = points.expand(*lead, *shape).reshape(-1, *shape)
    if positions.device.type != "cpu":
        slot, value = _nearest_pairs(flat, positions)
    else:
        slot, value = _nearest_kernel(flat, positions)
        if declared_kinds(flat):
            rest = Scene(**{**vars(flat), "mask": flat.mask & (flat.kind >= 2)})
            other, closer = _nearest_pairs(rest, positions)
            slot, value = torch.where(closer < value, other, slot), torch.minimum(closer, value)
    return slot.reshape(*lead, shape[0]), value.reshape(*lead, shape[0])


def _nearest_kernel(scene: Scene, points: Tensor, table: Array | None = None) -> tuple[Tensor, Tensor]:
    from shapeprog.geometry import solid_kernels as kernels

    scenes, count = points.shape[:-1]
    slots, values = np.empty(scenes * count, np.int64), np.empty(scenes * count)
    data = (
        solids(scene) if table is None else table, scene.mask.shape[-1], numbers(points).reshape(-1, 3), count,
        slots, values,
    )  # fmt: skip
    over_threads(lambda first, last: kernels.nearest(*data, first, last), len(slots), least=2048)
    nearest = torch.from_numpy(slots).reshape(scenes, count)
    return nearest, torch.from_numpy(values).to(points.dtype).reshape(scenes, count)


def _nearest_pairs(scene: Scene, points: Tensor) -> tuple[Tensor, Tensor]:
    """All pairs, in pieces that fit in memory."""
    if not scene.mask.shape[-1]:
        return torch.zeros(points.shape[:-1], dtype=torch.long, device=points.device), torch.full(
            points.shape[:-1], torch.inf, dtype=points.dtype, device=points.device
        )
    step = max(1, AT_ONCE // max(scene.mask.numel(), 1))
    found = [each_distance(scene, piece).min(-1) for piece in points.split(step, -2)]
    return torch.cat([each.indices for each in found], -1), torch.cat([each.values for each in found], -1)
