"""Boards and bars between two planar patches that face each other."""

from __future__ import annotations

import numpy as np

from shapeprog.inference.pieces.oriented import Boxes
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.space import Array, FloatArray


def slabs(patches: Boxes) -> Boxes:
    """Boxes between pairs of patches: intersection and bounds of both rectangles, and each of them."""
    normal = patches.rotation[:, :, 2]
    distance = np.einsum("ijk,ik->ij", patches.centre[None] - patches.centre[:, None], normal)
    parallel = np.abs(normal @ normal.T) > np.cos(np.radians(SETTINGS.parallel))
    area = patches.half[:, :2].prod(1)
    larger = area[:, None] >= area
    thick = np.abs(distance)
    i, j = np.nonzero(parallel & larger & (thick >= SETTINGS.thickness[0]) & (thick <= SETTINGS.thickness[1]))
    i, j = i[i != j], j[i != j]
    corner = patches.corners()[j] - patches.centre[i][:, None]
    flat = np.einsum("nck,nka->nca", corner, patches.rotation[i][:, :, :2])
    low, high = flat.min(1), flat.max(1)
    half = patches.half[i, :2]
    inner = np.maximum(low, -half), np.minimum(high, half)
    shared = np.maximum(inner[1] - inner[0], 0).prod(1)
    keep = shared >= SETTINGS.shared * np.minimum(4 * half.prod(1), (high - low).prod(1))
    i, j, low, high, half = i[keep], j[keep], low[keep], high[keep], half[keep]
    spans = [
        (inner[0][keep], inner[1][keep]),
        (np.minimum(low, -half), np.maximum(high, half)),
        (-half, half),
        (low, high),
    ]
    return _between(patches, i, distance[i, j], spans)


def sheets(patches: Boxes, count: int) -> Boxes:
    """Thin boxes about the largest patches."""
    largest = patches.take(np.argsort(-np.round(patches.half[:, :2].prod(1), 6), kind="stable")[:count])
    return largest._replace(half=np.maximum(largest.half, [0, 0, SETTINGS.thickness[0] / 2]))


def _between(patches: Boxes, i: Array, depth: FloatArray, spans: list[tuple[FloatArray, FloatArray]]) -> Boxes:
    """Boxes over spans (n, 2) in the planes of patches ``i``, as deep as the distance along their normals."""
    middle = np.concatenate([(low + high) / 2 for low, high in spans])
    half = np.concatenate([(high - low) / 2 for low, high in spans])
    frame, deep = np.tile(patches.rotation[i], (len(spans), 1, 1)), np.tile(depth, len(spans))
    local = np.concatenate([middle, deep[:, None] / 2], 1)
    centre = np.tile(patches.centre[i], (len(spans), 1)) + np.einsum("nij,nj->ni", frame, local)
    box = Boxes(centre, frame, np.concatenate([half, np.abs(deep)[:, None] / 2], 1))
    sides = np.sort(box.half, 1)
    return box.take((box.half > 0).all(1) & (box.half[:, 2] <= SETTINGS.stretch * sides[:, 1]))
