"""Boxes around neighbours that form a larger part: the frame of a back, the boards of a seat."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.separation import OrientedBoxes, touching
from shapeprog.inference.pieces.oriented import Boxes, bounds, boxes_around
from shapeprog.inference.pieces.settings import SETTINGS


def groups(boxes: Boxes) -> Boxes:
    """Boxes around boxes that touch.

    From each box, neighbours are added that do not exceed the extent of the first along some of its axes: one such axis
    yields frames and panels, two yield rods and stacks, and none yields all that touch.
    """
    first = boxes.take(np.arange(min(len(boxes.half), SETTINGS.grouped)))
    if len(first.half) < 2:
        return boxes.take(np.zeros(0, np.int64))
    adjacent = near(first, SETTINGS.group_gap)
    at = np.einsum("jkc,icd->ijkd", first.corners(), first.rotation)
    at -= np.einsum("ic,icd->id", first.centre, first.rotation)[:, None, None]
    within = np.abs(at).max(2) <= first.half[:, None] + SETTINGS.group_gap
    unique: dict[bytes, npt.NDArray[np.int64]] = {}
    for held in (held for count in (1, 2, 0) for held in combinations(range(3), count)):
        fits = within[:, :, held].all(2)
        for row in grown(adjacent, fits):
            if row.sum() > 1:
                unique.setdefault(row.tobytes(), np.flatnonzero(row))
    members = list(unique.values())
    corners = first.corners()
    points = np.concatenate([corners[indices].reshape(-1, 3) for indices in members]) if members else np.zeros((0, 3))
    return boxes_around(points, 8 * bounds(members))


def grown(adjacent: npt.NDArray[np.bool_], fits: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """For each start (a row) the boxes reachable over adjacent boxes (N, N) that fit it (N, N)."""
    reached, links = np.eye(len(fits), dtype=np.bool_), adjacent.astype(np.float32)  # products of floats are faster
    while True:
        onwards = reached | ((reached.astype(np.float32) @ links > 0) & fits)
        if np.array_equal(onwards, reached):
            return reached
        reached = onwards


def near(boxes: Boxes, gap: float) -> npt.NDArray[np.bool_]:
    """Which boxes (N, N) are within about ``gap`` of each other: they touch when both are larger by half of it."""
    edges = np.swapaxes(boxes.rotation, 1, 2) * (boxes.half + gap / 2)[..., None]
    first, second = touching(OrientedBoxes(boxes.centre, edges), 1e-9)
    result = np.eye(len(boxes.half), dtype=np.bool_)
    result[first, second] = result[second, first] = True
    return result
