"""Oriented boxes around many sets of points at once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from shapeprog.geometry.primitives import KINDS
from shapeprog.geometry.primitives.cuboid import CUBOID
from shapeprog.geometry.scene import Scene
from shapeprog.inference.surface.cloud import spiral
from shapeprog.inference.surface.oriented_kernels import COMPACT, FLAT, ROD, turn_each
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.space import Array, BoolArray, FloatArray, IntArray

LEAN = CUBOID.sizes.index("lean")  # slot of the shear of a cuboid
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))  # of a box of half extents 1, (8, 3)
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

    @property
    def straight(self) -> BoolArray:
        """Which of them lie along the axes of the grid (N,)."""
        return (np.abs(self.rotation).max(-2) >= 1 - 1e-6).all(-1)

    def corners(self) -> FloatArray:
        """Their corners (N, 8, 3)."""
        return self.centre[:, None] + np.einsum("nij,nkj->nki", self.rotation, CORNERS * self.half[:, None])


def join(parts: Sequence[Boxes]) -> Boxes:
    """All boxes of a list, in its order."""
    empty = Boxes(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    return Boxes(*(np.concatenate(column) for column in zip(empty, *parts, strict=True)))


def primitive_boxes(scene: Scene) -> Boxes:
    """The boxes around primitives (..., N); those of sheared boxes lie along their slanted faces.

    A box of height h and depth d, sheared by an angle a, fills one of length h / cos a + d |sin a| and depth d cos a.
    """
    centre, axes, half = (tensor.numpy() for tensor in (scene.centre, scene.rotation, scene.bounds))
    size, cuboid = scene.size.numpy(), scene.kind.numpy() == KINDS["cuboid"]
    angle = np.where(cuboid, np.arctan2(size[..., LEAN], 2 * size[..., 0]), 0.0)
    cosine, sine = np.cos(angle), np.sin(angle)
    length, depth = size[..., 0] / cosine + size[..., 1] * np.abs(sine), size[..., 1] * cosine
    half = np.where(cuboid[..., None], np.stack([length, depth, half[..., 2]], -1), half)
    cosine, sine = cosine[..., None], sine[..., None]
    turned = axes[..., 0] * cosine + axes[..., 1] * sine, axes[..., 1] * cosine - axes[..., 0] * sine, axes[..., 2]
    return Boxes(centre, np.stack(turned, -1), half)


def boxes_around(sets: Sequence[Array], frames: FloatArray | None = None, floor: float = SURFACE.thin) -> Boxes:
    """A small box around each set of points (P, 3), along the world's axes, or turned where it is much smaller then.

    With ``frames`` (G, 3, 3) of all sets, boxes are turned only about the last axes of these.  In the selection of
    directions, sides shorter than ``floor`` count as so long.
    """
    if not sets:
        return join([])
    kind, rotation = np.full(len(sets), FLAT), np.empty((len(sets), 3, 3))
    if frames is None:
        spread, frames = principal_axes(sets)
        rod = (spread[:, 0] > SURFACE.slender * spread[:, 1]) & (spread[:, 2] > SURFACE.even * spread[:, 1])
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
