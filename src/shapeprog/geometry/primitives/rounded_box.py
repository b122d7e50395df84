"""The rounded box: three half extents, and the radius to which its edges are rounded.

It is everything within that radius of an inner box, so its surface is that of a ball, pulled apart.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from shapeprog.geometry.primitive import Kernels, Mesh, Points, Primitive, Scalars, Sizes, Triple
from shapeprog.geometry.primitives import cuboid
from shapeprog.geometry.primitives.cuboid import corner, meet
from shapeprog.kernels.compile import helper
from shapeprog.kernels.table import SIZE
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import Array, FloatArray

PER_QUARTER = 8
"""Edges of the polygon that stands for a quarter of a circle in a mesh."""


def _rounding(size: Sizes) -> tuple[Points, Scalars]:
    """Half extents of the inner box, and the radius, which is at most the smallest half extent."""
    half = size[..., :3].clamp(min=0)
    radius = torch.minimum(size[..., 3].clamp(min=0), half.amin(-1))
    return half - radius[..., None], radius


def distance(points: Points, size: Sizes) -> Scalars:
    """Exact signed distance: that to the inner box, less the radius."""
    inner, radius = _rounding(size)
    up, depth, side = (points.abs() - inner).unbind(-1)
    return meet(meet(up, depth), side) - radius


def bound(size: Sizes) -> Points:
    """The half extents."""
    return size[..., :3]


def areas(size: Sizes) -> Float[Tensor, "*batch faces"]:
    """Areas of the flat faces across each axis, two together; of the four edges along each; and of the corners."""
    inner, radius = _rounding(size)
    up, depth, side = (2 * inner).unbind(-1)
    flat = 2 * torch.stack([depth * side, up * side, up * depth], -1)
    round_edges = 4 * math.pi * radius[..., None] * inner
    return torch.cat([flat, round_edges, 4 * math.pi * radius[..., None] ** 2], -1)


def sample(size: Sizes, face: Int[Tensor, "*batch"], u: Points) -> Points:
    """A place of which each coordinate is in [-1, 1] along the inner box, or beyond it by that of the normal.

    Drawn for the faces of axis 0 and then turned to the axis of the face; the corners together are a ball.
    """
    one, two, three = u.unbind(-1)
    flat = torch.stack([torch.where(one < 0.5, -2.0, 2.0).to(u), 2 * two - 1, 2 * three - 1], -1)
    along, angle = 2 * one - 1, 2 * math.pi * two
    rim = torch.where(face < 6, 1.0, (1 - along**2).clamp(min=0).sqrt())
    bent = torch.stack([along, rim * angle.cos(), rim * angle.sin()], -1)
    beyond = bent + torch.where(bent < 0, -1.0, 1.0).to(u)
    ball = (face >= 6)[..., None] | (torch.arange(3, device=u.device) > 0)
    unit = torch.where((face < 3)[..., None], flat, torch.where(ball, beyond, bent))
    return unit.gather(-1, (torch.arange(3, device=u.device) - face[..., None]) % 3)


def place(size: Sizes, unit: Points) -> Points:
    """Point of the rounded box for such a place."""
    inner, radius = _rounding(size)
    along = unit.clamp(-1, 1)
    return inner * along + radius[..., None] * (unit - along)


def normal(size: Sizes, unit: Points, face: Int[Tensor, "*batch"]) -> Points:
    """Outward normal: what a place is beyond the inner box."""
    return unit - unit.clamp(-1, 1)


def mesh(size: FloatArray) -> Mesh:
    """A ball of rings between two poles, pulled apart; its radius is a little smaller, so that the volume is exact."""
    half = np.maximum(size[:3], 0)
    radius = min(max(size[3], 0.0), half.min())
    if radius == 0:
        return cuboid.mesh(np.append(half, 0.0))
    sign, ball, faces = _pulled_apart()
    area = 2 * PER_QUARTER * math.sin(math.pi / (2 * PER_QUARTER))
    content = np.linalg.det(ball[faces]).sum() / 6
    # a radius takes 2 * edges * r^2 + corners * r^3 off the cuboid; the roots are sought from above, so it converges
    edges, corners = (4 - area) * half.sum(), 6 * area - 16 - content
    wanted = 2 * (4 - math.pi) * half.sum() * radius**2 + (6 * math.pi - 16 - 4 / 3 * math.pi) * radius**3
    for _ in range(6):
        off = 2 * edges * radius**2 + corners * radius**3
        radius -= (off - wanted) / (4 * edges * radius + 3 * corners * radius**2)
    return sign * (half - radius) + ball * radius, faces


def _pulled_apart() -> tuple[FloatArray, FloatArray, Array]:
    """Octants (V, 3) and places (V, 3) of vertices on the unit ball, and triangles; octants share no vertex."""
    many, step = PER_QUARTER + 1, math.pi / 2 / PER_QUARTER
    tilt = step * np.concatenate([np.arange(1, many), np.arange(PER_QUARTER, 2 * PER_QUARTER)])[:, None]
    quarter, column = np.divmod(np.arange(4 * many), many)
    angle = step * (PER_QUARTER * quarter + column)
    shape = (2 * PER_QUARTER, 4 * many)
    rim = np.sin(tilt)
    rings = np.stack([np.broadcast_to(np.cos(tilt), shape), rim * np.cos(angle), rim * np.sin(angle)], -1)
    around = np.stack([np.where(np.isin(quarter, (0, 3)), 1, -1), np.where(quarter < 2, 1, -1)], -1)
    upper = np.where(np.arange(2 * PER_QUARTER) < PER_QUARTER, 1, -1)[:, None]
    signs = np.concatenate([np.broadcast_to(upper[..., None], (*shape, 1)), np.broadcast_to(around, (*shape, 2))], -1)
    poles = np.array([[end, 0.0, 0.0] for end in (1, -1) for _ in range(4)])
    signs_of_poles = np.concatenate([poles[:, :1], np.tile(around[::many], (2, 1))], 1)
    a = np.arange(4 * many)
    b, last = (a + 1) % (4 * many), (2 * PER_QUARTER - 1) * 4 * many
    faces = []
    for low in range(0, last, 4 * many):
        faces += [np.stack([a, a + 4 * many, b + 4 * many], 1) + low, np.stack([a, b + 4 * many, b], 1) + low]
    seam, top = column == PER_QUARTER, last + 4 * many
    for ring, pole, turn in ((0, top, 1), (last, top + 4, -1)):
        fan = np.stack([quarter + pole, a + ring, b + ring], 1)
        strip = np.stack([quarter + pole, b + ring, quarter[b] + pole], 1)[seam]
        faces += [each[:, ::turn] for each in (fan, strip, np.array([[0, 1, 2], [0, 2, 3]]) + pole)]
    vertices = np.concatenate([rings.reshape(-1, 3), poles])
    return np.concatenate([signs.reshape(-1, 3), signs_of_poles]), vertices, np.concatenate(faces).astype(np.int64)


def volume(size: Sizes) -> Scalars:
    """The inner box, slabs on its faces, quarters of cylinders along its edges, and a ball."""
    inner, radius = _rounding(size)
    up, depth, side = inner.unbind(-1)
    slabs = 8 * radius * (up * depth + depth * side + side * up)
    return 8 * up * depth * side + slabs + radius**2 * math.pi * (2 * inner.sum(-1) + 4 / 3 * radius)


# Twins for kernels; sizes are at SIZE: half extents up, in depth and to the side, and the radius.


@helper
def _inner(table: Array, row: int) -> tuple[float, float, float, float]:
    """Twin of :func:`_rounding`."""
    up, depth, side = max(table[row, SIZE], 0.0), max(table[row, SIZE + 1], 0.0), max(table[row, SIZE + 2], 0.0)
    radius = min(max(table[row, SIZE + 3], 0.0), min(min(up, depth), side))
    return up - radius, depth - radius, side - radius, radius


@helper
def _to_sizes(
    table: Array, row: int, up: float, depth: float, side: float, by_radius: float
) -> tuple[float, float, float, float]:
    """Derivatives by the four sizes from those by the half extents and by the radius in force."""
    one, two, three, radius = table[row, SIZE], table[row, SIZE + 1], table[row, SIZE + 2], table[row, SIZE + 3]
    least = max(min(min(one, two), three), 0.0)
    if radius < 0:
        return up, depth, side, 0.0
    if radius < least:
        return up, depth, side, by_radius
    first, second, third = 1.0 if one <= least else 0.0, 1.0 if two <= least else 0.0, 1.0 if three <= least else 0.0
    share = by_radius / (first + second + third)
    return up + first * share, depth + second * share, side + third * share, 0.0


@helper
def distance_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """Twin of :func:`distance`."""
    up, depth, side, radius = _inner(table, row)
    up, depth, side = abs(a) - up, abs(b) - depth, abs(c) - side
    inside = max(max(up, depth), side)
    if inside <= 0:
        return inside - radius
    up, depth, side = max(up, 0.0), max(depth, 0.0), max(side, 0.0)
    return math.sqrt(up * up + depth * depth + side * side) - radius


@helper
def slopes_kernel(table: Array, row: int, a: float, b: float, c: float, out: Array) -> None:
    """Derivatives of :func:`distance_kernel`."""
    up, depth, side, _ = _inner(table, row)
    up, depth, side = abs(a) - up, abs(b) - depth, abs(c) - side
    by_up, by_depth = corner(up, depth)
    plane = max(up, depth)
    if plane > 0:
        plane = math.sqrt(max(up, 0.0) ** 2 + max(depth, 0.0) ** 2)
    by_plane, by_side = corner(plane, side)
    by_up, by_depth = by_plane * by_up, by_plane * by_depth
    out[0], out[1], out[2] = by_up * np.sign(a), by_depth * np.sign(b), by_side * np.sign(c)
    by_radius = by_up + by_depth + by_side - 1
    out[3], out[4], out[5], out[6] = _to_sizes(table, row, -by_up, -by_depth, -by_side, by_radius)


@helper
def bound_kernel(table: Array, row: int) -> Triple:
    """Twin of :func:`bound`."""
    return max(table[row, SIZE], 0.0), max(table[row, SIZE + 1], 0.0), max(table[row, SIZE + 2], 0.0)


@helper
def excess_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """How far a point is beyond the surface within the inner box, elsewhere by squared distances from that box."""
    up, depth, side, radius = _inner(table, row)
    up, depth, side = abs(a) - up, abs(b) - depth, abs(c) - side
    inside = max(max(up, depth), side)
    if inside <= 0:
        return inside - radius
    up, depth, side = max(up, 0.0), max(depth, 0.0), max(side, 0.0)
    return up * up + depth * depth + side * side - radius * radius


@helper
def sample_kernel(table: Array, row: int, face: int, one: float, two: float, three: float) -> Triple:
    """Twin of :func:`sample`."""
    if face < 3:
        u, v, w = -2.0 if one < 0.5 else 2.0, 2 * two - 1, 2 * three - 1
    else:
        u, angle, rim = 2 * one - 1, 2 * math.pi * two, 1.0
        if face == 6:
            rim = math.sqrt(max(1 - u * u, 0.0))
            u += -1.0 if u < 0 else 1.0
        v, w = rim * math.cos(angle), rim * math.sin(angle)
        v, w = v + (-1.0 if v < 0 else 1.0), w + (-1.0 if w < 0 else 1.0)
    axis = face % 3
    if axis == 1:
        return w, u, v
    if axis == 2:
        return v, w, u
    return u, v, w


@helper
def place_kernel(table: Array, row: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`place`."""
    up, depth, side, radius = _inner(table, row)
    one, two, three = min(max(u, -1.0), 1.0), min(max(v, -1.0), 1.0), min(max(w, -1.0), 1.0)
    return up * one + radius * (u - one), depth * two + radius * (v - two), side * three + radius * (w - three)


