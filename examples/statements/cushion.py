"""A cushion: an ellipsoid, which is a primitive of its own (``--with examples/statements/cushion.py``).

The distance to an ellipsoid has no closed form.  The foot point is found without gradient, and the distance is then
differentiated at that foot alone, which by the envelope theorem is exact.
"""

from __future__ import annotations

import math

import numpy as np
import torch

from shapeprog.geometry import Primitive, Solids, primitives
from shapeprog.language import statement
from shapeprog.language.parameters import Extent, Position
from shapeprog.language.shapes import solid

THINNEST = 1e-6
"""Semi-axes in cells below this count as this where they divide."""


def axes(size):
    """The three semi-axes (..., 3), never negative."""
    return size[..., :3].clamp(min=0)


@torch.no_grad()
def foot(points, size):
    """The place (..., 3) on the unit sphere whose image on the ellipsoid is nearest to a point.

    With semi-axes a and the point p folded into the first octant, the foot is a^2 p / (t + a^2) for the largest root t
    of sum (a p / (t + a^2))^2 = 1.  One over the root of that sum is concave in t, so Newton's steps from the left
    climb to the root without passing it.
    """
    a = axes(size).double().clamp(min=THINNEST)
    a, p = torch.broadcast_tensors(a, points.double().abs().clamp(min=1e-12))
    t = (a * p - a**2).amax(-1, keepdim=True)
    for _ in range(24):
        u = a * p / (t + a**2)
        length = u.norm(dim=-1, keepdim=True)
        slope = (u**2 / (t + a**2)).sum(-1, keepdim=True) / length**3
        t = t + (1 - 1 / length) / slope
    u = a * p / (t + a**2)
    u = u / u.norm(dim=-1, keepdim=True)
    return torch.where(points < 0, -u, u).to(points)


def outward(size, unit):
    """Outward unit normal (..., 3) at the image of a place on the unit sphere."""
    a = axes(size).clamp(min=THINNEST)
    return torch.nn.functional.normalize(unit * a.amin(-1, keepdim=True) / a, dim=-1)


def distance(points, size):
    """Exact signed distance: along the normal from the foot to the point."""
    unit = foot(points, size)
    return (outward(size, unit).detach() * (points - axes(size) * unit)).sum(-1)


def stretch(size, unit):
    """How much larger the ellipsoid is than the unit sphere, per area, at a place on the sphere."""
    a, b, c = axes(size).unbind(-1)
    return ((unit * torch.stack([b * c, a * c, a * b], -1)) ** 2).sum(-1).clamp(min=1e-24).sqrt()


def areas(size):
    """Area by Gauss-Legendre quadrature over one octant of the sphere; there is one face."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    height = torch.as_tensor((nodes + 1) / 2).to(size)[:, None].expand(24, 24)
    angle = torch.as_tensor((nodes + 1) * math.pi / 4).to(size)
    rim = (1 - height**2).sqrt()
    unit = torch.stack([height, rim * angle.cos(), rim * angle.sin()], -1)
    weight = torch.as_tensor(weights[:, None] * weights * math.pi).to(size)
    return (stretch(size[..., None, None, :], unit) * weight).sum((-1, -2))[..., None]


def sphere(u):
    """Place (..., 3) on the unit sphere, uniform by area, for two uniform numbers."""
    height = 2 * u[..., 0] - 1
    rim, angle = (1 - height**2).clamp(min=0).sqrt(), 2 * math.pi * u[..., 1]
    return torch.stack([height, rim * angle.cos(), rim * angle.sin()], -1)


def sample(size, face, u):
    """Uniform by area: places on the sphere, kept with a chance that grows with the local stretch."""
    source = torch.Generator(u.device).manual_seed(int(u.double().sum() * 2**24))
    a, b, c = axes(size).unbind(-1)
    most = torch.stack([b * c, a * c, a * b], -1).amax(-1).clamp(min=1e-12)
    unit, keep = sphere(u), u[..., 2] * most <= stretch(size, sphere(u))
    for _ in range(40):  # at least half of all places are kept each time
        fresh = torch.rand(u.shape, generator=source, device=u.device, dtype=u.dtype)
        unit = torch.where(keep[..., None], unit, sphere(fresh))
        keep = keep | (fresh[..., 2] * most <= stretch(size, unit))
    return unit


def place(size, unit):
    """The point of the ellipsoid for a place on the unit sphere."""
    return axes(size) * unit


def mesh(size, rings=16, sides=32):
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


ELLIPSOID = primitives.register(
    Primitive(
        name="ellipsoid", sizes=("half_up", "half_depth", "half_side"), extents=3, distance=distance, bound=axes,
        areas=areas, sample=sample, place=place, normal=lambda size, unit, face: outward(size, unit), mesh=mesh,
        volume=lambda size: 4 / 3 * math.pi * axes(size).prod(-1),
    )
)  # fmt: skip


@statement("cushion")
def cushion(at: Position, size: Extent) -> Solids:
    """A cushion or bolster: an ellipsoid from the low corner of its box and its full extents."""
    return solid(ELLIPSOID, at + size / 2, *(size / 2).unbind(-1))
