"""Points on the surface of the union of each scene, with gradient to sizes and poses.

Which primitive and which face a point lies on, where on the face, and whether another part hides it, is decided
without gradient; then only its place is differentiated.

*Weighting.*  Faces are chosen in proportion to their area, so a plain mean over points is the mean over the surface,
but the choice has no gradient: growing a face moves its points and does not yet make it count for more.  Every point
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
from shapeprog.geometry.arrays import ROW, array, declared_kinds, numbers, over_threads, slopes, solids
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.primitive import SIZES, primitives
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.take import take
from shapeprog.space import Array

SKIN = 1e-3
"""How far in cells off the surface a point is looked at to see whether it is hidden."""

PATIENCE = 64
"""Candidates drawn for each point wanted before a scene is given up."""


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


class _Choice(NamedTuple):
    """What is decided without gradient.

    ``chosen`` (B, n, 2) holds slot and face of each point, ``places`` (B, n, 9) its unit place, its position and its
    normal, ``found`` (B,) how many points each scene has.
    """

    chosen: Tensor
    places: Tensor
    found: Tensor

    @property
    def slot(self) -> Tensor:
        return self.chosen[..., 0]

    @property
    def face(self) -> Tensor:
        return self.chosen[..., 1]

    @property
    def unit(self) -> Tensor:
        return self.places[..., :3]

    @property
    def normal(self) -> Tensor:
        return self.places[..., 6:]


def sample_surface(scene: Scene, n: int, generator: torch.Generator | None = None) -> SurfaceSample:
    """Draw ``n`` points uniformly by area from the visible surface of each scene.

    A point is hidden when it lies inside another primitive, or on a face that an earlier primitive has too.

    Parameters
    ----------
    n
        Points for each scene.
    generator
        Source of randomness; equal states draw equal points.

    Raises
    ------
    ShapeProgError
        If a scene has no surface.
    """
    flat = scene.flatten()
    areas = _areas(flat)
    shares = _shares(areas.detach(), scene)
    device = generator.device if generator is not None else torch.device("cpu")
    seed = int(torch.randint(0, 2**62, (), generator=generator, device=device))
    lead = scene.batch_shape
    if flat.mask.device.type == "cpu" and not declared_kinds(flat):
        table = solids(flat)
        choice = _whole(_by_kernel(table, shares, n, seed), n)
        points, weights = _Place.apply(  # type: ignore[no-untyped-call]
            flat.size, flat.centre, flat.rotation, areas, table, choice
        )
        normal = _cast(choice.normal, flat.size)
    else:
        with torch.no_grad():
            choice = _whole(_by_declaration(flat.detach(), shares, n, seed), n)
        points, normal = _place(flat, choice.slot, choice.unit), choice.normal
        area = areas.flatten(-2).gather(-1, choice.slot * areas.shape[-1] + choice.face)
        weights = area / area.detach()
    return SurfaceSample(
        points.reshape(*lead, n, 3), weights.reshape(*lead, n), choice.slot.reshape(*lead, n),
        normal.reshape(*lead, n, 3),
    )  # fmt: skip


def has_surface(scene: Scene) -> Bool[Tensor, "*batch"]:
    """Which scenes have a surface to draw points from."""
    area = _areas(scene.detach().flatten()).double().flatten(1).sum(-1)
    return ((area > 0) & area.isfinite()).reshape(scene.batch_shape)


def _areas(scene: Scene) -> Float[Tensor, "B N F"]:
    """Area of every face of every slot, zero where there is none."""
    kinds = torch.unique(scene.kind[scene.mask]).tolist()
    found = [primitives[kind].areas(scene.size) for kind in kinds]
    most = max((each.shape[-1] for each in found), default=1)
    areas = scene.size.new_zeros(*scene.mask.shape, most)
    for kind, each in zip(kinds, found, strict=True):
        here = (scene.mask & (scene.kind == kind))[..., None]
        areas = torch.where(here, torch.nn.functional.pad(each, (0, most - each.shape[-1])), areas)
    return areas


def _shares(areas: Float[Tensor, "B N F"], scene: Scene) -> Float[Tensor, "B C"]:
    total = areas.double().flatten(-2).cumsum(-1)
    whole = total[..., -1:] if total.shape[-1] else total.new_zeros(len(total), 1)
    bare = ~((whole[:, 0] > 0) & whole[:, 0].isfinite())
    if bool(bare.any()):
        number = int(bare.nonzero()[0, 0])
        which = f"scene {number} of {len(bare)}" if scene.batch_shape else "the scene"
        raise ShapeProgError(
            f"{which} has no surface to draw points from", "give the program a statement that draws something"
        )
    return total / whole


def _by_kernel(table: Array, shares: Tensor, n: int, seed: int) -> _Choice:
    from shapeprog.geometry import surface_kernels as kernels

    count = len(shares)
    chosen, places = np.empty((count * n, 2), np.int64), np.empty((count * n, 9))
    found = np.zeros(count, np.int64)
    data = (
        table, len(table) // max(count, 1), numbers(shares), seed, SKIN, PATIENCE * n, n, chosen, places, found,
    )  # fmt: skip
    over_threads(lambda first, last: kernels.visible(*data, first, last), count)
    return _Choice(
        torch.from_numpy(chosen).reshape(count, n, 2), torch.from_numpy(places).reshape(count, n, 9),
        torch.from_numpy(found),
    )  # fmt: skip


def _cast(values: Tensor, like: Tensor) -> Tensor:
    """The values in another type, by numpy: torch would wake threads that then wait in the way of the kernels."""
    return torch.from_numpy(np.ascontiguousarray(values.numpy(), array(like).dtype))


def _by_declaration(scene: Scene, shares: Tensor, n: int, seed: int) -> _Choice:
    """The same from the declarations alone, for any kind of primitive on any device."""
    per = shares.shape[-1] // scene.mask.shape[-1]
    pieces: list[tuple[Tensor, ...]] = []
    drawn, found = 0, torch.zeros(len(shares), dtype=torch.long, device=shares.device)
    while drawn < PATIENCE * n and bool((found < n).any()):
        more = min(max(n, 256), PATIENCE * n - drawn)
        uniform = _uniform(seed, len(shares), drawn, more, shares.device)
        cell = torch.searchsorted(shares, uniform[..., 0].contiguous(), right=True)
        slot, face = cell.div(per, rounding_mode="floor"), cell % per
        unit, normal = _draw(scene, slot, face, uniform[..., 1:].to(scene.size))
        points = _place(scene, slot, unit)
        seen = ~_hidden(scene, slot, points, normal)
        pieces.append((torch.stack([slot, face], -1), torch.cat([unit, points, normal], -1), seen))
        found = found + seen.sum(-1)
        drawn += more
    chosen, places, seen = (torch.cat(each, 1) for each in zip(*pieces, strict=True))
    first = torch.argsort(~seen, dim=-1, stable=True)[:, :n]
    return _Choice(take(chosen, first), take(places, first), found.clamp(max=n))


def _whole(choice: _Choice, n: int) -> _Choice:
    """Repeat the points of scenes that are nearly hidden; refuse those that are hidden altogether."""
    if bool((choice.found >= n).all()):
        return choice
    if bool((choice.found == 0).any()):
        raise ShapeProgError("no point of the surface is visible", "the primitives of the scene hide each other")
    place = torch.arange(n, device=choice.found.device) % choice.found[:, None]
    return _Choice(take(choice.chosen, place), take(choice.places, place), choice.found)


def _uniform(seed: int, scenes: int, first: int, more: int, device: torch.device) -> Float[Tensor, "B M 4"]:
    """The numbers of ``surface_kernels.uniform``, in whole numbers that wrap around."""
    count = (torch.arange(scenes, device=device)[:, None] << 40) + 4 * first + torch.arange(4 * more, device=device)
    word = (count + 1) * (0x9E3779B97F4A7C15 - 2**64) + seed
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        word = (word ^ ((word >> shift) & ((1 << (64 - shift)) - 1))) * (factor - 2**64)
    word = word ^ ((word >> 31) & ((1 << 33) - 1))
    numbers: Tensor = ((word >> 11) & ((1 << 53) - 1)).double() * 2.0**-53
    return numbers.reshape(scenes, more, 4)


def _gathered(scene: Scene, slot: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Kind, size, centre and rotation of the primitive of each point."""
    table = torch.cat([scene.size, scene.centre, scene.rotation.flatten(-2)], -1)
    size, centre, rotation = take(table, slot).split([SIZES, 3, 9], -1)
    return scene.kind.gather(-1, slot), size, centre, rotation.unflatten(-1, (3, 3))


