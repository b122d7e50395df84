"""Words for the bodies of declarations: solids from corners, centres, ends."""

from __future__ import annotations

import torch
from jaxtyping import Float, Int
from torch import Tensor

from shapeprog.geometry.batch import Solids
from shapeprog.geometry.primitive import SIZES, Primitive, primitives, safe_norm
from shapeprog.geometry.primitives.cuboid import CUBOID
from shapeprog.geometry.primitives.cylinder import CYLINDER

Scalar = Float[Tensor, "*batch"]
Vector = Float[Tensor, "*batch 3"]


def solid(
    primitive: Primitive, centre: Vector, *sizes: Scalar, rotation: Float[Tensor, "*batch 3 3"] | None = None
) -> Solids:
    """A solid of any declared primitive from its sizes in the order it declares them."""
    zero = torch.zeros_like(centre[..., 0])
    padded = [*sizes, *[zero] * (SIZES - len(sizes))]
    return Solids(primitives.number(primitive), torch.stack(padded, -1), centre, rotation)


def cuboid(centre: Vector, half: Vector, lean: Scalar | None = None) -> Solids:
    """A cuboid from centre and half extents (..., 3); ``lean`` shifts its top against its bottom along depth."""
    return solid(CUBOID, centre, *half.unbind(-1), *([] if lean is None else [lean]))


def box(corner: Vector, extent: Vector) -> Solids:
    """A cuboid from its low, front, left corner and its full extents."""
    return cuboid(corner + extent / 2, extent / 2)


def slab(at: Vector, thickness: Scalar, half_depth: Scalar, half_side: Scalar) -> Solids:
    """A cuboid that stands on ``at``, the centre of its bottom face."""
    return cuboid(_raised(at, thickness), torch.stack([thickness / 2, half_depth, half_side], -1))


def disc(at: Vector, thickness: Scalar, radius: Scalar) -> Solids:
    """An upright cylinder that stands on ``at``, the centre of its bottom face."""
    return solid(CYLINDER, _raised(at, thickness), thickness / 2, radius)


def bar(start: Vector, end: Vector, radius: Scalar) -> Solids:
    """A cylinder between two points, with flat caps."""
    along = end - start
    return solid(CYLINDER, (start + end) / 2, safe_norm((along**2).sum(-1)) / 2, radius, rotation=align(along))


def align(direction: Vector) -> Float[Tensor, "*batch 3 3"]:
    """A rotation whose first column points along ``direction``; up for a zero vector.

    The other two columns come from the grid axis that is farthest from the direction, so the gradient is finite.
    """
    length = safe_norm((direction**2).sum(-1, keepdim=True))
    up = torch.zeros_like(direction)
    up[..., 0] = 1
    first = torch.where(length > 1e-9, direction / length, up)
    helper = torch.nn.functional.one_hot(first.detach().abs().argmin(-1), 3).to(direction)
    second = torch.linalg.cross(first, helper)
    second = second / safe_norm((second**2).sum(-1, keepdim=True))
    return torch.stack([first, second, torch.linalg.cross(first, second)], -1)


def leaned(direction: Vector, axis: Int[Tensor, "*batch"]) -> Float[Tensor, "*batch 3 3"]:
    """The least rotation that brings a grid axis onto the line along ``direction``; none for a zero vector.

    The other two columns are the other grid axes, leaned as little as can be.
    """
    length = safe_norm((direction**2).sum(-1, keepdim=True))
    main = torch.nn.functional.one_hot(axis, 3).to(direction)
    along = torch.where(length > 1e-9, direction / length, main)
    along = along * torch.where((along * main).sum(-1, keepdim=True) < 0, -1.0, 1.0).to(along)
    cross = _cross(torch.linalg.cross(main, along))
    cos = (along * main).sum(-1)[..., None, None]
    return torch.eye(3, device=main.device).to(main) + cross + cross @ cross / (1 + cos)


def about_axis(axis: Int[Tensor, "*batch"], degrees: Scalar) -> Float[Tensor, "*batch 3 3"]:
    """Rotation about a grid axis, counter-clockwise seen from its end."""
    angle = torch.deg2rad(degrees)[..., None, None]
    cross = _cross(torch.nn.functional.one_hot(axis, 3).to(angle))
    return torch.eye(3, device=angle.device).to(angle) + angle.sin() * cross + (1 - angle.cos()) * cross @ cross


def _cross(vector: Vector) -> Float[Tensor, "*batch 3 3"]:
    """The matrix that takes the cross product with ``vector`` from the left."""
    (a, b, c), zero = vector.unbind(-1), torch.zeros_like(vector[..., 0])
    return torch.stack([zero, -c, b, c, zero, -a, -b, a, zero], -1).unflatten(-1, (3, 3))


def _raised(at: Vector, thickness: Scalar) -> Vector:
    return torch.stack([at[..., 0] + thickness / 2, at[..., 1], at[..., 2]], -1)
