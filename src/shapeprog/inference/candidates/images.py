"""Mirror images: loops over candidates whose images about the middle of the shape lie on the surface as well.

What is found whole on one side may be found in other pieces on the other, or not at all: noise, holes and what meets it
differ.  Copies need not be candidates themselves; whether they are there is for the surface to say.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress

import numpy as np
import torch
from scipy.spatial import cKDTree

from shapeprog.geometry.surface import sample_surface
from shapeprog.language.program import Loop, Node, Program
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll
from shapeprog.space import DEPTH, SIDE, FloatArray

POINTS = 48
"""Points on each candidate whose images are looked for."""

ON = 0.4
"""Distance in cells within which a point is on the surface."""

SUPPORTED, AS_WELL = 0.6, 0.8
"""Share of its points that lie on the surface, at least; and how many as many of its image, at least."""


def images(singles: Sequence[Node], surface: FloatArray) -> list[Node]:
    """Loops over candidates and their mirror images, left and right, in front and behind, and both; none where these
    would lie over each other.

    Parameters
    ----------
    singles
        The candidates.
    surface
        Points (P, 3) on the surface of the target.
    """
    if not singles:
        return []
    scene = unroll(encode([Program((node,)) for node in singles], dtype=torch.float64))
    points = sample_surface(scene, POINTS, torch.Generator().manual_seed(0)).points.numpy()
    tree = cKDTree(surface)

    def on(*axes: int) -> FloatArray:
        """Share of its points that lie on the surface, of the image of each candidate."""
        image = points * [-1.0 if axis in axes else 1.0 for axis in range(3)]
        share: FloatArray = np.isfinite(tree.query(image, distance_upper_bound=ON)[0]).mean(1)
        return share

    own = on()
    least = np.where(own >= SUPPORTED, AS_WELL * own, np.inf)
    beside = (points.min(1) > 0) | (points.max(1) < 0)
    side, depth = (beside[:, axis] & (on(axis) >= least) for axis in (SIDE, DEPTH))
    both = side & depth & (on(SIDE, DEPTH) >= least)
    return [
        *(_mirrored(node, SIDE) for node in compress(singles, side)),
        *(_mirrored(node, DEPTH) for node in compress(singles, depth)),
        *(_mirrored(_mirrored(node, DEPTH), SIDE) for node in compress(singles, both)),
    ]


def _mirrored(node: Node, axis: int) -> Loop:
    return Loop("mirror", (2.0, float(axis), 0.0), (node,))
