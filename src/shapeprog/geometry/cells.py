"""Cells of the grid, packed: 32 to a word, so that a union is one ``|`` and a grid of 32^3 takes 4 kB.

Packed cells are int32 tensors (..., W * R, R): a row of R cells along left-right takes W = R / 32 words, rounded up,
the lowest cell in the lowest bit; the first words of the rows at all heights and depths come first, then the second.
Kernels on the CPU do the work, wherever the tensors are.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Bool, Float, Int, Shaped, UInt8
from torch import Tensor

from shapeprog.errors import ShapeProgError
from shapeprog.geometry import cell_kernels as kernels
from shapeprog.geometry.arrays import array, over_threads, table_of
from shapeprog.geometry.batch import Batch
from shapeprog.kernels.bits import WORD
from shapeprog.space import RESOLUTION, Array

Cells = Int[Tensor, "*batch words R"]  # packed cells


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
    bits = np.unpackbits(words_of(rows).view(np.uint8), -1, count=cells.shape[-1], bitorder="little")
    return torch.from_numpy(bits).to(cells.device)


def count(cells: Cells) -> Int[Tensor, "*batch"]:
    """How many cells of each grid are filled."""
    number = np.bitwise_count(words_of(cells)).sum((-2, -1), dtype=np.int64)
    return torch.from_numpy(np.asarray(number)).to(cells.device)


def iou(a: Int[Tensor, "*one words R"], b: Int[Tensor, "*two words R"]) -> Float[Tensor, "*batch"]:
    """Intersection over union of packed cells, with broadcasting; 1 when both are empty."""
    first, second = torch.broadcast_tensors(a, b)
    intersection, either = count(first & second).double(), count(first | second)
    return torch.where(either > 0, intersection / either.clamp(min=1), 1.0)
