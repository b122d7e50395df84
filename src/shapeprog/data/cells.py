"""The estimated surface of a shape of which only the cells that it touches are known."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.space import HALF, SPAN, BoolArray, FloatArray, IntArray

DEPTH_BELOW = 0.65
"""Mean depth, in cells, of a surface below the faces of the cells that it touches; chosen on val."""


def points_of_cells(voxels: BoolArray, count: int = 5000) -> npt.NDArray[np.float32]:
    """Points (count, 3) on the estimated surface of a shape with these touched cells, in the grid frame.

    Uniform on the exposed faces of the cells, moved inwards by ``DEPTH_BELOW`` but for those at the ends of the longest
    side, which is 24 cells long by definition.
    """
    occupied, random, faces = np.argwhere(voxels), np.random.default_rng(0), exposed_faces(voxels)
    selected = random.integers(len(faces[0]), size=count)
    normals, cells, exact = (column[selected] for column in faces)
    outwards = 0.5 - np.where(exact, 0.0, DEPTH_BELOW)
    points = cells + np.where(normals, 0.5 + outwards[:, None] * normals, random.random((count, 3)))
    low, high = occupied.min(0), occupied.max(0) + 1
    margin = np.where(high - low == SPAN, 0.0, DEPTH_BELOW)
    return (np.clip(points, low + margin, high - margin) - HALF).astype(np.float32)


def exposed_faces(voxels: BoolArray) -> tuple[FloatArray, IntArray, BoolArray]:
    """Normals (F, 3) of exposed faces of cells, their cells (F, 3), and which (F,) are at an end of a longest side."""
    padded, occupied = np.pad(voxels, 1), np.argwhere(voxels)
    sides = [[voxels & ~np.roll(padded, by, axis)[1:-1, 1:-1, 1:-1] for by in (1, -1)] for axis in range(3)]
    axis, above, *cell = np.argwhere(sides).T
    low, high = occupied.min(0)[axis], occupied.max(0)[axis]
    exact = (high - low == SPAN - 1) & (np.choose(axis, cell) == np.where(above, high, low))
    return np.where(above, 1, -1)[:, None] * np.eye(3)[axis], np.stack(cell, 1), exact
