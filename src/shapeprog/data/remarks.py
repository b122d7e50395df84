"""Remarks on inputs that may not be one piece of furniture, and on programs that differ from their input in size."""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry.scene import Scene
from shapeprog.space import RESOLUTION, UP, BoolArray, FloatArray


def remark_on_pieces(voxels: BoolArray) -> str:
    """A sentence about the pieces of a shape with these touched cells if empty cells separate them; else empty."""
    from scipy.ndimage import label

    pieces, count = label(voxels, np.ones((3, 3, 3)))
    if count < 2:
        return ""
    smallest = np.bincount(pieces[voxels])[1:].min() / np.count_nonzero(voxels)
    text = f"The input has {count} separate pieces, the smallest with {smallest:.1%} of its cells"
    return f"{text}: infer objects one by one, and remove geometry that is far from them."


def doubt_of_furniture(points: FloatArray, normals: FloatArray) -> str:
    """Why a shape with these points (P, 3) and normals (P, 3) does not look like furniture; empty if it does.

    Furniture carries something on level surfaces above the floor, and most of its surfaces face along an axis.
    """
    low, extents, normals = points.min(0), np.maximum(np.ptp(points, axis=0), 1e-9), np.abs(normals)
    share = (points - low) / extents
    plan = np.minimum((share[:, 1:] * RESOLUTION).astype(int), RESOLUTION - 1) @ [RESOLUTION, 1]
    level = (normals[:, UP] > math.cos(math.radians(15))) & (share[:, UP] > 0.1)
    covered = np.count_nonzero(np.bincount(plan[level])) / np.count_nonzero(np.bincount(plan))
    along = float((normals.max(1) > math.cos(math.radians(10))).mean())
    # Less is true of mugs, bottles, cars and figures, and of 2 % of furniture (val), all of it wire or shells.
    why = f"{along:.0%} of its surface faces along an axis, and level surfaces cover {covered:.0%} of its plan"
    return "" if covered >= 0.35 or along >= 0.45 else f"This does not look like furniture: {why}."


def remark_on_size(scene: Scene, points: FloatArray) -> str:
    """A sentence about the size of a program if it differs from that of points (P, 3) of its input by more than a
    tenth; else empty."""
    mask, extents = scene.mask.numpy(), np.ptp(points, axis=0)
    if not mask.any():
        return ""
    low, high = ((scene.centre + sign * scene.reach).numpy()[mask] for sign in (-1, 1))
    size = high.max(0) - low.min(0)
    differs = np.abs(size - extents) > np.maximum(0.1 * extents, 1.0)  # a sheet has no thickness
    pairs = zip(np.array(["high", "deep", "wide"])[differs], (size / np.maximum(extents, 1e-9))[differs], strict=True)
    sizes = " and ".join(f"{ratio:.0%} as {word}" for word, ratio in pairs)
    return sizes and f"The program is {sizes} as the input: parts are missing, or differ from it."
