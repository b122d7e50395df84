"""Points on the surface of the union of each scene, with gradient to sizes and poses.

Which primitive and which face a point lies on, where on the face, and whether another part hides it, is decided
without gradient; then only its place is differentiated.

*Weighting.*  Faces are chosen in proportion to their area, so a plain mean over points is the mean over the surface,
but the choice has no gradient: growing a face moves its points and does not yet increase its weight.  Every point
therefore has a weight of value 1 whose gradient is that of the logarithm of the area of its face.  A mean weighted
by it has the gradient of the mean over the surface, for faces that ``place`` stretches evenly, as those of cuboid
and cylinder.  The line along which a part becomes hidden in another is held still.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.autograd.function import once_differentiable

from shapeprog.errors import ShapeProgError
from shapeprog.geometry import surface_kernels as kernels
from shapeprog.geometry.arrays import array, by_kernel, cast, gradients, numbers, over_threads, table_of
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.distance_kernels import FARTHEST
from shapeprog.geometry.primitive import primitives
from shapeprog.kernels.bits import FIRST, GOLDEN, SECOND
from shapeprog.kernels.table import WIDTH
from shapeprog.space import Array

SKIN = 1e-3  # how far in cells off the surface a point is looked at to see whether it is hidden
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

    chosen: Int[Tensor, "B n 2"]  # slot and face of each point
    places: Float[Tensor, "B n 9"]  # its unit place, its position and its normal, three numbers each
    found: Int[Tensor, " B"]  # how many points each element has; -1 if some are farther away than ``FARTHEST``

    @property
    def slot(self) -> Int[Tensor, "B n"]:
        """Which primitive each point lies on."""
        return self.chosen[..., 0]


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
        Points, weights with which a mean over them has the gradient of the mean over the surface, the primitive of each
        point and its normal.

    Raises
    ------
    ShapeProgError
        If an element has no surface, or one that is too large or too far away for single precision.
    """
    flat = batch.flatten()
    areas = face_areas(flat)
    shares = area_shares(areas.detach(), batch)
    device = generator.device if generator is not None else torch.device("cpu")
    seed = int(torch.randint(0, 2**62, (), generator=generator, device=device))
    if by_kernel(flat):
        table = table_of(flat)
        choice = _whole(visible_by_kernel(table, shares, n, seed), n)
        points, weights = _Placed.apply(  # type: ignore[no-untyped-call]
            flat.size, flat.centre, flat.rotation, areas, table, choice
        )
        normals = cast(choice.places[..., 6:].numpy(), flat.size)
    else:
        with torch.no_grad():
            choice = _whole(visible(flat.detach(), shares, n, seed), n)
        points, weights = place(flat, areas, choice)
        normals = choice.places[..., 6:].to(points)
    found = SurfaceSample(points, weights, choice.slot, normals)
    return SurfaceSample(*(item.reshape(*batch.batch_shape, *item.shape[1:]) for item in found))


sample = sample_surface  # its public name, shapeprog.sample


def has_surface(batch: Batch) -> Bool[Tensor, "*batch"]:
    """Which elements have a surface to draw points from."""
    area = face_areas(batch.detach().flatten()).double().flatten(1).sum(-1)
    return ((area > 0) & area.isfinite()).reshape(batch.batch_shape)


def face_areas(flat: Batch) -> Float[Tensor, "B N F"]:
    """Area of every face of every slot, zero where there is none."""
    slots = [(kind, (flat.mask & (flat.kind == kind)).nonzero(as_tuple=True)) for kind in flat.kinds]
    found = [primitives[kind].areas(flat.size[selected]) for kind, selected in slots]
    width = max((item.shape[-1] for item in found), default=1)
    areas = flat.size.new_zeros(*flat.mask.shape, width)
    for (_, selected), item in zip(slots, found, strict=True):
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


