"""Cells of the grid, packed: 32 to a word, so that a union is one ``|`` and a grid of 32^3 takes 4 kB.

Packed cells are int32 tensors (..., W * R, R): a row of R cells along left-right takes W = R / 32 words, rounded up,
the lowest cell in the lowest bit; the first words of the rows at all heights and depths come first, then the second.
On the CPU kernels do the work, elsewhere their twins in torch.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Bool, Float, Int, Shaped, UInt8
from torch import Tensor

from shapeprog.errors import ShapeProgError
from shapeprog.geometry import cell_kernels as kernels
from shapeprog.geometry.arrays import array, by_kernel, declared_kinds, over_threads, table_of, twin_of
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.primitive import Primitive, primitives
from shapeprog.kernels.bits import WORD
from shapeprog.space import RESOLUTION, Array

AT_ONCE = 1 << 21
"""Cells, or words, that are worked on together."""

Cells = Int[Tensor, "*batch words R"]
"""Packed cells."""

_SPREAD = np.unpackbits(np.arange(256, dtype=np.uint8), bitorder="little").view(np.uint64)


def rasterise(batch: Batch, resolution: int = RESOLUTION) -> Cells:
    """The packed cells that the primitives of each element occupy, clipped to the grid; see :func:`voxels`."""
    return rasterise_apart(batch, torch.zeros_like(batch.kind), 1, resolution)[..., 0, :, :]


def rasterise_apart(
    batch: Batch, part: Int[Tensor, "*batch N"], parts: int, resolution: int = RESOLUTION
) -> Int[Tensor, "*batch parts words R"]:
    """The same of groups of primitives, each on its own; ``part`` is the group of a slot, from 0 to ``parts`` - 1."""
    if resolution < 1:
        raise ShapeProgError(f"a grid of {resolution} cells a side holds nothing", "ask for a resolution of 1 or more")
    flat, rows = batch.flatten(), -(-resolution // WORD) * resolution
    cells = torch.zeros(len(flat) * parts, rows, resolution, dtype=torch.int32, device=flat.device)
    plane = torch.arange(len(flat), device=flat.device)[:, None] * parts + part.reshape(flat.mask.shape)
    (fill_by_kernel if by_kernel(flat.mask) else fill)(flat, plane, cells)
    return cells.reshape(*batch.batch_shape, parts, rows, resolution)


def voxels(batch: Batch, resolution: int = RESOLUTION) -> UInt8[Tensor, "*batch R R R"]:
    """The cells that the primitives of each element occupy, 1 or 0, clipped to the grid, to which they are scaled.

    A cuboid at right angles covers [rint(low), rint(high)) along each axis, and if sheared each layer is moved by
    whole cells; a cylinder covers the cells whose centre is within 1.01 radii of its axis; a turned cuboid, and any
    other primitive, those whose centre it contains.  On whole-numbered programs this is the published executor.
    """
    return unpack(rasterise(batch, resolution))


def words_of(cells: Cells) -> npt.NDArray[np.uint32]:
    """The words of cells on the CPU as unsigned numbers, which is how kernels take them; not copied."""
    return array(cells).view(np.uint32)


def cells_of(words: npt.NDArray[np.uint32]) -> Int[Tensor, ...]:
    """Unsigned words as cells; not copied."""
    return torch.from_numpy(words.view(np.int32))


def pack(voxels: Shaped[Tensor, "*batch R R R"] | Array) -> Cells:
    """Packed cells of grids of cells, given as booleans or as 1 and 0."""
    packed: Cells = pack_rows(torch.as_tensor(voxels) != 0).movedim(-1, -3).flatten(-3, -2)
    return packed


def _pack_rows_by_numpy(rows: Bool[Tensor, "*batch places"]) -> Int[Tensor, "*batch words"]:
    spare = [(0, 0)] * (rows.ndim - 1) + [(0, -rows.shape[-1] % WORD)]
    bits = np.packbits(np.pad(array(rows), spare) if spare[-1][1] else array(rows), -1, bitorder="little")
    return cells_of(bits.view("<u4").astype(np.uint32, copy=False))


@twin_of(_pack_rows_by_numpy)
def pack_rows(rows: Bool[Tensor, "*batch places"]) -> Int[Tensor, "*batch words"]:
    """Rows of cells as words; the highest bit wraps to the sign, as it should."""
    padded = torch.nn.functional.pad(rows, (0, -rows.shape[-1] % WORD)).unflatten(-1, (-1, WORD))
    return (padded * (1 << torch.arange(WORD, device=rows.device))).sum(-1).to(torch.int32)


def _unpack_by_kernel(cells: Cells) -> UInt8[Tensor, "*batch R R R"]:
    rows = _rows(cells)
    words = words_of(rows).reshape(-1)
    eights = np.empty((len(words), 4), np.uint64)
    over_threads(partial(kernels.unpack, words, _SPREAD, eights), len(words), least=1 << 15)
    voxels = torch.from_numpy(eights.view(np.uint8)).reshape(*rows.shape[:-1], -1)
    return voxels[..., : cells.shape[-1]].contiguous()


@twin_of(_unpack_by_kernel)
def unpack(cells: Cells) -> UInt8[Tensor, "*batch R R R"]:
    """Grids of cells, 1 or 0, of packed ones."""
    bits = (_rows(cells)[..., None] >> torch.arange(WORD, dtype=torch.int32, device=cells.device)) & 1
    return bits.to(torch.uint8).flatten(-2)[..., : cells.shape[-1]]


def _rows(cells: Cells) -> Int[Tensor, "*batch R R W"]:
    """The words of every row side by side."""
    return cells.unflatten(-2, (-1, cells.shape[-1])).movedim(-3, -1)


def _count_by_numpy(cells: Cells) -> Int[Tensor, "*batch"]:
    return torch.from_numpy(np.asarray(np.bitwise_count(words_of(cells)).sum((-2, -1), dtype=np.int64)))


@twin_of(_count_by_numpy)
def count(cells: Cells) -> Int[Tensor, "*batch"]:
    """How many cells of each grid are filled."""
    return unpack.twin(cells).flatten(-3).sum(-1, dtype=torch.int64)  # type: ignore[attr-defined]


def _iou_by_kernel(a: Int[Tensor, "*one words R"], b: Int[Tensor, "*two words R"]) -> Float[Tensor, "*batch"]:
    first, second = torch.broadcast_tensors(a, b)
    lead = first.shape[:-2]
    counts = np.empty((lead.numel(), 2), np.int64)
    kernels.shared(*(words_of(item).reshape(lead.numel(), -1) for item in (first, second)), counts)
    intersection, either = torch.from_numpy(counts).double().reshape(*lead, 2).unbind(-1)
    return torch.where(either > 0, intersection / either.clamp(min=1), 1.0)


@twin_of(_iou_by_kernel)
def iou(a: Int[Tensor, "*one words R"], b: Int[Tensor, "*two words R"]) -> Float[Tensor, "*batch"]:
    """Intersection over union of packed cells, with broadcasting; 1 when both are empty."""
    intersection, either = count(a & b).double(), count(a | b).double()
    return torch.where(either > 0, intersection / either.clamp(min=1), 1.0)


def union(parts: Int[Tensor, "*batch K words R"]) -> Cells:
    """The cells of all parts together."""
    cells = torch.zeros_like(parts[..., 0, :, :])
    for part in parts.unbind(-3):
        cells |= part
    return cells


def preceding(parts: Int[Tensor, "*batch K words R"]) -> Int[Tensor, "*batch K words R"]:
    """For each part, the cells of all parts before it."""
    cells = torch.zeros_like(parts)
    for k in range(1, parts.shape[-3]):
        cells[..., k, :, :] = cells[..., k - 1, :, :] | parts[..., k - 1, :, :]
    return cells


def widen(cells: Cells) -> Cells:
    """All cells that share a face with a filled one, and these themselves."""
    resolution = cells.shape[-1]
    words = cells.unflatten(-2, (-1, resolution))
    wide = words | (words << 1) | ((words >> 1) & 0x7FFFFFFF)  # the sign must not be drawn in
    wide[..., 1:, :, :] |= (words[..., :-1, :, :] >> 31) & 1
    wide[..., :-1, :, :] |= words[..., 1:, :, :] << 31
    if resolution % WORD:
        wide[..., -1, :, :] &= (1 << resolution % WORD) - 1
    wide[..., 1:, :] |= words[..., :-1, :]
    wide[..., :-1, :] |= words[..., 1:, :]
    wide[..., 1:] |= words[..., :-1]
    wide[..., :-1] |= words[..., 1:]
    return wide.flatten(-3, -2)


def fill_by_kernel(flat: Batch, plane: Int[Tensor, "B N"], cells: Cells) -> None:
    """Add the cells of every slot to its plane, by the kernel for built-in primitives."""
    words = words_of(cells.unflatten(-2, (-1, cells.shape[-1])))
    data = table_of(flat), array(plane).reshape(-1), flat.mask.shape[-1], words
    over_threads(partial(kernels.fill, *data), len(flat), least=32)
    if declared := declared_kinds(flat):
        fill(flat, plane, cells, declared)


def fill(flat: Batch, plane: Int[Tensor, "B N"], cells: Cells, kinds: list[int] | None = None) -> None:
    """The same from the declarations, for some or all kinds of primitive on any device; the twin of the kernel.

    Primitives whose rule is to fill rows are filled row by row, the others tested cell by cell.
    """
    resolution = cells.shape[-1]
    scale, origin = resolution / RESOLUTION, resolution / 2
    for kind in flat.kinds if kinds is None else kinds:
        declared, selected = primitives[kind], flat.mask & (flat.kind == kind)
        size, centre, rotation = (item.detach()[selected].double() for item in (flat.size, flat.centre, flat.rotation))
        size, centre = declared.cell_size(size * scale), centre * scale + origin
        finite = torch.cat([size, centre, rotation.flatten(1)], -1).isfinite().all(-1)
        size, centre, rotation, target = (item[finite] for item in (size, centre, rotation, plane[selected]))
        square = ((rotation - rotation.round()).abs() <= kernels.SQUARE).all(-1).all(-1)
        if declared.spans is not None:
            spans = declared.spans(size, centre, rotation, square, resolution)
            covers = target, *spans.layers, *spans.depth, *spans.side
            _fill_rows(cells, *(item[spans.applies] for item in covers))
            size, centre, rotation, target = (item[~spans.applies] for item in (size, centre, rotation, target))
        _fill_tested(cells, target, declared, size, centre, rotation)


def _fill_rows(cells: Tensor, plane: Int[Tensor, " M"], *covers: Float[Tensor, "M _"]) -> None:
    """Add solids to their planes: the first of each plane together, then the second, and so on."""
    resolution = cells.shape[-1]
    order = plane.argsort()
    plane = plane[order]
    rank = torch.arange(len(plane), device=plane.device) - torch.searchsorted(plane, plane)
    ticks = torch.arange(resolution, device=plane.device)
    for turn in range(int(rank.max()) + 1 if len(rank) else 0):
        for part in (rank == turn).nonzero()[:, 0].split(max(1, AT_ONCE // resolution**2)):
            up, top, front, rear, left, right = (item[order[part]] for item in covers)
            layers = (ticks >= up) & (ticks < top)
            depth = (ticks >= front[..., None]) & (ticks < rear[..., None]) & layers[..., None]
            side = (ticks >= left[..., None]) & (ticks < right[..., None])
            words = pack_rows.twin(side).movedim(-1, 1)  # type: ignore[attr-defined]
            cells[plane[part]] |= torch.where(depth[:, None], words[..., None], 0).flatten(1, 2)


def _fill_tested(
    cells: Tensor,
    plane: Int[Tensor, " M"],
    declared: Primitive,
    size: Float[Tensor, "M 4"],
    centre: Float[Tensor, "M 3"],
    rotation: Float[Tensor, "M 3 3"],
) -> None:
    """Add the cells whose centre is inside, looking at those in the boxes around the solids."""
    reach = (rotation.abs() @ declared.bound(size)[..., None])[..., 0]
    resolution = cells.shape[-1]
    for owner, index in _within(centre - reach, centre + reach, resolution):
        offset = index + 0.5 - centre[owner]
        inside = declared.distance((rotation[owner].mT @ offset[..., None])[..., 0], size[owner]) <= 0
        up, depth, side = index[inside].unbind(-1)
        row = plane[owner[inside]] * cells.shape[-2] + side // WORD * resolution + up
        # each bit once, so that adding bits is joining them
        bit = torch.unique((row * resolution + depth) * WORD + side % WORD)
        added = torch.zeros_like(cells).flatten().index_add(0, bit // WORD, (1 << bit % WORD).to(torch.int32))
        cells |= added.view_as(cells)


def _within(
    low: Float[Tensor, "M 3"], high: Float[Tensor, "M 3"], resolution: int
) -> Iterator[tuple[Int[Tensor, " C"], Int[Tensor, "C 3"]]]:
    """The cells of boxes, some millions at a time: which box, and which cell."""
    first = (low - 0.5).floor().clamp(0, resolution).long()
    last = (high + 0.5).ceil().clamp(0, resolution).long()
    window = (last - first).clamp(min=0)
    volume = window.prod(-1)
    start = 0
    while start < len(low):
        stop = start + max(1, int((volume[start:].cumsum(0) <= AT_ONCE).sum()))
        volumes = volume[start:stop]
        owner = torch.repeat_interleave(torch.arange(start, stop, device=low.device), volumes)
        offset_in_box = torch.arange(len(owner), device=owner.device) - (volumes.cumsum(0) - volumes)[owner - start]
        side, depth = window[owner, 2], window[owner, 1]
        yield (
            owner,
            torch.stack([offset_in_box // (side * depth), offset_in_box // side % depth, offset_in_box % side], -1)
            + first[owner],
        )
        start = stop
