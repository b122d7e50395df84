"""Occupancy of the grid: hard cells as bits and bytes, and the soft form that has a gradient."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import array, declared_kinds, over_threads, solids
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.primitive import primitives
from shapeprog.geometry.raster import cells_within, filled, spread
from shapeprog.geometry.scene import Scene
from shapeprog.space import RESOLUTION

Words = npt.NDArray[np.uint32]
"""Rows of cells as bits, lowest cell in the lowest bit."""


def voxels(scene: Scene, resolution: int = RESOLUTION) -> UInt8[Tensor, "*batch R R R"]:
    """The cells that the primitives of each scene occupy, 1 or 0, clipped to the grid.

    A cuboid at right angles covers [rint(low), rint(high)) along each axis, and if sheared each layer is moved by
    whole cells; a cylinder covers the cells whose centre is within 1.01 radii of its axis; a turned cuboid, and any
    other primitive, those whose centre it contains.  On whole-numbered programs this is the published executor.

    Parameters
    ----------
    resolution
        Cells along each side R; the scene is scaled with it.
    """
    if scene.mask.device.type != "cpu" and resolution == RESOLUTION:
        return spread(filled(scene))
    words = _words(scene, resolution)
    if resolution == RESOLUTION:
        cells = unpack(words[:, 0])
    else:
        bits = np.unpackbits(words.transpose(0, 2, 3, 1).copy().view(np.uint8), axis=-1, bitorder="little")
        cells = np.ascontiguousarray(bits[..., :resolution])
    return torch.from_numpy(cells).to(scene.mask.device).reshape(*scene.batch_shape, *cells.shape[1:])


def packed_rows(scene: Scene) -> Words:
    """The cells of each scene at 32^3 with every (up, depth) row of 32 cells as one word: (..., 32, 32)."""
    return _words(scene, RESOLUTION)[:, 0].reshape(*scene.batch_shape, RESOLUTION, RESOLUTION)


def packed_blocks(scene: Scene, blocks: int) -> Words:
    """The cells of each block of each scene on their own, as packed rows (..., blocks, 32, 32)."""
    flat = scene.flatten()
    plane = torch.arange(len(flat), device=flat.block.device)[:, None] * blocks + flat.block
    words = _words(flat, RESOLUTION, plane, len(flat) * blocks)
    return words.reshape(*scene.batch_shape, blocks, RESOLUTION, RESOLUTION)


def pack(cells: npt.ArrayLike) -> Words:
    """Packed rows (..., 32, 32) of grids of cells (..., 32, 32, 32)."""
    bits = np.packbits(np.asarray(cells, dtype=bool), axis=-1, bitorder="little")
    return bits.view("<u4")[..., 0].astype(np.uint32, copy=False)


def unpack(words: Words) -> npt.NDArray[np.uint8]:
    """Grids of cells (..., 32, 32, 32), 1 or 0, of packed rows (..., 32, 32)."""
    from shapeprog.geometry import voxel_kernels as kernels

    rows = np.ascontiguousarray(words).reshape(-1)
    cells = np.empty((*words.shape, RESOLUTION), np.uint8)
    eights = cells.reshape(-1, RESOLUTION).view(np.uint64)
    over_threads(lambda first, last: kernels.unpack(rows, _SPREAD, eights, first, last), len(rows), least=1 << 15)
    return cells


def packed_iou(one: Words, two: Words) -> npt.NDArray[np.float64]:
    """Intersection over union (...) of packed grids (..., 32, 32); leading dimensions broadcast, empty grids agree."""
    from shapeprog.geometry import voxel_kernels as kernels

    lead = np.broadcast_shapes(one.shape, two.shape)[:-2]
    counts = np.empty((int(np.prod(lead)), 2), np.int64)
    rows = (np.array(np.broadcast_to(each, lead + each.shape[-2:])) for each in (one, two))
    kernels.shared_cells(*(each.reshape(len(counts), -1) for each in rows), counts)
    ratio = np.where(counts[:, 1] > 0, counts[:, 0] / np.maximum(counts[:, 1], 1), 1.0)
    return ratio.reshape(lead)


def cell_centres(resolution: int = RESOLUTION, like: Tensor | None = None) -> Float[Tensor, "R R R 3"]:
    """Centres of all cells in the grid frame."""
    cell = RESOLUTION / resolution
    ticks = (torch.arange(resolution, dtype=torch.float64) + 0.5) * cell - RESOLUTION / 2
    grid = torch.stack(torch.meshgrid(ticks, ticks, ticks, indexing="ij"), -1)
    return grid.float() if like is None else grid.to(like)


def soft_logits(
    scene: Scene, sharpness: float | Tensor = 4.0, resolution: int = RESOLUTION
) -> Float[Tensor, "*batch R R R"]:
    """Logits of the soft occupancy: minus sharpness times the signed distance of the union at the cell centres."""
    centres = cell_centres(resolution, scene.centre)
    points = centres.reshape(-1, 3).expand(*scene.batch_shape, -1, 3)
    distance: Tensor = signed_distance(scene, points).unflatten(-1, centres.shape[:-1])
    return distance * -sharpness


def soft_occupancy(
    scene: Scene, sharpness: float | Tensor = 4.0, resolution: int = RESOLUTION
) -> Float[Tensor, "*batch R R R"]:
    """How far each cell is inside the union, between 0 and 1, with gradient to every size and pose.

    As the sharpness grows it tends to 1 where the centre of the cell is inside and to 0 where it is outside.

    Parameters
    ----------
    sharpness
        Slope per cell of the logit; the transition is about 4 / sharpness cells wide.
    """
    return torch.sigmoid(soft_logits(scene, sharpness, resolution))


_SPREAD: npt.NDArray[np.uint64] = (
    np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little").copy().view(np.uint64)[:, 0]
)


def _words(scene: Scene, resolution: int, plane: Int[Tensor, "B N"] | None = None, planes: int = 0) -> Words:
    """Words (B, W, R, R) of all scenes, or of planes that gather the primitives which name them."""
    from shapeprog.geometry import voxel_kernels as kernels

    if resolution < 1:
        raise ShapeProgError(f"a grid of {resolution} cells a side holds nothing", "ask for a resolution of 1 or more")
    table, many, scenes = solids(scene), scene.mask.shape[-1], scene.batch_shape.numel()
    if plane is None:
        plane, planes = torch.arange(scenes, device=scene.mask.device)[:, None].expand(-1, many), scenes
    words = np.zeros((planes, (resolution + 31) // 32, resolution, resolution), np.uint32)
    owner = array(plane).reshape(-1)
    over_threads(lambda first, last: kernels.fill(table, owner, many, words, first, last), scenes, least=32)
    for declared in declared_kinds(scene):
        _fill_declared(scene.flatten().detach(), declared, plane, words)
    return words


def _fill_declared(scene: Scene, kind: int, plane: Int[Tensor, "B N"], words: Words) -> None:
    """Add the cells whose centre a primitive of a declared kind contains, within its bounding box."""
    here = scene.mask & (scene.kind == kind)
    size, centre, rotation = (t[here].double() for t in (scene.size, scene.centre, scene.rotation))
    finite = torch.cat([size, centre, rotation.flatten(1)], -1).isfinite().all(-1)
    size, centre, rotation, plane = size[finite], centre[finite], rotation[finite], plane[here][finite]
    reach = (rotation.abs() @ primitives[kind].bound(size)[..., None])[..., 0]

    def inside(owner: Int[Tensor, " C"], offset: Float[Tensor, "C 3"]) -> Bool[Tensor, " C"]:
        local = (rotation[owner].mT @ offset[..., None])[..., 0]
        return primitives[kind].distance(local, size[owner]) <= 0

    for owner, index in cells_within(centre, reach, inside, words.shape[-1]):
        _set_cells(words, plane[owner], index)


def _set_cells(words: Words, program: Int[Tensor, " M"], index: Int[Tensor, "M 3"]) -> None:
    which, (up, depth, side) = array(program), array(index).T
    bits = np.left_shift(np.uint32(1), (side % 32).astype(np.uint32))
    np.bitwise_or.at(words, (which, side // 32, up, depth), bits)
