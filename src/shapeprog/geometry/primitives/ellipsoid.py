"""The ellipsoid: three half axes along the local axes.

The distance to an ellipsoid has no closed form.  The foot point is found without gradient, and the distance is then
differentiated at that foot alone, which by the envelope theorem is exact.
"""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry.derived import solid
from shapeprog.geometry.formulas import (
    Four,
    Number,
    Triple,
    at_least,
    call,
    constant,
    cos,
    minimum,
    positive,
    root,
    sin,
    where,
)  # fmt: skip
from shapeprog.geometry.primitive import Mesh, Scalars
from shapeprog.geometry.random import uniform as uniform_at
from shapeprog.kernels.bits import uniform
from shapeprog.kernels.compile import helper
from shapeprog.kernels.table import SIZE
from shapeprog.lazy_torch import torch
from shapeprog.space import Array, FloatArray

THINNEST = 1e-6  # half axes in cells below this count as this where they divide
STEPS = 24  # Newton steps to a foot; kernels stop once it no longer moves
CLOSE = 1e-9  # of the squared length to 1, for kernels; the distance, least at the foot, errs by its square
NODES = 12  # positions along each axis of the quadrature for the area
TRIES = 40  # positions drawn before one is taken as it comes; at least half of them are accepted each time


def foot(a: Scalars, b: Scalars, c: Scalars, x: Scalars, y: Scalars, z: Scalars) -> tuple[Scalars, Scalars, Scalars]:
    """The point on the unit sphere whose image on the ellipsoid of half axes a, b, c is nearest to (x, y, z).

    With half axes a and the point p folded into the first octant, the foot is a^2 p / (t + a^2) for the largest root t
    of sum (a p / (t + a^2))^2 = 1.  One over the root of that sum is concave in t, so Newton's steps from the left
    climb to the root without passing it.
    """
    axes, points = torch.stack([a, b, c], -1).detach().double(), torch.stack([x, y, z], -1).detach()
    axes, p = torch.broadcast_tensors(axes, points.double().abs().clamp(min=1e-12))
    t = (axes * p - axes**2).amax(-1, keepdim=True)
    for _ in range(STEPS):
        u = axes * p / (t + axes**2)
        length = u.norm(dim=-1, keepdim=True)
        slope = (u**2 / (t + axes**2)).sum(-1, keepdim=True) / length**3
        t = t + (1 - 1 / length) / slope
    u = axes * p / (t + axes**2)
    u = u / u.norm(dim=-1, keepdim=True)
    first, second, third = torch.where(points < 0, -u, u).to(points).unbind(-1)
    return first, second, third


