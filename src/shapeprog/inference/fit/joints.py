"""Where the parts of a program touch each other and the floor, and what keeps them together.

A joint is a point of one primitive that should be inside another: where they overlap, or else where the gap between
them is narrowest, found by projecting onto the one and the other in turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from shapeprog.geometry.batch import Batch
from shapeprog.geometry.distance import projected, signed_distance
from shapeprog.geometry.primitives import primitives
from shapeprog.geometry.scene import Scene
from shapeprog.inference.fit.residuals import rows_of
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.fit.tunable import ROW


class Joints(NamedTuple):
    """Pairs of primitives that should touch, and primitives that should touch the floor.

    Parameters
    ----------
    first, second
        Slots (C,) of the two.
    normalized
        Point of each joint (C, 3) in the box of the first primitive, in units of its half extents.
    standing
        Slots (S,) of the primitives that should touch the floor.
    floor
        Height of the floor.
    """

    first: Int[Tensor, " C"]
    second: Int[Tensor, " C"]
    normalized: Float[Tensor, "C 3"]
    standing: Int[Tensor, " S"]
    floor: float


class Needs(NamedTuple):
    """Residuals of joints (C + S,), in cells, and their derivatives (C + S, F) by the numbers."""

    residual: Float[Tensor, " R"]
    slopes: Float[Tensor, "R F"]


def find_joints(scene: Scene, floor: float) -> Joints:
    """The joints of a scene: of parts that touch, and of those that nearly touch where nothing else joins them."""
    count = len(scene.mask)
    first, second, points, gap = gaps(scene)
    selected = (joining(first, second, gap, count, FIT.nearly) | (gap <= FIT.touching)).nonzero()[:, 0]
    lowest = _lowest(scene, torch.arange(count))[:, 0]
    standing = ((lowest - floor).abs() <= FIT.nearly).nonzero()[:, 0]
    inner = _inner(scene, first[selected], points[selected])
    return Joints(first[selected], second[selected], inner, standing, floor)


class Gaps(NamedTuple):
    """Pairs of primitives close to each other: slots (C,) of the two, the point (C, 3) where the gap is narrowest, and
    the width of the gap (C,)."""

    first: Int[Tensor, " C"]
    second: Int[Tensor, " C"]
    points: Float[Tensor, "C 3"]
    width: Float[Tensor, " C"]


def gaps(scene: Scene) -> Gaps:
    """The gaps of a scene, those between parts that overlap below zero; the smaller part of each pair comes first."""
    low, high = scene.centre - scene.reach, scene.centre + scene.reach
    start, end = torch.maximum(low[:, None], low), torch.minimum(high[:, None], high)  # of what both boxes contain
    first, second = ((start - end).amax(-1) < 1.0).triu(1).nonzero(as_tuple=True)
    area = scene.bounds.prod(-1)
    swap = area[first] > area[second]
    first, second = torch.where(swap, second, first), torch.where(swap, first, second)
    points = between(scene, first, second, ((start + end) / 2)[first, second], 24)
    width = signed_distance(rows_of(scene, second)[0], points[:, None])[:, 0].detach()
    width = width + signed_distance(rows_of(scene, first)[0], points[:, None])[:, 0].detach().clamp(min=0)
    return Gaps(first, second, points, width)


def joining(
    first: Int[Tensor, " C"], second: Int[Tensor, " C"], gap: Float[Tensor, " C"], count: int, widest: float
) -> Bool[Tensor, " C"]:
    """Which pairs it takes to join all of so many primitives that gaps up to the widest divide: the
    narrowest (Kruskal 1956)."""
    needed, group = torch.zeros(len(gap), dtype=torch.bool), list(range(count))
    for pair in torch.argsort(gap, stable=True).tolist():
        target, source = group[int(first[pair])], group[int(second[pair])]
        if gap[pair] <= widest and target != source:
            needed[pair] = True
            group = [target if label == source else label for label in group]
    return needed


def moved(scene: Scene, joints: Joints) -> Joints:
    """The same joints after their parts have moved: the points deepest in both parts, or nearest to both."""
    if not len(joints.first):
        return joints
    points = between(scene, joints.first, joints.second, positions_of(scene, joints), 6)
    inner = _inner(scene, joints.first, points)
    return joints._replace(normalized=inner)


def positions_of(scene: Scene, joints: Joints) -> Float[Tensor, "C 3"]:
    """Positions of joints when their first parts are as in the scene."""
    local = scene.bounds[joints.first] * joints.normalized
    positions: Tensor = scene.centre[joints.first] + (scene.rotation[joints.first] @ local[..., None])[..., 0]
    return positions


def needs(scene: Scene, slopes: Float[Tensor, "N 16 F"], joints: Joints) -> Needs:
    """Gap of every joint, zero if it is closed, and height above the floor of every part that should touch it."""
    reach = depths(scene, slopes, joints)
    gap = reach.residual + 0.02  # into the other part, by more than rounding takes away
    joined = torch.where((gap >= 0)[:, None], reach.slopes, 0.0)  # on an axis the slope of a depth is no number
    stand, feet = rows_of(scene, joints.standing)
    low = _inner(scene, joints.standing, _lowest(scene, joints.standing))
    height = stand.centre[:, 0, 0] + (stand.rotation[:, 0, 0] * stand.bounds[:, 0] * low).sum(-1) - joints.floor
    standing = _by_number(_slopes_of(height, feet), slopes[joints.standing])
    return Needs(torch.cat([gap.clamp(min=0), height.detach()]), torch.cat([joined, standing]))


def depths(scene: Scene, slopes: Float[Tensor, "N 16 F"], joints: Joints) -> Needs:
    """Signed distance from the point of every joint to the second part, negative inside it."""
    first, first_leaves = rows_of(scene, joints.first)
    second, second_leaves = rows_of(scene, joints.second)
    points = first.centre[:, 0] + (first.rotation[:, 0] @ (first.bounds[:, 0] * joints.normalized)[..., None])[..., 0]
    far = signed_distance(second, points[:, None])[:, 0]
    by_row = _slopes_of(far, [*first_leaves, *second_leaves])
    by_first, by_second = by_row[:, :ROW], by_row[:, ROW:]
    return Needs(
        far.detach(), _by_number(by_first, slopes[joints.first]) + _by_number(by_second, slopes[joints.second])
    )


def between(
    scene: Scene, first: Int[Tensor, " C"], second: Int[Tensor, " C"], points: Float[Tensor, "C 3"], rounds: int
) -> Float[Tensor, "C 3"]:
    """Points moved between two primitives each of a scene."""
    slots = torch.stack([first, second], 1)
    pairs = (tensor[slots] for tensor in (scene.kind, scene.size, scene.centre, scene.rotation, scene.mask))
    return projected(Batch(*pairs), points, rounds)


def _slopes_of(values: Float[Tensor, " R"], leaves: Sequence[Tensor]) -> Float[Tensor, "R S"]:
    """Derivatives of values by the rows of leaves, one after another."""
    gradients = torch.autograd.grad(values.sum(), leaves, allow_unused=True)
    rows = [
        torch.zeros_like(leaf) if gradient is None else gradient
        for gradient, leaf in zip(gradients, leaves, strict=True)
    ]
    return torch.cat([row.flatten(1) for row in rows], 1)


def _by_number(rows: Float[Tensor, "R 16"], slopes: Float[Tensor, "R 16 F"]) -> Float[Tensor, "R F"]:
    product: Tensor = (rows[:, None] @ slopes)[:, 0]
    return product


def _inner(scene: Scene, slots: Int[Tensor, " C"], points: Float[Tensor, "C 3"]) -> Float[Tensor, "C 3"]:
    """Points in the boxes of primitives, in units of the half extents."""
    local = ((points - scene.centre[slots])[..., None] * scene.rotation[slots]).sum(-2)
    return local / scene.bounds[slots].clamp(min=1e-6)


def _lowest(scene: Scene, slots: Int[Tensor, " S"]) -> Float[Tensor, "S 3"]:
    """The lowest points of primitives."""
    points = torch.zeros(len(slots), 3, dtype=scene.centre.dtype)
    for n, slot in enumerate(slots.tolist()):
        vertices, _ = primitives[int(scene.kind[slot])].mesh(scene.size[slot].double().numpy())
        placed = torch.from_numpy(vertices) @ scene.rotation[slot].T + scene.centre[slot]
        lowest = placed[:, 0] <= placed[:, 0].min() + 1e-6
        points[n] = placed[lowest].mean(0)
    return points
