"""The cuboid, upright or sheared: a parallelogram in local axes (0, 1), extruded along local axis 2.

Sizes are three half extents and ``lean``, the shift along axis 1 of the top face against the bottom face.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Float, Int
from torch import Tensor

from shapeprog.geometry.primitive import Mesh, Points, Primitive, Scalars, Sizes, primitives, safe_norm

FACES = 6
"""Faces in the order -0, +0, -1, +1, -2, +2."""


def distance(points: Points, size: Sizes) -> Scalars:
    """Exact signed distance to a sheared cuboid.

    The distance to the parallelogram follows from its horizontal and its slanted edges after folding the plane
    by its point symmetry; extrusion combines it with the distance along axis 2, which keeps it exact.
    """
    half_up, half_depth, half_side = size[..., :3].clamp(min=0).unbind(-1)
    slant = size[..., 3] / 2
    up, depth, side = points.unbind(-1)

    fold = torch.where(up < 0, -1.0, 1.0).to(points)
    up, depth = up * fold, depth * fold
    over_up = up - half_up
    along = depth - slant
    over_along = (along.abs() - half_depth).clamp(min=0)
    to_cap = over_up**2 + over_along**2

    cross = depth * half_up - up * slant
    fold = torch.where(cross < 0, -1.0, 1.0).to(points)
    edge_up, edge_depth = up * fold, depth * fold - half_depth
    length = (half_up**2 + slant**2).clamp(min=1e-24)
    foot = ((edge_up * half_up + edge_depth * slant) / length).clamp(-1, 1)
    to_side = (edge_up - foot * half_up) ** 2 + (edge_depth - foot * slant) ** 2

    inside = (over_up < 0) & (cross.abs() < half_depth * half_up)
    plane = safe_norm(torch.minimum(to_cap, to_side)) * torch.where(inside, -1.0, 1.0).to(points)
    over_side = side.abs() - half_side
    outer = safe_norm(plane.clamp(min=0) ** 2 + over_side.clamp(min=0) ** 2)
    inner = torch.maximum(plane, over_side)
    return torch.where(inner > 0, outer, inner)


def bound(size: Sizes) -> Points:
    """Half extents of the box around the sheared cuboid."""
    return torch.stack([size[..., 0], size[..., 1] + size[..., 3].abs() / 2, size[..., 2]], -1)


def areas(size: Sizes) -> Float[Tensor, "*batch faces"]:
    """Areas of the six faces; a shear keeps those of the caps and of the two ends."""
    up, depth, side = (2 * size[..., :3].clamp(min=0)).unbind(-1)
    cap, end = depth * side, up * depth
    slanted = side * safe_norm(up**2 + size[..., 3] ** 2)
    return torch.stack([cap, cap, slanted, slanted, end, end], -1)


def sample(size: Sizes, face: Int[Tensor, "*batch"], u: Points) -> Points:
    """Uniform place on a face of the cube [-1, 1]^3."""
    unit = 2 * u - 1
    axis = face.div(2, rounding_mode="floor")
    sign = (2 * (face % 2) - 1).to(unit)
    return torch.where(torch.arange(3, device=u.device) == axis[..., None], sign[..., None], unit)


def place(size: Sizes, unit: Points) -> Points:
    """Point of the cuboid for a point of the cube [-1, 1]^3."""
    depth = size[..., 1] * unit[..., 1] + size[..., 3] / 2 * unit[..., 0]
    return torch.stack([size[..., 0] * unit[..., 0], depth, size[..., 2] * unit[..., 2]], -1)


def normal(size: Sizes, unit: Points, face: Int[Tensor, "*batch"]) -> Points:
    """Outward normal of a face; the two slanted faces lean with the shear."""
    half_up, slant = size[..., 0], size[..., 3] / 2
    length = safe_norm(half_up**2 + slant**2)
    axis = face.div(2, rounding_mode="floor")
    sign = (2 * (face % 2) - 1).to(unit)
    flat = (torch.arange(3, device=unit.device) == axis[..., None]).to(unit)
    slanted = torch.stack([-slant / length, half_up / length, torch.zeros_like(slant)], -1)
    return sign[..., None] * torch.where((axis == 1)[..., None], slanted, flat)


def mesh(size: npt.NDArray[np.float64]) -> Mesh:
    """Eight corners, twelve triangles."""
    corners = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], np.float64)
    vertices = corners * size[:3]
    vertices[:, 1] += corners[:, 0] * size[3] / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return vertices, np.array(faces, np.int64)


def volume(size: Sizes) -> Scalars:
    """Eight times the product of the half extents: a shear keeps the volume."""
    return 8 * size[..., :3].clamp(min=0).prod(-1)


CUBOID = primitives.register(
    Primitive(
        "cuboid", ("half_up", "half_depth", "half_side", "lean"), 3,
        distance, bound, areas, sample, place, normal, mesh, volume,
    )
)  # fmt: skip
