"""Boxes around neighbours that form a larger part: the frame of a back, the boards of a seat."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt

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
    adjacent = touching(first, SETTINGS.group_gap)
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


def touching(boxes: Boxes, gap: float) -> npt.NDArray[np.bool_]:
    """Which boxes (N, N) are within about ``gap`` of each other: they have no separating axis (Gottschalk 1996)."""
    half = boxes.half + gap / 2
    count = len(half)
    offset = boxes.centre[None] - boxes.centre[:, None]
    axes = np.broadcast_to(boxes.rotation[:, None], (count, count, 3, 3)).transpose(0, 1, 3, 2)
    other_axes = axes.transpose(1, 0, 2, 3)
    edges = np.cross(axes[:, :, :, None], other_axes[:, :, None]).reshape(count, count, 9, 3)
    touch = np.ones((count, count), np.bool_)
    for directions in (axes, other_axes, edges):
        distance = np.abs(np.einsum("ijad,ijd->ija", directions, offset))
        reach = np.abs(np.einsum("ijad,idk,ik->ijak", directions, boxes.rotation, half)).sum(3)
        reach += np.abs(np.einsum("ijad,jdk,jk->ijak", directions, boxes.rotation, half)).sum(3)
        touch &= (distance <= reach + 1e-9).all(2)
    return touch
