"""Where the parts of a program touch each other and the floor, and what keeps them together.

A joint is a point of one primitive that should be inside another: where they overlap, or else where the gap between
them is narrowest, found by projecting onto the one and the other in turn.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree
from torch import Tensor

from shapeprog.geometry.distance import projected, signed_distance, slopes_to_slots
from shapeprog.geometry.mesh import part_meshes
from shapeprog.geometry.primitive import SIZES
from shapeprog.geometry.scene import Scene
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.fit.tunable import Poses


class Joints(NamedTuple):
    """Pairs of primitives that should touch, and primitives that should touch the floor, by their slots."""

    pairs: Int[Tensor, "C 2"]
    normalized: Float[Tensor, "C 3"]  # point of each joint in the box of the first, in units of its half extents
    standing: Int[Tensor, " S"]
    floor: float  # its height


def find_joints(scene: Scene, floor: float) -> Joints:
    """The joints of a scene: of parts that touch, and of those that nearly touch where nothing else joins them."""
    count, reach = len(scene.mask), scene.reach
    low, high = scene.centre - reach, scene.centre + reach
    start, end = torch.maximum(low[:, None], low), torch.minimum(high[:, None], high)  # of what both boxes contain
    pairs = ((start - end).amax(-1) < 1.0).triu(1).nonzero()
    volume = scene.bounds.prod(-1)[pairs]
    pairs = torch.where(volume[:, :1] > volume[:, 1:], pairs.flip(1), pairs)  # the smaller part comes first
    first, second = pairs.unbind(1)
    points = projected(scene[pairs], ((start + end) / 2)[first, second], rounds=24)
    inner, outer = (signed_distance(scene[slots[:, None]], points[:, None])[:, 0] for slots in (second, first))
    gap = inner + outer.clamp(min=0)
    selected = joining(pairs, gap, count, FIT.nearly) | (gap <= FIT.touching)
    standing = ((_lowest(scene)[:, 0] - floor).abs() <= FIT.nearly).nonzero()[:, 0]
    return Joints(pairs[selected], _inner(scene[first[selected]], points[selected]), standing, floor)


def joining(pairs: Int[Tensor, "C 2"], gap: Float[Tensor, " C"], count: int, widest: float) -> Bool[Tensor, " C"]:
    """Which pairs it takes to join all of so many primitives that gaps up to the widest divide: those of a minimum
    spanning tree."""
    weights = 1 + gap.numpy() - gap.numpy().min(initial=0)  # zero would be no pair
    tree = minimum_spanning_tree(coo_array((weights, pairs.T.numpy()), shape=(count, count)))
    return (gap <= widest) & torch.from_numpy(tree.toarray()[tuple(pairs.T.numpy())] > 0)


def moved(scene: Scene, joints: Joints) -> Joints:
    """The same joints after their parts have moved: the points deepest in both parts, or nearest to both."""
    first = scene[joints.pairs[:, 0]]
    points = projected(scene[joints.pairs], _placed(first, joints.normalized), rounds=6)
    return joints._replace(normalized=_inner(first, points))


def needs(poses: Poses, joints: Joints) -> tuple[Float[Tensor, " R"], Float[Tensor, "R F"]]:
    """Gap of every joint, zero if it is closed, then height above the floor of every part that should touch it, in
    cells (C + S,); and their derivatives (C + S, F) by the numbers."""
    scene, slopes = poses
    (first, second), standing = joints.pairs.unbind(1), scene[joints.standing]
    bearing = torch.cat([first, joints.standing])  # the primitives on which the points are: joints, then feet
    normalized = torch.cat([joints.normalized, _inner(standing, _lowest(standing))])
    rows = torch.cat([scene.size, scene.centre, scene.rotation.flatten(-2)], -1)[bearing].requires_grad_()
    size, centre, rotation = rows.split([SIZES, 3, 9], -1)
    parts = replace(scene[bearing], size=size, centre=centre, rotation=rotation.unflatten(-1, (3, 3)))
    points = _placed(parts, normalized)
    at_joints, at_feet = points.split([len(first), len(standing)])
    gap, by_other, by_joints = slopes_to_slots(scene, second, at_joints.detach())
    gap = gap + 0.02  # into the other part, by more than rounding takes away
    upwards = torch.eye(3, dtype=points.dtype)[:1].expand(len(standing), 3)
    # Of a sum, because gradients of vectors import SymPy.
    (by_rows,) = torch.autograd.grad((points * torch.cat([by_joints, upwards])).sum(), rows)
    by_number = (by_rows[:, None] @ slopes[bearing])[:, 0]
    by_number[: len(second)] += (by_other[:, None] @ slopes[second])[:, 0]
    by_number[: len(second)][gap < 0] = 0.0  # on an axis the slope of a depth is no number
    return torch.cat([gap.clamp(min=0), at_feet[:, 0].detach() - joints.floor]), by_number


def _placed(parts: Scene, normalized: Float[Tensor, "C 3"]) -> Float[Tensor, "C 3"]:
    """Points given in the boxes of primitives (C,), in units of the half extents."""
    return parts.centre + (parts.rotation @ (parts.bounds * normalized)[..., None])[..., 0]


def _inner(scene: Scene, points: Float[Tensor, "C 3"]) -> Float[Tensor, "C 3"]:
    """Points in the boxes of primitives (C,), in units of the half extents."""
    local = ((points - scene.centre)[..., None] * scene.rotation).sum(-2)
    return local / scene.bounds.clamp(min=1e-6)


def _lowest(scene: Scene) -> Float[Tensor, "S 3"]:
    """The lowest points of primitives (S,)."""
    points = scene.centre.clone()  # of parts that are too thin for a mesh
    for n, vertices, _ in part_meshes(scene, math.inf):
        points[n] = torch.from_numpy(vertices[vertices[:, 0] <= vertices[:, 0].min() + 1e-6]).mean(0)
    return points
