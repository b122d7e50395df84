"""Cells of the grid, packed: 32 to a word, so that a union is one ``|`` and a grid of 32^3 takes 4 kB.

Packed cells are int32 tensors (..., W * R, R): a row of R cells along left-right takes W = R / 32 words, rounded up,
the lowest cell in the lowest bit; the first words of the rows at all heights and depths come first, then the second.
Kernels on the CPU do the work, wherever the tensors are.
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
from shapeprog.geometry.arrays import array, declared_kinds, over_threads, table_of
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.primitive import primitives
from shapeprog.kernels.bits import WORD
from shapeprog.space import RESOLUTION, Array

AT_ONCE = 1 << 21  # cells that are tested together
Cells = Int[Tensor, "*batch words R"]  # packed cells

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
    cells = torch.zeros(len(flat) * parts, rows, resolution, dtype=torch.int32)
    plane = torch.arange(len(flat))[:, None] * parts + part.cpu().reshape(flat.mask.shape)
    words = words_of(cells.unflatten(-2, (-1, resolution)))
    data = table_of(flat), array(plane).reshape(-1), flat.mask.shape[-1], words
    over_threads(partial(kernels.fill, *data), len(flat), least=32)
    for kind in declared_kinds(flat):
        _fill_declared(flat, kind, plane, cells)
    return cells.reshape(*batch.batch_shape, parts, rows, resolution).to(flat.device)


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


def pack_rows(rows: Bool[Tensor, "*batch places"]) -> Int[Tensor, "*batch words"]:
    """Rows of cells as words."""
    spare = [(0, 0)] * (rows.ndim - 1) + [(0, -rows.shape[-1] % WORD)]
    bits = np.packbits(np.pad(array(rows), spare) if spare[-1][1] else array(rows), -1, bitorder="little")
    return cells_of(bits.view("<u4").astype(np.uint32, copy=False)).to(rows.device)


def unpack(cells: Cells) -> UInt8[Tensor, "*batch R R R"]:
    """Grids of cells, 1 or 0, of packed ones."""
    rows = cells.unflatten(-2, (-1, cells.shape[-1])).movedim(-3, -1)  # the words of every row side by side
    words = words_of(rows).reshape(-1)
    eights = np.empty((len(words), 4), np.uint64)
    over_threads(partial(kernels.unpack, words, _SPREAD, eights), len(words), least=1 << 15)
    voxels = torch.from_numpy(eights.view(np.uint8)).reshape(*rows.shape[:-1], -1)
    return voxels[..., : cells.shape[-1]].contiguous().to(cells.device)


def count(cells: Cells) -> Int[Tensor, "*batch"]:
    """How many cells of each grid are filled."""
    number = np.bitwise_count(words_of(cells)).sum((-2, -1), dtype=np.int64)
    return torch.from_numpy(np.asarray(number)).to(cells.device)


def iou(a: Int[Tensor, "*one words R"], b: Int[Tensor, "*two words R"]) -> Float[Tensor, "*batch"]:
    """Intersection over union of packed cells, with broadcasting; 1 when both are empty."""
    first, second = torch.broadcast_tensors(a, b)
    lead = first.shape[:-2]
    counts = np.empty((lead.numel(), 2), np.int64)
    kernels.shared(*(words_of(item).reshape(lead.numel(), -1) for item in (first, second)), counts)
    intersection, either = torch.from_numpy(counts).to(a.device).double().reshape(*lead, 2).unbind(-1)
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


def _fill_declared(flat: Batch, kind: int, plane: Int[Tensor, "B N"], cells: Cells) -> None:
    """Add the cells of a primitive without kernels to their planes: those whose centre is inside."""
    selected, declared, resolution = flat.mask & (flat.kind == kind), primitives[kind], cells.shape[-1]
    size, centre, rotation = (t.detach()[selected].double().cpu() for t in (flat.size, flat.centre, flat.rotation))
    size, centre = size * (resolution / RESOLUTION), centre * (resolution / RESOLUTION) + resolution / 2
    finite = torch.cat([size, centre, rotation.flatten(1)], -1).isfinite().all(-1)
    size, centre, rotation, plane = (item[finite] for item in (size, centre, rotation, plane[selected.cpu()]))
    reach = (rotation.abs() @ declared.bound(size)[..., None])[..., 0]
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
