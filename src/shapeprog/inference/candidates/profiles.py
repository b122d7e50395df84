"""Profiles of candidates, by which copies are recognised whatever statements draw them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from scipy.spatial.distance import cdist

from shapeprog.geometry.distance import signed_distance
from shapeprog.inference.candidates.settings import SETTINGS
from shapeprog.language.program import Loop, Node, Program
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll
from shapeprog.space import FloatArray


class Profiles(NamedTuple):
    """Profiles of candidates: equal for copies by translation, whatever the order of the axes of their solids.

    Parameters
    ----------
    kind
        A number for the statements and counts of each block (C,).
    middle, half
        Middle and half extents (C, 3) of the box around a candidate, along the axes of the grid.
    distance
        Signed distances (C, 27) of the surface from the middle, corners, edges and faces of that box.
    """

    kind: npt.NDArray[np.int64]
    middle: FloatArray
    half: FloatArray
    distance: FloatArray

    @property
    def size(self) -> FloatArray:
        """Half of the diagonal (C,) of the box."""
        return np.sqrt((self.half**2).sum(1))

    def copies(self) -> npt.NDArray[np.bool_]:
        """Whether two candidates (C, C) are copies of each other by translation."""
        alike = cdist(self.half, self.half, "chebyshev") <= SETTINGS.alike * self.size[:, None]
        level = cdist(self.distance, self.distance, "chebyshev") <= SETTINGS.level
        same: npt.NDArray[np.bool_] = alike & level & (self.kind[:, None] == self.kind)
        return same


def profiles(nodes: Sequence[Node]) -> Profiles:
    """The profiles of blocks, at least one."""
    scene = unroll(encode([Program((node,)) for node in nodes], dtype=torch.float64))
    there = scene.mask[..., None]
    low, high = ((scene.centre + sign * scene.reach).where(there, -sign * torch.inf) for sign in (-1, 1))
    ends = torch.stack([low.amin(1), high.amax(1)]).nan_to_num(posinf=0, neginf=0)
    middle, half = ends.mean(0), (ends[1] - ends[0]) / 2
    signs = torch.cartesian_prod(*[torch.tensor([-1.0, 0.0, 1.0], dtype=torch.float64)] * 3)
    distance = signed_distance(scene, middle[:, None] + signs * half[:, None]).nan_to_num(0, 0, 0)
    kind = np.unique([_kind(node) for node in nodes], return_inverse=True)[1]
    return Profiles(kind, middle.numpy(), half.numpy(), distance.numpy())


def _kind(node: Node) -> str:
    if isinstance(node, Loop):
        return f"{node.name} {node.count} {' '.join(_kind(inner) for inner in node.body)}"
    return node.name


def distinct(nodes: Sequence[Node]) -> list[Node]:
    """The candidates without later ones of the same kind and nearly the same position and profile, in their order."""
    if not nodes:
        return []
    profile = profiles(nodes)
    order = np.round(np.log2(np.maximum(profile.size, SETTINGS.same)))  # order of magnitude
    features = np.concatenate([profile.middle, profile.half, profile.distance], 1)
    key = np.column_stack([profile.kind, order, np.round(features / (SETTINGS.same * 2 ** order[:, None]))])
    return [nodes[k] for k in np.sort(np.unique(key, axis=0, return_index=True)[1])]
