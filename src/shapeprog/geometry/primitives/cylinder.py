"""The cylinder: half height along local axis 0, radius across it.

A cell belongs to it when its centre is within 1.01 radii of the axis, as in the published executor.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from shapeprog.geometry.primitive import Kernels, Mesh, Points, Primitive, Scalars, Sizes, Triple, safe_norm
from shapeprog.geometry.primitives.cuboid import corner, meet
from shapeprog.kernels.compile import helper
from shapeprog.kernels.rows import CAP, REACH, clip, fill_row
from shapeprog.kernels.table import CENTRE, ROTATION, SIZE
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import Array, FloatArray

SEGMENTS = 48
"""Corners of the polygon that stands for the circle in a mesh."""


def distance(points: Points, size: Sizes) -> Scalars:
    """Exact signed distance: a rectangle in (axial, radial) coordinates.

    Appendix A of Liang (2022) mixes full and half height and takes a squared length for a length; here both
    coordinates are lengths and the half height is meant.
    """
    half_height, radius = size[..., :2].clamp(min=0).unbind(-1)
    rho = safe_norm(points[..., 1] ** 2 + points[..., 2] ** 2)
    return meet(points[..., 0].abs() - half_height, rho - radius)


def bound(size: Sizes) -> Points:
    """Half extents of the box around the cylinder."""
    return size[..., [0, 1, 1]]


def areas(size: Sizes) -> Float[Tensor, "*batch faces"]:
    """Areas of bottom cap, top cap and lateral surface."""
    half_height, radius = size[..., :2].clamp(min=0).unbind(-1)
    cap = math.pi * radius**2
    return torch.stack([cap, cap, 4 * math.pi * radius * half_height], -1)


def sample(size: Sizes, face: Int[Tensor, "*batch"], u: Points) -> Points:
    """Axial coordinate in [-1, 1] and a place in the unit disc (on its rim for the lateral surface)."""
    angle, lateral = 2 * math.pi * u[..., 0], face == 2
    rim = torch.where(lateral, 1.0, u[..., 1].sqrt())
    axial = torch.where(lateral, 2 * u[..., 2] - 1, (2 * face - 1).to(u))
    return torch.stack([axial, rim * angle.cos(), rim * angle.sin()], -1)


def place(size: Sizes, unit: Points) -> Points:
    """Point of the cylinder for an axial coordinate and a place in the unit disc."""
    return unit * bound(size)


def normal(size: Sizes, unit: Points, face: Int[Tensor, "*batch"]) -> Points:
    """Outward normal: along the axis on the caps, radial on the side."""
    across = torch.arange(3, device=unit.device) > 0
    return torch.where(across == (face == 2)[..., None], unit, 0.0)


def mesh(size: FloatArray) -> Mesh:
    """That of a frustum with equal radii."""
    return frustum_mesh(*size[[0, 1, 1]])


def frustum_mesh(half_height: float, bottom: float, top: float) -> Mesh:
    """A frustum over regular polygons with the areas of the circles, so that the volume is exact.

    A circle without radius is one vertex.
    """
    step = 2 * math.pi / SEGMENTS
    angle = step * np.arange(SEGMENTS)
    low, high = (radius * math.sqrt(step / math.sin(step)) for radius in (bottom, top))
    ring, up = np.stack([np.zeros(SEGMENTS), np.cos(angle), np.sin(angle)], 1), np.array([half_height, 0.0, 0.0])
    vertices = np.concatenate([low * ring - up, high * ring + up, [-up, up]])
    a = np.arange(SEGMENTS)
    b, foot, head = (a + 1) % SEGMENTS, np.full(SEGMENTS, 2 * SEGMENTS), np.full(SEGMENTS, 2 * SEGMENTS + 1)
    sides = [(a, b, b + SEGMENTS), (a, b + SEGMENTS, a + SEGMENTS), (foot, b, a), (head, a + SEGMENTS, b + SEGMENTS)]
    vertex = np.arange(len(vertices))
    if bottom <= 0:
        vertex[:SEGMENTS] = foot
    if top <= 0:
        vertex[SEGMENTS : 2 * SEGMENTS] = head
    faces = vertex[np.concatenate([np.stack(side, 1) for side in sides])]
    used, faces = np.unique(faces[(faces != np.roll(faces, 1, 1)).all(1)], return_inverse=True)
    return vertices[used], faces.reshape(-1, 3).astype(np.int64)


def volume(size: Sizes) -> Scalars:
    """Height times the area of the circle."""
    half_height, radius = size[..., :2].clamp(min=0).unbind(-1)
    return 2 * math.pi * half_height * radius**2


def cell_size(size: Sizes) -> Sizes:
    """The sizes by which cells are tested, in cells; none is inside a cylinder without height or radius."""
    tested = torch.cat([size[..., :1] + CAP, size[..., 1:2] * REACH, size[..., 2:]], -1)
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
