"""The ellipsoid: three half axes along the local axes.

The distance to an ellipsoid has no closed form.  The foot point is found without gradient, and the distance is then
differentiated at that foot alone, which by the envelope theorem is exact.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from shapeprog.geometry.primitive import Kernels, Mesh, Points, Primitive, Scalars, Sizes, Triple, safe_norm
from shapeprog.geometry.random import uniform as uniform_at
from shapeprog.kernels.bits import uniform
from shapeprog.kernels.compile import helper
from shapeprog.kernels.table import SIZE
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import Array, FloatArray

THINNEST = 1e-6  # half axes in cells below this count as this where they divide
STEPS = 24  # Newton steps to a foot; kernels stop once it no longer moves
CLOSE = 1e-9  # of the squared length of a place to 1, for kernels; the distance, least at the foot, errs by its square
NODES = 12  # places along each axis of the quadrature for the area
TRIES = 40  # places drawn before one is taken as it comes; at least half of them are kept each time


def _axes(size: Sizes) -> Points:
    """The three half axes, never negative."""
    return size[..., :3].clamp(min=0)


def foot(points: Points, size: Sizes) -> Points:
    """The place (..., 3) on the unit sphere whose image on the ellipsoid is nearest to a point.

    With half axes a and the point p folded into the first octant, the foot is a^2 p / (t + a^2) for the largest root t
    of sum (a p / (t + a^2))^2 = 1.  One over the root of that sum is concave in t, so Newton's steps from the left
    climb to the root without passing it.
    """
    points, size = points.detach(), size.detach()
    a = _axes(size).double().clamp(min=THINNEST)
    a, p = torch.broadcast_tensors(a, points.double().abs().clamp(min=1e-12))
    t = (a * p - a**2).amax(-1, keepdim=True)
    for _ in range(STEPS):
        u = a * p / (t + a**2)
        length = u.norm(dim=-1, keepdim=True)
        slope = (u**2 / (t + a**2)).sum(-1, keepdim=True) / length**3
        t = t + (1 - 1 / length) / slope
    u = a * p / (t + a**2)
    u = u / u.norm(dim=-1, keepdim=True)
    return torch.where(points < 0, -u, u).to(points)


def distance(points: Points, size: Sizes) -> Scalars:
    """Exact signed distance: along the normal from the foot to the point."""
    unit = foot(points, size)
    return (normal(size, unit).detach() * (points - place(size, unit))).sum(-1)


def _cuts(size: Sizes) -> Points:
    """Products of two half axes each: the areas of the cuts across an axis, in units of pi."""
    a, b, c = _axes(size).unbind(-1)
    return torch.stack([b * c, a * c, a * b], -1)


def _stretch(size: Sizes, unit: Points) -> Scalars:
    """How much larger the ellipsoid is than the unit sphere, per area, at a place on the sphere."""
    return safe_norm(((unit * _cuts(size)) ** 2).sum(-1))


def areas(size: Sizes) -> Float[Tensor, "*batch faces"]:
    """Area by Gauss-Legendre quadrature over one octant of the sphere, to 1e-4 for the thinnest; there is one face."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    height = torch.as_tensor((nodes + 1) / 2).to(size)[:, None].expand(NODES, NODES)
    angle = torch.as_tensor((nodes + 1) * math.pi / 4).to(size)
    rim = (1 - height**2).sqrt()
    unit = torch.stack([height, rim * angle.cos(), rim * angle.sin()], -1).expand(*size.shape[:-1], NODES, NODES, 3)
    weight = torch.as_tensor(weights[:, None] * weights * math.pi).to(size)
    each = _stretch(size[..., None, None, :].expand(*unit.shape[:-1], 4), unit)
    return (each * weight).sum((-1, -2))[..., None]


def _sphere(one: Scalars, two: Scalars) -> Points:
    """Place on the unit sphere, uniform by area, for two uniform numbers."""
    height, angle = 2 * one - 1, 2 * math.pi * two
    rim = (1 - height**2).clamp(min=0).sqrt()
    return torch.stack([height, rim * angle.cos(), rim * angle.sin()], -1)


