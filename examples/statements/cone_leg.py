"""A tapered leg: a frustum, which is a primitive of its own (``--with examples/statements/cone_leg.py``).

The frustum has its axis along local axis 0; sizes are the half height and the radii of its bottom and its top.
"""

from __future__ import annotations

import math

import numpy as np
import torch

from shapeprog.geometry import Primitive, Solids, primitives
from shapeprog.geometry.primitive import safe_norm
from shapeprog.language import statement
from shapeprog.language.parameters import Length, Position, Radius
from shapeprog.language.shapes import solid

SIDES = 48
"""Corners of the polygon that stands for a circle in a mesh."""


def lengths(size):
    """Half height, bottom radius and top radius, never negative."""
    return size[..., :3].clamp(min=0).unbind(-1)


def radius(size, axial):
    """Radius at an axial coordinate between -1 and 1."""
    _, bottom, top = lengths(size)
    return (bottom * (1 - axial) + top * (1 + axial)) / 2


def distance(points, size):
    """Exact signed distance: a trapezoid in (axial, radial) coordinates, bounded by two caps and a slanted side."""
    half, bottom, top = lengths(size)
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


def bound(size):
    """Half extents of the box around the frustum."""
    half, bottom, top = lengths(size)
    widest = torch.maximum(bottom, top)
    return torch.stack([half, widest, widest], -1)


def areas(size):
    """Areas of bottom cap, top cap and slanted side."""
    half, bottom, top = lengths(size)
    slant = safe_norm(4 * half**2 + (top - bottom) ** 2)
    return math.pi * torch.stack([bottom**2, top**2, (bottom + top) * slant], -1)


def sample(size, face, u):
    """Axial coordinate and a place in the unit disc; the side has more area where it is wider."""
    _, bottom, top = lengths(size)
    angle = 2 * math.pi * u[..., 0]
    root = (bottom**2 + (top**2 - bottom**2) * u[..., 2]).clamp(min=0).sqrt()
    along = u[..., 2] * (bottom + top) / (bottom + root).clamp(min=1e-12)
    side = face == 2
    rim = torch.where(side, torch.ones_like(angle), u[..., 1].sqrt())
    axial = torch.where(side, 2 * along - 1, (2 * face - 1).to(u))
    return torch.stack([axial, rim * angle.cos(), rim * angle.sin()], -1)


def place(size, unit):
    """The point of the frustum for an axial coordinate and a place in the unit disc."""
    wide = radius(size, unit[..., 0])
    return torch.stack([lengths(size)[0] * unit[..., 0], wide * unit[..., 1], wide * unit[..., 2]], -1)


def normal(size, unit, face):
    """Outward normal: along the axis on the caps, leaning with the taper on the side."""
    half, bottom, top = lengths(size)
    lean, out = bottom - top, 2 * half
    side = torch.stack([lean, out * unit[..., 1], out * unit[..., 2]], -1) / safe_norm(lean**2 + out**2)[..., None]
    cap = torch.stack([unit[..., 0], torch.zeros_like(lean), torch.zeros_like(lean)], -1)
    return torch.where((face == 2)[..., None], side, cap)


def mesh(size):
    """A frustum over regular polygons with the areas of the circles, so that the volume is exact."""
    half, bottom, top = (float(length) for length in size[:3])
    step = 2 * math.pi / SIDES
    angle = step * np.arange(SIDES)
    ring = math.sqrt(step / math.sin(step)) * np.stack([np.zeros(SIDES), np.cos(angle), np.sin(angle)], 1)
    rise = np.array([half, 0.0, 0.0])
    vertices = np.concatenate([bottom * ring - rise, top * ring + rise, [-rise, rise]])
    a = np.arange(SIDES)
    b, low, high = (a + 1) % SIDES, np.full(SIDES, 2 * SIDES), np.full(SIDES, 2 * SIDES + 1)
    sides = [(a, b, b + SIDES), (a, b + SIDES, a + SIDES), (low, b, a), (high, a + SIDES, b + SIDES)]
    return vertices, np.concatenate([np.stack(side, 1) for side in sides]).astype(np.int64)


def volume(size):
    """Height times the mean of the areas of the circles between bottom and top."""
    half, bottom, top = lengths(size)
    return 2 / 3 * math.pi * half * (bottom**2 + bottom * top + top**2)


FRUSTUM = primitives.register(
    Primitive(
        name="frustum", sizes=("half_height", "bottom", "top"), extents=3, distance=distance, bound=bound,
        areas=areas, sample=sample, place=place, normal=normal, mesh=mesh, volume=volume,
    )
)  # fmt: skip


@statement("cone_leg")
def cone_leg(at: Position, height: Length, bottom: Radius, top: Radius) -> Solids:
    """A tapered round leg on the centre of its bottom face."""
    centre = torch.stack([at[..., 0] + height / 2, at[..., 1], at[..., 2]], -1)
    return solid(FRUSTUM, centre, height / 2, bottom, top)
