"""Exposed faces of cells."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


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
