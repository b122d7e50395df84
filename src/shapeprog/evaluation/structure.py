"""The structure of a program that matters in editing: slivers, pieces."""

from __future__ import annotations

import torch

from shapeprog.evaluation.likeness import Triangles
from shapeprog.geometry.mesh import pieces
from shapeprog.geometry.primitives import primitives
from shapeprog.geometry.scene import Scene
from shapeprog.space import SPAN

SLIVER = 0.004
"""Share of the longest side of the target below which a primitive is too thin to be a part."""


def slivers(scene: Scene) -> float:
    """Share of the primitives of a scene that are thinner than ``SLIVER``; not a number where there are none.

    The thickness is that of the local bounding box of the primitive without its shear.
    """
    thin = []
    for kind in scene.kinds:
        size = scene.size[scene.mask & (scene.kind == kind)]
        straight = torch.where(torch.arange(size.shape[-1]) < primitives[kind].extents, size, 0)
        thin.append(2 * primitives[kind].bound(straight).amin(-1) < SLIVER * SPAN)
    return float(torch.cat(thin).double().mean()) if thin else float("nan")


def one_piece(union: Triangles | None) -> float:
    """1 where a union is one connected solid, 0 where it is several; not a number where there is none."""
    return float("nan") if union is None else float(pieces(*union) == 1)
