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
from shapeprog.geometry.distance import each_distance, projected, signed_distance
from shapeprog.geometry.primitives import primitives
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.fit.residuals import rows_of
from shapeprog.inference.fit.tunable import ROW, bounds

NEARLY, TOUCHING = 0.3, 0.05
"""Gaps in cells up to which parts nearly touch, and touch."""

CLOSED = 0.02
"""How far in cells a joint should reach into the other part: more than rounding takes away."""

LOOKED = 64
"""Samples of each primitive that say where it may touch others."""

CANDIDATE = 2.0
"""Gap between samples up to which primitives may touch, in cells: a face may have no sample."""

FIRST, AGAIN = 24, 6
"""Rounds of projections when a joint is looked for, and when its parts have moved."""


class Joints(NamedTuple):
    """Pairs of primitives that should touch, and primitives that should stand on the floor.

    Parameters
    ----------
    first, second
        Slots (C,) of the two.
    places
        Of each joint the place in the box of the first (C, 3), its half extents being 1.
    standing
        Slots (S,) of the primitives that stand on the floor.
    floor
        Height of the floor.
    """

    first: Int[Tensor, " C"]
    second: Int[Tensor, " C"]
    places: Float[Tensor, "C 3"]
    standing: Int[Tensor, " S"]
    floor: float


class Needs(NamedTuple):
    """What joints ask for: residuals (C + S,), in cells, and their derivatives (C + S, F) by the numbers."""

    residual: Float[Tensor, " R"]
    slopes: Float[Tensor, "R F"]


def find_joints(scene: Scene, floor: float, generator: torch.Generator) -> Joints:
    """The joints of a scene: of parts that touch, and of those that nearly touch where nothing else joins them."""
    count = len(scene.mask)
    first, second, points, gap = gaps(scene, generator)
    chosen = (joining(first, second, gap, count, NEARLY) | (gap <= TOUCHING)).nonzero()[:, 0]
    lowest = _lowest(scene, torch.arange(count))[:, 0]
    standing = ((lowest - floor).abs() <= NEARLY).nonzero()[:, 0]
    inner = _inner(scene, first[chosen], points[chosen])
    return Joints(first[chosen], second[chosen], inner, standing, floor)


class Gaps(NamedTuple):
    """Pairs of primitives close to each other: slots (C,) of the two, the place (C, 3) where the gap is narrowest, and
    how wide it is there (C,)."""

    first: Int[Tensor, " C"]
    second: Int[Tensor, " C"]
    points: Float[Tensor, "C 3"]
    width: Float[Tensor, " C"]


def gaps(scene: Scene, generator: torch.Generator) -> Gaps:
    """The gaps of a scene, those between parts that overlap below zero; the smaller part of each pair comes first."""
    places, apart = _samples(scene, generator)
    first, second = (torch.minimum(apart, apart.T) < CANDIDATE).triu(1).nonzero(as_tuple=True)
    area = bounds(scene).prod(-1)
    swap = area[first] > area[second]
    first, second = torch.where(swap, second, first), torch.where(swap, first, second)
    points = between(scene, first, second, places[first, second], FIRST)
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
        one, other = group[int(first[pair])], group[int(second[pair])]
        if gap[pair] <= widest and one != other:
            needed[pair] = True
            group = [one if each == other else each for each in group]
    return needed


def moved(scene: Scene, known: Joints) -> Joints:
    """The same joints where their parts have moved: the places that are deepest in both, or nearest to both."""
    if not len(known.first):
        return known
    points = between(scene, known.first, known.second, places_of(scene, known), AGAIN)
    inner = _inner(scene, known.first, points)
    return known._replace(places=inner)


def places_of(scene: Scene, known: Joints) -> Float[Tensor, "C 3"]:
    """Where joints are while their first parts are where the scene has them."""
    local = bounds(scene)[known.first] * known.places
    found: Tensor = scene.centre[known.first] + (scene.rotation[known.first] @ local[..., None])[..., 0]
    return found


