"""The rounded box: three half extents, and the radius to which its edges are rounded.

It is everything within that radius of an inner box: its surface is that of a ball whose octants are moved apart.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from shapeprog.geometry import formulas as f
from shapeprog.geometry.formulas import Four, Number, Triple
from shapeprog.geometry.primitive import Mesh, Primitive
from shapeprog.geometry.primitives import cuboid
from shapeprog.space import FloatArray

PER_QUARTER = 8  # edges of the polygon that approximates a quarter of a circle in a mesh


def _inner(size: Four) -> Four:
    """Half extents of the inner box, and the radius, which is at most the smallest half extent."""
    up, depth, side, radius = map(f.positive, size)
    radius = f.minimum(radius, f.minimum(f.minimum(up, depth), side))
    return up - radius, depth - radius, side - radius, radius


def _beyond(size: Four, point: Triple) -> Four:
    """How far a point is beyond the inner box along each axis, and the radius."""
    up, depth, side, radius = _inner(size)
    return abs(point[0]) - up, abs(point[1]) - depth, abs(point[2]) - side, radius


def distance(size: Four, point: Triple) -> Number:
    """Exact signed distance: that to the inner box, less the radius."""
    up, depth, side, radius = _beyond(size, point)
    inside = f.maximum(f.maximum(up, depth), side)
    outside = f.root(f.positive(up) ** 2 + f.positive(depth) ** 2 + f.positive(side) ** 2)
    return f.where(inside > 0, outside, inside) - radius


def excess(size: Four, point: Triple) -> Number:
    """How far a point is beyond the surface within the inner box, elsewhere by squared distances from that box."""
    up, depth, side, radius = _beyond(size, point)
    inside = f.maximum(f.maximum(up, depth), side)
    squared = f.positive(up) ** 2 + f.positive(depth) ** 2 + f.positive(side) ** 2
    return f.where(inside > 0, squared - radius**2, inside - radius)


def bound(size: Four) -> Triple:
    """The half extents."""
    return f.positive(size[0]), f.positive(size[1]), f.positive(size[2])


def areas(size: Four) -> tuple[Number, ...]:
    """Areas of the flat faces across each axis, two together; of the four edges along each; and of the corners."""
    up, depth, side, radius = _inner(size)
    edges = (4 * math.pi * radius * half for half in (up, depth, side))
    return 8 * depth * side, 8 * up * side, 8 * up * depth, *edges, 4 * math.pi * radius**2


def sample(size: Four, face: Number, uniform: Triple) -> Triple:
    """A position of which each coordinate is in [-1, 1] along the inner box, or beyond it by that of the normal.

    Drawn for the faces of axis 0 and then turned to the axis of the face; the corners together are a ball.
    """
    first_uniform, second_uniform, third_uniform = uniform
    u, angle, flat, ball = 2 * first_uniform - 1, 2 * math.pi * second_uniform, face < 3, face > 5
    rim = f.where(ball, f.root(f.positive(1 - u**2)), 1.0)
    first = f.where(flat, f.where(first_uniform < 0.5, -2.0, 2.0), f.where(ball, u + f.where(u < 0, -1.0, 1.0), u))
    second, third = rim * f.cos(angle), rim * f.sin(angle)
    second = f.where(flat, 2 * second_uniform - 1, second + f.where(second < 0, -1.0, 1.0))
    third = f.where(flat, 2 * third_uniform - 1, third + f.where(third < 0, -1.0, 1.0))
    axis = face % 3

    def turned(zero: Number, first_uniform: Number, second_uniform: Number) -> Number:
        return f.where(axis < 1, zero, f.where(axis < 2, first_uniform, second_uniform))

    return turned(first, third, second), turned(second, first, third), turned(third, second, first)


def place(size: Four, unit: Triple) -> Triple:
    """Point of the rounded box for such a position."""
    up, depth, side, radius = _inner(size)
    u, v, w = (f.clamp(number, -1.0, 1.0) for number in unit)
    return up * u + radius * (unit[0] - u), depth * v + radius * (unit[1] - v), side * w + radius * (unit[2] - w)


def normal(size: Four, unit: Triple, face: Number) -> Triple:
    """Outward normal: how far a position is beyond the inner box."""
    u, v, w = (number - f.clamp(number, -1.0, 1.0) for number in unit)
    return u, v, w


def mesh(size: FloatArray) -> Mesh:
    """The convex hull of eighths of a ball, one at each corner of the inner box.

    The radius of the balls, which are polyhedra, is a little smaller, so that the volume is exact.
    """
    from manifold3d import Manifold

    half = np.maximum(size[:3], 0)
    radius = min(max(size[3], 0.0), half.min())
    if radius == 0:
        return cuboid.mesh(np.append(half, 0.0))
    tilt = math.pi / 2 * np.linspace(0, 1, PER_QUARTER + 1)
    radius = _smaller(radius, half.sum(), tilt)
    rim, axial, around = np.sin(tilt)[:, None], np.cos(tilt)[:, None], np.ones_like(tilt)
    eighth = np.stack([axial * around, rim * np.cos(tilt), rim * np.sin(tilt)], -1).reshape(-1, 3)
    signs = np.array([*product((-1, 1), repeat=3)])[:, None]
    hull = Manifold.hull_points((signs * (half - radius + radius * eighth)).reshape(-1, 3)).to_mesh64()
    return np.array(hull.vert_properties), np.array(hull.tri_verts, np.int64)


def _smaller(radius: float, halves: float, tilt: FloatArray) -> float:
    """The radius of balls over polygons at angles from the pole to the equator that takes as much off the cuboid.

    A radius takes 2 * edges * r^2 + corners * r^3 off; the root is approached from above, so Newton's method converges.
    """
    area = 2 * PER_QUARTER * math.sin(math.pi / (2 * PER_QUARTER))  # of the polygon in a circle of radius 1
    low, high = np.sin(tilt[:-1]), np.sin(tilt[1:])
    ball = 2 / 3 * area * (-np.diff(np.cos(tilt)) * (low**2 + low * high + high**2)).sum()
    edges, corners = (4 - area) * halves, 6 * area - 16 - ball
    removed = 2 * (4 - math.pi) * halves * radius**2 + (6 * math.pi - 16 - 4 / 3 * math.pi) * radius**3
    for _ in range(6):
        off = 2 * edges * radius**2 + corners * radius**3
        radius -= (off - removed) / (4 * edges * radius + 3 * corners * radius**2)
    return radius


def volume(size: Four) -> Number:
    """The inner box, slabs on its faces, quarters of cylinders along its edges, and a ball."""
    up, depth, side, radius = _inner(size)
    slabs = 8 * radius * (up * depth + depth * side + side * up)
    return 8 * up * depth * side + slabs + radius**2 * math.pi * (2 * (up + depth + side) + 4 / 3 * radius)


PRIMITIVE = ROUNDED_BOX = Primitive(
    "rounded_box", ("half_up", "half_depth", "half_side", "radius"), 3, distance=distance, excess=excess, bound=bound,
    areas=areas, sample=sample, place=place, normal=normal, mesh=mesh, volume=volume,
)  # fmt: skip
