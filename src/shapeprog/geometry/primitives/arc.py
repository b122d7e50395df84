"""The arc: a round rod bent along an arc of a circle, with flat caps; without sagitta it is the cylinder.

Sizes are half the chord between the ends, the radius of the rod and the sagitta, the height of the arc over its chord.
The chord is parallel to local axis 0, at minus half the sagitta along axis 1; the apex is at plus half the sagitta.

All follows from the curvature k = 2 s / (c^2 + s^2), which is zero for a straight rod, and is written so that nothing
cancels there: with h from the apex to an end, half the arc is h / sinc(t / 2) long, where t, its angle, has
sin t = k c and cos t = 1 - k s.  A sagitta beyond half the chord makes more than half a ring; the rod is at most as
thick as fills the ring.
"""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry import formulas as f
from shapeprog.geometry.formulas import Four, Number, Triple
from shapeprog.geometry.primitive import Mesh, Primitive
from shapeprog.geometry.primitives.frustum import SEGMENTS, tube
from shapeprog.kernels.compile import helper
from shapeprog.kernels.rows import enclose, fill_row, stretch
from shapeprog.kernels.table import SIZE, local
from shapeprog.lazy_torch import torch
from shapeprog.space import Array, FloatArray

SHORTEST = 1e-6  # half a chord in cells below this counts as this
SERIES = 0.1  # angles up to which sinc is taken from its series
PIECES = 24  # straight pieces of a mesh along the arc


def _bend(size: Four) -> Four:
    """Half the chord, radius in force, sagitta and curvature."""
    half, radius, sagitta = f.at_least(size[0], SHORTEST), f.positive(size[1]), f.positive(size[2])
    curvature = 2 * sagitta / (half**2 + sagitta**2)
    return half, radius / f.at_least(curvature * radius, 1.0), sagitta, curvature


def _sinc(angle: Number) -> Number:
    """sin(x) / x, whose gradient is as exact near zero as elsewhere."""
    small, square = abs(angle) < SERIES, angle**2
    series = 1 - square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72)))
    return f.where(small, series, f.sin(angle) / f.where(small, 1.0, angle))


def _length(size: Four) -> tuple[Number, Number]:
    """Half the length of the arc, and half its angle seen from the centre of the circle."""
    half, _, sagitta, _ = _bend(size)
    angle = f.atan2(sagitta, half)
    return f.root(half**2 + sagitta**2) / _sinc(angle), 2 * angle


def _beyond(curvature: Number, along: Number, out: Number) -> Number:
    """How far a point is beyond the circle: (k (x^2 + y^2) + 2 y) / (turn + 1), where x is along and y out from the
    apex, and turn is k times its distance from the centre."""
    turn = f.root((curvature * along) ** 2 + (1 + curvature * out) ** 2)
    return (curvature * (along**2 + out**2) + 2 * out) / (turn + 1)


def distance(size: Four, point: Triple) -> Number:
    """Exact signed distance: the nearer one of the tube and the cap at the end of a point's side."""
    half, radius, sagitta, curvature = _bend(size)
    along, out, side = abs(point[0]), point[1] - sagitta / 2, point[2]
    tube = f.root(_beyond(curvature, along, out) ** 2 + side**2) - radius

    sine, cosine = curvature * half, 1 - curvature * sagitta
    ahead, above = along - half, out + sagitta
    over_cap = ahead * cosine - above * sine
    across = f.root((ahead * sine + above * cosine) ** 2 + side**2)
    cap = f.root(over_cap**2 + f.positive(across - radius) ** 2)
    return f.where(over_cap > 0, cap, f.maximum(tube, -cap))


def excess(size: Four, point: Triple) -> Number:
    """How far a point is beyond the caps, or its squared distance from the arc beyond that of the tube."""
    half, radius, sagitta, curvature = _bend(size)
    along, out = abs(point[0]), point[1] - sagitta / 2
    over_cap = (along - half) * (1 - curvature * sagitta) - (out + sagitta) * curvature * half
    over_tube = _beyond(curvature, along, out) ** 2 + point[2] ** 2 - radius**2
    return f.where(over_cap > 0, over_cap, f.maximum(over_cap, over_tube))


def bound(size: Four) -> Triple:
    """Half extents of the box around the arc; beyond half a ring it is wider than its chord."""
    half, radius, sagitta, curvature = _bend(size)
    over = sagitta > half
    along = f.where(over, (half**2 + sagitta**2) / f.at_least(2 * sagitta, SHORTEST), half)
    return along + radius * f.where(over, 1.0, curvature * half), sagitta / 2 + radius, radius


def areas(size: Four) -> Triple:
    """Areas of the two caps and of the tube, which by Pappus is as large as that of a straight one."""
    radius = _bend(size)[1]
    cap = math.pi * radius**2
    return cap, cap, 4 * math.pi * radius * _length(size)[0]


