"""Surface points for a shape that is given as cells."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.space import HALF, SPAN

INSET = 0.65
"""Mean depth in cells of a surface below the faces of its touched cells; tuned on val.

A surface is anywhere within the cells that it touches, so the touched solid is too large by up to a cell on each side.
"""


def points_of_cells(
    voxels: npt.NDArray[np.bool_], count: int = 5000, *, inset: float = INSET, seed: int = 0
) -> npt.NDArray[np.float32]:
    """Points (count, 3) on the estimated surface of a shape with these touched cells, in the grid frame.

    Uniform on the exposed faces of the cells, moved inwards by ``inset``; a face at the end of the longest side
    is exact, since that side is 24 cells long by definition, and stays.
    """
    low, high = np.argwhere(voxels).min(0), np.argwhere(voxels).max(0) + 1
    faces = exposed_faces(voxels)
    outer = np.where(faces[:, 4] < 0, low[faces[:, 3]], high[faces[:, 3]] - 1)
    exact = (high - low == SPAN)[faces[:, 3]] & (faces[np.arange(len(faces)), faces[:, 3]] == outer)
    table = np.column_stack([faces, np.where(exact, 0.0, inset)])
    random = np.random.default_rng(seed)
    selected = table[random.integers(len(table), size=count)]
    points = selected[:, :3] + random.random((count, 3))
    along, outwards, inwards = selected[:, 3].astype(int), selected[:, 4], selected[:, 5]
    rows = np.arange(count)
    points[rows, along] = selected[rows, along] + np.where(outwards > 0, 1 - inwards, inwards)
    edge_low, edge_high = low + inset, high - inset
    full = high - low == SPAN
    points = np.clip(points, np.where(full, low, edge_low), np.where(full, high, edge_high))
    return (points - HALF).astype(np.float32)


def exposed_faces(voxels: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Faces (F, 5) between a touched and an untouched cell: the cell (3), the axis, and the side of the cell."""
    padded, faces = np.pad(voxels, 1), []
    for axis in range(3):
        for sign in (-1, 1):
            beyond = np.roll(padded, -sign, axis)[1:-1, 1:-1, 1:-1]
            cells = np.argwhere(voxels & ~beyond)
            faces.append(np.column_stack([cells, np.full(len(cells), axis), np.full(len(cells), sign)]))
    return np.ascontiguousarray(np.concatenate(faces))  # kernels need contiguous arrays


def exposed(
    voxels: npt.NDArray[np.bool_], cells: npt.NDArray[np.int64], axis: npt.NDArray[np.int64], sign: int
) -> npt.NDArray[np.bool_]:
    """Whether the neighbour of each cell (C, 3) along its axis (C,) is empty."""
    neighbours = cells + 1 + sign * np.eye(3, dtype=np.int64)[axis]
    empty: npt.NDArray[np.bool_] = ~np.pad(voxels, 1)[tuple(neighbours.T)]
    return empty