def _place(scene: Scene, slot: Tensor, unit: Tensor) -> Tensor:
    kind, size, centre, rotation = _gathered(scene, slot)
    local = torch.zeros_like(unit)
    for each in torch.unique(kind).tolist():
        here = (kind == each).nonzero(as_tuple=True)
        local = local.index_put(here, primitives[each].place(size[here], unit[here]))
    return _turned(rotation, local) + centre


def _draw(scene: Scene, slot: Tensor, face: Tensor, numbers: Tensor) -> tuple[Tensor, Tensor]:
    """Unit places and normals from the declarations."""
    kind, size, _, rotation = _gathered(scene, slot)
    unit, normal = torch.zeros_like(numbers), torch.zeros_like(numbers)
    for each in torch.unique(kind).tolist():
        here = (kind == each).nonzero(as_tuple=True)
        unit[here] = primitives[each].sample(size[here], face[here], numbers[here])
        normal[here] = primitives[each].normal(size[here], unit[here], face[here])
    return unit, _turned(rotation, normal)


def _turned(rotation: Tensor, vectors: Tensor) -> Tensor:
    turned: Tensor = (rotation @ vectors[..., None])[..., 0]
    return turned


def _hidden(scene: Scene, slot: Tensor, points: Tensor, normals: Tensor) -> Tensor:
    order = torch.arange(scene.mask.shape[-1], device=slot.device)
    over, under = points + SKIN * normals, points - SKIN * normals
    inside = (each_distance(scene, over) < 0) & (order != slot[..., None])
    flush = (each_distance(scene, under) < 0) & (order < slot[..., None])
    return (inside | flush).any(-1)


