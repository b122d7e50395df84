"""Boxes around boxes that touch, and those of a list that differ."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.separation import OrientedBoxes, touching
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.surface.oriented import Boxes, boxes_around
from shapeprog.space import BoolArray, FloatArray, IntArray

LINES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 0], [1, 0, 1], [1, 0, -1], [0, 1, 1], [0, 1, -1]])
"""Directions along which boxes are compared."""


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


def _reachable(adjacent: npt.NDArray[np.float32], fits: BoolArray) -> BoolArray:
    """For each start (a row) the boxes reachable over adjacent boxes (N, N) that fit it (N, N)."""
    reached = np.eye(len(fits), dtype=np.bool_)
    while True:
        onwards = reached | ((reached.astype(np.float32) @ adjacent > 0) & fits)
        if np.array_equal(onwards, reached):
            return reached
        reached = onwards
