"""Cells of scenes in plain tensor code: the readable twin of the kernels, and what other devices than the CPU use.

Solids that stand at right angles to the grid fill rows of bits separably: layers, times rows of a layer, times one
word for each row.  Only turned solids, and those that their declaration alone knows, are tested cell by cell, within
their bounding box.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from shapeprog.geometry.arrays import BUILT_IN
from shapeprog.geometry.primitive import primitives
from shapeprog.geometry.scene import Scene
from shapeprog.space import RESOLUTION

REACH = 1.01
"""A cell belongs to a cylinder when its centre is within this many radii of the axis."""

CAP = 1e-3
"""Slack in cells along the axis of a cylinder, so that a cap through a cell centre takes that cell."""

SQUARE = 1e-6
"""How far an entry of a rotation may be from 0 or 1 and still count as a right angle."""

CUBOID, CYLINDER = 0, 1

AT_ONCE = 1 << 21
"""Cells, or words, that are worked on together."""

Rows = Int[Tensor, "M 32 32"]
"""Words of the (up, depth) rows of each solid: int32, lowest cell in the lowest bit."""


def filled(scene: Scene) -> Int[Tensor, "*batch 32 32"]:
    """The cells of each scene at 32^3 as packed rows, on the device of the scene; ``voxels`` says which they are."""
    plane = torch.arange(scene.batch_shape.numel(), device=scene.mask.device)[:, None].expand(-1, scene.mask.shape[-1])
    return _filled(scene.flatten(), plane, len(plane)).reshape(*scene.batch_shape, RESOLUTION, RESOLUTION)


def filled_blocks(scene: Scene, blocks: int) -> Int[Tensor, "*batch blocks 32 32"]:
    """The cells of each block of each scene on their own, as packed rows."""
    flat = scene.flatten()
    plane = torch.arange(len(flat), device=flat.block.device)[:, None] * blocks + flat.block
    words = _filled(flat, plane, len(flat) * blocks)
    return words.reshape(*scene.batch_shape, blocks, RESOLUTION, RESOLUTION)


def spread(words: Int[Tensor, "*batch 32 32"]) -> UInt8[Tensor, "*batch 32 32 32"]:
    """Cells, 1 or 0, of packed rows."""
    places = torch.arange(RESOLUTION, dtype=torch.int32, device=words.device)
    return ((words[..., None] >> places) & 1).to(torch.uint8)


def cells_within(
    centre: Float[Tensor, "M 3"],
    reach: Float[Tensor, "M 3"],
    inside: Callable[[Int[Tensor, " C"], Float[Tensor, "C 3"]], Bool[Tensor, " C"]],
    resolution: int = RESOLUTION,
) -> Iterator[tuple[Int[Tensor, " C"], Int[Tensor, "C 3"]]]:
    """Cells of solids that pass a test: which solid, and which cell, some millions at a time.

    Parameters
    ----------
    centre, reach
        Middle and half extents of the bounding boxes, in cells of the 32^3 grid.
    inside
        ``(solid, offset from its centre)`` to whether it contains the place.
    resolution
        Cells along each side.
    """
    cell = RESOLUTION / resolution
    first = ((centre - reach + RESOLUTION / 2) / cell - 0.5).floor().clamp(0, resolution).long()
    last = ((centre + reach + RESOLUTION / 2) / cell + 0.5).ceil().clamp(0, resolution).long()
    window = (last - first).clamp(min=0)
    volume = window.prod(-1)
    place = 0
    while place < len(centre):
        stop = place + max(1, int((volume[place:].cumsum(0) <= AT_ONCE).sum()))
        many = volume[place:stop]
        owner = torch.repeat_interleave(torch.arange(place, stop, device=centre.device), many)
        rest = torch.arange(len(owner), device=owner.device) - (many.cumsum(0) - many)[owner - place]
        side, depth = window[owner, 2], window[owner, 1]
        index = torch.stack([rest // (side * depth), rest // side % depth, rest % side], -1) + first[owner]
        within = inside(owner, (index + 0.5) * cell - RESOLUTION / 2 - centre[owner])
        yield owner[within], index[within]
        place = stop


def _filled(scene: Scene, plane: Int[Tensor, "B N"], planes: int) -> Int[Tensor, "planes 32 32"]:
    size, centre, rotation = (each.detach().double() for each in (scene.size, scene.centre, scene.rotation))
    whole = torch.cat([size, centre, rotation.flatten(-2)], -1).isfinite().all(-1) & scene.mask
    square = (rotation - rotation.round()).abs().amax((-2, -1)) <= SQUARE
    standing = square & (rotation[..., 0, 0].abs() > 0.5)
    disc = whole & (scene.kind == CYLINDER) & (size[..., 0] >= 0) & (size[..., 1] > 0)
    box = whole & (scene.kind == CUBOID) & (size[..., :3] > 0).all(-1)
    level = square & (size[..., 3] == 0)
    words = torch.zeros(planes, RESOLUTION, RESOLUTION, dtype=torch.int32, device=plane.device)
    for here, rows in (
        (box & level, _box_rows),
        (box & standing & ~level, _shear_rows),
        (disc & standing, _disc_rows),
    ):
        _merge(words, plane[here], rows, size[here], centre[here] + RESOLUTION / 2, rotation[here])
    for here, kind in (
        (box & ~level & ~standing, CUBOID),
        (disc & ~standing, CYLINDER),
        *((whole & (scene.kind == kind), kind) for kind in range(BUILT_IN, len(primitives))),
    ):
        _mark(words, plane[here], kind, size[here], centre[here], rotation[here])
    return words


def _box_rows(size: Float[Tensor, "M 4"], centre: Float[Tensor, "M 3"], rotation: Float[Tensor, "M 3 3"]) -> Rows:
    """A cuboid at right angles to the grid covers [rint(low), rint(high)) along each axis."""
    half = (rotation.round().abs() @ size[:, :3, None])[..., 0]
    low, high = (centre - half).round()[..., None], (centre + half).round()[..., None]
    return _rows(low[:, 0], high[:, 0], low[:, 1], high[:, 1], low[:, 2], high[:, 2])


def _shear_rows(size: Float[Tensor, "M 4"], centre: Float[Tensor, "M 3"], rotation: Float[Tensor, "M 3 3"]) -> Rows:
    """A sheared cuboid that stands upright: each layer is moved by a whole number of cells.

    Layer i of t covers [o, o + a) with o = rint(y + lean * i / t) along the axis that it leans to.
    """
    item = torch.arange(len(size), device=size.device)
    along = torch.where(rotation[:, 1, 1].abs() > 0.5, 1, 2)
    across = 3 - along
    lean = size[:, 3] * rotation[item, along, 1].round() * rotation[:, 0, 0].round()
    bottom, top = (centre[:, 0] - size[:, 0]).round(), (centre[:, 0] + size[:, 0]).round()
    start = centre[item, along] - size[:, 1] - lean / 2
    layer = torch.arange(RESOLUTION, device=size.device) - bottom[:, None]
    low = (start[:, None] + lean[:, None] * layer / (2 * size[:, :1])).round()
    high = low + (2 * size[:, 1:2]).round()
    near = (centre[item, across] - size[:, 2]).round()[:, None].expand_as(low)
    far = (centre[item, across] + size[:, 2]).round()[:, None].expand_as(low)
    deep = (along == 1)[:, None]
    depth = torch.where(deep, low, near), torch.where(deep, high, far)
    side = torch.where(deep, near, low), torch.where(deep, far, high)
    return _rows(bottom[:, None], top[:, None], *depth, *side)


def _disc_rows(size: Float[Tensor, "M 4"], centre: Float[Tensor, "M 3"], rotation: Float[Tensor, "M 3 3"]) -> Rows:
    """A disc of cells, repeated in every layer whose centres lie between the caps."""
    middle = torch.arange(RESOLUTION, dtype=torch.float64, device=size.device) + 0.5
    layers = (middle - centre[:, :1]).abs() <= size[:, :1] + CAP
    left = (REACH * size[:, 1:2]) ** 2 - (middle - centre[:, 1:2]) ** 2
    disc = (middle - centre[:, 2:3])[:, None, :] ** 2 <= left[:, :, None]
    return torch.where(layers[:, :, None], _packed(disc)[:, None, :], 0)


def _rows(
    up_low: Float[Tensor, "M 1"],
    up_high: Float[Tensor, "M 1"],
    depth_low: Float[Tensor, "M layers"],
    depth_high: Float[Tensor, "M layers"],
    side_low: Float[Tensor, "M layers"],
    side_high: Float[Tensor, "M layers"],
) -> Rows:
    """Cells from low to high along each axis; along depth and side each layer may have its own."""
    place = torch.arange(RESOLUTION, device=up_low.device)
    layers = (place >= up_low) & (place < up_high)
    depth = (place >= depth_low[..., None]) & (place < depth_high[..., None])
    side = (place >= side_low[..., None]) & (place < side_high[..., None])
    return torch.where(layers[:, :, None] & depth, _packed(side)[:, :, None], 0)


def _packed(cells: Bool[Tensor, "*batch 32"]) -> Int[Tensor, "*batch"]:
    """Cells of a row as one word; the highest bit wraps to the sign, as it should."""
    weights = 1 << torch.arange(RESOLUTION, device=cells.device)
    return (cells * weights).sum(-1).to(torch.int32)


def _merge(
    words: Int[Tensor, "planes 32 32"], plane: Int[Tensor, " M"], rows: Callable[..., Rows], *solids: Tensor
) -> None:
    """Add solids to their planes: the first of each plane together, then the second, and so on."""
    order = plane.argsort()
    plane = plane[order]
    rank = torch.arange(len(plane), device=plane.device) - torch.searchsorted(plane, plane)
    for turn in range(int(rank.max()) + 1 if len(rank) else 0):
        for part in (rank == turn).nonzero()[:, 0].split(AT_ONCE // RESOLUTION**2):
            words[plane[part]] |= rows(*(each[order[part]] for each in solids))


def _mark(
    words: Int[Tensor, "planes 32 32"],
    plane: Int[Tensor, " M"],
    kind: int,
    size: Float[Tensor, "M 4"],
    centre: Float[Tensor, "M 3"],
    rotation: Float[Tensor, "M 3 3"],
) -> None:
    """Add the cells whose centre is inside, for solids in any pose."""
    if not len(plane):
        return
    slack = size.new_tensor([CAP, 0, 0]) if kind == CYLINDER else 0
    widened = size * size.new_tensor([1, REACH, 1, 1]) if kind == CYLINDER else size
    reach = (rotation.abs() @ (primitives[kind].bound(widened) + slack)[..., None])[..., 0]

    def inside(owner: Int[Tensor, " C"], offset: Float[Tensor, "C 3"]) -> Bool[Tensor, " C"]:
        local = (rotation[owner].mT @ offset[..., None])[..., 0]
        return _contains(kind, local, size[owner])

    for owner, index in cells_within(centre, reach, inside):
        up, depth, side = index.unbind(-1)
        row = (plane[owner] * RESOLUTION + up) * RESOLUTION + depth
        cell = torch.unique(row * RESOLUTION + side)  # each bit once, so that adding bits is joining them
        row, bit = cell // RESOLUTION, (1 << cell % RESOLUTION).to(torch.int32)
        words |= torch.zeros_like(words).flatten().index_add(0, row, bit).view_as(words)


def _contains(kind: int, local: Float[Tensor, "C 3"], size: Float[Tensor, "C 4"]) -> Bool[Tensor, " C"]:
    """Whether solids contain places in their local frames, by the rules for cells."""
    along, depth, side = local.unbind(-1)
    if kind == CYLINDER:
        return (along.abs() <= size[:, 0] + CAP) & (depth**2 + side**2 <= (REACH * size[:, 1]) ** 2)
    if kind == CUBOID:
        lean = size[:, 3] / 2 * along / size[:, 0]
        upright = (along.abs() <= size[:, 0]) & (side.abs() <= size[:, 2])
        return upright & ((depth - lean).abs() <= size[:, 1])
    return primitives[kind].distance(local, size) <= 0