def needs(scene: Scene, slopes: Float[Tensor, "N 16 F"], known: Joints) -> Needs:
    """How far every joint is from closed, none where it is, and how high each part is that stands on the floor."""
    reach = depths(scene, slopes, known)
    gap = reach.residual + CLOSED
    joined = torch.where((gap >= 0)[:, None], reach.slopes, 0.0)  # on an axis the slope of a depth is no number
    stand, feet = rows_of(scene, known.standing)
    low = _inner(scene, known.standing, _lowest(scene, known.standing))
    height = stand.centre[:, 0, 0] + (stand.rotation[:, 0, 0] * bounds(stand)[:, 0] * low).sum(-1) - known.floor
    standing = _by_number(_slopes_of(height, feet), slopes[known.standing])
    return Needs(torch.cat([gap.clamp(min=0), height.detach()]), torch.cat([joined, standing]))


def depths(scene: Scene, slopes: Float[Tensor, "N 16 F"], known: Joints) -> Needs:
    """How far the place of every joint is from the second part, below zero inside it."""
    one, ours = rows_of(scene, known.first)
    two, theirs = rows_of(scene, known.second)
    points = one.centre[:, 0] + (one.rotation[:, 0] @ (bounds(one)[:, 0] * known.places)[..., None])[..., 0]
    far = signed_distance(two, points[:, None])[:, 0]
    found = _slopes_of(far, [*ours, *theirs])
    mine, others = found[:, :ROW], found[:, ROW:]
    return Needs(far.detach(), _by_number(mine, slopes[known.first]) + _by_number(others, slopes[known.second]))


def between(
    scene: Scene, first: Int[Tensor, " C"], second: Int[Tensor, " C"], points: Float[Tensor, "C 3"], rounds: int
) -> Float[Tensor, "C 3"]:
    """Points moved between two primitives each of a scene."""
    both = torch.stack([first, second], 1)
    pairs = (each[both] for each in (scene.kind, scene.size, scene.centre, scene.rotation, scene.mask))
    return projected(Batch(*pairs), points, rounds)


def _samples(scene: Scene, generator: torch.Generator) -> tuple[Float[Tensor, "N N 3"], Float[Tensor, "N N"]]:
    """Of the samples of each primitive the middle of those nearest to each other one, and their distance."""
    single = Batch(*(each[:, None] for each in (scene.kind, scene.size, scene.centre, scene.rotation, scene.mask)))
    drawn = sample_surface(single, LOOKED, generator).points
    away = each_distance(scene, drawn.flatten(0, 1)).unflatten(0, drawn.shape[:2])
    distance, nearest = away.topk(4, 1, largest=False)
    places = drawn[torch.arange(len(drawn))[:, None, None], nearest].mean(1)
    return places, distance[:, 0]


def _slopes_of(values: Float[Tensor, " R"], leaves: Sequence[Tensor]) -> Float[Tensor, "R S"]:
    """Derivatives of values by the rows of leaves, one after another."""
    found = torch.autograd.grad(values.sum(), leaves, allow_unused=True)
    rows = [torch.zeros_like(leaf) if each is None else each for each, leaf in zip(found, leaves, strict=True)]
    return torch.cat([each.flatten(1) for each in rows], 1)


def _by_number(rows: Float[Tensor, "R 16"], slopes: Float[Tensor, "R 16 F"]) -> Float[Tensor, "R F"]:
    found: Tensor = (rows[:, None] @ slopes)[:, 0]
    return found


def _inner(scene: Scene, slots: Int[Tensor, " C"], points: Float[Tensor, "C 3"]) -> Float[Tensor, "C 3"]:
    """Places in the boxes of primitives."""
    local = ((points - scene.centre[slots])[..., None] * scene.rotation[slots]).sum(-2)
    return local / bounds(scene)[slots].clamp(min=1e-6)


def _lowest(scene: Scene, slots: Int[Tensor, " S"]) -> Float[Tensor, "S 3"]:
    """The lowest points of primitives."""
    found = torch.zeros(len(slots), 3, dtype=scene.centre.dtype)
    for n, slot in enumerate(slots.tolist()):
        vertices, _ = primitives[int(scene.kind[slot])].mesh(scene.size[slot].double().numpy())
        placed = torch.from_numpy(vertices) @ scene.rotation[slot].T + scene.centre[slot]
        lowest = placed[:, 0] <= placed[:, 0].min() + 1e-6
        found[n] = placed[lowest].mean(0)
    return found
