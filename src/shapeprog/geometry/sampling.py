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

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.autograd.function import once_differentiable

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import array, arrays, declared_kinds, over_threads
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.primitive import SIZES, primitives
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.take import take

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
    """What is decided without gradient, (B, n, ...), and how many points each scene has found (B,)."""

    slot: Tensor
    face: Tensor
    unit: Tensor
    normal: Tensor
    found: Tensor


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
    still = flat.detach()
    with torch.no_grad():
        quick = flat.mask.device.type == "cpu" and not declared_kinds(flat)
        choice = (_by_kernel if quick else _by_declaration)(still, shares, n, seed)
        choice = _whole(choice, n, scene)
    if quick:
        points: Tensor = _Place.apply(  # type: ignore[no-untyped-call]
            flat.size, flat.centre, flat.rotation, flat.kind, choice.slot, choice.unit
        )
    else:
        points = _place(flat, choice.slot, choice.unit)
    cell = choice.slot * areas.shape[-1] + choice.face
    area = areas.flatten(-2).gather(-1, cell)
    lead = scene.batch_shape
    return SurfaceSample(
        points.reshape(*lead, n, 3), (area / area.detach()).reshape(*lead, n),
        choice.slot.reshape(*lead, n), choice.normal.reshape(*lead, n, 3),
    )  # fmt: skip


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


def _by_kernel(scene: Scene, shares: Tensor, n: int, seed: int) -> _Choice:
    from shapeprog.geometry import surface_kernels as kernels

    count, like = len(shares), scene.size
    slot, face = (torch.empty(count, n, dtype=torch.long) for _ in range(2))
    unit, normal = (torch.empty(count, n, 3, dtype=like.dtype) for _ in range(2))
    found = torch.zeros(count, dtype=torch.long)
    data = (
        *arrays(scene), array(shares), seed, SKIN, PATIENCE * n,
        slot.numpy(), face.numpy(), unit.numpy(), normal.numpy(), found.numpy(),
    )  # fmt: skip
    over_threads(lambda first, last: kernels.visible(*data, first, last), count)
    return _Choice(slot, face, unit, normal, found)


def _by_declaration(scene: Scene, shares: Tensor, n: int, seed: int) -> _Choice:
    """The same from the declarations alone, for any kind of primitive on any device."""
    per = shares.shape[-1] // scene.mask.shape[-1]
    pieces: list[tuple[Tensor, ...]] = []
    drawn, found = 0, torch.zeros(len(shares), dtype=torch.long, device=shares.device)
    while drawn < PATIENCE * n and bool((found < n).any()):
        more = min(max(n, 256), PATIENCE * n - drawn)
        numbers = _uniform(seed, len(shares), drawn, more, shares.device)
        cell = torch.searchsorted(shares, numbers[..., 0].contiguous(), right=True)
        slot, face = cell.div(per, rounding_mode="floor"), cell % per
        unit, normal = _draw(scene, slot, face, numbers[..., 1:].to(scene.size))
        seen = ~_hidden(scene, slot, _place(scene, slot, unit), normal)
        pieces.append((slot, face, unit, normal, seen))
        found = found + seen.sum(-1)
        drawn += more
    slot, face, unit, normal, seen = (torch.cat(each, 1) for each in zip(*pieces, strict=True))
    first = torch.argsort(~seen, dim=-1, stable=True)[:, :n]
    deep = first[..., None].expand(-1, -1, 3)
    return _Choice(
        slot.gather(1, first), face.gather(1, first), unit.gather(1, deep), normal.gather(1, deep), found.clamp(max=n)
    )


def _whole(choice: _Choice, n: int, scene: Scene) -> _Choice:
    """Repeat the points of scenes that are nearly hidden; refuse those that are hidden altogether."""
    if bool((choice.found >= n).all()):
        return choice
    if bool((choice.found == 0).any()):
        raise ShapeProgError("no point of the surface is visible", "the primitives of the scene hide each other")
    place = torch.arange(n, device=choice.slot.device) % choice.found[:, None]
    deep = place[..., None].expand(-1, -1, 3)
    return _Choice(
        choice.slot.gather(1, place), choice.face.gather(1, place), choice.unit.gather(1, deep),
        choice.normal.gather(1, deep), choice.found,
    )  # fmt: skip


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
    """Placing points on cuboids and cylinders as one differentiable step."""

    @staticmethod
    def forward(
        ctx: Any, size: Tensor, centre: Tensor, rotation: Tensor, kind: Tensor, slot: Tensor, unit: Tensor
    ) -> Tensor:
        from shapeprog.geometry import surface_kernels as kernels

        ctx.save_for_backward(size, centre, rotation, kind, slot, unit)
        points = unit.new_empty(unit.shape)
        data = array(kind), array(size), array(centre), array(rotation), array(slot), array(unit), points.numpy()
        over_threads(lambda first, last: kernels.put(*data, first, last), len(slot), least=8)
        return points

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor | None, ...]:
        from shapeprog.geometry import surface_kernels as kernels

        size, centre, rotation, kind, slot, unit = ctx.saved_tensors
        to_size, to_centre, to_rotation = (each.new_zeros(each.shape) for each in (size, centre, rotation))
        data = (
            array(kind), array(size), array(rotation), array(slot), array(unit), array(slope),
            to_size.numpy(), to_centre.numpy(), to_rotation.numpy(),
        )  # fmt: skip
        over_threads(lambda first, last: kernels.pull(*data, first, last), len(slot), least=8)
        return to_size, to_centre, to_rotation, None, None, None
