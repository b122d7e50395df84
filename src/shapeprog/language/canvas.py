"""Canvases: what blocks have drawn so far, as packed rows of cells on the device of the program.

A canvas is a grid of 32^3 cells with every (up, depth) row as one 32-bit word, lowest cell in the lowest bit: 4 kB a
grid instead of 32, and a union is one ``|``.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Bool, Int, UInt8
from torch import Tensor

from shapeprog.geometry.occupancy import packed_blocks, unpack
from shapeprog.geometry.raster import filled_blocks, spread
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import unroll
from shapeprog.space import RESOLUTION

Canvas = Int[Tensor, "*batch 32 32"]
"""Packed cells, int32 so that every device can shift and combine them."""


def draw_blocks(code: Code) -> Int[Tensor, "*batch K 32 32"]:
    """The cells of every block on its own, as an executor of whole numbers draws it: parameters are rounded."""
    scene = unroll(Code(code.ids, code.parameters.detach().round()))
    if code.ids.device.type != "cpu":
        return filled_blocks(scene, code.ids.shape[-2])
    words = packed_blocks(scene, code.ids.shape[-2])
    return torch.from_numpy(words.view(np.int32))


def stays_inside(code: Code) -> Bool[Tensor, "*batch K"]:
    """Which blocks have the centre of every copy within the grid; what lies outside of it no canvas shows."""
    lead, (steps, slots) = code.ids.shape[:-1], code.parameters.shape[-2:]
    scene = unroll(Code(code.ids.reshape(-1, 1, steps), code.parameters.detach().reshape(-1, 1, steps, slots)))
    within = (scene.centre.abs() <= RESOLUTION / 2).all(-1) | ~scene.mask
    return within.all(-1).reshape(lead)


def so_far(blocks: Int[Tensor, "*batch K 32 32"]) -> Int[Tensor, "*batch K 32 32"]:
    """The canvas that each block finds: the union of all blocks before it."""
    canvas = torch.zeros_like(blocks)
    for k in range(1, blocks.shape[-3]):
        canvas[..., k, :, :] = canvas[..., k - 1, :, :] | blocks[..., k - 1, :, :]
    return canvas


def union(blocks: Int[Tensor, "*batch K 32 32"]) -> Canvas:
    """The canvas on which all blocks are drawn."""
    canvas = torch.zeros_like(blocks[..., 0, :, :])
    for block in blocks.unbind(-3):
        canvas |= block
    return canvas


def packed(cells: UInt8[Tensor, "*batch 32 32 32"]) -> Canvas:
    """Cells, 1 or 0, as a canvas."""
    if cells.device.type == "cpu":
        bits = np.packbits(cells.numpy(), axis=-1, bitorder="little")
        return torch.from_numpy(bits.view(np.int32)[..., 0])
    weights = torch.ones(RESOLUTION, dtype=torch.int32, device=cells.device) << _places(cells.device)
    return (cells.int() * weights).sum(-1, dtype=torch.int32)  # the highest bit wraps to the sign, as it should


def unpacked(canvas: Canvas) -> UInt8[Tensor, "*batch 32 32 32"]:
    """A canvas as cells, 1 or 0."""
    if canvas.device.type == "cpu":
        return torch.from_numpy(unpack(canvas.numpy().view(np.uint32)))
    return spread(canvas)


def count(canvas: Canvas) -> Int[Tensor, "*batch"]:
    """How many cells of each canvas are drawn."""
    if canvas.device.type == "cpu":
        words = canvas.numpy().view(np.uint32)
        return torch.from_numpy(np.bitwise_count(words).sum((-2, -1), dtype=np.int64))
    return unpacked(canvas).flatten(-3).sum(-1, dtype=torch.int64)


def widened(canvas: Canvas) -> Canvas:
    """All cells that share a face with a drawn one, and these themselves."""
    wide = canvas | (canvas << 1) | ((canvas >> 1) & 0x7FFFFFFF)  # the sign must not be drawn in
    wide[..., 1:, :] |= canvas[..., :-1, :]
    wide[..., :-1, :] |= canvas[..., 1:, :]
    wide[..., 1:] |= canvas[..., :-1]
    wide[..., :-1] |= canvas[..., 1:]
    return wide


def _places(device: torch.device) -> Int[Tensor, " 32"]:
    return torch.arange(RESOLUTION, dtype=torch.int32, device=device)
