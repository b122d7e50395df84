"""Samples of a program: cells as NPY, points on its surface as XYZ."""

from __future__ import annotations

import io

import numpy as np
import torch

from shapeprog.arguments import MOST_SEED, check_number
from shapeprog.formats.parts import placed
from shapeprog.geometry import cells
from shapeprog.geometry.mesh import MOST_VOXELISED, joined, part_meshes
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.geometry.voxelise import voxelise_mesh
from shapeprog.language.program import Program
from shapeprog.language.statement import language
from shapeprog.language.unroll import unroll
from shapeprog.space import RESOLUTION, Frame

POINTS = 5000  # default number of points
FINEST = 512  # most cells along each side


def occupied(
    program: Program, scene: Scene, snapped: Program | None = None, resolution: int = RESOLUTION
) -> cells.Cells:
    """The packed cells of a program, as they are exported, stored in packs and compared with those of a target.

    Those of the whole-numbered program, as published, if all statements are of the kind that generators are taught: by
    default of the program rounded.  Of others, whose parts may be thinner than a cell, those that the solid touches
    or encloses.  Raises what :func:`shapeprog.geometry.mesh.part_meshes` does.
    """
    if snapped is not None or all(language()[node.name].taught for node in program.walk()):
        return cells.rasterise(unroll(program.snap() if snapped is None else snapped), resolution)
    vertices, faces = joined([(part.vertices, part.faces) for part in part_meshes(scene, MOST_VOXELISED)])
    return cells.pack(voxelise_mesh(vertices * (resolution / RESOLUTION), faces, resolution))


def npy(program: Program, resolution: int = RESOLUTION) -> bytes:
    """The cells of a program, as in the evaluation: booleans (R, R, R) in the grid frame."""
    check_number("resolution", resolution, 1, FINEST, whole=True)
    content = io.BytesIO()
    grid = cells.unpack(occupied(program, unroll(program), resolution=resolution))
    np.save(content, grid.numpy().astype(np.bool_))
    return content.getvalue()


def xyz(program: Program, frame: Frame, points: int = POINTS, seed: int = 0) -> str:
    """Points on the surface of the union of the unsnapped program, with normals, in the world of the frame."""
    check_number("seed", seed, 0, MOST_SEED, whole=True)
    sample = sample_surface(unroll(program), points, torch.Generator().manual_seed(seed))
    normals = sample.normals.numpy() @ np.asarray(frame.axes).T
    rows = np.concatenate([placed(sample.points.detach().numpy(), frame), normals], 1)
    content = io.StringIO()
    np.savetxt(content, rows, fmt="%.12g")
    return content.getvalue()
