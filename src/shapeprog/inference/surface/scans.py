"""How many points of a scan are worth looking at.

Points of a clean scan lie on planes with their nearest neighbours wherever the surface is flat: the more of them are
looked at, the sharper are thin parts and edges.  With noise, points that are nearer to each other than it is large tell
no direction, and fewer of them show more.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from shapeprog.data.shape import Shape
from shapeprog.inference.surface.cloud import planes
from shapeprog.space import FloatArray

NEIGHBOURS = 8
"""Points, one and its nearest neighbours, that lie on a plane of a clean scan."""

FLATTEST, CLEAN = 0.1, 0.02
"""Share of the points that may be expected to lie where the surface is flat; and noise in cells about their planes of a
scan that is clean."""


def points_of_scan(shape: Shape) -> FloatArray:
    """The points (P, 3) to look at of a shape that came as points: of a clean scan all, of others the usual number."""
    assert shape.points is not None
    if shape.scan is not None and is_clean(np.asarray(shape.scan, np.float64)):
        return np.asarray(shape.scan, np.float64)
    return np.asarray(shape.points, np.float64)


def is_clean(points: FloatArray) -> bool:
    """Whether points (P, 3) lie on planes with their nearest neighbours where the surface is flattest."""
    if len(points) <= NEIGHBOURS:
        return False
    near = cKDTree(points).query(points, k=NEIGHBOURS)[1]
    _, squared = planes(points, near)
    return bool(np.quantile(np.sqrt(squared / (NEIGHBOURS - 3)), FLATTEST) < CLEAN)
