"""Samples of a program: cells as NPY, points on its surface as XYZ."""

from __future__ import annotations

import io

import numpy as np
import torch

from shapeprog.formats.parts import placed
from shapeprog.geometry.cells import voxels
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import RESOLUTION, Frame

POINTS = 5000  # default number of points


def npy(program: Program, frame: Frame, resolution: int = RESOLUTION) -> bytes:
    """The cells of a program snapped to the grid, as in the evaluation: booleans (R, R, R) in the grid frame."""
    content = io.BytesIO()
    np.save(content, voxels(unroll(program.snap()), resolution).numpy().astype(np.bool_))
    return content.getvalue()


def xyz(program: Program, frame: Frame, points: int = POINTS, seed: int = 0) -> str:
    """Points on the surface of the union of the unsnapped program, with normals, in the world of the frame."""
    sample = sample_surface(unroll(program), points, torch.Generator().manual_seed(seed))
    normals = sample.normals.numpy() @ np.asarray(frame.axes).T
    rows = np.concatenate([placed(sample.points.detach().numpy(), frame), normals], 1)
    content = io.StringIO()
    np.savetxt(content, rows, fmt="%.7g")
    return content.getvalue()