@helper
def normal_kernel(table: Array, row: int, face: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`normal`."""
    return u - min(max(u, -1.0), 1.0), v - min(max(v, -1.0), 1.0), w - min(max(w, -1.0), 1.0)


@helper
def pull_kernel(
    table: Array, row: int, u: float, v: float, w: float, da: float, db: float, dc: float, out: Array
) -> None:
    """Gradient of :func:`place_kernel` by the sizes."""
    one, two, three = min(max(u, -1.0), 1.0), min(max(v, -1.0), 1.0), min(max(w, -1.0), 1.0)
    by_radius = da * (u - 2 * one) + db * (v - 2 * two) + dc * (w - 2 * three)
    up, depth, side, by_radius = _to_sizes(table, row, da * one, db * two, dc * three, by_radius)
    out[row, SIZE] += up
    out[row, SIZE + 1] += depth
    out[row, SIZE + 2] += side
    out[row, SIZE + 3] += by_radius


PRIMITIVE = ROUNDED_BOX = Primitive(
    "rounded_box", ("half_up", "half_depth", "half_side", "radius"), 3,
    distance, bound, areas, sample, place, normal, mesh, volume,
    kernels=Kernels(
        distance_kernel, slopes_kernel, bound_kernel, excess_kernel, sample_kernel, place_kernel, normal_kernel,
        pull_kernel,
    ),
)  # fmt: skip
