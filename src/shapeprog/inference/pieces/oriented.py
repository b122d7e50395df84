"""Oriented boxes around many sets of points at once."""

from __future__ import annotations

from collections.abc import Sequence, Sized
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.inference.pieces.oriented_kernels import COMPACT, FLAT, MANY, ROD, box_each
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.space import Array, FloatArray

_LINES = np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 0], [1, 0, 1], [1, 0, -1], [0, 1, 1], [0, 1, -1]]
)
"""Directions along which boxes are compared."""


class Boxes(NamedTuple):
    """Oriented boxes, in cells: centres (N, 3), axes (N, 3, 3) as columns of proper rotations, half extents (N, 3)."""

    centre: FloatArray
    rotation: FloatArray
    half: FloatArray

    def take(self, which: Array) -> Boxes:
        """Some of them, by index or mask."""
        return Boxes(self.centre[which], self.rotation[which], self.half[which])

    def corners(self) -> FloatArray:
        """Their corners (N, 8, 3)."""
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
        return self.centre[:, None] + np.einsum("nij,nkj->nki", self.rotation, signs * self.half[:, None])

    def area(self) -> FloatArray:
        """Their surfaces (N,)."""
        a, b, c = self.half.T
        return 8 * (a * b + b * c + c * a)


def join(parts: list[Boxes]) -> Boxes:
    """All boxes of a list, in its order."""
    empty = Boxes(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    return Boxes(*(np.concatenate(column) for column in zip(empty, *parts, strict=True)))


def boxes_around(points: Array, start: Array, frames: FloatArray | None = None, floor: float = SETTINGS.thin) -> Boxes:
    """A small box around each run of points, along the world's axes or turned about one of them where that is small.

    Parameters
    ----------
    points
        Points (P, 3), in cells.
    start
        Bounds (G + 1,) of the runs, none of them empty.
    frames
        Frames (G, 3, 3) about whose last axis the boxes are turned instead.
    floor
        Shorter sides count as so long in the selection of directions.
    """
    points, start = np.ascontiguousarray(points, np.float64), np.ascontiguousarray(start, np.int64)
    runs = len(start) - 1
    boxes = Boxes(np.zeros((runs, 3)), np.zeros((runs, 3, 3)), np.zeros((runs, 3)))
    if not runs:
        return boxes
    if frames is None:
        spread, frames = principal_axes(points, start)
        rod = (spread[:, 0] > SETTINGS.slender * spread[:, 1]) & (spread[:, 2] > SETTINGS.even * spread[:, 1])
        kind = np.where(rod, ROD, COMPACT)
    else:
        kind = np.full(runs, FLAT)
    box_each(points, start, sphere(), np.ascontiguousarray(frames), kind, floor, *boxes)
    return boxes


def bounds(runs: Sequence[Sized]) -> npt.NDArray[np.int64]:
    """Start of each run in their concatenation, and the end of the last (G + 1,)."""
    return np.cumsum([0, *(len(run) for run in runs)], dtype=np.int64)


def distinct(boxes: Boxes, step: float) -> npt.NDArray[np.int64]:
    """Which boxes are the first of their kind: their positions and sizes differ by more than about ``step``."""
    reach = boxes.rotation * boxes.half[:, None]
    extent = np.abs(np.einsum("di,nij->ndj", _LINES, reach)).sum(2)
    key = np.round(np.concatenate([boxes.centre, extent, 2 * np.sort(boxes.half, 1)], 1) / step).astype(np.int64)
    return np.sort(np.unique(key, axis=0, return_index=True)[1])


def principal_axes(points: FloatArray, start: Array) -> tuple[FloatArray, FloatArray]:
    """Variances (G, 3), largest first, and their directions (G, 3, 3), as columns of proper rotations, of each run."""
    count = np.diff(start)
    mean = np.add.reduceat(points, start[:-1]) / count[:, None]
    off = points - np.repeat(mean, count, axis=0)
    moments = np.add.reduceat(off[:, :, None] * off[:, None], start[:-1]) / count[:, None, None]
    spread, axes = np.linalg.eigh(moments)
    axes = np.ascontiguousarray(axes[:, :, ::-1])
    axes[np.linalg.det(axes) < 0, :, 2] *= -1
    return spread[:, ::-1], axes


@cache
def sphere() -> FloatArray:
    """Evenly spread unit vectors, one of each opposite pair: the upper half of a spiral (Vogel 1979)."""
    count = MANY // 2
    height = (np.arange(count) + 0.5) / count
    turn = np.arange(count) * np.pi * (3 - 5**0.5)
    around = np.sqrt(1 - height**2)
    return np.stack([around * np.cos(turn), around * np.sin(turn), height], 1)
