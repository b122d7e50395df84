"""The cuboid, upright or sheared: a parallelogram in local axes (0, 1), extruded along local axis 2.

Sizes are three half extents and ``lean``, the shift along axis 1 of the top face against the bottom face.

Its cells follow rules of their own, those of the published executor: at right angles to the grid it covers
[rint(low), rint(high)) along each axis; sheared and upright, each layer is moved by a whole number of cells.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from shapeprog.geometry.primitive import Kernels, Mesh, Points, Primitive, Scalars, Sizes, Spans, Triple, safe_norm
from shapeprog.kernels.compile import helper
from shapeprog.kernels.rows import clip, fill_box
from shapeprog.kernels.table import CENTRE, ROTATION, SIZE
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import Array, FloatArray

FACES = 6
"""Faces in the order -0, +0, -1, +1, -2, +2."""


def distance(points: Points, size: Sizes) -> Scalars:
    """Exact signed distance to a sheared cuboid; upright and outside it is equation 3 of Liang (2022).

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
    return meet(plane, side.abs() - half_side)


def meet(one: Scalars, two: Scalars) -> Scalars:
    """Signed distance to what two bodies at right angles have in common, by the signed distances to each."""
    outer = safe_norm(one.clamp(min=0) ** 2 + two.clamp(min=0) ** 2)
    inner = torch.maximum(one, two)
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