@helper
def foot_kernel(a: float, b: float, c: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Kernel version of :func:`foot`."""
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


def _axes(size: Four) -> Triple:
    """The three half axes where they divide."""
    return at_least(size[0], THINNEST), at_least(size[1], THINNEST), at_least(size[2], THINNEST)


def distance(size: Four, point: Triple) -> Number:
    """Exact signed distance: along the normal from the foot to the point."""
    unit = call(foot_kernel, foot, *_axes(size), *point)
    across, foot_point = normal(size, unit), place(size, unit)
    x, y, z = (
        constant(first) * (second - third) for first, second, third in zip(across, point, foot_point, strict=True)
    )
    return x + y + z


def excess(size: Four, point: Triple) -> Number:
    """Squared length, beyond 1, of a point in units of the half axes."""
    x, y, z = (first / axis for first, axis in zip(point, size, strict=False))
    return where((size[0] > 0) & (size[1] > 0) & (size[2] > 0), x**2 + y**2 + z**2 - 1, 1.0)


def bound(size: Four) -> Triple:
    """The half axes."""
    return positive(size[0]), positive(size[1]), positive(size[2])


def _stretch(size: Four, unit: Triple) -> Number:
    """How much larger the ellipsoid is than the unit sphere, per area, at a point of the sphere."""
    a, b, c = bound(size)
    return root((unit[0] * b * c) ** 2 + (unit[1] * a * c) ** 2 + (unit[2] * a * b) ** 2)


def areas(size: Four) -> tuple[Number]:
    """Area by Gauss-Legendre quadrature over one octant of the sphere, to 1e-4 for the thinnest; there is one face."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    height = torch.as_tensor((nodes + 1) / 2).to(size[0])[:, None].expand(NODES, NODES)
    angle = torch.as_tensor((nodes + 1) * math.pi / 4).to(size[0])
    rim = (1 - height**2).sqrt()
    unit = height, rim * angle.cos(), rim * angle.sin()
    weight = torch.as_tensor(weights[:, None] * weights * math.pi).to(size[0])
    wide = size[0][..., None, None], size[1][..., None, None], size[2][..., None, None], size[3]
    return ((_stretch(wide, unit) * weight).sum((-1, -2)),)


def _sphere(first: Number, second: Number) -> Triple:
    """Point of the unit sphere, uniform by area, for two uniform numbers."""
    height, angle = 2 * first - 1, 2 * math.pi * second
    rim = root(positive(1 - height**2))
    return height, rim * cos(angle), rim * sin(angle)


def sample(size: Four, face: Number, numbers: Triple) -> Triple:
    """Uniform by area: points of the sphere, accepted with a chance that grows with the local stretch.

    Numbers for further points come from the stream whose seed is the third number.
    """
    a, b, c = bound(size)
    largest = torch.maximum(torch.maximum(b * c, a * c), a * b)
    first, second, third = numbers
    seed = (third.double() * 2**53).long()
    unit = _sphere(first, second)
    keep = third * largest <= _stretch(size, unit)
    for turn in range(1, TRIES):
        if bool(keep.all()):
            break
        first, second, third = (uniform_at(seed, torch.full_like(seed, 3 * turn + k)).to(third) for k in range(3))
        fresh = _sphere(first, second)
        unit = where(keep, unit[0], fresh[0]), where(keep, unit[1], fresh[1]), where(keep, unit[2], fresh[2])
        keep = keep | (third * largest <= _stretch(size, fresh))
    return unit


@helper
def sample_kernel(
    table: Array, row: int, face: int, first: float, second: float, third: float
) -> tuple[float, float, float]:
    """Kernel version of :func:`sample`."""
    a, b, c = table[row, SIZE], table[row, SIZE + 1], table[row, SIZE + 2]
    largest = max(max(b * c, a * c), a * b)
    seed, turn = int(third * 9007199254740992.0), 0
    while True:
        height, angle = 2 * first - 1, 2 * math.pi * second
        rim = math.sqrt(max(1 - height * height, 0.0))
        v, w = rim * math.cos(angle), rim * math.sin(angle)
        d, e, f = height * b * c, v * a * c, w * a * b
        turn += 1
        if turn >= TRIES or third * largest <= math.sqrt(max(d * d + e * e + f * f, 1e-24)):
            return height, v, w
        first, second, third = uniform(seed, 3 * turn), uniform(seed, 3 * turn + 1), uniform(seed, 3 * turn + 2)


def place(size: Four, unit: Triple) -> Triple:
    """The point of the ellipsoid for a point of the unit sphere."""
    a, b, c = bound(size)
    return a * unit[0], b * unit[1], c * unit[2]


def normal(size: Four, unit: Triple, face: Number = None) -> Triple:
    """Outward unit normal at the image of a point of the unit sphere, which is the one face."""
    a, b, c = _axes(size)
    smallest = minimum(minimum(a, b), c)
    x, y, z = unit[0] * smallest / a, unit[1] * smallest / b, unit[2] * smallest / c
    length = root(x**2 + y**2 + z**2)
    return x / length, y / length, z / length


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


def volume(size: Four) -> Number:
    """That of the unit ball times the three half axes."""
    a, b, c = bound(size)
    return 4 / 3 * math.pi * a * b * c


PRIMITIVE = ELLIPSOID = solid(
    "ellipsoid", ("half_up", "half_depth", "half_side"), 3, distance=distance, excess=excess, bound=bound, areas=areas,
    sample=sample, place=place, normal=normal, mesh=mesh, volume=volume, sample_kernel=sample_kernel,
)  # fmt: skip
