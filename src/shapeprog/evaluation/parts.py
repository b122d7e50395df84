"""Does one physical part become one primitive?  Recall and precision of the parts of an object.

A part is recovered where a primitive that no other part took, best pairs first, has IoU >= .5 with its oriented box.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from shapeprog.evaluation.likeness import Triangles
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.scene import Scene
from shapeprog.language.hints import Box

ENOUGH = 0.5
"""IoU from which a primitive counts as a part."""

THINNEST = 0.1
"""Half extents in cells that the box of a part has at least, so that sheets have a volume."""

POINTS = 20_000
"""Points drawn in the box of each part."""


class PartScores(NamedTuple):
    """How many parts are covered by one primitive, over the parts and over the primitives."""

    part_recall: float
    part_precision: float


def oriented_box(part: Triangles) -> Box:
    """The smallest box around a part, in any direction."""
    bounds: Any = importlib.import_module("trimesh.bounds")
    used = np.asarray(part.vertices, np.float64)[np.unique(part.faces)]
    to_box, extents = bounds.oriented_bounds(used)
    pose = np.linalg.inv(to_box)
    return Box(pose[:3, 3], pose[:3, :3], np.maximum(extents / 2, THINNEST))


def overlaps(parts: Sequence[Box], scene: Scene, seed: int = 0) -> npt.NDArray[np.float64]:
    """IoU (parts, primitives) of boxes with the primitives of one scene, by sampling the boxes."""
    slots = scene.mask.nonzero()[:, 0]
    volume = scene.volumes[slots].double().numpy()
    sampled = np.random.default_rng(seed).uniform(-1, 1, (POINTS, 3))
    table = np.zeros((len(parts), len(slots)))
    for row, part in enumerate(parts):
        points = torch.from_numpy(part.centre + (sampled * part.half) @ part.rotation.T)
        inside = (each_distance(scene, points.to(scene.size.dtype)) <= 0).double().mean(0)[slots].numpy()
        box_volume = float(np.prod(2 * part.half))
        shared = inside * box_volume
        table[row] = shared / np.maximum(box_volume + volume - shared, 1e-12)
    return table


def best_pairs(table: npt.NDArray[np.float64]) -> list[tuple[int, int]]:
    """Rows and columns of overlaps that belong together, best pairs first, each once; enough of them overlaps."""
    remaining, pairs = table.copy(), []
    while remaining.size and remaining.max() >= ENOUGH:
        row, column = (int(index) for index in np.unravel_index(remaining.argmax(), remaining.shape))
        remaining[row], remaining[:, column] = -1, -1
        pairs.append((row, column))
    return pairs


def part_scores(parts: Sequence[Triangles], scene: Scene, seed: int = 0) -> PartScores:
    """Recall and precision of the physical parts of an object, placed in the grid as the target is."""
    table = overlaps([oriented_box(part) for part in parts], scene, seed)
    recovered = len(best_pairs(table))
    return PartScores(recovered / max(len(parts), 1), recovered / max(table.shape[1], 1))
