"""Which points each candidate explains or holds, as bits: 64 points are a word."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.arrays import over_threads, table_of
from shapeprog.geometry.batch import Batch
from shapeprog.inference.choice.coverage_kernels import explain, hold
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.space import HALF, RESOLUTION, FloatArray

WORD = 64
"""Bits of a word."""

COARSE, FINE = 16, 64
"""Cells along each side of the grids that bin points: for tests against primitives, and against other points."""

Bits = npt.NDArray[np.uint64]
Flags = npt.NDArray[np.bool_]


class BinnedPoints(NamedTuple):
    """Points sorted by the cells of a grid, see the kernels: original indices, and the first index of each cell."""

    points: FloatArray
    order: npt.NDArray[np.int64]
    starts: npt.NDArray[np.int64]
    cells: int


def by_word(values: FloatArray) -> FloatArray:
    """Means of the values that share a word, zero beyond the last."""
    words = -(-len(values) // WORD)
    counts = np.minimum(WORD, len(values) - WORD * np.arange(words))
    return np.add.reduceat(values, WORD * np.arange(words)) / counts if words else np.zeros(0)


def pack(flags: Flags) -> Bits:
    """Flags (B, N) as rows of words, the first of each in its lowest bit."""
    padded = np.pad(flags, ((0, 0), (0, -flags.shape[1] % WORD)))
    return np.packbits(padded, axis=1, bitorder="little").view(np.uint64)


def explains(scene: Batch, binned: BinnedPoints, normals: FloatArray, evidence: Evidence) -> Bits:
    """Which points each candidate (B, N) explains, as rows of bits (B, W)."""
    rows = _no_bits(scene, binned)
    data = (
        table_of(scene), scene.mask.shape[1], binned.points, normals[binned.order], binned.order, binned.starts,
        binned.cells, evidence.tolerance, evidence.agreement, rows,
    )  # fmt: skip
    over_threads(partial(explain, *data), len(rows))
    return rows


def holds(scene: Batch, binned: BinnedPoints, depth: float) -> Bits:
    """Which points lie deeper than ``depth`` inside each candidate (B, N), as rows of bits (B, W)."""
    rows = _no_bits(scene, binned)
    data = (
        table_of(scene), scene.mask.shape[1], binned.points, binned.order, binned.starts, binned.cells, depth, rows
    )  # fmt: skip
    over_threads(partial(hold, *data), len(rows))
    return rows


def _no_bits(scene: Batch, binned: BinnedPoints) -> Bits:
    return np.zeros((len(scene), -(-len(binned.order) // WORD)), np.uint64)


def nearby(points: FloatArray) -> npt.NDArray[np.int64]:
    """Morton codes (P,) of the cells of points: nearby points mostly have close codes (Morton 1966).

    In this order, the points of a word are neighbours, so a small candidate has bits in few words.
    """
    index = np.clip(((points + HALF) * (FINE / RESOLUTION)).astype(np.int64), 0, FINE - 1)
    shifted = [((index[:, axis] >> bit) & 1) << (3 * bit + axis) for bit in range(6) for axis in range(3)]
    return np.sum(shifted, axis=0)


def sorted_by_cell(points: FloatArray, cells: int = COARSE) -> BinnedPoints:
    """Points (P, 3) in the order of the cells of a grid."""
    index = np.clip(((points + HALF) * (cells / RESOLUTION)).astype(np.int64), 0, cells - 1)
    key = (index[:, 0] * cells + index[:, 1]) * cells + index[:, 2]
    order = np.argsort(key, kind="stable")
    starts = np.concatenate([[0], np.bincount(key, minlength=cells**3).cumsum()])
    return BinnedPoints(np.ascontiguousarray(points[order]), order, starts, cells)