class _Place(torch.autograd.Function):
    """Points on cuboids and cylinders, and their weights, as one differentiable step."""

    @staticmethod
    def forward(
        ctx: Any, size: Tensor, centre: Tensor, rotation: Tensor, areas: Tensor, table: Array, choice: _Choice
    ) -> tuple[Tensor, Tensor]:
        ctx.save_for_backward(areas)
        ctx.table, ctx.choice = table, choice
        points = _cast(choice.places[..., 3:6], size)
        return points, torch.from_numpy(np.ones(points.shape[:-1], points.numpy().dtype))

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, slope: Tensor, weigh: Tensor) -> tuple[Tensor | None, ...]:
        from shapeprog.geometry import surface_kernels as kernels

        (areas,) = ctx.saved_tensors
        scenes, many, faces = areas.shape
        n, choice = slope.shape[1], ctx.choice
        to_solids, to_faces = np.zeros((scenes * many, ROW)), np.zeros((scenes * many, faces))
        data = (
            ctx.table, many, n, array(choice.chosen).reshape(-1, 2), array(choice.places).reshape(-1, 9),
            numbers(slope).reshape(-1, 3), numbers(weigh).reshape(-1), to_solids, to_faces,
        )  # fmt: skip
        over_threads(lambda first, last: kernels.pull(*data, first, last), scenes)
        to_areas = torch.from_numpy(to_faces).to(areas).reshape(areas.shape) / torch.where(areas > 0, areas, 1)
        return *slopes(to_solids, areas, scenes, many), to_areas, None, None
