"""The renderer of Liang (2022) in plain PyTorch: a reference to read; tests hold the fast core to it.

Section 4.2 turns a program into primitives and draws points on them; section 4.3 compares these with a target.  Axes
are up, depth, side; lengths are in cells.  Where the paper is wrong or silent, the docstring gives the alternative.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from shapeprog.errors import ShapeProgError

RECTANGLE, SQUARE, ROUND = (2, 5), (3, 7, 9), (4, 6, 8)
CROSS, SIDEBOARD, BACK, LINE, TRANSLATE, ROTATE, END = 10, 11, 15, 17, 19, 20, 21  # the other statements are cuboids
SKIN = 1e-4  # share of its size by which a point is moved off its primitive to see whether another one hides it

Points = Float[Tensor, "P 3"]
Distances = Float[Tensor, " P"]


class Primitive(NamedTuple):
    """A primitive of section 4.2: kind P^i, size P^z, centre P^t and rotation P^q.

    The size of a ``cuboid`` is three half extents; of a ``back``, a cuboid whose top is shifted in depth, also this
    shift; of a ``cylinder`` half its height, which lies along the first column of the rotation, and its radius.
    """

    kind: str
    size: Float[Tensor, " S"]
    centre: Float[Tensor, " 3"]
    rotation: Float[Tensor, "3 3"]

    def transform(self, unit: Points) -> Points:
        """Points of the standard primitive, in [-1, 1]^3, on this one: the reparameterisation of section 4.2."""
        local = unit * (self.size[[0, 1, 1]] if self.kind == "cylinder" else self.size[:3])
        if self.kind == "back":
            local = local + unit[:, :1] * self.size[3] / 2 * unit.new_tensor([0, 1, 0])
        return local @ self.rotation.T + self.centre


def unroll(ids: Int[Tensor, "K J"], parameters: Float[Tensor, "K J 7"]) -> list[Primitive]:
    """All primitives of a program of K blocks, each of them loops around one drawing statement (section 4.2).

    Translation: copy i is shifted by i (rho_2, rho_3, rho_4); rho_1 is the count, which the paper leaves out.
    Rotation: copy i of n is turned by i/n of a circle about the vertical axis through its start, a cross arm by quarter
    turns.  Counts and quarter turns are rounded; negative extents draw nothing, nor do blocks outside the published
    grammar.  Of these, the language of this package draws rotations of other statements, and those inside or around
    another loop.  A ``ShapeProgError`` if a statement is none of the paper's.
    """
    if ids.numel() and (largest := int(ids.max())) > END:
        cure = "unroll it by sp.unroll, or infer a program of the paper: sp.infer(shape, statements='paper')"
        raise ShapeProgError(f"statement {largest} is not one of the paper, whose last is {END}", cure)
    primitives: list[Primitive] = []
    for block, rows in zip(ids.tolist(), parameters, strict=True):
        *loops, statement = [number for number in block if 0 < number < END] or [0]
        if block[: len(loops) + 1] != [*loops, statement] or not 0 < statement < TRANSLATE:
            continue
        values = rows[len(loops)]
        copies = [draw(statement, values)]
        if loops == [ROTATE] and statement in (CROSS, LINE):
            count, quarters = rows[0, :2].round().tolist()
            share, axis = (quarters / 4, values[:3]) if statement == CROSS else (1 / max(count, 1), values[:3] + 0.5)
            copies = [turned(copies[0], axis, math.tau * share * i) for i in range(int(count))]
        elif set(loops) <= {TRANSLATE}:
            for loop in rows[: len(loops)].flip(0):
                shifts = [i * loop[1:4] for i in range(int(loop[0].round()))]
                copies = [copy._replace(centre=copy.centre + shift) for shift in shifts for copy in copies]
        else:
            continue
        primitives += [copy for copy in copies if bool((copy.size[:3] >= 0).all())]
    return primitives


def draw(statement: int, parameters: Float[Tensor, " 7"]) -> Primitive:
    """The primitive of a drawing statement, from its parameter space to that of primitives (section 4.2).

    Most have a position, a height, and lengths a and b that give half extents in depth and side.  The position is at
    the bottom, in the middle or, where ``towards`` is not 0, at the edge from which the primitive extends that way.
    """
    position, (height, a, b, c) = parameters[:3], parameters[3:]
    upright = torch.eye(3).to(parameters)
    if statement == LINE:  # ends name cells, whose centres are half a cell above their boundaries
        start, end = position + 0.5, parameters[3:6] + 0.5
        size = torch.stack([(end - start).norm() / 2, c])
        return Primitive("cylinder", size, (start + end) / 2, aligned(end - start))
    if statement in RECTANGLE + SQUARE + ROUND:
        half, towards = [a, b if statement in RECTANGLE else a], (0, 0)
    elif statement == SIDEBOARD:
        half, towards = [a, b / 2], (0, 1)
    elif statement == CROSS:  # an arm of length a, two cells wide, after b quarter turns
        towards = ((0, -1), (1, 0), (0, 1), (-1, 0))[int(b.round()) % 4]
        half = [a / 2 if along else torch.ones_like(a) for along in towards]
    else:
        half, towards = [a / 2, b / 2], (1, 1)
    size = torch.stack([height / 2, *half])
    centre = position + size * size.new_tensor([1, *towards])
    if statement in ROUND:
        return Primitive("cylinder", size[:2], centre, upright)
    if statement == BACK:  # a shear, as the published executor draws it; the paper calls it an elevation angle
        return Primitive("back", torch.stack([*size, c]), centre + c / 2 * upright[1], upright)
    return Primitive("cuboid", size, centre, upright)


def turned(primitive: Primitive, axis: Float[Tensor, " 3"], angle: float) -> Primitive:
    """A primitive turned by an angle in radians, from depth to side, about the vertical through a point."""
    cos, sin = math.cos(angle), math.sin(angle)
    turn = axis.new_tensor([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    return primitive._replace(centre=axis + turn @ (primitive.centre - axis), rotation=turn @ primitive.rotation)


def aligned(direction: Float[Tensor, " 3"]) -> Float[Tensor, "3 3"]:
    """A rotation whose first column points along a direction, up for none; the others start from the farthest axis."""
    frame, length = torch.eye(3).to(direction), direction.norm()
    first = direction / length if length > 1e-9 else frame[0]
    second = torch.linalg.cross(first, frame[first.detach().abs().argmin()])
    second = second / second.norm()
    return torch.stack([first, second, torch.linalg.cross(first, second)], -1)


def cuboid_distance(points: Points, size: Float[Tensor, " 3"]) -> Distances:
    """Equation 3: distance to a cuboid of half extents s; 0 inside."""
    return (points.abs() - size).clamp(min=0).norm(dim=-1)


def cylinder_distance(points: Points, size: Float[Tensor, " 2"]) -> Distances:
    """Appendix A, corrected (see README.md): distance to a cylinder of half height h and radius r; 0 inside."""
    height_and_radius = torch.stack([points[:, 0].abs(), points[:, 1:].norm(dim=-1)], -1)
    return (height_and_radius - size).clamp(min=0).norm(dim=-1)


def back_distance(points: Points, size: Float[Tensor, " 4"]) -> Distances:
    """Equation 3 for a sheared cuboid: distance to its parallelogram in (up, depth), and to its ends along side."""
    up, depth, side, shift = size
    corner = torch.stack([up, shift / 2 - depth, up, shift / 2 + depth]).reshape(2, 2)
    corner = torch.cat([corner, -corner])  # in order around the parallelogram
    edge, from_corner = corner.roll(-1, 0) - corner, points[:, None, :2] - corner
    inside = (edge[:, 0] * from_corner[..., 1] > edge[:, 1] * from_corner[..., 0]).all(-1)
    foot = ((from_corner * edge).sum(-1) / (edge**2).sum(-1).clamp(min=1e-24)).clamp(0, 1)
    planar = (from_corner - foot[..., None] * edge).norm(dim=-1).amin(-1).masked_fill(inside, 0)
    return torch.stack([planar, (points[:, 2].abs() - side).clamp(min=0)], -1).norm(dim=-1)


def distance(primitive: Primitive, points: Points) -> Distances:
    """Equation 4: distance to a primitive in any pose, by its inverse transformation of the points."""
    canonical = {"cuboid": cuboid_distance, "cylinder": cylinder_distance, "back": back_distance}[primitive.kind]
    return canonical((points - primitive.centre) @ primitive.rotation, primitive.size)


def union_distance(primitives: Sequence[Primitive], points: Points) -> Distances:
    """Equation 2: the distance to a union is the least of those to its primitives; infinite for none."""
    nothing = torch.full_like(points[:, 0], torch.inf)
    return torch.stack([nothing, *(distance(primitive, points) for primitive in primitives)]).amin(0)


def coverage(primitives: Sequence[Primitive], target: Points) -> Float[Tensor, ""]:
    """Equation 1: mean distance of target points to the union; one box that fills the grid has none."""
    return union_distance(primitives, target).mean()


def face_areas(primitive: Primitive) -> Float[Tensor, " F"]:
    """Areas of the six faces of a cuboid, two for each axis, or of both caps and the side of a cylinder."""
    if primitive.kind == "cylinder":
        height, radius = primitive.size
        return math.pi * torch.stack([radius**2, radius**2, 4 * radius * height])
    height, depth, side = primitive.size[:3]
    slant = torch.stack([height, primitive.size[3] / 2]).norm() if primitive.kind == "back" else height
    return 4 * torch.stack([depth * side, slant * side, height * depth]).repeat_interleave(2)


def standard_points(kind: str, face: Int[Tensor, " P"], rng: torch.Generator | None) -> Points:
    """Points drawn evenly on faces of the standard primitive, which no parameter changes (section 4.2)."""
    noise = 2 * torch.rand(len(face), 3, generator=rng, dtype=torch.float64) - 1
    end = 2.0 * (face % 2) - 1
    if kind != "cylinder":
        return torch.where(torch.arange(3) == face[:, None] // 2, end[:, None], noise)
    height = torch.where(face < 2, end, noise[:, 0])
    radius, angle = torch.where(face < 2, ((1 + noise[:, 1]) / 2).sqrt(), 1), math.pi * noise[:, 2]
    return torch.stack([height, radius * angle.sin(), radius * angle.cos()], -1)


@torch.no_grad()
def hidden(primitives: Sequence[Primitive], index: int, unit: Points) -> Bool[Tensor, " P"]:
    """Which points of a primitive are not on the surface of the union; of faces that coincide the first counts."""
    outer, inner = (primitives[index].transform(scale * unit) for scale in (1 + SKIN, 1 - SKIN))
    before, after = primitives[:index], primitives[index + 1 :]
    return (union_distance([*before, *after], outer) == 0) | (union_distance(before, inner) == 0)


def sample(primitives: Sequence[Primitive], n: int, rng: torch.Generator | None = None) -> tuple[Points, Distances]:
    """Points drawn on the surface in proportion to area, with gradient to sizes and poses (section 4.2).

    Of the n points those that another primitive hides are dropped, which the paper leaves out.  With them come weights
    of value 1 whose gradient is that of the logarithm of the area of the face: the number of points on it carries none.
    """
    if not primitives:
        raise ShapeProgError("a program that draws nothing has no surface to sample", "sample programs that draw parts")
    areas = [face_areas(primitive) for primitive in primitives]
    faces = torch.multinomial(torch.cat(areas).detach(), n, replacement=True, generator=rng)
    counts = faces.bincount(minlength=sum(map(len, areas))).split([len(area) for area in areas])
    points, weights = [], []
    for index, (primitive, area, count) in enumerate(zip(primitives, areas, counts, strict=True)):
        face = torch.arange(len(area)).repeat_interleave(count)
        unit = standard_points(primitive.kind, face, rng).to(primitive.centre)
        visible = ~hidden(primitives, index, unit)
        points.append(primitive.transform(unit[visible]))
        weights.append((area / area.detach())[face[visible]])
    return torch.cat(points), torch.cat(weights)


def chamfer(points: Points, target: Float[Tensor, "Q 3"], weights: Distances | None = None) -> Float[Tensor, ""]:
    """Section 4.3.1: mean squared distances, not sums, to the nearest point of the other cloud, both ways added."""
    squared = ((points[:, None] - target) ** 2).sum(-1)
    weights = torch.ones_like(points[:, 0]) if weights is None else weights
    return (weights * squared.amin(1)).sum() / weights.sum() + squared.amin(0).mean()