def sample(size: Sizes, face: Int[Tensor, "*batch"], u: Points) -> Points:
    """Uniform by area: places on the sphere, kept with a chance that grows with the local stretch.

    Numbers for further places come from the stream whose seed is the third number.
    """
    most = _cuts(size).amax(-1)
    one, two, three = u.unbind(-1)
    seed = (three.double() * 2**53).long()
    unit = _sphere(one, two)
    keep = three * most <= _stretch(size, unit)
    for turn in range(1, TRIES):
        if bool(keep.all()):
            break
        one, two, three = (uniform_at(seed, torch.full_like(seed, 3 * turn + k)).to(u) for k in range(3))
        fresh = _sphere(one, two)
        unit = torch.where(keep[..., None], unit, fresh)
        keep = keep | (three * most <= _stretch(size, fresh))
    return unit


def place(size: Sizes, unit: Points) -> Points:
    """The point of the ellipsoid for a place on the unit sphere."""
    return _axes(size) * unit


def normal(size: Sizes, unit: Points, face: Int[Tensor, "*batch"] | None = None) -> Points:
    """Outward unit normal at the image of a place on the unit sphere, which is the one face."""
    a = _axes(size).clamp(min=THINNEST)
    return torch.nn.functional.normalize(unit * a.amin(-1, keepdim=True) / a, dim=-1)


def mesh(size: FloatArray, rings: int = 16, sides: int = 32) -> Mesh:
    """Rings between two poles, grown a little so that the volume is that of the ellipsoid."""
    height = np.cos(np.pi * np.arange(1, rings) / rings)[:, None]
    angle = 2 * np.pi * np.arange(sides) / sides
    rim = np.sqrt(1 - height**2)
    ring = np.stack([np.broadcast_to(height, (rings - 1, sides)), rim * np.cos(angle), rim * np.sin(angle)], -1)
    vertices = np.concatenate([ring.reshape(-1, 3), [[1.0, 0, 0], [-1.0, 0, 0]]])
    a = np.arange(sides)
    b, top, bottom = (a + 1) % sides, np.full(sides, len(vertices) - 2), np.full(sides, len(vertices) - 1)
    faces = [np.stack([top, a, b], 1), np.stack([bottom, b + (rings - 2) * sides, a + (rings - 2) * sides], 1)]
    for low in range(0, (rings - 2) * sides, sides):
        faces += [np.stack([a, a + sides, b + sides], 1) + low, np.stack([a, b + sides, b], 1) + low]
    triangles = np.concatenate(faces)
    solid_angle = np.linalg.det(vertices[triangles]).sum() / 6
    return vertices * np.cbrt(4 / 3 * np.pi / solid_angle) * size[:3], triangles.astype(np.int64)


def volume(size: Sizes) -> Scalars:
    """That of the unit ball times the three half axes."""
    return 4 / 3 * math.pi * _axes(size).prod(-1)


# Twins for kernels; sizes are at SIZE: the three half axes.


@helper
def _foot(table: Array, row: int, x: float, y: float, z: float) -> Triple:
    """Twin of :func:`foot`."""
    a, b, c = (
        max(table[row, SIZE], THINNEST), max(table[row, SIZE + 1], THINNEST), max(table[row, SIZE + 2], THINNEST)
    )  # fmt: skip
    aa, bb, cc = a * a, b * b, c * c
    p, q, r = a * max(abs(x), 1e-12), b * max(abs(y), 1e-12), c * max(abs(z), 1e-12)
    t = max(max(p - aa, q - bb), r - cc)
    u, v, w = 1.0, 0.0, 0.0
    for _ in range(STEPS):
        f, g, h = 1 / (t + aa), 1 / (t + bb), 1 / (t + cc)
        u, v, w = p * f, q * g, r * h
        squared = u * u + v * v + w * w
        if abs(squared - 1) <= CLOSE:
            break
        length = math.sqrt(squared)
        t += (length - 1) * squared / (u * u * f + v * v * g + w * w * h)
    length = math.sqrt(u * u + v * v + w * w)
    return math.copysign(u / length, x), math.copysign(v / length, y), math.copysign(w / length, z)


