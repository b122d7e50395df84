"""The frustum: a cone cut across its axis, which is local axis 0; sizes are the half height and the two radii."""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry import formulas as f
from shapeprog.geometry.formulas import TINY, Four, Number, Triple
from shapeprog.geometry.primitive import Mesh, Primitive
from shapeprog.space import FloatArray

SEGMENTS = 48  # corners of the polygon that approximates a circle in a mesh


def distance(size: Four, point: Triple) -> Number:
    """Exact signed distance: a trapezoid in (axial, radial) coordinates, bounded by two caps and a slanted side.

    The foot on the side is where the squared distance is least, so it need not be differentiated.
    """
    half, bottom, top = map(f.positive, size[:3])
    axial, radial = point[0], f.root(point[1] ** 2 + point[2] ** 2)
    over_cap, over_rim = abs(axial) - half, f.positive(radial - f.where(axial < 0, bottom, top))
    to_cap = over_rim**2 + over_cap**2
    rise, run, up, out = 2 * half, top - bottom, axial + half, radial - bottom
    foot = f.constant(f.clamp((up * rise + out * run) / f.at_least(rise**2 + run**2, TINY), 0.0, 1.0))
    to_side = (up - foot * rise) ** 2 + (out - foot * run) ** 2
    inside = (over_cap < 0) & (out * rise < up * run)
    return f.root(f.minimum(to_cap, to_side)) * f.where(inside, -1.0, 1.0)


def excess(size: Four, point: Triple) -> Number:
    """How far a point is beyond the caps, or beyond the side there, by squared distances from the axis, scaled."""
    half, bottom, top, _ = size
    over_cap, radius = abs(point[0]) - half, bottom * (half - point[0]) + top * (half + point[0])
    over_side = 4 * half**2 * (point[1] ** 2 + point[2] ** 2) - radius**2
    return f.where(over_cap > 0, over_cap, f.maximum(over_cap, over_side))


def bound(size: Four) -> Triple:
    """Half extents of the box around the frustum."""
    widest = f.positive(f.maximum(size[1], size[2]))
    return f.positive(size[0]), widest, widest


def areas(size: Four) -> Triple:
    """Areas of bottom cap, top cap and slanted side."""
    half, bottom, top = map(f.positive, size[:3])
    slant = f.root(4 * half**2 + (top - bottom) ** 2)
    return math.pi * bottom**2, math.pi * top**2, math.pi * (bottom + top) * slant


def sample(size: Four, face: Number, uniform: Triple) -> Triple:
    """Axial coordinate in [-1, 1] and a point of the unit disc; the side has more area where it is wider."""
    _, bottom, top = map(f.positive, size[:3])
    u, v, w = uniform
    widths = f.root(bottom**2 + (top**2 - bottom**2) * w)
    along = 2 * w * (bottom + top) / f.at_least(bottom + widths, 1e-12) - 1
    axial, rim = f.where(face > 1, along, 2.0 * face - 1.0), f.where(face > 1, 1.0, f.root(v))
    return axial, rim * f.cos(2 * math.pi * u), rim * f.sin(2 * math.pi * u)


def place(size: Four, unit: Triple) -> Triple:
    """The point of the frustum for an axial coordinate and a point of the unit disc."""
    half, bottom, top = map(f.positive, size[:3])
    radius = (bottom * (1 - unit[0]) + top * (1 + unit[0])) / 2
    return half * unit[0], radius * unit[1], radius * unit[2]


def normal(size: Four, unit: Triple, face: Number) -> Triple:
    """Outward normal: along the axis on the caps, leaning with the taper on the side."""
    half, bottom, top = map(f.positive, size[:3])
    lean, out = bottom - top, 2 * half
    length, side = f.root(lean**2 + out**2), face > 1
    across = f.where(side, out / length, 0.0)
    return f.where(side, lean / length, unit[0]), across * unit[1], across * unit[2]


def mesh(size: FloatArray) -> Mesh:
    """A frustum over regular polygons with the areas of the circles, so that the volume is exact.

    A circle without radius is one vertex.
    """
    half, bottom, top, step = *size[:3], 2 * math.pi / SEGMENTS
    low, high = (radius * math.sqrt(step / math.sin(step)) for radius in (bottom, top))
    angle, up = step * np.arange(SEGMENTS), np.array([half, 0.0, 0.0])
    ring = np.stack([np.zeros(SEGMENTS), np.cos(angle), np.sin(angle)], 1)
    vertices, faces = tube(np.stack([low * ring - up, high * ring + up]), np.stack([-up, up]))
    vertex = np.arange(len(vertices))
    if bottom <= 0:
        vertex[:SEGMENTS] = 2 * SEGMENTS
    if top <= 0:
        vertex[SEGMENTS : 2 * SEGMENTS] = 2 * SEGMENTS + 1
    faces = vertex[faces]
    used, faces = np.unique(faces[(faces != np.roll(faces, 1, 1)).all(1)], return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


def tube(rings: FloatArray, ends: FloatArray) -> Mesh:
    """The mesh through rings of points (R, S, 3), closed by the middles (2, 3) of the first and of the last one."""
    around = np.arange(rings.shape[1])
    after, count = np.roll(around, -1), rings.size // 3
    last = count - len(around)
    faces = [np.stack(np.broadcast_arrays(count, after, around), 1)]
    for low in range(0, last, len(around)):
        a, b, c, d = around + low, after + low, after + low + len(around), around + low + len(around)
        faces += [np.stack([a, b, c], 1), np.stack([a, c, d], 1)]
    faces.append(np.stack(np.broadcast_arrays(count + 1, around + last, after + last), 1))
    return np.concatenate([rings.reshape(-1, 3), ends]), np.concatenate(faces).astype(np.int64)


def volume(size: Four) -> Number:
    """Height times the mean of the areas of the circles between bottom and top."""
    half, bottom, top = map(f.positive, size[:3])
    return 2 / 3 * math.pi * half * (bottom**2 + bottom * top + top**2)


PRIMITIVE = FRUSTUM = Primitive(
    "frustum", ("half_height", "bottom", "top"), 3, distance=distance, excess=excess, bound=bound, areas=areas,
    sample=sample, place=place, normal=normal, mesh=mesh, volume=volume,
)  # fmt: skip