def visible_by_kernel(table: Array, shares: Float[Tensor, "B C"], n: int, seed: int) -> Choice:
    """Visible points, from the table of primitives."""
    count = len(shares)
    chosen, places = np.empty((count * n, 2), np.int64), np.empty((count * n, 9))
    found = np.zeros(count, np.int64)
    data = (
        table, len(table) // max(count, 1), numbers(shares), seed, SKIN, PATIENCE * n, n, chosen, places, found,
    )  # fmt: skip
    over_threads(lambda first, last: kernels.visible(*data, first, last), count)
    return Choice(*(torch.from_numpy(item).reshape(count, *shape) for item, shape in (
        (chosen, (n, 2)), (places, (n, 9)), (found, ())
    )))  # fmt: skip


def visible(flat: Batch, shares: Float[Tensor, "B C"], n: int, seed: int) -> Choice:
    """The same from the declarations alone, for any kind of primitive on any device; the twin of the kernel."""
    per = shares.shape[-1] // flat.mask.shape[-1]
    pieces: list[tuple[Tensor, ...]] = []
    tried, found = 0, torch.zeros(len(shares), dtype=torch.long, device=shares.device)
    while tried < PATIENCE * n and bool((found < n).any()):
        more = min(max(n, 256), PATIENCE * n - tried)
        count = 4 * tried + torch.arange(4 * more, device=shares.device)
        numbers = uniform(seed, (torch.arange(len(shares), device=shares.device)[:, None] << 40) + count)
        numbers = numbers.unflatten(-1, (more, 4))
        cell = torch.searchsorted(shares, numbers[..., 0].contiguous(), right=True)
        slot, face = cell.div(per, rounding_mode="floor"), cell % per
        places = _drawn(flat, slot, face, numbers[..., 1:])
        shown = ~_hidden(flat, slot, places[..., 3:6].to(flat.size), places[..., 6:].to(flat.size))
        pieces.append((torch.stack([slot, face], -1), places, shown))
        found = found + shown.sum(-1)
        tried += more
    chosen, places, shown = (torch.cat(item, 1) for item in zip(*pieces, strict=True))
    first = torch.argsort(~shown, dim=-1, stable=True)[:, :n]
    places = _rows(places, first)
    far = ~(places[..., 3:6].abs().sum(-1) < FARTHEST) & (torch.arange(n, device=found.device) < found[:, None])
    return Choice(_rows(chosen, first), places, torch.where(far.any(-1), -1, found.clamp(max=n)))


def place(flat: Batch, areas: Float[Tensor, "B N F"], choice: Choice) -> tuple[Tensor, Tensor]:
    """Points (B, n, 3) of a choice and their weights (B, n), with gradient; the twin of the kernels."""
    kind, size, centre, rotation = flat.at(choice.slot)
    unit = choice.places[..., :3].to(size)
    local = torch.zeros_like(unit)
    for item in flat.kinds:
        selected = (kind == item).nonzero(as_tuple=True)
        local = local.index_put(selected, primitives[item].place(size[selected], unit[selected]))
    area = areas.flatten(-2).gather(-1, choice.slot * areas.shape[-1] + choice.chosen[..., 1])
    return _turned(rotation, local) + centre, area / area.detach()


class _Placed(torch.autograd.Function):
    """Points of a choice and their weights as one differentiable step of kernels."""

    @staticmethod
    def forward(
        ctx: Any, size: Tensor, centre: Tensor, rotation: Tensor, areas: Tensor, table: Array, choice: Choice
    ) -> tuple[Tensor, Tensor]:
        ctx.save_for_backward(areas)
        ctx.table, ctx.choice = table, choice
        points = cast(choice.places[..., 3:6].numpy(), size)
        return points, torch.from_numpy(np.ones(points.shape[:-1], points.numpy().dtype))

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, slope: Tensor, weigh: Tensor) -> tuple[Tensor | None, ...]:
        (areas,) = ctx.saved_tensors
        scenes, per_scene, faces = areas.shape
        n, choice = slope.shape[1], ctx.choice
        to_table, to_faces = np.zeros((scenes * per_scene, WIDTH)), np.zeros((scenes * per_scene, faces))
        data = (
            ctx.table, per_scene, n, array(choice.chosen).reshape(-1, 2), array(choice.places).reshape(-1, 9),
            numbers(slope).reshape(-1, 3), numbers(weigh).reshape(-1), to_table, to_faces,
        )  # fmt: skip
        over_threads(lambda first, last: kernels.pull(*data, first, last), scenes)
        to_areas = torch.from_numpy(to_faces).to(areas).reshape(areas.shape) / torch.where(areas > 0, areas, 1)
        return *gradients(to_table, areas, scenes, per_scene), to_areas, None, None