@helper
def distance_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """Twin of :func:`distance`."""
    u, v, w = _foot(table, row, a, b, c)
    x, y, z = normal_kernel(table, row, 0, u, v, w)
    d, e, f = place_kernel(table, row, u, v, w)
    return x * (a - d) + y * (b - e) + z * (c - f)


@helper
def slopes_kernel(table: Array, row: int, a: float, b: float, c: float, out: Array) -> None:
    """Derivatives of :func:`distance_kernel`."""
    u, v, w = _foot(table, row, a, b, c)
    x, y, z = normal_kernel(table, row, 0, u, v, w)
    out[0], out[1], out[2] = x, y, z
    out[3], out[4], out[5], out[6] = -x * u, -y * v, -z * w, 0.0


@helper
def bound_kernel(table: Array, row: int) -> Triple:
    """The half axes."""
    return max(table[row, SIZE], 0.0), max(table[row, SIZE + 1], 0.0), max(table[row, SIZE + 2], 0.0)


@helper
def excess_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """Squared length, beyond 1, of a point in units of the half axes."""
    one, two, three = table[row, SIZE], table[row, SIZE + 1], table[row, SIZE + 2]
    if one <= 0 or two <= 0 or three <= 0:
        return 1.0
    a, b, c = a / one, b / two, c / three
    return a * a + b * b + c * c - 1


@helper
def sample_kernel(table: Array, row: int, face: int, one: float, two: float, three: float) -> Triple:
    """Twin of :func:`sample`."""
    a, b, c = table[row, SIZE], table[row, SIZE + 1], table[row, SIZE + 2]
    most = max(max(b * c, a * c), a * b)
    seed, turn = int(three * 9007199254740992.0), 0
    while True:
        height, angle = 2 * one - 1, 2 * math.pi * two
        rim = math.sqrt(max(1 - height * height, 0.0))
        v, w = rim * math.cos(angle), rim * math.sin(angle)
        d, e, f = height * b * c, v * a * c, w * a * b
        turn += 1
        if turn >= TRIES or three * most <= math.sqrt(max(d * d + e * e + f * f, 1e-24)):
            return height, v, w
        one, two, three = uniform(seed, 3 * turn), uniform(seed, 3 * turn + 1), uniform(seed, 3 * turn + 2)


@helper
def place_kernel(table: Array, row: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`place`."""
    return max(table[row, SIZE], 0.0) * u, max(table[row, SIZE + 1], 0.0) * v, max(table[row, SIZE + 2], 0.0) * w


@helper
def normal_kernel(table: Array, row: int, face: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`normal`."""
    a, b, c = (
        max(table[row, SIZE], THINNEST), max(table[row, SIZE + 1], THINNEST), max(table[row, SIZE + 2], THINNEST)
    )  # fmt: skip
    least = min(min(a, b), c)
    x, y, z = u * least / a, v * least / b, w * least / c
    length = max(math.sqrt(x * x + y * y + z * z), 1e-12)
    return x / length, y / length, z / length


@helper
def pull_kernel(
    table: Array, row: int, u: float, v: float, w: float, da: float, db: float, dc: float, out: Array
) -> None:
    """Gradient of :func:`place_kernel` by the sizes."""
    out[row, SIZE] += da * u
    out[row, SIZE + 1] += db * v
    out[row, SIZE + 2] += dc * w


PRIMITIVE = ELLIPSOID = Primitive(
    "ellipsoid", ("half_up", "half_depth", "half_side"), 3,
    distance, _axes, areas, sample, place, normal, mesh, volume,
    kernels=Kernels(
        distance_kernel, slopes_kernel, bound_kernel, excess_kernel, sample_kernel, place_kernel, normal_kernel,
        pull_kernel,
    ),
)  # fmt: skip