def _facing(face: Int[Tensor, "*batch"], like: Points) -> tuple[Float[Tensor, "*batch 1"], Bool[Tensor, "*batch 3"]]:
    """Sign of a face, and which axis it is on."""
    sign = (2 * (face % 2) - 1).to(like)
    return sign[..., None], torch.arange(3, device=face.device) == (face // 2)[..., None]


def sample(size: Sizes, face: Int[Tensor, "*batch"], u: Points) -> Points:
    """Uniform place on a face of the cube [-1, 1]^3."""
    sign, axis = _facing(face, u)
    return torch.where(axis, sign, 2 * u - 1)


def place(size: Sizes, unit: Points) -> Points:
    """Point of the cuboid for a point of the cube [-1, 1]^3."""
    depth = size[..., 1] * unit[..., 1] + size[..., 3] / 2 * unit[..., 0]
    return torch.stack([size[..., 0] * unit[..., 0], depth, size[..., 2] * unit[..., 2]], -1)


def normal(size: Sizes, unit: Points, face: Int[Tensor, "*batch"]) -> Points:
    """Outward normal of a face; the two slanted faces lean with the shear."""
    half_up, slant = size[..., 0], size[..., 3] / 2
    length = safe_norm(half_up**2 + slant**2)
    sign, axis = _facing(face, unit)
    slanted = torch.stack([-slant / length, half_up / length, torch.zeros_like(slant)], -1)
    return sign * torch.where(axis[..., 1:2], slanted, axis.to(unit))


def mesh(size: FloatArray) -> Mesh:
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


def cell_size(size: Sizes) -> Sizes:
    """The same sizes; nothing is inside a cuboid without height, depth or width."""
    return torch.where((size[..., :3] > 0).all(-1, keepdim=True), size, torch.nan)


def spans(
    size: Sizes, centre: Points, rotation: Float[Tensor, "M 3 3"], square: Bool[Tensor, " M"], resolution: int
) -> Spans:
    """Cells of cuboids at right angles to the grid, and of sheared ones that stand upright."""
    layer = torch.arange(resolution, device=size.device)
    turn, item = rotation.round(), torch.arange(len(size), device=size.device)
    half = (turn.abs() @ size[:, :3, None])[..., 0]
    low, high = (centre - half).round(), (centre + half).round()
    # Layer i of t covers [o, o + a) with o = rint(y + lean * i / t) along the axis that it leans to.
    along = torch.where(turn[:, 1, 1].abs() > 0.5, 1, 2)
    lean = size[:, 3] * turn[item, along, 1] * turn[:, 0, 0]
    start = centre[item, along] - size[:, 1] - lean / 2
    moved = (start[:, None] + lean[:, None] * (layer - low[:, :1]) / (2 * size[:, :1])).round()
    end = moved + (2 * size[:, 1:2]).round()
    leans = size[:, 3] != 0
    covers = [(low[:, axis, None].expand_as(moved), high[:, axis, None].expand_as(moved)) for axis in (1, 2)]
    for axis in (1, 2):
        here = (leans & (along == axis))[:, None]
        covers[axis - 1] = (torch.where(here, moved, covers[axis - 1][0]), torch.where(here, end, covers[axis - 1][1]))
    known = square & (~leans | (turn[:, 0, 0].abs() > 0.5))
    return Spans(known, (low[:, :1], high[:, :1]), *covers)


# Twins for kernels; sizes are at SIZE: half extents up, in depth and to the side, and the lean.


@helper
def distance_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """Twin of :func:`distance`."""
    over_side = abs(c) - max(table[row, SIZE + 2], 0.0)
    half_up, half_depth = max(table[row, SIZE], 0.0), max(table[row, SIZE + 1], 0.0)
    if table[row, SIZE + 3] == 0:
        over_up, over_depth = abs(a) - half_up, abs(b) - half_depth
        plane = max(over_up, over_depth)
        if plane > 0:
            over_up, over_depth = max(over_up, 0.0), max(over_depth, 0.0)
            plane = math.sqrt(over_up * over_up + over_depth * over_depth)
    else:
        plane = _parallelogram(half_up, half_depth, table[row, SIZE + 3] / 2, a, b)[0]
    inner = max(plane, over_side)
    if inner <= 0:
        return inner
    plane, over_side = max(plane, 0.0), max(over_side, 0.0)
    return math.sqrt(plane * plane + over_side * over_side)


@helper
def _parallelogram(
    half_up: float, half_depth: float, slant: float, up: float, depth: float
) -> tuple[float, float, float, float, float, float]:
    """Signed distance in the plane of the shear, and its derivatives by up, depth, half_up, half_depth and lean.

    The foot of the perpendicular is where the squared distance is least, so it need not be differentiated.
    """
    turn = -1.0 if up < 0 else 1.0
    up, depth = up * turn, depth * turn
    over_up, along = up - half_up, depth - slant
    over_along = max(abs(along) - half_depth, 0.0)
    to_cap = over_up * over_up + over_along * over_along
    cross = depth * half_up - up * slant
    fold = -1.0 if cross < 0 else 1.0
    edge_up, edge_depth = up * fold, depth * fold - half_depth
    length = max(half_up * half_up + slant * slant, 1e-24)
    foot = min(max((edge_up * half_up + edge_depth * slant) / length, -1.0), 1.0)
    side_up, side_depth = edge_up - foot * half_up, edge_depth - foot * slant
    to_side = side_up * side_up + side_depth * side_depth
    plane = math.sqrt(min(to_cap, to_side))
    sign = -1.0 if over_up < 0 and abs(cross) < half_depth * half_up else 1.0
    if plane < 1e-12:
        return sign * plane, 0.0, 0.0, 0.0, 0.0, 0.0
    scale = sign / plane
    if to_cap <= to_side:
        away = over_along * scale * (1.0 if along > 0 else -1.0)
        return sign * plane, over_up * scale * turn, away * turn, -over_up * scale, -over_along * scale, -away / 2
    by_up, by_depth = side_up * fold * scale * turn, side_depth * fold * scale * turn
    by_half_up, by_lean = -foot * side_up * scale, -foot * side_depth * scale / 2
    return sign * plane, by_up, by_depth, by_half_up, -side_depth * scale, by_lean


@helper
def corner(one: float, two: float) -> tuple[float, float]:
    """Derivatives of the distance to where two surfaces meet by the distances to each, as autograd takes them."""
    if one <= 0 and two <= 0:
        if one == two:
            return 0.5, 0.5
        return (1.0, 0.0) if one > two else (0.0, 1.0)
    one, two = max(one, 0.0), max(two, 0.0)
    whole = math.sqrt(one * one + two * two)
    if whole < 1e-12:
        return 0.0, 0.0
    return one / whole, two / whole


@helper
def slopes_kernel(table: Array, row: int, a: float, b: float, c: float, out: Array) -> None:
    """Derivatives of :func:`distance_kernel`."""
    half_up, half_depth = max(table[row, SIZE], 0.0), max(table[row, SIZE + 1], 0.0)
    plane, by_up, by_depth, by_half_up, by_half_depth, by_lean = _parallelogram(
        half_up, half_depth, table[row, SIZE + 3] / 2, a, b
    )
    by_plane, by_side = corner(plane, abs(c) - max(table[row, SIZE + 2], 0.0))
    out[0], out[1], out[2] = by_plane * by_up, by_plane * by_depth, by_side * np.sign(c)
    out[3], out[4], out[5], out[6] = by_plane * by_half_up, by_plane * by_half_depth, -by_side, by_plane * by_lean


@helper
def bound_kernel(table: Array, row: int) -> Triple:
    """Twin of :func:`bound`."""
    depth = max(table[row, SIZE + 1], 0.0) + abs(table[row, SIZE + 3]) / 2
    return max(table[row, SIZE], 0.0), depth, max(table[row, SIZE + 2], 0.0)


@helper
def excess_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """How far a point is beyond the caps, the ends, or the slanted faces, there times the half height."""
    half_up, half_depth = table[row, SIZE], table[row, SIZE + 1]
    over_up = abs(a) - half_up
    if over_up > 0:
        return over_up
    over_depth = abs(b * half_up - a * (table[row, SIZE + 3] / 2)) - half_depth * half_up
    return max(max(over_up, over_depth), abs(c) - table[row, SIZE + 2])


@helper
def sample_kernel(table: Array, row: int, face: int, one: float, two: float, three: float) -> Triple:
    """Twin of :func:`sample`."""
    sign = 2.0 * (face % 2) - 1
    u, v, w = 2 * one - 1, 2 * two - 1, 2 * three - 1
    if face < 2:
        return sign, v, w
    if face < 4:
        return u, sign, w
    return u, v, sign


@helper
def place_kernel(table: Array, row: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`place`."""
    depth = table[row, SIZE + 1] * v + table[row, SIZE + 3] / 2 * u
    return table[row, SIZE] * u, depth, table[row, SIZE + 2] * w


@helper
def normal_kernel(table: Array, row: int, face: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`normal`."""
    sign = 2.0 * (face % 2) - 1
    if face < 2:
        return sign, 0.0, 0.0
    if face < 4:
        half_up, slant = table[row, SIZE], table[row, SIZE + 3] / 2
        length = math.sqrt(max(half_up * half_up + slant * slant, 1e-24))
        return -sign * slant / length, sign * half_up / length, 0.0
    return 0.0, 0.0, sign


@helper
def pull_kernel(
    table: Array, row: int, u: float, v: float, w: float, da: float, db: float, dc: float, out: Array
) -> None:
    """Gradient of :func:`place_kernel` by the sizes."""
    out[row, SIZE] += da * u
    out[row, SIZE + 1] += db * v
    out[row, SIZE + 2] += dc * w
    out[row, SIZE + 3] += db * u / 2


@helper
def cells_kernel(table: Array, row: int, square: bool, planes: Array, plane: int, low: Array, high: Array) -> bool:
    """Twin of :func:`spans`; fills nothing where a length is not positive."""
    if table[row, SIZE] <= 0 or table[row, SIZE + 1] <= 0 or table[row, SIZE + 2] <= 0:
        return True
    resolution, lean = planes.shape[2], table[row, SIZE + 3]
    if not square or (lean != 0 and abs(table[row, ROTATION]) < 0.5):
        return False
    for axis in range(3):
        half = 0.0
        for other in range(3):
            half += abs(np.rint(table[row, ROTATION + 3 * axis + other])) * table[row, SIZE + other]
        low[axis] = clip(np.rint(table[row, CENTRE + axis] - half), resolution)
        high[axis] = clip(np.rint(table[row, CENTRE + axis] + half), resolution)
    if lean == 0:
        fill_box(planes, plane, low, high)
        return True
    along = 1 if abs(table[row, ROTATION + 4]) > 0.5 else 2
    lean *= np.rint(table[row, ROTATION + 3 * along + 1]) * np.rint(table[row, ROTATION])
    bottom = np.rint(table[row, CENTRE] - table[row, SIZE])
    start = table[row, CENTRE + along] - table[row, SIZE + 1] - lean / 2
    depth = np.rint(2 * table[row, SIZE + 1])
    for i in range(low[0], high[0]):
        low[0], high[0] = i, i + 1
        offset = np.rint(start + lean * (i - bottom) / (2 * table[row, SIZE]))
        low[along], high[along] = clip(offset, resolution), clip(offset + depth, resolution)
        fill_box(planes, plane, low, high)
    return True


PRIMITIVE = CUBOID = Primitive(
    "cuboid", ("half_up", "half_depth", "half_side", "lean"), 3,
    distance, bound, areas, sample, place, normal, mesh, volume, cell_size, spans,
    kernels=Kernels(
        distance_kernel, slopes_kernel, bound_kernel, excess_kernel, sample_kernel, place_kernel, normal_kernel,
        pull_kernel, cells_kernel,
    ),
)  # fmt: skip
