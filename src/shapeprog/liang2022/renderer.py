"""The renderer of Liang (2022) in plain PyTorch: a reference to read; tests hold the fast core to it.

Section 4.2 turns a program into primitives and draws points on them; section 4.3 compares these with a target.  Lengths
are in cells of the grid frame, axes up, depth, side; sizes are half extents.  One program at a time, gradients by
autograd.  Where the paper is wrong or silent, the docstring gives the alternative.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

RECTANGLE, SQUARE, ROUND = (2, 5), (3, 7, 9), (4, 6, 8)
CROSS, SIDEBOARD, BACK, LINE, TRANSLATE, ROTATE, END = 10, 11, 15, 17, 19, 20, 21
"""Ids of statements; those not named here are cuboids by corner and extents."""

SKIN = 1e-4
"""Share of its size by which a point is moved off its primitive to see whether another one hides it."""

Points = Float[Tensor, "P 3"]
Distances = Float[Tensor, " P"]


class Primitive(NamedTuple):
    """A primitive (P^i, P^z, P^t, P^q) of section 4.2.

    Parameters
    ----------
    kind
        ``cuboid``, ``cylinder``, or ``back``, a cuboid whose top is shifted in depth.
    size
        P^z: three half extents, for a back also the shift of its top against its bottom; or half height and radius.
    centre, rotation
        P^t and P^q; the axis of a cylinder is the first column of the rotation.
    """

    kind: str
    size: Float[Tensor, " S"]
    centre: Float[Tensor, " 3"]
    rotation: Float[Tensor, "3 3"]

    @property
    def axes(self) -> Float[Tensor, "3 3"]:
        """Half axes as columns: a point u of the standard primitive in [-1, 1]^3 lies at ``centre + axes @ u``."""
        local = torch.diag(self.size[[0, 1, 1]] if self.kind == "cylinder" else self.size[:3])
        if self.kind == "back":
            local = local + self.size[3] / 2 * local.new_tensor([[0, 0, 0], [1, 0, 0], [0, 0, 0]])
        return self.rotation @ local


def unroll(ids: Int[Tensor, "K J"], parameters: Float[Tensor, "K J 7"]) -> list[Primitive]:
    """All primitives of a program of K blocks in drawing order, with gradient to its parameters (section 4.2).

    Ids are 0 for no statement; counts and quarter turns are rounded and have no gradient.
    """
    return [primitive for block in zip(ids, parameters, strict=True) for primitive in unroll_block(*block)]


def unroll_block(ids: Int[Tensor, " J"], parameters: Float[Tensor, "J 7"]) -> list[Primitive]:
    """The copies that loops make of one statement (section 4.2).

    Translation: copy i is shifted by i (rho_2, rho_3, rho_4); rho_1 is the count, which the paper leaves out.
    Rotation: copy i of n is turned by i/n of a circle about the vertical axis through its start, a cross arm by quarter
    turns.  Blocks outside the grammar and negative extents draw nothing.
    """
    chain = [number for number in ids.tolist() if 0 < number < END]
    if not chain or chain != ids.tolist()[: len(chain)] or chain[-1] >= TRANSLATE:
        return []
    *loops, statement = chain
    values = parameters[len(loops)]
    if loops == [ROTATE] and statement in (CROSS, LINE):
        count, step = int(parameters[0, 0].round()), parameters[0, 1].detach().round()
        if statement == CROSS:
            copies = [draw(CROSS, torch.cat([values[:5], values[5:] + i * step])) for i in range(count)]
        else:
            copies = [turned(draw(LINE, values), values[:3] + 0.5, math.tau * i / count) for i in range(count)]
    elif all(loop == TRANSLATE for loop in loops):
        copies = [draw(statement, values)]
        for loop in reversed(parameters[: len(loops)].unbind()):
            shifts = [i * loop[1:4] for i in range(int(loop[0].round()))]
            copies = [copy._replace(centre=copy.centre + shift) for shift in shifts for copy in copies]
    else:
        return []
    return [copy for copy in copies if bool((copy.size[:3] >= 0).all())]


def draw(statement: int, parameters: Float[Tensor, " 7"]) -> Primitive:
    """The primitive of one drawing statement, from its own parameters to the shape primitive space (section 4.2)."""
    h, y, z, t, a, b, _ = parameters.unbind()
    unit_length, upright = torch.ones_like(t), torch.eye(3).to(parameters)
    if statement in ROUND:
        return Primitive("cylinder", torch.stack([t / 2, a]), torch.stack([h + t / 2, y, z]), upright)
    if statement == LINE:  # ends name cells, whose centres are half a cell above their boundaries
        start, end = parameters[:3] + 0.5, parameters[3:6] + 0.5
        size = torch.stack([root(((end - start) ** 2).sum()) / 2, parameters[6]])
        return Primitive("cylinder", size, (start + end) / 2, aligned(end - start))
    if statement in RECTANGLE + SQUARE:
        b = b if statement in RECTANGLE else a
        corner, extent = (h, y - a, z - b), (t, 2 * a, 2 * b)
    elif statement == SIDEBOARD:
        corner, extent = (h, y - a, z), (t, 2 * a, b)
    elif statement == CROSS:  # a is the length, b the quarter turn
        depth, side = [
            (-unit_length, -a),
            (0 * unit_length, -unit_length),
            (-unit_length, 0 * unit_length),
            (-a, -unit_length),
        ][int(b.round()) % 4]
        corner = (h, y + depth, z + side)
        extent = (t, a, 2 * unit_length) if int(b.round()) % 2 else (t, 2 * unit_length, a)
    else:
        corner, extent = (h, y, z), (t, a, b)
    half = torch.stack(extent) / 2
    box = Primitive("cuboid", half, torch.stack(corner) + half, upright)
    if statement != BACK:
        return box
    tilt = parameters[6:]  # a shear, as the published executor draws it; the paper calls it an elevation angle
    return Primitive("back", torch.cat([half, tilt]), box.centre + tilt / 2 * upright[1], upright)


def turned(primitive: Primitive, axis: Float[Tensor, " 3"], angle: float) -> Primitive:
    """A primitive turned by an angle in radians, from depth to side, about the vertical through a point."""
    cos, sin = math.cos(angle), math.sin(angle)
    turn = axis.new_tensor([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    return primitive._replace(centre=axis + turn @ (primitive.centre - axis), rotation=turn @ primitive.rotation)


def aligned(direction: Float[Tensor, " 3"]) -> Float[Tensor, "3 3"]:
    """A rotation whose first column points along a direction, up for none; the others start from the farthest axis."""
    up, length = torch.eye(3).to(direction)[0], root((direction**2).sum())
    first = direction / length if length > 1e-9 else up
    second = torch.linalg.cross(first, torch.eye(3).to(first)[first.detach().abs().argmin()])
    second = second / root((second**2).sum())
    return torch.stack([first, second, torch.linalg.cross(first, second)], -1)


def root(squared: Tensor) -> Tensor:
    """A square root whose gradient is 0 at 0, as on the axis of a cylinder, and not infinite."""
    return squared.clamp(min=1e-24).sqrt()


def cuboid_distance(points: Points, size: Float[Tensor, " 3"]) -> Distances:
    """Equation 3: distance to a cuboid of half extents s; 0 inside."""
    return root(((points.abs() - size).clamp(min=0) ** 2).sum(-1))


def back_distance(points: Points, size: Float[Tensor, " 4"]) -> Distances:
    """Equation 3 for a sheared cuboid: distance to its parallelogram in (up, depth), and to its ends along side."""
    up, depth, side, shift = size
    corner = torch.stack([up, shift / 2 - depth, up, shift / 2 + depth]).reshape(2, 2)
    corner = torch.cat([corner, -corner])  # in order around the parallelogram
    edge, from_corner = corner.roll(-1, 0) - corner, points[:, None, :2] - corner
    inside = (edge[:, 0] * from_corner[..., 1] > edge[:, 1] * from_corner[..., 0]).all(-1)
    foot = ((from_corner * edge).sum(-1) / (edge**2).sum(-1).clamp(min=1e-24)).clamp(0, 1)
    squared = ((from_corner - foot[..., None] * edge) ** 2).sum(-1).amin(-1)
    return root(torch.where(inside, 0, squared) + (points[:, 2].abs() - side).clamp(min=0) ** 2)


def cylinder_distance(points: Points, size: Float[Tensor, " 2"]) -> Distances:
    """Appendix A, mended: distance to a cylinder of half height h and radius r; 0 inside.

    The published algorithm compares with the full and the half height in turn, and y^2 with s_x^2 instead of r^2.
    """
    across = root((points[:, 1:] ** 2).sum(-1))
    over = torch.stack([points[:, 0].abs(), across], -1) - size
    return root((over.clamp(min=0) ** 2).sum(-1))


DISTANCES = {"cuboid": cuboid_distance, "back": back_distance, "cylinder": cylinder_distance}


def distance(primitive: Primitive, points: Points) -> Distances:
    """Equation 4: distance to a primitive in any pose, by its inverse transformation of the points."""
    return DISTANCES[primitive.kind]((points - primitive.centre) @ primitive.rotation, primitive.size)


def union_distance(primitives: Sequence[Primitive], points: Points) -> Distances:
    """Equation 2: the distance to a union is the least of those to its primitives."""
    return torch.stack([distance(primitive, points) for primitive in primitives]).amin(0)


def coverage(primitives: Sequence[Primitive], target: Points) -> Float[Tensor, ""]:
    """Equation 1: mean distance of target points to the union; one box that fills the grid has none."""
    return union_distance(primitives, target).mean()


def contains(primitive: Primitive, points: Points) -> Bool[Tensor, " P"]:
    """Which points lie strictly inside a primitive; none where it has no volume."""
    unit = (points - primitive.centre) @ torch.linalg.pinv(primitive.axes).T
    if primitive.kind == "cylinder":
        unit = torch.stack([unit[:, 0], unit[:, 1:].norm(dim=-1)], -1)
    return (unit.abs() < 1).all(-1) & (torch.linalg.det(primitive.axes) > 0)


def face_areas(primitive: Primitive) -> Float[Tensor, " F"]:
    """Areas of the six faces of a cuboid, two for each axis, or of both caps and the side of a cylinder."""
    if primitive.kind == "cylinder":
        height, radius = primitive.size
        return math.pi * torch.stack([radius**2, radius**2, 4 * radius * height])
    axes = primitive.axes.T
    return 4 * root((torch.linalg.cross(axes.roll(1, 0), axes.roll(2, 0)) ** 2).sum(-1)).repeat_interleave(2)


def standard_points(kind: str, face: Int[Tensor, " P"], generator: torch.Generator | None) -> Float[Tensor, "P 3"]:
    """Points drawn evenly on faces of the standard primitive, which no parameter changes (section 4.2)."""
    noise = 2 * torch.rand(len(face), 3, generator=generator, dtype=torch.float64) - 1
    sign = (2 * (face % 2) - 1).double()
    if kind != "cylinder":
        return torch.where(torch.arange(3) == face[:, None] // 2, sign[:, None], noise)
    height = torch.where(face < 2, sign, noise[:, 0])
    radius = torch.where(face < 2, ((1 + noise[:, 1]) / 2).sqrt(), 1)
    angle = math.pi * noise[:, 2]
    return torch.stack([height, radius * angle.sin(), radius * angle.cos()], -1)


def transform(primitive: Primitive, unit: Points) -> Points:
    """Points of the standard primitive on the transformed one: the reparameterisation of section 4.2."""
    return unit.to(primitive.centre) @ primitive.axes.T + primitive.centre


@torch.no_grad()
def hidden(primitives: Sequence[Primitive], index: int, unit: Points) -> Bool[Tensor, " P"]:
    """Which points of a primitive are not on the surface of the union; of faces that coincide the first counts."""
    covered = torch.zeros(len(unit), dtype=torch.bool)
    for number, neighbour in enumerate(primitives):
        if number != index:
            covered |= contains(neighbour, transform(primitives[index], (1 + SKIN) * unit))
        if number < index:
            covered |= contains(neighbour, transform(primitives[index], (1 - SKIN) * unit))
    return covered


def sample(
    primitives: Sequence[Primitive], n: int, generator: torch.Generator | None = None
) -> tuple[Points, Distances]:
    """Draw points on the surface in proportion to area, with gradient to sizes and poses (section 4.2).

    Parameters
    ----------
    primitives
        What to draw on; their area must not be zero.
    n
        Points drawn; those that another primitive hides are dropped, which the paper leaves out.
    generator
        Source of randomness.

    Returns
    -------
    Points, and weights of value 1 whose gradient is that of the logarithm of the area of the face: the number of points
    drawn on a face carries none.
    """
    areas = [face_areas(primitive) for primitive in primitives]
    faces = torch.multinomial(torch.cat(areas).detach(), n, replacement=True, generator=generator)
    points, weights, first = [], [], 0
    for index, (primitive, area) in enumerate(zip(primitives, areas, strict=True)):
        face = faces[(faces >= first) & (faces < first + len(area))] - first
        unit = standard_points(primitive.kind, face, generator)
        visible = ~hidden(primitives, index, unit)
        points.append(transform(primitive, unit[visible]))
        weights.append((area / area.detach())[face[visible]])
        first += len(area)
    return torch.cat(points), torch.cat(weights)


def chamfer(points: Points, target: Float[Tensor, "Q 3"], weights: Distances | None = None) -> Float[Tensor, ""]:
    """Section 4.3.1: squared distances to the nearest point of the other cloud, forward and backward score added.

    Means over points, where the paper has sums: only those fit the values of its tables.
    """
    squared = ((points[:, None] - target) ** 2).sum(-1)
    weights = torch.ones_like(points[:, 0]) if weights is None else weights
    return (weights * squared.amin(1)).sum() / weights.sum() + squared.amin(0).mean()
