"""Points on a mesh, uniform by area and the same for the same seed on every machine."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.space import Array

_AT_ONCE = 1 << 17
"""Triangles in memory at once: meshes may have millions."""


def sample_surface(vertices: Array, faces: Array, count: int, seed: int = 0) -> npt.NDArray[np.float32]:
    """Points (count, 3) drawn uniformly by area from the triangles; see :func:`sample_with_faces`."""
    return sample_with_faces(vertices, faces, count, seed)[0]


def sample_with_faces(
    vertices: Array, faces: Array, count: int, seed: int = 0
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int64]]:
    """Points (count, 3) drawn uniformly by area from the triangles, and the triangle (count,) that each lies on.

    Faces without area get none; a mesh that has no area at all is drawn from uniformly by face.

    Parameters
    ----------
    vertices
        Corners (V, 3).
    faces
        Triangles (F, 3) as indices of vertices.
    count
        How many points.
    seed
        Seed of the generator.
    """
    positions, listed = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    starts = range(0, max(len(listed), 1), _AT_ONCE)
    weight = np.cumsum(np.concatenate([_areas(positions, listed[at : at + _AT_ONCE]) for at in starts]))
    if weight[-1] <= 0:
        weight = np.arange(1.0, len(listed) + 1)
    random = np.random.default_rng(seed).random((count, 3))
    face = np.minimum(np.searchsorted(weight, random[:, 0] * weight[-1], side="right"), len(listed) - 1)
    corners = positions[listed[face]]
    first, along, across = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # The square root keeps the density even from the first corner to the opposite edge.
    root, share = np.sqrt(random[:, 1:2]), random[:, 2:3]
    points: Array = first + root * ((1 - share) * along + share * across)
    return points.astype(np.float32), face


def _areas(vertices: Array, faces: Array) -> Array:
    """Twice the area of each triangle."""
    corners = vertices[faces]
    normals: Array = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.linalg.norm(normals, axis=1)
