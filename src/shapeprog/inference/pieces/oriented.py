"""Oriented boxes, around many sets of points at once and around boxes that touch."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.separation import OrientedBoxes, touching
from shapeprog.inference.pieces.oriented_kernels import COMPACT, FLAT, ROD, turn_each
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.surface.cloud import spiral
from shapeprog.inference.surface.components import IntArray
from shapeprog.space import Array, FloatArray

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))  # the corners (8, 3) of a box of half extents 1
LINES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 0], [1, 0, 1], [1, 0, -1], [0, 1, 1], [0, 1, -1]])
"""Directions along which boxes are compared."""

SPHERE = np.ascontiguousarray(spiral((np.arange(80) + 0.5) / 80)[:, [1, 2, 0]].T)
"""Evenly spread unit vectors (3, 80), one of each opposite pair, that define the outermost points."""


class Boxes(NamedTuple):
    """Oriented boxes, in cells: centres (N, 3), axes (N, 3, 3) as columns of proper rotations, half extents (N, 3)."""

    centre: FloatArray
    rotation: FloatArray
    half: FloatArray

    def take(self, which: Array | slice) -> Boxes:
        """Some of them, by index or mask."""
        return Boxes(self.centre[which], self.rotation[which], self.half[which])

    def corners(self) -> FloatArray:
        """Their corners (N, 8, 3)."""
        return self.centre[:, None] + np.einsum("nij,nkj->nki", self.rotation, CORNERS * self.half[:, None])


def join(parts: Sequence[Boxes]) -> Boxes:
    """All boxes of a list, in its order."""
    empty = Boxes(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    return Boxes(*(np.concatenate(column) for column in zip(empty, *parts, strict=True)))


def boxes_around(sets: Sequence[Array], frames: FloatArray | None = None, floor: float = SETTINGS.thin) -> Boxes:
    """A small box around each set of points (P, 3), along the world's axes, or turned where it is much smaller then.

    With ``frames`` (G, 3, 3) of all sets, boxes are turned only about the last axes of these.  In the selection of
    directions, sides shorter than ``floor`` count as so long.
    """
    if not sets:
        return join([])
    kind, rotation = np.full(len(sets), FLAT), np.empty((len(sets), 3, 3))
    if frames is None:
        spread, frames = principal_axes(sets)
        rod = (spread[:, 0] > SETTINGS.slender * spread[:, 1]) & (spread[:, 2] > SETTINGS.even * spread[:, 1])
        kind = np.where(rod, ROD, COMPACT)
    points, start = _joined(sets)
    turn_each(points, start, SPHERE, np.ascontiguousarray(frames), kind, floor, rotation)
    at = np.einsum("pi,pij->pj", points, np.repeat(rotation, np.diff(start), 0))
    low, high = np.minimum.reduceat(at, start[:-1]), np.maximum.reduceat(at, start[:-1])
    return Boxes(np.einsum("nij,nj->ni", rotation, (low + high) / 2), rotation, (high - low) / 2)


def _joined(sets: Sequence[Array]) -> tuple[FloatArray, IntArray]:
    """The points of all sets (P, 3), and the first of each set with the end of the last (G + 1,)."""
    return np.concatenate(sets, dtype=np.float64), np.cumsum([0, *map(len, sets)], dtype=np.int64)


def principal_axes(sets: Sequence[Array]) -> tuple[FloatArray, FloatArray]:
    """Variances (G, 3) of each set of points, largest first, and their directions (G, 3, 3), a proper rotation each."""
    points, start = _joined(sets)
    count, first = np.diff(start), start[:-1]
    off = points - np.repeat(np.add.reduceat(points, first) / count[:, None], count, axis=0)
    moments = np.add.reduceat(off[:, :, None] * off[:, None], first) / count[:, None, None]
    spread, axes = np.linalg.eigh(moments)
    axes = np.ascontiguousarray(axes[:, :, ::-1])
    axes[np.linalg.det(axes) < 0, :, 2] *= -1
    return spread[:, ::-1], axes


def distinct(boxes: Boxes) -> IntArray:
    """The boxes that are first of their kind: positions and sizes differ by more than about ``SETTINGS.same``."""
    extent = np.abs(np.einsum("di,nij->ndj", LINES, boxes.rotation * boxes.half[:, None])).sum(2)
    measures = np.concatenate([boxes.centre, extent, 2 * np.sort(boxes.half, 1)], 1)
    return np.sort(np.unique(np.round(measures / SETTINGS.same).astype(np.int64), axis=0, return_index=True)[1])


def groups(boxes: Boxes) -> Boxes:
    """Boxes around those of the first ``SETTINGS.grouped`` boxes that touch: the frame of a back, the boards of a seat.

    From each box, neighbours are added that do not exceed the extent of the first along some of its axes: one such axis
    yields frames and panels, two yield rods and stacks, and none yields all that touch.
    """
    boxes = boxes.take(slice(SETTINGS.grouped))
    # Boxes touch when both are larger by half of the gap.
    edges = np.swapaxes(boxes.rotation, 1, 2) * (boxes.half + SETTINGS.group_gap / 2)[..., None]
    first, second = touching(OrientedBoxes(boxes.centre, edges), 1e-9)
    adjacent = np.eye(len(edges), dtype=np.float32)  # products of floats are faster than those of flags
    adjacent[first, second] = adjacent[second, first] = 1
    corners = boxes.corners()
    at = np.einsum("ijkc,icd->ijkd", corners - boxes.centre[:, None, None], boxes.rotation)
    within = np.abs(at).max(2) <= boxes.half[:, None] + SETTINGS.group_gap
    unique: dict[bytes, FloatArray] = {}
    for held in ([0], [1], [2], [0, 1], [0, 2], [1, 2], []):
        for row in _reachable(adjacent, within[:, :, held].all(2)):
            if row.sum() > 1:
                unique.setdefault(row.tobytes(), corners[row].reshape(-1, 3))
    return boxes_around(list(unique.values()))


def _reachable(adjacent: npt.NDArray[np.float32], fits: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """For each start (a row) the boxes reachable over adjacent boxes (N, N) that fit it (N, N)."""
    reached = np.eye(len(fits), dtype=np.bool_)
    while True:
        onwards = reached | ((reached.astype(np.float32) @ adjacent > 0) & fits)
        if np.array_equal(onwards, reached):
            return reached
        reached = onwards
