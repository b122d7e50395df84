"""The cuboid, upright or sheared: a parallelogram in local axes (0, 1), extruded along local axis 2.

Sizes are three half extents and ``lean``, the shift along axis 1 of the top face against the bottom face.

Its cells follow the rules of the published executor: at right angles to the grid it covers
[rint(low), rint(high)) along each axis; sheared and upright, each layer is moved by a whole number of cells.
"""

from __future__ import annotations

import numpy as np

from shapeprog.geometry import formulas as f
from shapeprog.geometry.formulas import TINY, Four, Number, Triple
from shapeprog.geometry.primitive import Mesh, Primitive
from shapeprog.kernels.compile import helper
from shapeprog.kernels.rows import clip, fill_box
from shapeprog.kernels.table import CENTRE, ROTATION, SIZE
from shapeprog.space import Array, FloatArray


def distance(size: Four, point: Triple) -> Number:
    """Exact signed distance to a sheared cuboid; upright and outside it is equation 3 of Liang (2022).

    The distance to the parallelogram follows from its horizontal and its slanted edges after folding the plane by its
    point symmetry; extrusion combines it with the distance along axis 2, which keeps it exact.  The
    foot on the slanted edge is where the squared distance is least, so it need not be differentiated.
    """
    half_up, half_depth, half_side = map(f.positive, size[:3])
    slant = size[3] / 2
    up, depth, side = point

    fold = f.where(up < 0, -1.0, 1.0)
    up, depth = up * fold, depth * fold
    over_up, over_depth = up - half_up, f.positive(abs(depth - slant) - half_depth)
    to_cap = over_up**2 + over_depth**2

    cross = depth * half_up - up * slant
    fold = f.where(cross < 0, -1.0, 1.0)
    edge_up, edge_depth = up * fold, depth * fold - half_depth
    foot = f.constant(
        f.clamp((edge_up * half_up + edge_depth * slant) / f.at_least(half_up**2 + slant**2, TINY), -1.0, 1.0)
    )
    to_side = (edge_up - foot * half_up) ** 2 + (edge_depth - foot * slant) ** 2

    inside = (over_up < 0) & (abs(cross) < half_depth * half_up)
    return f.meet(f.root(f.minimum(to_cap, to_side)) * f.where(inside, -1.0, 1.0), abs(side) - half_side)


def value(size: Four, point: Triple) -> Number:
    """The same distance, cheaper where nothing is sheared, but without the slope by ``lean`` there."""
    up, depth, side = (abs(at) - f.positive(half) for at, half in zip(point, size[:3], strict=True))
    inside = f.maximum(f.maximum(up, depth), side)
    outside = f.plain_root(f.positive(up) ** 2 + f.positive(depth) ** 2 + f.positive(side) ** 2)
    return f.where(abs(size[3]) > 0, distance(size, point), f.where(inside > 0, outside, inside))


def excess(size: Four, point: Triple) -> Number:
    """How far a point is beyond the caps, the ends, or the slanted faces, there times the half height."""
    half_up, half_depth, half_side, lean = size
    up, depth, side = point
    over_up = abs(up) - half_up
    over_depth = abs(depth * half_up - up * (lean / 2)) - half_depth * half_up
    return f.where(over_up > 0, over_up, f.maximum(f.maximum(over_up, over_depth), abs(side) - half_side))


def bound(size: Four) -> Triple:
    """Half extents of the box around the sheared cuboid."""
    return f.positive(size[0]), f.positive(size[1]) + abs(size[3]) / 2, f.positive(size[2])


def areas(size: Four) -> tuple[Number, ...]:
    """Areas of the faces -0, +0, -1, +1, -2, +2; a shear keeps those of the caps and of the two ends."""
    up, depth, side = (2 * f.positive(half) for half in size[:3])
    cap, end, slanted = depth * side, up * depth, side * f.root(up**2 + size[3] ** 2)
    return cap, cap, slanted, slanted, end, end


def sample(size: Four, face: Number, uniform: Triple) -> Triple:
    """Uniform position on a face of the cube [-1, 1]^3."""
    sign = 2.0 * (face % 2) - 1.0
    u, v, w = (2 * number - 1 for number in uniform)
    return f.where(face < 2, sign, u), f.where((face < 2) | (face > 3), v, sign), f.where(face > 3, sign, w)


def place(size: Four, unit: Triple) -> Triple:
    """Point of the cuboid for a point of the cube [-1, 1]^3."""
    u, v, w = unit
    return size[0] * u, size[1] * v + size[3] / 2 * u, size[2] * w


def normal(size: Four, unit: Triple, face: Number) -> Triple:
    """Outward normal of a face; the two slanted faces lean with the shear."""
    half_up, slant = size[0], size[3] / 2
    length, sign = f.root(half_up**2 + slant**2), 2.0 * (face % 2) - 1.0
    slanted = (face > 1) & (face < 4)
    up = f.where(face < 2, sign, f.where(slanted, -sign * slant / length, 0.0))
    return up, f.where(slanted, sign * half_up / length, 0.0), f.where(face > 3, sign, 0.0)


def mesh(size: FloatArray) -> Mesh:
    """Eight corners, twelve triangles."""
    corners = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], np.float64)
    vertices = corners * size[:3]
    vertices[:, 1] += corners[:, 0] * size[3] / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return vertices, np.array(faces, np.int64)


def volume(size: Four) -> Number:
    """Eight times the product of the half extents: a shear keeps the volume."""
    half_up, half_depth, half_side = map(f.positive, size[:3])
    return 8 * half_up * half_depth * half_side


@helper
def cells_kernel(table: Array, row: int, square: bool, planes: Array, plane: int, low: Array, high: Array) -> bool:
    """Cells of cuboids at right angles to the grid, and of sheared upright ones; nothing without a volume."""
    if table[row, SIZE] <= 0 or table[row, SIZE + 1] <= 0 or table[row, SIZE + 2] <= 0:
        return True
    resolution, lean = planes.shape[2], table[row, SIZE + 3]
    if not square or (lean != 0 and abs(table[row, ROTATION]) < 0.5):
        return False
    for axis in range(3):
        half = 0.0
        for column in range(3):
            half += abs(np.rint(table[row, ROTATION + 3 * axis + column])) * table[row, SIZE + column]
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
    "cuboid", ("half_up", "half_depth", "half_side", "lean"), 3, distance=distance, value=value, excess=excess,
    bound=bound, areas=areas, volume=volume, sample=sample, place=place, normal=normal, mesh=mesh, cells=cells_kernel,
)  # fmt: skip
