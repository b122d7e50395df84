"""Cells out: binvox for other tools, NPZ for arrays of everything."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shapeprog.files import atomic_path
from shapeprog.language.program import Program
from shapeprog.space import Frame

POINTS = 5000
"""Points on the surface that an NPZ holds."""


def cells(program: Program) -> npt.NDArray[np.bool_]:
    """The 32^3 cells of a program snapped to the grid, as the measure of the project takes them."""
    from shapeprog.geometry.cells import voxels
    from shapeprog.language.unroll import unroll

    return voxels(unroll(program.snap())).numpy().astype(np.bool_)


def write_cells(program: Program, path: Path, frame: Frame) -> None:
    """Write the cells as binvox, where the input lies."""
    from shapeprog.data.binvox import write_binvox

    write_binvox(path, cells(program), frame)


def write_arrays(program: Program, path: Path, frame: Frame) -> None:
    """Write arrays: everything in the grid frame, and the frame.

    ==========================  ===================  ==========================================================
    array                       shape                meaning
    ==========================  ===================  ==========================================================
    ``voxels``                  (32, 32, 32) bool    cells of the program snapped to the grid
    ``points``, ``normals``     (5000, 3) float32    on the surface of the union of the program as it is, in cells
    ``ids``, ``parameters``     (K, J), (K, J, 7)    the program as tensors
    ``scale, centre, axes``     (), (3,), (3, 3)     the way to the world: centre + axes @ (scale * point)
    ==========================  ===================  ==========================================================
    """
    import torch

    from shapeprog.geometry.surface import sample_surface
    from shapeprog.language.tensors import encode
    from shapeprog.language.unroll import unroll

    code = encode(program)
    scene = unroll(code)
    arrays: dict[str, Any] = {"voxels": cells(program), "ids": code.ids.numpy(), "parameters": code.parameters.numpy()}
    if bool(scene.mask.any()):
        surface = sample_surface(scene, POINTS, torch.Generator().manual_seed(0))
        arrays |= {"points": surface.points.detach().numpy(), "normals": surface.normals.detach().numpy()}
    else:
        arrays |= {"points": np.zeros((0, 3), np.float32), "normals": np.zeros((0, 3), np.float32)}
    place: dict[str, Any] = {
        "scale": np.float64(frame.scale),
        "centre": np.array(frame.centre),
        "axes": np.array(frame.axes),
    }
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **arrays, **place)
