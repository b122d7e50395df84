"""Samples of a program: cells as binvox and NPY, surface points as XYZ, all arrays as NPZ.

Cells are those of the program snapped to the grid, as in the evaluation; points lie on the surface of the union of the
unsnapped program.
"""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch

from shapeprog.files import atomic_path, write_bytes
from shapeprog.formats.parts import placed
from shapeprog.geometry.cells import voxels
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.program import Program
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll
from shapeprog.space import HALF, RESOLUTION, Array, Frame

POINTS = 5000  # surface points of an NPZ, and the default number for an XYZ


def cells(program: Program, resolution: int = RESOLUTION) -> npt.NDArray[np.bool_]:
    """The cells (R, R, R) of a program snapped to the grid."""
    return voxels(unroll(program.snap()), resolution).numpy().astype(np.bool_)


def write_cells(program: Program, path: Path, frame: Frame) -> None:
    """Write the cells as binvox, in the coordinates of the input."""
    placed(np.array([[-RESOLUTION] * 3, [RESOLUTION] * 3]), frame)  # the header holds numbers alone
    write_binvox(path, cells(program), frame)


def write_binvox(path: str | os.PathLike[str], voxels: Array, frame: Frame | None = None) -> None:
    """Write cells of the grid as a binvox file in the coordinates of the input.

    Parameters
    ----------
    path
        Where to.
    voxels
        Occupied cells (R, R, R), axes up, depth, left-right.
    frame
        From the grid to the world; its axes are signed world axes, as :func:`~shapeprog.space.grid_axes` gives them.
    """
    frame = frame or Frame()
    cells, axes = np.asarray(voxels, np.bool_), np.asarray(frame.axes)
    order = np.abs(axes).argmax(1)  # the grid axis that runs along each world axis
    turned = cells.transpose(order)
    turned = np.flip(turned, tuple(axis for axis in range(3) if axes[axis, order[axis]] < 0))
    size = cells.shape[0]
    corner = np.asarray(frame.centre) - frame.scale * HALF
    flat = np.ascontiguousarray(turned.transpose(0, 2, 1)).reshape(-1).astype(np.uint8)
    starts = np.flatnonzero(np.diff(flat, prepend=1 - flat[:1]))
    runs = bytearray()
    for value, length in zip(flat[starts], np.diff(starts, append=len(flat)), strict=True):
        full, partial = divmod(int(length), 255)
        runs += bytes((value, 255)) * full + (bytes((value, partial)) if partial else b"")
    translate = " ".join(f"{number:.9g}" for number in corner)
    head = f"#binvox 1\ndim {size} {size} {size}\ntranslate {translate}\nscale {frame.scale * 2 * HALF:.9g}\ndata\n"
    write_bytes(path, head.encode() + bytes(runs))


def write_grid(program: Program, path: Path, frame: Frame, resolution: int = RESOLUTION) -> None:
    """Write the cells as a boolean array in the grid frame; the frame is not stored."""
    content = io.BytesIO()  # numpy reports a full disk less clearly
    np.save(content, cells(program, resolution))
    write_bytes(path, content.getvalue())


def write_points(program: Program, path: Path, frame: Frame, points: int = POINTS, seed: int = 0) -> None:
    """Write points on the surface with their normals, in the world of the frame."""
    sample = sample_surface(unroll(program), points, torch.Generator().manual_seed(seed))
    normals = sample.normals.numpy() @ np.asarray(frame.axes).T
    rows = np.concatenate([placed(sample.points.detach().numpy(), frame), normals], 1)
    with atomic_path(path) as temporary:
        np.savetxt(temporary, rows, fmt="%.7g")


def write_arrays(program: Program, path: Path, frame: Frame) -> None:
    """Write arrays: everything in the grid frame, and the frame.

    ==========================  ===================  ==========================================================
    array                       shape                meaning
    ==========================  ===================  ==========================================================
    ``voxels``                  (32, 32, 32) bool    cells of the program snapped to the grid
    ``points``, ``normals``     (5000, 3) float32    on the surface of the union of the unchanged program, in cells
    ``ids``, ``parameters``     (K, J), (K, J, 7+)   the program as tensors
    ``scale, centre, axes``     (), (3,), (3, 3)     the way to the world: centre + axes @ (scale * point)
    ==========================  ===================  ==========================================================
    """
    code = encode(program)
    scene = unroll(code)
    arrays: dict[str, Any] = {"voxels": cells(program), "ids": code.ids.numpy(), "parameters": code.parameters.numpy()}
    if bool(scene.mask.any()):
        surface = sample_surface(scene, POINTS, torch.Generator().manual_seed(0))
        placed(surface.points.detach().numpy())
        arrays |= {"points": surface.points.detach().numpy(), "normals": surface.normals.detach().numpy()}
    else:
        arrays |= {"points": np.zeros((0, 3), np.float32), "normals": np.zeros((0, 3), np.float32)}
    frame_arrays: dict[str, Any] = {
        "scale": np.float64(frame.scale),
        "centre": np.array(frame.centre),
        "axes": np.array(frame.axes),
    }
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **arrays, **frame_arrays)
