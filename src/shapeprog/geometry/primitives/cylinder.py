"""The cylinder: half height along local axis 0, radius across it.

A cell belongs to it when its centre is within 1.01 radii of the axis, as in the published executor.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Float, Int
from torch import Tensor

from shapeprog.geometry.primitive import Kernels, Mesh, Points, Primitive, Scalars, Sizes, Triple, safe_norm
from shapeprog.geometry.primitives.cuboid import corner
from shapeprog.kernels.compile import helper
from shapeprog.kernels.rows import CAP, REACH, clip, fill_row
from shapeprog.kernels.table import CENTRE, ROTATION, SIZE
from shapeprog.space import Array

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


def cell_size(size: Sizes) -> Sizes:
    """The sizes by which cells are tested, in cells; none is inside a cylinder without height or radius."""
    tested = torch.stack([size[..., 0] + CAP, size[..., 1] * REACH, *size[..., 2:].unbind(-1)], -1)
    solid = (size[..., 0] >= 0) & (size[..., 1] > 0)
    return torch.where(solid[..., None], tested, torch.nan)


# Twins for kernels; sizes are at SIZE: half height and radius.


@helper
def distance_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """Twin of :func:`distance`."""
    axial = abs(a) - max(table[row, SIZE], 0.0)
    radial = math.sqrt(b * b + c * c) - max(table[row, SIZE + 1], 0.0)
    inner = max(axial, radial)
    if inner <= 0:
        return inner
    axial, radial = max(axial, 0.0), max(radial, 0.0)
    return math.sqrt(axial * axial + radial * radial)


@helper
def slopes_kernel(table: Array, row: int, a: float, b: float, c: float, out: Array) -> None:
    """Derivatives of :func:`distance_kernel`."""
    rho = math.sqrt(b * b + c * c)
    by_axial, by_radial = corner(abs(a) - max(table[row, SIZE], 0.0), rho - max(table[row, SIZE + 1], 0.0))
    out[0], out[1], out[2] = by_axial * np.sign(a), 0.0, 0.0
    if rho >= 1e-12:
        out[1], out[2] = by_radial * b / rho, by_radial * c / rho
    out[3], out[4], out[5], out[6] = -by_axial, -by_radial, 0.0, 0.0


@helper
def bound_kernel(table: Array, row: int) -> Triple:
    """Twin of :func:`bound`."""
    radius = max(table[row, SIZE + 1], 0.0)
    return max(table[row, SIZE], 0.0), radius, radius


@helper
def excess_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """How far a point is beyond the caps, or its squared distance from the axis beyond that of the side."""
    over, radius = abs(a) - table[row, SIZE], table[row, SIZE + 1]
    return over if over > 0 else max(over, b * b + c * c - radius * radius)


@helper
def sample_kernel(table: Array, row: int, face: int, one: float, two: float, three: float) -> Triple:
    """Twin of :func:`sample`."""
    angle = 2 * math.pi * one
    if face == 2:
        return 2 * three - 1, math.cos(angle), math.sin(angle)
    rim = math.sqrt(two)
    return 2.0 * face - 1, rim * math.cos(angle), rim * math.sin(angle)


@helper
def place_kernel(table: Array, row: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`place`."""
    return table[row, SIZE] * u, table[row, SIZE + 1] * v, table[row, SIZE + 1] * w


@helper
def normal_kernel(table: Array, row: int, face: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`normal`."""
    return (0.0, v, w) if face == 2 else (u, 0.0, 0.0)


@helper
def pull_kernel(
    table: Array, row: int, u: float, v: float, w: float, da: float, db: float, dc: float, out: Array
) -> None:
    """Gradient of :func:`place_kernel` by the sizes."""
    out[row, SIZE] += da * u
    out[row, SIZE + 1] += db * v + dc * w


@helper
def cells_kernel(table: Array, row: int, square: bool, planes: Array, plane: int, low: Array, high: Array) -> bool:
    """Twin of :func:`cell_size`; a cylinder that stands upright is one disc of cells, repeated in its layers."""
    if table[row, SIZE] < 0 or table[row, SIZE + 1] <= 0:
        return True
    table[row, SIZE] += CAP
    table[row, SIZE + 1] *= REACH
    if not square or abs(table[row, ROTATION]) < 0.5:
        return False
    resolution, half, reach = planes.shape[2], table[row, SIZE], table[row, SIZE + 1]
    up, depth, side = table[row, CENTRE], table[row, CENTRE + 1], table[row, CENTRE + 2]
    bottom, top = clip(np.ceil(up - half - 0.5), resolution), clip(np.floor(up + half + 0.5), resolution)
    for j in range(clip(depth - reach - 0.5, resolution), clip(np.ceil(depth + reach + 0.5), resolution)):
        left = reach * reach - (j + 0.5 - depth) ** 2
        if left < 0:
            continue
        width = math.sqrt(left)
        first = clip(np.floor(side - width - 0.5), resolution)
        last = clip(np.ceil(side + width + 0.5), resolution)
        while first < last and (first + 0.5 - side) ** 2 > left:
            first += 1
        while first < last and (last - 0.5 - side) ** 2 > left:
            last -= 1
        for i in range(bottom, top):
            fill_row(planes, plane, i, j, first, last)
    return True


PRIMITIVE = CYLINDER = Primitive(
    "cylinder", ("half_height", "radius"), 2, distance, bound, areas, sample, place, normal, mesh, volume, cell_size,
    kernels=Kernels(
        distance_kernel, slopes_kernel, bound_kernel, excess_kernel, sample_kernel, place_kernel, normal_kernel,
        pull_kernel, cells_kernel,
    ),
)  # fmt: skip
