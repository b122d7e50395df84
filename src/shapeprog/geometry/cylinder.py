"""The cylinder: half height along local axis 0, radius across it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Float, Int
from torch import Tensor

from shapeprog.geometry.primitive import Mesh, Points, Primitive, Scalars, Sizes, primitives, safe_norm

SEGMENTS = 48
"""Corners of the polygon that stands for the circle in a mesh."""


def distance(points: Points, size: Sizes) -> Scalars:
    """Exact signed distance: a rectangle in (axial, radial) coordinates.

    The appendix of the paper mixes full and half height and takes a squared length for a length; here both
    coordinates are lengths and the half height is meant.
    """
    half_height, radius = size[..., 0].clamp(min=0), size[..., 1].clamp(min=0)
    axial = points[..., 0].abs() - half_height
    radial = safe_norm(points[..., 1] ** 2 + points[..., 2] ** 2) - radius
    outer = safe_norm(axial.clamp(min=0) ** 2 + radial.clamp(min=0) ** 2)
    inner = torch.maximum(axial, radial)
    return torch.where(inner > 0, outer, inner)


def bound(size: Sizes) -> Points:
    """Half extents of the box around the cylinder."""
    return torch.stack([size[..., 0], size[..., 1], size[..., 1]], -1)


def areas(size: Sizes) -> Float[Tensor, "*batch faces"]:
    """Areas of bottom cap, top cap and lateral surface."""
    half_height, radius = size[..., 0].clamp(min=0), size[..., 1].clamp(min=0)
    cap = math.pi * radius**2
    return torch.stack([cap, cap, 4 * math.pi * radius * half_height], -1)


def sample(size: Sizes, face: Int[Tensor, "*batch"], u: Points) -> Points:
    """Axial coordinate in [-1, 1] and a place in the unit disc (on its rim for the lateral surface)."""
    angle = 2 * math.pi * u[..., 0]
    lateral = face == 2
    rim = torch.where(lateral, torch.ones_like(u[..., 1]), u[..., 1].sqrt())
    axial = torch.where(lateral, 2 * u[..., 2] - 1, (2 * face - 1).to(u))
    return torch.stack([axial, rim * angle.cos(), rim * angle.sin()], -1)


def place(size: Sizes, unit: Points) -> Points:
    """Point of the cylinder for an axial coordinate and a place in the unit disc."""
    return unit * torch.stack([size[..., 0], size[..., 1], size[..., 1]], -1)


def normal(size: Sizes, unit: Points, face: Int[Tensor, "*batch"]) -> Points:
    """Outward normal: along the axis on the caps, radial on the side."""
    zero = torch.zeros_like(unit[..., 0])
    radial = torch.stack([zero, unit[..., 1], unit[..., 2]], -1)
    axial = torch.stack([unit[..., 0], zero, zero], -1)
    return torch.where((face == 2)[..., None], radial, axial)


def mesh(size: npt.NDArray[np.float64]) -> Mesh:
    """A prism over a regular polygon whose area is that of the circle, so that the volume is exact."""
    half_height, radius = float(size[0]), float(size[1])
    step = 2 * math.pi / SEGMENTS
    rim = radius * math.sqrt(step / math.sin(step))
    angle = step * np.arange(SEGMENTS)
    ring = np.stack([np.zeros(SEGMENTS), rim * np.cos(angle), rim * np.sin(angle)], 1)
    up = np.array([half_height, 0.0, 0.0])
    vertices = np.concatenate([ring - up, ring + up, [-up, up]])
    a = np.arange(SEGMENTS)
    b = (a + 1) % SEGMENTS
    low, high = np.full(SEGMENTS, 2 * SEGMENTS), np.full(SEGMENTS, 2 * SEGMENTS + 1)
    top_a, top_b = a + SEGMENTS, b + SEGMENTS
    sides = [(a, b, top_b), (a, top_b, top_a), (low, b, a), (high, top_a, top_b)]
    return vertices, np.concatenate([np.stack(side, 1) for side in sides]).astype(np.int64)


def volume(size: Sizes) -> Scalars:
    """Height times the area of the circle."""
    return 2 * math.pi * size[..., 0].clamp(min=0) * size[..., 1].clamp(min=0) ** 2


CYLINDER = primitives.register(
    Primitive(
        "cylinder", ("half_height", "radius"), 2, distance, bound, areas, sample, place, normal, mesh, volume
    )
)  # fmt: skip