def _whole(choice: Choice, n: int) -> Choice:
    """Repeat the points of elements that are nearly hidden; refuse those that are hidden altogether, or too far."""
    if bool((choice.found >= n).all()):
        return choice
    if bool((choice.found < 0).any()):
        raise ShapeProgError(
            f"parts of the surface are farther than {FARTHEST:.0e} cells away, where distances leave single precision",
            "lower positions, sizes and shifts",
        )
    if bool((choice.found == 0).any()):
        raise ShapeProgError("no point of the surface is visible", "the primitives of the scene hide each other")
    turn = torch.arange(n, device=choice.found.device) % choice.found[:, None]
    return Choice(_rows(choice.chosen, turn), _rows(choice.places, turn), choice.found)


def _rows(table: Tensor, index: Int[Tensor, "B n"]) -> Tensor:
    """Rows (B, n, F) of tables (B, m, F)."""
    return table.gather(1, index[..., None].expand(*index.shape, table.shape[-1]))


def _drawn(flat: Batch, slot: Tensor, face: Tensor, numbers: Float[Tensor, "B n 3"]) -> Float[Tensor, "B n 9"]:
    """Unit places, positions and normals from the declarations, in double precision as kernels have them."""
    kind, size, centre, rotation = flat.at(slot)
    size, centre, rotation = size.double(), centre.double(), rotation.double()
    unit, local, normal = torch.zeros_like(numbers), torch.zeros_like(numbers), torch.zeros_like(numbers)
    for item in flat.kinds:
        selected, declared = (kind == item).nonzero(as_tuple=True), primitives[item]
        unit[selected] = declared.sample(size[selected], face[selected], numbers[selected])
        local[selected] = declared.place(size[selected], unit[selected])
        normal[selected] = declared.normal(size[selected], unit[selected], face[selected])
    return torch.cat([unit, _turned(rotation, local) + centre, _turned(rotation, normal)], -1)


def _turned(rotation: Tensor, vectors: Tensor) -> Tensor:
    turned: Tensor = (rotation @ vectors[..., None])[..., 0]
    return turned


def _hidden(flat: Batch, slot: Tensor, points: Tensor, normals: Tensor) -> Bool[Tensor, "B n"]:
    order = torch.arange(flat.mask.shape[-1], device=slot.device)
    over, under = points + SKIN * normals, points - SKIN * normals
    inside = (each_distance(flat, over) < 0) & (order != slot[..., None])
    flush = (each_distance(flat, under) < 0) & (order < slot[..., None])
    return (inside | flush).any(-1)


def uniform(seed: int | Int[Tensor, "*batch"], count: Int[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """Numbers of the stream of a seed, uniform in [0, 1): the twin of :func:`shapeprog.kernels.bits.uniform`."""
    word = (count + 1) * (GOLDEN - 2**64) + seed  # whole numbers that wrap around
    for shift, factor in ((30, FIRST), (27, SECOND)):
        word = (word ^ ((word >> shift) & ((1 << (64 - shift)) - 1))) * (factor - 2**64)
    word = word ^ ((word >> 31) & ((1 << 33) - 1))
    numbers: Tensor = ((word >> 11) & ((1 << 53) - 1)).double() * 2.0**-53
    return numbers
