"""Boxes of components that are copies of each other."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.pieces.oriented import Boxes
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.surface.components import Components
from shapeprog.space import FloatArray


def align_copies(mesh: Components, boxes: Boxes) -> Boxes:
    """Boxes of components, with corresponding orientations for copies of each other.

    Copies have their vertices in the same order; the motion between them, which may be a reflection, is the best fit
    (Kabsch 1976).  The copy whose box is closest to the world's axes is the model of the others.
    """
    count = np.diff(mesh.corner_start)[: len(boxes.half)]
    rotation, centre, half = boxes.rotation.copy(), boxes.centre.copy(), boxes.half.copy()
    turned = np.abs(boxes.rotation).max(1).sum(1)  # 3 along the axes
    for size in np.unique(count[(count > 2) & (count <= SETTINGS.copy_vertices)]):
        remaining = np.flatnonzero(count == size)
        at = mesh.corner_start[remaining][:, None] + np.arange(size)
        middle = mesh.vertices[mesh.corner[at]].mean(1)
        cloud = mesh.vertices[mesh.corner[at]] - middle[:, None]
        for _ in range(SETTINGS.copy_kinds):
            if len(remaining) < 2:
                break
            model = 0
            same, turn = _motions(cloud[model], cloud)
            members = np.flatnonzero(same)
            best = members[np.argmax(np.round(turned[remaining[members]], 3))]
            for member in members:
                motion = turn[member] @ turn[best].T
                source, goal = remaining[best], remaining[member]
                if member != best:
                    rotation[goal] = motion @ boxes.rotation[source]
                    half[goal] = boxes.half[source]
                    centre[goal] = middle[member] + motion @ (boxes.centre[source] - middle[best])
            keep = ~same
            remaining, cloud, middle = remaining[keep], cloud[keep], middle[keep]
    rotation[np.linalg.det(rotation) < 0, :, 2] *= -1
    return Boxes(centre, rotation, half)


def _motions(model: FloatArray, clouds: FloatArray) -> tuple[npt.NDArray[np.bool_], FloatArray]:
    """Which centred clouds (G, V, 3) are the model (V, 3) turned or reflected, and by what (G, 3, 3)."""
    u, _, vt = np.linalg.svd(np.einsum("gvi,vj->gij", clouds, model))
    turn = u @ vt
    off = np.abs(np.einsum("gij,vj->gvi", turn, model) - clouds).max((1, 2))
    return off < SETTINGS.copy_distance, turn
