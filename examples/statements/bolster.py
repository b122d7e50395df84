"""A bolster: a capsule, which is a primitive of its own (``--with examples/statements/bolster.py``).

The capsule has its axis along local axis 0; sizes are half the length of its straight part, and its radius.
"""

from __future__ import annotations

import math

import numpy as np
import torch

from shapeprog.geometry import Primitive, Solids, primitives
from shapeprog.geometry.primitive import safe_norm
from shapeprog.language import statement
from shapeprog.language.parameters import Length, Position, Radius
from shapeprog.language.shapes import align, solid


def lengths(size):
    """Half length of the straight part, and radius, never negative."""
    return size[..., :2].clamp(min=0).unbind(-1)


def distance(points, size):
    """Exact signed distance: that to the axis, less the radius."""
    half, radius = lengths(size)
    beyond = (points[..., 0].abs() - half).clamp(min=0)
    return safe_norm(beyond**2 + points[..., 1] ** 2 + points[..., 2] ** 2) - radius


def bound(size):
    """Half extents of the box around the capsule."""
    half, radius = lengths(size)
    return torch.stack([half + radius, radius, radius], -1)


def areas(size):
    """Areas of the two half balls and of the side."""
    half, radius = lengths(size)
    ball = 2 * math.pi * radius**2
    return torch.stack([ball, ball, 4 * math.pi * radius * half], -1)


def sample(size, face, u):
    """Axial coordinate, from -1 to 1 on the side and up to 2 beyond it on the half balls, and a place across."""
    angle, side = 2 * math.pi * u[..., 0], face == 2
    height = torch.where(side, 0.0, u[..., 1])
    rim = (1 - height**2).sqrt()
    axial = torch.where(side, 2 * u[..., 2] - 1, (1 + height) * (2 * face - 1).to(u))
    return torch.stack([axial, rim * angle.cos(), rim * angle.sin()], -1)


def place(size, unit):
    """The point of the capsule for such a place."""
    half, radius = lengths(size)
    straight = unit[..., 0].clamp(-1, 1)
    along = half * straight + radius * (unit[..., 0] - straight)
    return torch.stack([along, radius * unit[..., 1], radius * unit[..., 2]], -1)


def normal(size, unit, face):
    """Outward normal: away from the axis."""
    return torch.stack([unit[..., 0] - unit[..., 0].clamp(-1, 1), unit[..., 1], unit[..., 2]], -1)


def volume(size):
    """That of the straight part and of a ball."""
    half, radius = lengths(size)
    return 2 * math.pi * radius**2 * half + 4 / 3 * math.pi * radius**3


def mesh(size, rings=8, sides=32):
    """Rings between two poles, those of the two ends one straight part apart; widened to the exact volume."""
    half, radius = (float(length) for length in size[:2])
    rise = np.sin(np.pi / 2 * np.arange(rings) / rings)
    rim = np.concatenate([np.sqrt(1 - rise[::-1] ** 2), np.sqrt(1 - rise**2)])
    along = np.concatenate([-half - radius * rise[::-1], half + radius * rise])
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.zeros(sides), np.cos(angle), np.sin(angle)], 1)
    vertices = [radius * rim[k] * ring + [along[k], 0, 0] for k in range(2 * rings)]
    vertices = np.concatenate([*vertices, [[half + radius, 0, 0], [-half - radius, 0, 0]]])
    a, last = np.arange(sides), (2 * rings - 1) * sides
    b, top, bottom = (a + 1) % sides, np.full(sides, last + sides), np.full(sides, last + sides + 1)
    faces = [np.stack([top, a + last, b + last], 1), np.stack([bottom, b, a], 1)]
    for low in range(0, last, sides):
        faces += [np.stack([a, b, b + sides], 1) + low, np.stack([a, b + sides, a + sides], 1) + low]
    triangles = np.concatenate(faces)
    found = np.linalg.det(vertices[triangles]).sum() / 6
    wanted = 2 * math.pi * radius**2 * half + 4 / 3 * math.pi * radius**3
    vertices[:, 1:] *= math.sqrt(wanted / found) if found > 0 else 1
    return vertices, triangles.astype(np.int64)


CAPSULE = primitives.register(
    Primitive(
        name="capsule", sizes=("half_length", "radius"), extents=2, distance=distance, bound=bound, areas=areas,
        sample=sample, place=place, normal=normal, mesh=mesh, volume=volume,
    )
)  # fmt: skip


@statement("bolster")
def bolster(at: Position, length: Length, radius: Radius) -> Solids:
    """A bolster from its middle, lying from left to right: so much of its length is straight, its ends are round."""
    side = torch.zeros_like(at)
    side[..., 2] = 1
    return solid(CAPSULE, at, length / 2, radius, rotation=align(side))
