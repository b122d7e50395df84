"""Shapes of programs, as meshes become shapes: cells, and points on the surface."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch

from shapeprog.data.shape import Shape
from shapeprog.formats.samples import occupied
from shapeprog.geometry.cells import unpack
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll


def shapes_of(programs: Mapping[str, Program], points: int = 0, seed: int = 0) -> list[Shape]:
    """The shapes that programs draw.

    Parameters
    ----------
    programs
        Programs by the names of the shapes.
    points
        Number of points on each surface; without any, the shapes are voxels alone.
    seed
        Seed of the points.
    """
    packed = torch.stack([occupied(program, unroll(program)) for program in programs.values()])
    cells = unpack(packed).numpy().astype(np.bool_)
    if not points:
        return [Shape(name, grid) for name, grid in zip(programs, cells, strict=True)]
    scene = unroll(list(programs.values()))
    clouds = sample_surface(scene, points, torch.Generator().manual_seed(seed)).points.numpy().astype(np.float32)
    return [Shape(name, *arrays) for name, *arrays in zip(programs, cells, clouds, strict=True)]
