"""Points on a mesh, uniform by area and the same for the same seed on every machine."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def sample_surface(vertices: Array, faces: Array, count: int, seed: int = 0) -> npt.NDArray[np.float32]:
    """Points (count, 3) drawn uniformly by area from the triangles.

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
    corners = np.asarray(vertices, np.float64)[np.asarray(faces, np.int64)]
    first, along, across = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    weight = np.cumsum(np.linalg.norm(np.cross(along, across), axis=1))
    if weight[-1] <= 0:
        weight = np.arange(1.0, len(corners) + 1)
    drawn = np.random.default_rng(seed).random((count, 3))
    face = np.minimum(np.searchsorted(weight, drawn[:, 0] * weight[-1], side="right"), len(corners) - 1)
    # The square root keeps the density even from the first corner to the opposite edge.
    root, share = np.sqrt(drawn[:, 1:2]), drawn[:, 2:3]
    points: Array = first[face] + root * ((1 - share) * along[face] + share * across[face])
    single: npt.NDArray[np.float32] = points.astype(np.float32)
    return single
