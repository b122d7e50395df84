"""Programs in the statements of the paper for the cells of a shape: searched with whole numbers, then fitted."""

from __future__ import annotations

import math

import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.data.cells import points_of_cells
from shapeprog.data.shape import Shape
from shapeprog.formats.samples import occupied
from shapeprog.geometry.arrays import one_thread
from shapeprog.geometry.cells import iou, pack
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.nearest import squared_distance
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.budget import NEVER, Deadline, Progress
from shapeprog.inference.cells.blocks import to_program
from shapeprog.inference.cells.search import search_structure
from shapeprog.inference.cells.settings import Settings
from shapeprog.inference.choice.coverage import Prices
from shapeprog.inference.fit.adjustment import adjust
from shapeprog.inference.fit.tunable import Tunable
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import BoolArray

REACH = 1.49  # largest change of a parameter from a whole number, in cells: rounding and one step lead back

STEPS, DRAWN, RATE = 50, 1000, 0.12
"""Number of steps by the chamfer distance, points of the target and of the program that each draws, and length of the
first step in cells; it falls to a tenth by a cosine."""


def reconstruct(
    shape: Shape,
    evidence: Evidence,
    *,
    settings: Settings,
    tied: bool,
    seed: int,
    searching: Deadline,
    refining: Deadline,
    progress: Progress | None,
) -> tuple[Program, Program, str]:
    """The program of at most ``settings.blocks`` blocks whose cells are near those of a shape; the same for one seed.

    Its numbers are fitted to the faces of the surface, which ties can keep, if they will be ``tied``; else by the
    chamfer distance, which is that of the paper.  No further round of the search starts after ``searching``, and no
    further step of fitting after ``refining``.

    Returns the program with continuous numbers, the same with whole ones, each within one of the rounded number of the
    first, and a sentence that says why the search stopped.  Both are in the statements of the paper.
    """
    blocks, stopped = search_structure(shape.voxels, settings, seed=seed, deadline=searching, progress=progress)
    snapped = to_program(blocks)
    if tied:
        program = adjust(snapped, evidence, reach=REACH, seed=seed, deadline=refining, progress=progress)
    else:
        points = points_of_cells(shape.voxels) if shape.points is None else evidence.points
        program = refined(snapped, torch.from_numpy(points), seed=seed, deadline=refining)
    if searching.cut:
        advice = ""
    elif snapped.blocks >= settings.blocks:
        advice = f"; the limit of --blocks {settings.blocks} is reached, raise it for more"
    else:
        used = f"{snapped.blocks} of {settings.blocks} drawing statements are in use"
        advice = f"; {used}, another would improve the fit too little"
    return program, snapped, f"The search ended after {stopped}{advice}."


def description_length(program: Program, voxels: BoolArray, snapped: Program | None = None) -> float:
    """Description length of cells (32, 32, 32) by a program: 1 - IoU, plus the price of its text."""
    return 1 - float(iou(occupied(program, unroll(program), snapped), pack(voxels))) + Prices().of(program)


def refined(program: Program, target: Float[Tensor, "P 3"], *, seed: int = 0, deadline: Deadline = NEVER) -> Program:
    """The same program with continuous parameters, each within ``REACH`` of that of ``program``, by a chamfer distance.

    Of its two directions one is exact: points on the surface of the target (P, 3), at least one, to the surface of the
    union by signed distance; points sampled on the visible surface have their nearest target points.  The seed is that
    of the points that each step draws.
    """
    if not program.size:
        return program
    points, tunable = target.double(), Tunable(program)
    values = tunable.values
    low, high = torch.maximum(tunable.low, values - REACH), values + REACH
    mean, square = torch.zeros_like(values), torch.zeros_like(values)
    generator = torch.Generator().manual_seed(seed)
    with one_thread(kernels=1):
        for step in range(STEPS):
            if deadline.passed(f"the refinement after {step} of {STEPS} steps"):
                break
            moved = values.clone().requires_grad_()
            scene = tunable.scene(moved)
            some = points[torch.randint(len(points), (DRAWN,), generator=generator)]
            sample = sample_surface(scene, DRAWN, generator)
            surface_loss = (squared_distance(sample.points, points) * sample.weights).mean()
            loss = (signed_distance(scene, some) ** 2).mean() + surface_loss
            slope = torch.autograd.grad(loss, moved)[0].nan_to_num(0)
            # Adam (Kingma & Ba 2015) by hand: the first use of torch.optim imports its compiler, for 1.5 s.
            mean.lerp_(slope, 1 - 0.8)
            square.lerp_(slope**2, 1 - 0.95)
            pace = RATE * (0.55 + 0.45 * math.cos(math.pi * step / STEPS)) / (1 - 0.8 ** (step + 1))
            values = (values - pace * mean / ((square / (1 - 0.95 ** (step + 1))).sqrt() + 1e-8)).clamp(low, high)
    return tunable.settled(values)
