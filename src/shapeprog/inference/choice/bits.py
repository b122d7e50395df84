"""Which points each candidate explains or holds, as bits: 64 points are a word."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.arrays import over_threads, table_of
from shapeprog.geometry.batch import Batch
from shapeprog.inference.choice.coverage_kernels import CELLS, cover
from shapeprog.space import BoolArray, FloatArray, IntArray, cells_at

WORD = 64  # bits of a word

Bits = npt.NDArray[np.uint64]


class BinnedPoints(NamedTuple):
    """Points and normals sorted by the cells of a grid, see the kernels: their indices before, and the first of each
    cell."""

    points: FloatArray
    normals: FloatArray
    order: IntArray
    starts: IntArray


def by_word(values: FloatArray) -> FloatArray:
    """Means of the values that share a word."""
    starts = np.arange(0, len(values), WORD)
    return np.add.reduceat(values, starts) / np.diff(starts, append=len(values))


def pack(flags: BoolArray) -> Bits:
    """Flags (B, N) as rows of words, the first of each in its lowest bit."""
    padded = np.pad(flags, ((0, 0), (0, -flags.shape[1] % WORD)))
    return np.packbits(padded, axis=1, bitorder="little").view(np.uint64)


def covers(scene: Batch, binned: BinnedPoints, tolerance: float, agreement: float = 0.0) -> tuple[Bits, Bits]:
    """Bits (B, W) of the points that each candidate (B, N) explains, and of those deeper inside it than a tolerance.

    ``agreement`` is the least cosine between the normals of a point and of the surface that explains it.
    """
    explained, interior = np.zeros((2, len(scene), -(-len(binned.order) // WORD)), np.uint64)
    data = (table_of(scene), scene.mask.shape[1], *binned, tolerance, agreement, explained, interior)
    over_threads(partial(cover, *data), len(scene))
    return explained, interior


def nearby(points: FloatArray) -> IntArray:
    """Morton codes (P,) of the cells of points: nearby points mostly have close codes (Morton 1966).

    In this order, the points of a word are neighbours, so a small candidate has bits in few words.
    """
    index, bits = cells_at(points, 64), range(6)
    return np.sum([((index[:, axis] >> bit) & 1) << (3 * bit + axis) for bit in bits for axis in range(3)], axis=0)


def sorted_by_cell(points: FloatArray, normals: FloatArray | None = None) -> BinnedPoints:
    """Points and normals (P, 3), zero if unknown, in the order of the cells of a grid."""
    key = cells_at(points, CELLS) @ [CELLS**2, CELLS, 1]
    order = np.argsort(key, kind="stable")
    starts = np.concatenate([[0], np.bincount(key, minlength=CELLS**3).cumsum()])
    return BinnedPoints(points[order], (np.zeros_like(points) if normals is None else normals)[order], order, starts)
