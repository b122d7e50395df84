"""The cylinder: half height along local axis 0, radius across it; in most respects a frustum of equal radii.

A cell belongs to it when its centre is within 1.01 radii of the axis, as in the published executor.
"""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry import formulas as f
from shapeprog.geometry.formulas import Four, Number, Triple
from shapeprog.geometry.primitive import Formula, Primitive
from shapeprog.geometry.primitives import frustum
from shapeprog.kernels.compile import helper
from shapeprog.kernels.rows import CAP, REACH, clip, fill_row
from shapeprog.kernels.table import CENTRE, ROTATION, SIZE
from shapeprog.space import Array


def distance(size: Four, point: Triple) -> Number:
    """Exact signed distance: a rectangle in (axial, radial) coordinates.

    Appendix A of Liang (2022) mixes full and half height and takes a squared length for a length; here both
    coordinates are lengths, and the height is the half height.
    """
    rho = f.root(point[1] ** 2 + point[2] ** 2)
    return f.meet(abs(point[0]) - f.positive(size[0]), rho - f.positive(size[1]))


def excess(size: Four, point: Triple) -> Number:
    """How far a point is beyond the caps, or its squared distance from the axis beyond that of the side."""
    over = abs(point[0]) - size[0]
    return f.where(over > 0, over, f.maximum(over, point[1] ** 2 + point[2] ** 2 - size[1] ** 2))


def sample(size: Four, face: Number, uniform: Triple) -> Triple:
    """Axial coordinate in [-1, 1] and a point of the unit disc, on its rim for the lateral surface."""
    u, v, w = uniform
    axial, rim = f.where(face > 1, 2 * w - 1, 2.0 * face - 1.0), f.where(face > 1, 1.0, f.root(v))
    return axial, rim * f.cos(2 * math.pi * u), rim * f.sin(2 * math.pi * u)


def place(size: Four, unit: Triple) -> Triple:
    """Point of the cylinder for an axial coordinate and a point of the unit disc."""
    return size[0] * unit[0], size[1] * unit[1], size[1] * unit[2]


def normal(size: Four, unit: Triple, face: Number) -> Triple:
    """Outward normal: along the axis on the caps, radial on the side."""
    side = face > 1
    return f.where(side, 0.0, unit[0]), f.where(side, unit[1], 0.0), f.where(side, unit[2], 0.0)


@helper
def cells_kernel(table: Array, row: int, square: bool, planes: Array, plane: int, low: Array, high: Array) -> bool:
    """Cells within ``REACH`` radii of the axis; a cylinder that stands upright is one disc, repeated in its layers."""
    if table[row, SIZE] < 0 or table[row, SIZE + 1] <= 0:
        return True
    table[row, SIZE] += CAP
    table[row, SIZE + 1] *= REACH
    if not square or abs(table[row, ROTATION]) < 0.5:
        return False
    resolution, half, reach = planes.shape[2], table[row, SIZE], table[row, SIZE + 1]
    up, depth, side = table[row, CENTRE], table[row, CENTRE + 1], table[row, CENTRE + 2]
    bottom, top = clip(np.ceil(up - half - 0.5), resolution), clip(np.floor(up + half + 0.5), resolution)
    for j in range(clip(depth - reach - 0.5, resolution), clip(np.ceil(depth + reach + 0.5), resolution)):
        squared = reach * reach - (j + 0.5 - depth) ** 2
        if squared < 0:
            continue
        width = math.sqrt(squared)
        first = clip(np.floor(side - width - 0.5), resolution)
        last = clip(np.ceil(side + width + 0.5), resolution)
        while first < last and (first + 0.5 - side) ** 2 > squared:
            first += 1
        while first < last and (last - 0.5 - side) ** 2 > squared:
            last -= 1
        for i in range(bottom, top):
            fill_row(planes, plane, i, j, first, last)
    return True


def _of_frustum(formula: Formula) -> Formula:
    """A formula of the frustum for the sizes of a cylinder."""
    return lambda size: formula((size[0], size[1], size[1], size[3]))


PRIMITIVE = CYLINDER = Primitive(
    "cylinder", ("half_height", "radius"), 2, distance=distance, excess=excess, bound=_of_frustum(frustum.bound),
    areas=_of_frustum(frustum.areas), volume=_of_frustum(frustum.volume), sample=sample,
    place=place, normal=normal, mesh=lambda size: frustum.mesh(size[[0, 1, 1]]),
    cells=cells_kernel,
)  # fmt: skip
