"""Boxes around neighbours that make up something larger: the frame of a back, the boards of a seat."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.pieces.oriented import Boxes, bounds, boxes_around

GAP = 0.3
"""Distance in cells between boxes that still touch, and by which a neighbour may stand out."""

MOST = 120
"""Boxes that are looked at, the first ones."""


def groups(boxes: Boxes) -> Boxes:
    """Boxes around boxes that touch.

    From each box, neighbour after neighbour joins as long as it does not stand out along some of the axes of the first:
    one axis held makes frames and panels, two make rods and stacks, and none makes all that touches.
    """
    first = boxes.take(np.arange(min(len(boxes.half), MOST)))
    if len(first.half) < 2:
        return boxes.take(np.zeros(0, np.int64))
    beside = touching(first, GAP)
    at = np.einsum("jkc,icd->ijkd", first.corners(), first.rotation)
    at -= np.einsum("ic,icd->id", first.centre, first.rotation)[:, None, None]
    within = np.abs(at).max(2) <= first.half[:, None] + GAP
    found: dict[bytes, npt.NDArray[np.int64]] = {}
    for held in (held for count in (1, 2, 0) for held in combinations(range(3), count)):
        fits = within[:, :, held].all(2)
        for row in grown(beside, fits):
            if row.sum() > 1:
                found.setdefault(row.tobytes(), np.flatnonzero(row))
    members = list(found.values())
    corners = first.corners()
    points = np.concatenate([corners[each].reshape(-1, 3) for each in members]) if members else np.zeros((0, 3))
    return boxes_around(points, 8 * bounds(members))


def grown(beside: npt.NDArray[np.bool_], fits: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """For each start (a row) all that is reached from neighbour to neighbour (N, N) through what fits it (N, N)."""
    reached, links = np.eye(len(fits), dtype=np.bool_), beside.astype(np.float32)  # products of floats are faster
    while True:
        onwards = reached | ((reached.astype(np.float32) @ links > 0) & fits)
        if np.array_equal(onwards, reached):
            return reached
        reached = onwards


def touching(boxes: Boxes, gap: float) -> npt.NDArray[np.bool_]:
    """Which boxes (N, N) come within about ``gap`` of each other: no axis tells them apart (Gottschalk 1996)."""
    half = boxes.half + gap / 2
    count = len(half)
    apart = boxes.centre[None] - boxes.centre[:, None]
    axes = np.broadcast_to(boxes.rotation[:, None], (count, count, 3, 3)).transpose(0, 1, 3, 2)
    others = axes.transpose(1, 0, 2, 3)
    edges = np.cross(axes[:, :, :, None], others[:, :, None]).reshape(count, count, 9, 3)
    found = np.ones((count, count), np.bool_)
    for directions in (axes, others, edges):
        distance = np.abs(np.einsum("ijad,ijd->ija", directions, apart))
        reach = np.abs(np.einsum("ijad,idk,ik->ijak", directions, boxes.rotation, half)).sum(3)
        reach += np.abs(np.einsum("ijad,jdk,jk->ijak", directions, boxes.rotation, half)).sum(3)
        found &= (distance <= reach + 1e-9).all(2)
    return found
