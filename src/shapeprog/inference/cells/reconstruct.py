"""Programs in the statements of the paper for the cells of a shape: searched with whole numbers, then fitted."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.data.shape import Shape
from shapeprog.data.touched import occupied
from shapeprog.geometry.cells import iou, pack
from shapeprog.geometry.distance import nearest_primitive
from shapeprog.inference.budget import NEVER, Deadline, Progress
from shapeprog.inference.cells.blocks import to_program
from shapeprog.inference.cells.refinement import REACH, refined
from shapeprog.inference.cells.search import search_structure
from shapeprog.inference.cells.settings import Settings
from shapeprog.inference.choice.coverage import Prices
from shapeprog.inference.fit.adjustment import adjust
from shapeprog.inference.surface.evidence import Evidence, points_of_cells
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll


def reconstruct(
    shape: Shape,
    evidence: Evidence,
    *,
    settings: Settings,
    tied: bool = False,
    seed: int = 0,
    searching: Deadline = NEVER,
    refining: Deadline = NEVER,
    progress: Progress | None = None,
) -> tuple[Program, Program, str]:
    """The program of at most ``settings.blocks`` blocks whose cells are near those of a shape; the same for one seed.

    Parameters
    ----------
    shape, evidence
        A shape, whose cells are searched, and its surface, to which the numbers are fitted.
    tied
        Whether the numbers will be tied: they are then fitted to the faces of the surface, which ties can keep; else by
        the chamfer distance, which is that of the paper.
    searching, refining
        When no further round of the search, and no further step of fitting, starts.
    progress
        Called with the name of the current step and the completed share of it.

    Returns
    -------
    program, snapped
        In the statements of the paper: with continuous numbers, and with whole ones, each within one of the rounded
        number of ``program``.
    reason
        Why the search stopped, as a sentence.
    """
    found, stopped = search_structure(shape.voxels, settings, seed=seed, deadline=searching, progress=progress)
    snapped = to_program(found)
    if tied:
        program = adjust(snapped, evidence, reach=REACH, seed=seed, deadline=refining, progress=progress)
    else:
        program = refined(snapped, outer_points(shape, snapped), seed=seed, deadline=refining)
    reason = f"The search ended after {stopped}"
    if searching.cut:
        reason += "."
    elif snapped.blocks >= settings.blocks:
        reason += f"; the limit of --blocks {settings.blocks} is reached, raise it for more."
    else:
        reason += f"; {snapped.blocks} of {settings.blocks} drawing statements are in use, another would improve the "
        reason += "fit too little."
    return program, snapped, reason


def description_length(program: Program, voxels: npt.NDArray[np.bool_], snapped: Program | None = None) -> float:
    """Description length of cells (32, 32, 32) by a program: 1 - IoU, plus the price of its text."""
    return 1 - float(iou(occupied(program, unroll(program), snapped), pack(voxels))) + Prices().of(program)


def outer_points(shape: Shape, snapped: Program) -> Float[Tensor, "P 3"]:
    """Points that the surface of the program should meet.

    Points deeper than 2.5 cells inside the snapped solid lie on inner faces of the mesh, such as the back of a drawer.
    The surface of a union cannot reach them; in the loss they would pull its outer faces inwards.
    """
    if shape.points is None:
        return torch.from_numpy(points_of_cells(shape.voxels))
    points = torch.from_numpy(np.asarray(shape.points, np.float32))
    outer = points[nearest_primitive(unroll(snapped), points)[1] > -2.5] if snapped.size else points
    return outer if len(outer) else points
