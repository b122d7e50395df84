"""Moments of the solids of candidates, by which copies are recognised independently of their statements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.geometry.primitive import SIZES
from shapeprog.geometry.primitives import primitives
from shapeprog.geometry.scene import Scene
from shapeprog.language.program import Loop, Node, Program
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll
from shapeprog.space import FloatArray

SAME = 0.03
"""Difference of positions and extents, as a share of the size, below which two candidates are the same."""


class Moments(NamedTuple):
    """Moments of candidates, up to the third.

    Parameters
    ----------
    kind
        The statements and counts of a block.
    middle, spread, skew
        The mean (C, 3) of the centres of its solids, second moments (C, 3, 3) and third moments (C, 3) about it.
    lean
        Asymmetry of solids between their sides, in cells along each axis (C, 3), as of tapered legs and bulging arcs.
    """

    kind: tuple[str, ...]
    middle: FloatArray
    spread: FloatArray
    skew: FloatArray
    lean: FloatArray

    @property
    def size(self) -> FloatArray:
        """Size (C,) of a candidate: the root mean square distance from its middle."""
        return np.sqrt(np.trace(self.spread, axis1=1, axis2=2))


def moments(nodes: Sequence[Node]) -> Moments:
    """The moments of blocks."""
    return moments_of([Program((node,)) for node in nodes])


def moments_of(programs: Sequence[Program]) -> Moments:
    """The moments of all solids of each program."""
    scene = unroll(encode(programs, dtype=torch.float64))
    share = scene.mask.double()
    share = share / share.sum(-1, keepdim=True).clamp(min=1)
    inner, lean = _solid_moments(scene)
    middle = (share[..., None] * scene.centre).sum(1)
    away = scene.centre - middle[:, None]
    squared = (away**2).sum(-1) + inner.diagonal(dim1=-2, dim2=-1).sum(-1)
    spread = inner + away[..., :, None] * away[..., None, :]
    skew = squared[..., None] * away + 2 * (inner @ away[..., None])[..., 0]
    vectors = ((share[..., None] * array).sum(1) for array in (skew, lean))
    arrays = (share[..., None, None] * spread).sum(1), *vectors
    kinds = tuple(" ".join(map(_kind, program.body)) for program in programs)
    return Moments(kinds, middle.numpy(), *(array.numpy() for array in arrays))


def _solid_moments(scene: Scene) -> tuple[Float[Tensor, "C N 3 3"], Float[Tensor, "C N 3"]]:
    """Second moments of each solid, approximated by those of its box, and the asymmetry of its distance between sides.

    Both turn and mirror with the solid, and do not depend on the order of its axes.
    """
    spread, leans = torch.zeros_like(scene.rotation), torch.zeros_like(scene.centre)
    signs = torch.cartesian_prod(*[torch.tensor([-1.0, 0.0, 1.0], dtype=torch.float64)] * 3)
    for kind in scene.kinds:
        mask = scene.mask & (scene.kind == kind)
        size, rotation = scene.size[mask], scene.rotation[mask]
        half = primitives[kind].bound(size)
        positions = signs * half[:, None]
        level = primitives[kind].distance(positions, size[:, None].expand(*positions.shape[:2], SIZES))
        lean = level @ signs / len(signs)
        twist = torch.einsum("mp,mpi,mpj->mij", level, positions, positions) / len(signs) / half.amax(-1)[:, None, None]
        twist = twist - torch.diag_embed(twist.diagonal(dim1=-2, dim2=-1))
        local = torch.diag_embed(half**2) + twist
        spread[mask] = rotation @ local @ rotation.mT
        leans[mask] = (rotation @ lean[..., None])[..., 0]
    return spread, leans


def _kind(node: Node) -> str:
    if isinstance(node, Loop):
        return f"{node.name} {node.count} {' '.join(_kind(inner) for inner in node.body)}"
    return node.name


def distinct(nodes: Sequence[Node]) -> list[Node]:
    """The candidates without later ones of the same kind and nearly the same moments, in their order."""
    if not nodes:
        return []
    stats = moments(nodes)
    kind = np.unique(stats.kind, return_inverse=True)[1]
    order = np.round(np.log2(np.maximum(stats.size, SAME)))  # order of magnitude
    features = np.concatenate([stats.middle, stats.spread.reshape(-1, 9) / np.maximum(stats.size, SAME)[:, None]], 1)
    key = np.column_stack([kind, order, np.round(features / (SAME * 2 ** order[:, None]))])
    return [nodes[k] for k in np.sort(np.unique(key, axis=0, return_index=True)[1])]
