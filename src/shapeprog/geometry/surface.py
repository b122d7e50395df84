"""Points on the surface of the union of each scene, with gradient to sizes and poses.

Which primitive and which face a point lies on, where on the face, and whether another part hides it, is decided
without gradient; then only its place is differentiated.

*Weighting.*  Faces are chosen in proportion to their area, so a plain mean over points is the mean over the surface,
but the choice has no gradient: growing a face moves its points and does not yet increase its weight.  Every point
therefore has a weight of value 1 whose gradient is that of the logarithm of the area of its face.  A mean weighted
by it has the gradient of the mean over the surface where ``place`` stretches faces evenly, as those of cuboid and
cylinder, and no part hides another.  It leaves out that points of a taper move along it as its radii change, and that
the line along which one part becomes hidden in another moves: errors of the first order in both cases.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from shapeprog.arguments import check_number
from shapeprog.errors import ShapeProgError
from shapeprog.geometry import surface_kernels as kernels
from shapeprog.geometry.arrays import cast, first_order, gradients, numbers, over_threads, table_of
from shapeprog.geometry.batch import Batch, check_batch
from shapeprog.geometry.contacts import TOUCHING
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.distance_kernels import FARTHEST
from shapeprog.geometry.primitives import primitives
from shapeprog.kernels.table import WIDTH
from shapeprog.space import Array

SKIN = 1e-3  # how far in cells off the surface a point is looked at to see whether it is hidden
VISIBLE_SAMPLES = 4096  # points drawn on the visible surface to detect hidden groups
PATIENCE = 64  # candidates drawn for each point wanted before a scene is given up


class SurfaceSample(NamedTuple):
    """Points on the surface of the union.

    Parameters
    ----------
    points
        Positions in the grid frame, with gradient.
    weights
        Ones, whose gradient is that of the log area of the face (see the module).
    slot
        Which primitive each point lies on.
    normals
        Outward unit normals, without gradient.
    """

    points: Float[Tensor, "*batch n 3"]
    weights: Float[Tensor, "*batch n"]
    slot: Int[Tensor, "*batch n"]
    normals: Float[Tensor, "*batch n 3"]


class Choice(NamedTuple):
    """Decisions made without gradient."""

    chosen: Int[Array, "B n 2"]  # slot and face of each point
    places: Float[Array, "B n 9"]  # its unit place, its position and its normal, three numbers each
    found: Int[Array, " B"]  # how many points each element has; -1 if some are farther away than ``FARTHEST``


def sample_surface(batch: Batch, n: int, generator: torch.Generator | None = None) -> SurfaceSample:
    """Draw ``n`` points uniformly by area from the visible surface of each element.

    A point is hidden when it lies inside another primitive, or on a face that an earlier primitive has too.

    Parameters
    ----------
    batch
        A scene, or any batch of primitives, with gradient to sizes and poses.
    n
        Points for each element.
    generator
        Source of randomness; equal states draw equal points.

    Returns
    -------
    SurfaceSample
        Points, weights that add the change of areas to the gradient of a mean over them (see the module), the
        primitive of each point and its normal.

    Raises
    ------
    ShapeProgError
        If this is no batch, an element has no surface, or one that is too large or too far away for single precision.
    """
    check_batch(batch)
    check_number("n", n, 0, whole=True)
    if not isinstance(generator, torch.Generator | None):
        raise ShapeProgError(f"generator is {generator!r}", "give torch.Generator().manual_seed(0), for example")
    flat = batch.flatten()
    areas = face_areas(flat)
    shares = area_shares(areas.detach(), batch)
    device = generator.device if generator is not None else torch.device("cpu")
    seed = int(torch.randint(0, 2**62, (), generator=generator, device=device))
    table = table_of(flat)
    choice = _repeated(visible(table, shares, n, seed), n)
    points, weights = _Placed.apply(  # type: ignore[no-untyped-call]
        flat.size, flat.centre, flat.rotation, areas, table, choice
    )
    slot = torch.from_numpy(choice.chosen[..., 0]).to(flat.device)
    sample = points, weights, slot, cast(choice.places[..., 6:], flat.size)
    return SurfaceSample(*(item.reshape(*batch.batch_shape, *item.shape[1:]) for item in sample))


sample = sample_surface  # its public name, shapeprog.sample


def hidden_groups(batch: Batch, group: Int[Tensor, " N"]) -> set[int]:
    """The groups (N,) of primitives of one scene whose surface lies inside other groups, to within ``TOUCHING``.

    A scene without a surface has none.
    """
    if not face_areas(batch.flatten()).any():
        return set()
    sample = sample_surface(batch, VISIBLE_SAMPLES, torch.Generator().manual_seed(0))
    away, owner = each_distance(batch, sample.points), group[sample.slot]
    visible = away.masked_fill(group == owner[:, None], math.inf).amin(1) > TOUCHING
    return {*group.tolist()} - {*owner[visible].tolist()}


def face_areas(flat: Batch) -> Float[Tensor, "B N F"]:
    """Area of every face of every slot, zero where there is none."""
    slots = [(kind, (flat.mask & (flat.kind == kind)).nonzero(as_tuple=True)) for kind in flat.kinds]
    kind_areas = [primitives[kind].areas(flat.size[selected]) for kind, selected in slots]
    width = max((item.shape[-1] for item in kind_areas), default=1)
    areas = flat.size.new_zeros(*flat.mask.shape, width)
    for (_, selected), item in zip(slots, kind_areas, strict=True):
        areas = areas.index_put(selected, torch.nn.functional.pad(item, (0, width - item.shape[-1])))
    return areas


def area_shares(areas: Float[Tensor, "B N F"], batch: Batch) -> Float[Tensor, "B C"]:
    """Cumulative shares of area of all faces of each element.

    Raises
    ------
    ShapeProgError
        If an element has no area, or an infinite one.
    """
    total = areas.double().flatten(-2).cumsum(-1)
    total_area = total[..., -1:] if total.shape[-1] else total.new_zeros(len(total), 1)
    bare = ~((total_area[:, 0] > 0) & total_area[:, 0].isfinite())
    if bool(bare.any()):
        number = int(bare.nonzero()[0, 0])
        which = f"scene {number} of {len(bare)}" if batch.batch_shape else "the scene"
        if not bool(total_area[number].isfinite()):
            raise ShapeProgError(f"{which} has a surface of infinite or undefined area", "lower sizes and positions")
        message = f"{which} has no surface to draw points from"
        raise ShapeProgError(message, "give the program a statement that draws something")
    return total / total_area


def visible(table: Array, shares: Float[Tensor, "B C"], n: int, seed: int) -> Choice:
    """Visible points, from the table of primitives."""
    count = len(shares)
    choice = Choice(np.empty((count, n, 2), np.int64), np.empty((count, n, 9)), np.zeros(count, np.int64))
    data = (
        table, len(table) // max(count, 1), numbers(shares), seed, SKIN, PATIENCE * n, n, choice.chosen.reshape(-1, 2),
        choice.places.reshape(-1, 9), choice.found,
    )  # fmt: skip
    over_threads(partial(kernels.visible, *data), count)
    return choice


class _Placed(torch.autograd.Function):
    """Points of a choice and their weights as one differentiable step of kernels."""

    @staticmethod
    def forward(
        ctx: Any, size: Tensor, centre: Tensor, rotation: Tensor, areas: Tensor, table: Array, choice: Choice
    ) -> tuple[Tensor, Tensor]:
        ctx.save_for_backward(areas)
        ctx.table, ctx.choice = table, choice
        points = cast(choice.places[..., 3:6], size)
        return points, cast(np.ones(points.shape[:-1]), size)

    @staticmethod
    @first_order
    def backward(ctx: Any, slope: Tensor, weigh: Tensor) -> tuple[Tensor | None, ...]:
        (areas,) = ctx.saved_tensors
        scenes, per_scene, faces = areas.shape
        n, choice = slope.shape[1], ctx.choice
        to_table, to_faces = np.zeros((scenes * per_scene, WIDTH)), np.zeros((scenes * per_scene, faces))
        data = (
            ctx.table, per_scene, n, choice.chosen.reshape(-1, 2), choice.places.reshape(-1, 9),
            numbers(slope).reshape(-1, 3), numbers(weigh).reshape(-1), to_table, to_faces,
        )  # fmt: skip
        over_threads(partial(kernels.pull, *data), scenes)
        to_areas = torch.from_numpy(to_faces).to(areas).reshape(areas.shape) / torch.where(areas > 0, areas, 1)
        return *gradients(to_table, areas, scenes, per_scene), to_areas, None, None


def _repeated(choice: Choice, n: int) -> Choice:
    """Repeat the points of elements that are nearly hidden; refuse those that are hidden altogether, or too far."""
    if (choice.found >= n).all():
        return choice
    if (choice.found < 0).any():
        raise ShapeProgError(
            f"parts of the surface are farther than {FARTHEST:.0e} cells away, where distances leave single precision",
            "lower positions, sizes and shifts",
        )
    if (choice.found == 0).any():
        raise ShapeProgError("no point of the surface is visible", "the primitives of the scene hide each other")
    turn = (np.arange(n) % choice.found[:, None])[..., None]
    chosen, places = (np.take_along_axis(rows, turn, 1) for rows in (choice.chosen, choice.places))
    return Choice(chosen, places, choice.found)
