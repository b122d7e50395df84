"""Parts that touch, for many scenes at once, and connected components of graphs.

Pairs whose oriented boxes overlap are compared by alternating projections (von Neumann 1933).
"""

from __future__ import annotations

import numpy as np

from shapeprog.geometry import distance_kernels as kernels
from shapeprog.geometry.arrays import array, table_of
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.separation import OrientedBoxes, boxes_of, gaps
from shapeprog.kernels.table import CENTRE, ROTATION, WIDTH
from shapeprog.space import Array, BoolArray, IntArray

TOUCHING = 0.02
"""Gap in cells up to which parts touch."""

ROUNDS = 500
"""Most projections onto each of two parts: rods that lean a little against each other need many."""


def contact_groups(scenes: Batch) -> list[int]:
    """The number of groups of touching primitives in each scene of a batch (B, N)."""
    graphs = zip(touching(scenes, TOUCHING), array(scenes.mask), strict=True)
    labels = (linked(np.argwhere(graph[here][:, here]), here.sum()) for graph, here in graphs)
    return [int(label.max(initial=-1)) + 1 for label in labels]


def linked(pairs: Array, count: int) -> IntArray:
    """The connected component (count,) of each of ``count`` items, from linked pairs (P, 2)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(pairs), np.bool_), pairs.T), (count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def touching(scenes: Batch, within: float) -> BoolArray:
    """Which primitives of each scene of a batch (B, N) lie ``within`` cells of which later ones (B, N, N).

    Projections of parts that barely overlap may end before they meet: such parts count as apart.
    """
    mask, (centre, edges) = array(scenes.mask), boxes_of(scenes)
    reach = np.abs(edges).sum(-2)
    low, high = centre - reach, centre + reach + within
    near = (low[:, :, None] <= high[:, None]).all(-1) & mask[:, :, None] & mask[:, None]
    near &= np.triu(near.swapaxes(1, 2), 1)
    scene, first, second = np.nonzero(near)
    rows = table_of(scenes).reshape(*mask.shape, WIDTH)
    pairs = np.stack([rows[scene, first], rows[scene, second]], 1)
    pairs[..., CENTRE:ROTATION] = (pairs[..., CENTRE:ROTATION] - pairs[:, :1, CENTRE:ROTATION]).round(6) + 0.0
    # Copies of a pair are compared once.
    different, index, number = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    boxes, start = OrientedBoxes(centre.reshape(-1, 3), edges.reshape(-1, 3, 3)), scene[index] * mask.shape[1]
    gap = gaps(boxes, start + first[index], start + second[index])  # a lower bound of the gap between the parts
    close = gap <= within
    exact = np.empty(np.count_nonzero(close))
    kernels.gaps(different[close].reshape(-1, WIDTH), ROUNDS, within, exact)
    gap[close] = exact
    near[scene, first, second] = (gap <= within)[number.reshape(-1)]
    return near