def sample(size: Four, face: Number, uniform: Triple) -> Triple:
    """Position along the arc in [-1, 1] and in the unit disc, its first axis pointing away from the centre of the
    circle.

    The tube has 1 + k r cos(a) times as much area at an angle a from there: angles are drawn evenly, and turned to the
    other side with the chance that makes it so.
    """
    _, radius, _, curvature = _bend(size)
    u, v, w = uniform
    angle, tube = 2 * math.pi * u, face > 1
    cosine = f.cos(angle)
    inner = tube & (2 * v > 1 + curvature * radius * cosine)
    rim = f.where(tube, 1.0, f.root(v))
    along = f.where(tube, 2 * w - 1, 2.0 * face - 1.0)
    return along, rim * f.where(inner, -cosine, cosine), rim * f.sin(angle)


def place(size: Four, unit: Triple) -> Triple:
    """Point of the arc for a position along it and in the unit disc.

    On the arc it ends a chord from the apex, which is tilted by half its angle.
    """
    _, radius, sagitta, _ = _bend(size)
    length, full = _length(size)
    tilt, out = unit[0] * full / 2, radius * unit[1]
    chord = unit[0] * length * _sinc(tilt)
    low, high = f.sin(tilt), f.cos(tilt)
    sine, cosine = 2 * low * high, 1 - 2 * low**2
    return chord * high + out * sine, sagitta / 2 - chord * low + out * cosine, radius * unit[2]


def normal(size: Four, unit: Triple, face: Number) -> Triple:
    """Outward normal: along the arc on the caps, away from it on the tube."""
    along, out, side = unit
    angle, tube = along * _length(size)[1], face > 1
    sine, cosine = f.sin(angle), f.cos(angle)
    up, across = f.where(tube, out * sine, along * cosine), f.where(tube, out * cosine, -along * sine)
    return up, across, f.where(tube, side, 0.0)


def mesh(size: FloatArray) -> Mesh:
    """Polygons along the arc, each as large as makes up for the circle and for the straight pieces between them.

    An edge of each lies on the inner side, so that they reach the centre of the circle later than the rod does.
    """
    full = 2 * math.atan2(max(size[2], 0.0), max(size[0], SHORTEST))
    step, turn = 2 * math.pi / SEGMENTS, 2 * full / PIECES
    grown = math.sqrt(1 / np.sinc(step / math.pi) / np.sinc(turn / math.pi))
    angle, way = step * (np.arange(SEGMENTS) + 0.5), np.linspace(-1, 1, PIECES + 1)
    rings = np.zeros((PIECES + 1, SEGMENTS, 3))
    rings[..., 0], rings[..., 1], rings[..., 2] = way[:, None], grown * np.cos(angle), grown * np.sin(angle)
    unit, faces = tube(rings, np.array([[-1.0, 0, 0], [1, 0, 0]]))
    return PRIMITIVE.place(torch.tensor(size).expand(len(unit), 4), torch.tensor(unit)).numpy(), faces


def volume(size: Four) -> Number:
    """By Pappus, length times the area of the circle."""
    return 2 * math.pi * _bend(size)[1] ** 2 * _length(size)[0]


PRIMITIVE = ARC = Primitive(
    "arc", ("half_chord", "radius", "sagitta"), 2, distance=distance, excess=excess, bound=bound, areas=areas,
    volume=volume, sample=sample, place=place, normal=normal, mesh=mesh,
)  # fmt: skip
bound_kernel, distance_kernel = ARC.kernels["bound"], ARC.kernels["distance"]


@helper
def cells_kernel(table: Array, row: int, square: bool, planes: Array, plane: int, low: Array, high: Array) -> bool:
    """An arc is not convex: along a row of cells, steps are as long as the arc is away."""
    if table[row, SIZE + 1] <= 0 or (table[row, SIZE] <= 0 and table[row, SIZE + 2] <= 0):
        return True
    resolution, box = planes.shape[2], bound_kernel(table, row)
    reach = enclose(table, row, box, resolution, low, high)
    if not math.isfinite(reach):
        return True
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            k, last = stretch(table, row, box, i, j, reach, resolution, low, high)
            while k < last:
                a, b, c = local(table, row, i + 0.5, j + 0.5, k + 0.5)
                away = distance_kernel(table, row, a, b, c)
                after = k + 1
                if abs(away) > 1:  # the same is true of all cells nearer than that, but for rounding
                    after = min(k + int(np.ceil(min(abs(away), float(resolution)) - 1e-9)), last)
                if away <= 0:
                    fill_row(planes, plane, i, j, k, after)
                k = after
    return True


ARC.kernels["cells"] = cells_kernel
