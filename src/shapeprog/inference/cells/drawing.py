"""Cells of blocks as rows of bits, one word for the 32 cells of a row."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.cells.raster_kernels import ROWS, count_cells, draw_blocks
from shapeprog.space import RESOLUTION, FloatArray

Rows = npt.NDArray[np.uint32]
Whole = npt.NDArray[np.int64]


def draw_each(blocks: FloatArray) -> Rows:
    """Rows (P, 1024) of each block on its own."""
    rows = np.zeros((len(blocks), ROWS), np.uint32)
    draw_blocks(blocks, rows)
    return rows


def draw_all(blocks: FloatArray) -> Rows:
    """Rows (1024) of the union of blocks."""
    rows = np.zeros((1, ROWS), np.uint32)
    draw_blocks(blocks, rows)
    return rows[0]


def cells_shared(sets: Rows, first: Rows, second: Rows) -> Whole:
    """Number of cells that each set of rows (P, 1024) shares with two further sets: (P, 2)."""
    counts = np.empty((len(sets), 2), np.int64)
    count_cells(sets.view(np.uint64), first.view(np.uint64), second.view(np.uint64), counts)
    return counts


def low_corners(rows: Rows) -> Whole:
    """Low corners (n, 3) of the cells of rows (1024), in the frame of the grid."""
    bits = np.unpackbits(rows.view(np.uint8), bitorder="little").view(np.bool_)
    cells = np.unravel_index(np.flatnonzero(bits), (RESOLUTION,) * 3)
    return np.stack(cells, 1) - RESOLUTION // 2
