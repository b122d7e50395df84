"""Samples of a program: cells as NPY, points on its surface as XYZ."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import torch

from shapeprog.files import atomic_path, write_bytes
from shapeprog.formats.parts import placed
from shapeprog.geometry.cells import voxels
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import RESOLUTION, Frame

POINTS = 5000  # default number of points


def write_grid(program: Program, path: Path, frame: Frame, resolution: int = RESOLUTION) -> None:
    """Write the cells of a program snapped to the grid, as in the evaluation: booleans (R, R, R) in the grid frame."""
    cells = voxels(unroll(program.snap()), resolution).numpy().astype(np.bool_)
    content = io.BytesIO()  # numpy reports a full disk less clearly
    np.save(content, cells)
    write_bytes(path, content.getvalue())


def write_points(program: Program, path: Path, frame: Frame, points: int = POINTS, seed: int = 0) -> None:
    """Write points on the surface of the union of the unsnapped program, with normals, in the world of the frame."""
    sample = sample_surface(unroll(program), points, torch.Generator().manual_seed(seed))
    normals = sample.normals.numpy() @ np.asarray(frame.axes).T
    rows = np.concatenate([placed(sample.points.detach().numpy(), frame), normals], 1)
    with atomic_path(path) as temporary:
        np.savetxt(temporary, rows, fmt="%.7g")
