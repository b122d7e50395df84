"""The cells of a program that are compared with the touched cells of a shape."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int
from torch import Tensor

from shapeprog.data.voxelise import voxelise_mesh
from shapeprog.errors import ShapeProgError
from shapeprog.geometry import cells
from shapeprog.geometry.mesh import union_mesh
from shapeprog.geometry.scene import Scene
from shapeprog.language.program import Program
from shapeprog.language.statement import language
from shapeprog.language.unroll import unroll
from shapeprog.space import RESOLUTION


def occupied(program: Program, scene: Scene, snapped: Program | None = None) -> Int[Tensor, "32 32"]:
    """The packed cells whose share with those of a target is measured.

    Those of the whole-numbered program, as published, if all statements are of the kind that generators are taught: by
    default of the program rounded.  Of others, whose parts may be thinner than a cell, those that the solid touches.
    """
    if snapped is None and not all(language()[node.name].taught for node in program.walk()):
        try:
            return cells.pack(voxelise_mesh(*union_mesh(scene)))
        except ShapeProgError:  # nothing in it has a volume
            return cells.pack(np.zeros((RESOLUTION,) * 3, np.bool_))
    return cells.rasterise(unroll(program.snap() if snapped is None else snapped))
