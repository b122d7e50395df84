"""The frustum: a cone cut across its axis, which is local axis 0; sizes are the half height and the two radii."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from shapeprog.geometry.primitive import Kernels, Mesh, Points, Primitive, Scalars, Sizes, Triple, safe_norm
from shapeprog.geometry.primitives.cylinder import frustum_mesh
from shapeprog.kernels.compile import helper
from shapeprog.kernels.table import SIZE
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import Array, FloatArray


def _lengths(size: Sizes) -> tuple[Scalars, Scalars, Scalars]:
    """Half height, bottom radius and top radius, never negative."""
    half, bottom, top = size[..., :3].clamp(min=0).unbind(-1)
    return half, bottom, top


def distance(points: Points, size: Sizes) -> Scalars:
    """Exact signed distance: a trapezoid in (axial, radial) coordinates, bounded by two caps and a slanted side."""
    half, bottom, top = _lengths(size)
    axial = points[..., 0]
    radial = safe_norm(points[..., 1] ** 2 + points[..., 2] ** 2)
    over_rim = (radial - torch.where(axial < 0, bottom, top)).clamp(min=0)
    to_cap = over_rim**2 + (axial.abs() - half) ** 2
    rise, run = 2 * half, top - bottom
    squared = (rise**2 + run**2).clamp(min=1e-24)
    foot = (((axial + half) * rise + (radial - bottom) * run) / squared).clamp(0, 1)
    to_side = (axial + half - foot * rise) ** 2 + (radial - bottom - foot * run) ** 2
    inside = (axial.abs() < half) & ((radial - bottom) * rise < (axial + half) * run)
    return safe_norm(torch.minimum(to_cap, to_side)) * torch.where(inside, -1.0, 1.0).to(points)


def bound(size: Sizes) -> Points:
    """Half extents of the box around the frustum."""
    half, bottom, top = _lengths(size)
    widest = torch.maximum(bottom, top)
    return torch.stack([half, widest, widest], -1)


def areas(size: Sizes) -> Float[Tensor, "*batch faces"]:
    """Areas of bottom cap, top cap and slanted side."""
    half, bottom, top = _lengths(size)
    slant = safe_norm(4 * half**2 + (top - bottom) ** 2)
    return math.pi * torch.stack([bottom**2, top**2, (bottom + top) * slant], -1)


def sample(size: Sizes, face: Int[Tensor, "*batch"], u: Points) -> Points:
    """Axial coordinate and a place in the unit disc; the side has more area where it is wider."""
    _, bottom, top = _lengths(size)
    angle = 2 * math.pi * u[..., 0]
    root = (bottom**2 + (top**2 - bottom**2) * u[..., 2]).clamp(min=0).sqrt()
    along = u[..., 2] * (bottom + top) / (bottom + root).clamp(min=1e-12)
    side = face == 2
    rim = torch.where(side, 1.0, u[..., 1].sqrt())
    axial = torch.where(side, 2 * along - 1, (2 * face - 1).to(u))
    return torch.stack([axial, rim * angle.cos(), rim * angle.sin()], -1)


def place(size: Sizes, unit: Points) -> Points:
    """The point of the frustum for an axial coordinate and a place in the unit disc."""
    half, bottom, top = _lengths(size)
    radius = (bottom * (1 - unit[..., 0]) + top * (1 + unit[..., 0])) / 2
    return torch.stack([half * unit[..., 0], radius * unit[..., 1], radius * unit[..., 2]], -1)


def normal(size: Sizes, unit: Points, face: Int[Tensor, "*batch"]) -> Points:
    """Outward normal: along the axis on the caps, leaning with the taper on the side."""
    half, bottom, top = _lengths(size)
    lean, out = bottom - top, 2 * half
    side = torch.stack([lean, out * unit[..., 1], out * unit[..., 2]], -1) / safe_norm(lean**2 + out**2)[..., None]
    cap = torch.stack([unit[..., 0], torch.zeros_like(lean), torch.zeros_like(lean)], -1)
    return torch.where((face == 2)[..., None], side, cap)


def mesh(size: FloatArray) -> Mesh:
    """Rings of the two circles, see :func:`frustum_mesh`."""
    return frustum_mesh(*size[:3])


def volume(size: Sizes) -> Scalars:
    """Height times the mean of the areas of the circles between bottom and top."""
    half, bottom, top = _lengths(size)
    return 2 / 3 * math.pi * half * (bottom**2 + bottom * top + top**2)


# Twins for kernels; sizes are at SIZE: half height, bottom and top radius.


@helper
def distance_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """Twin of :func:`distance`."""
    return _profile(table, row, a, math.sqrt(b * b + c * c))[0]


@helper
def _profile(table: Array, row: int, axial: float, radial: float) -> tuple[float, float, float, float, float, float]:
    """Signed distance in (axial, radial) coordinates; its derivatives by these, the half height and the radii.

    The foot on the side is where the squared distance is least, so it need not be differentiated.
    """
    half, bottom, top = max(table[row, SIZE], 0.0), max(table[row, SIZE + 1], 0.0), max(table[row, SIZE + 2], 0.0)
    over_cap, over_rim = abs(axial) - half, max(radial - (bottom if axial < 0 else top), 0.0)
    to_cap = over_rim * over_rim + over_cap * over_cap
    rise, run, up, out = 2 * half, top - bottom, axial + half, radial - bottom
    foot = min(max((up * rise + out * run) / max(rise * rise + run * run, 1e-24), 0.0), 1.0)
    side_up, side_out = up - foot * rise, out - foot * run
    to_side = side_up * side_up + side_out * side_out
    plane = math.sqrt(min(to_cap, to_side))
    sign = -1.0 if over_cap < 0 and out * rise < up * run else 1.0
    if plane < 1e-12:
        return sign * plane, 0.0, 0.0, 0.0, 0.0, 0.0
    scale = sign / plane
    if to_cap <= to_side:
        over_cap, over_rim = over_cap * scale, over_rim * scale
        by_bottom, by_top = (-over_rim, 0.0) if axial < 0 else (0.0, -over_rim)
        return sign * plane, over_cap * np.sign(axial), over_rim, -over_cap, by_bottom, by_top
    side_up, side_out = side_up * scale, side_out * scale
    return sign * plane, side_up, side_out, side_up * (1 - 2 * foot), side_out * (foot - 1), -side_out * foot


@helper
def slopes_kernel(table: Array, row: int, a: float, b: float, c: float, out: Array) -> None:
    """Derivatives of :func:`distance_kernel`."""
    rho = math.sqrt(b * b + c * c)
    _, out[0], by_radial, out[3], out[4], out[5] = _profile(table, row, a, rho)
    out[1], out[2], out[6] = 0.0, 0.0, 0.0
    if rho >= 1e-12:
        out[1], out[2] = by_radial * b / rho, by_radial * c / rho


@helper
def bound_kernel(table: Array, row: int) -> Triple:
    """Twin of :func:`bound`."""
    widest = max(max(table[row, SIZE + 1], table[row, SIZE + 2]), 0.0)
    return max(table[row, SIZE], 0.0), widest, widest


@helper
def excess_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """How far a point is beyond the caps, or beyond the side there, by squared distances from the axis, scaled."""
    half = table[row, SIZE]
    over_cap = abs(a) - half
    if over_cap > 0:
        return over_cap
    radius = table[row, SIZE + 1] * (half - a) + table[row, SIZE + 2] * (half + a)
    return max(over_cap, 4 * half * half * (b * b + c * c) - radius * radius)


@helper
def sample_kernel(table: Array, row: int, face: int, one: float, two: float, three: float) -> Triple:
    """Twin of :func:`sample`."""
    angle = 2 * math.pi * one
    if face == 2:
        bottom, top = table[row, SIZE + 1], table[row, SIZE + 2]
        root = math.sqrt(max(bottom * bottom + (top * top - bottom * bottom) * three, 0.0))
        return 2 * three * (bottom + top) / max(bottom + root, 1e-12) - 1, math.cos(angle), math.sin(angle)
    rim = math.sqrt(two)
    return 2.0 * face - 1, rim * math.cos(angle), rim * math.sin(angle)


@helper
def place_kernel(table: Array, row: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`place`."""
    radius = (table[row, SIZE + 1] * (1 - u) + table[row, SIZE + 2] * (1 + u)) / 2
    return table[row, SIZE] * u, radius * v, radius * w


@helper
def normal_kernel(table: Array, row: int, face: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`normal`."""
    if face != 2:
        return u, 0.0, 0.0
    lean, out = table[row, SIZE + 1] - table[row, SIZE + 2], 2 * table[row, SIZE]
    length = math.sqrt(max(lean * lean + out * out, 1e-24))
    return lean / length, out * v / length, out * w / length


@helper
def pull_kernel(
    table: Array, row: int, u: float, v: float, w: float, da: float, db: float, dc: float, out: Array
) -> None:
    """Gradient of :func:`place_kernel` by the sizes."""
    by_radius = (db * v + dc * w) / 2
    out[row, SIZE] += da * u
    out[row, SIZE + 1] += by_radius * (1 - u)
    out[row, SIZE + 2] += by_radius * (1 + u)


PRIMITIVE = FRUSTUM = Primitive(
    "frustum", ("half_height", "bottom", "top"), 3, distance, bound, areas, sample, place, normal, mesh, volume,
    kernels=Kernels(
        distance_kernel, slopes_kernel, bound_kernel, excess_kernel, sample_kernel, place_kernel, normal_kernel,
        pull_kernel,
    ),
)  # fmt: skip
