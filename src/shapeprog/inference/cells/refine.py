"""Refinement: all continuous parameters of a program together, by gradient through the renderer.

The loss has both directions of a chamfer distance, one of them exact: target points to the surface of the union by
signed distance, and points sampled on the visible surface to their nearest target points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.errors import InputError
from shapeprog.geometry.arrays import one_tensor_thread
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.nearest import squared_distance
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.budget import NEVER, Deadline, Progress
from shapeprog.inference.fit.tunable import Tunable
from shapeprog.language.program import Program
from shapeprog.space import HALF

REACH = 1.49
"""Largest change of a parameter from a whole number, in cells: rounding and one step lead back."""


@dataclass(frozen=True)
class Schedule:
    """Steps and step size of refinement; chosen on val.

    Parameters
    ----------
    steps
        Gradient steps.
    rate
        First step size of Adam in cells; it falls to a tenth by a cosine.
    points
        Random target points of one step.
    samples
        Points sampled on the surface of the program in one step.
    cells
        Cells near the surface whose occupancy enters one step, where the target has cells.
    """

    steps: int = 50
    rate: float = 0.12
    points: int = 1000
    samples: int = 1000
    cells: int = 1000


def refine(
    program: Program,
    target: Float[Tensor, "P 3"],
    *,
    voxels: npt.NDArray[np.bool_] | None = None,
    schedule: Schedule | None = None,
    reach: float | None = None,
    seed: int = 0,
    deadline: Deadline = NEVER,
    progress: Progress | None = None,
) -> Program:
    """The same program with parameters that fit target points (P, 3) on a surface, in the grid frame.

    Parameters
    ----------
    voxels
        Touched cells (32, 32, 32) of the target, whose soft occupancy the program should match as well; for targets
        that are given as cells.
    schedule
        Steps, step size and numbers of points.
    reach
        Largest change of any parameter in cells; unlimited by default.
    deadline
        When no further step starts.

    Raises
    ------
    InputError
        If there are no target points or some are not finite.
    """
    plan = schedule or Schedule()
    points = torch.as_tensor(target, dtype=torch.float64)
    if not len(points) or not bool(torch.isfinite(points).all()):
        raise InputError("refinement needs finite target points", "load the target with shapeprog.load_shape")
    if not program.size:
        return program
    tunable = Tunable(program)
    values, low, high = tunable.values, tunable.low, torch.full_like(tunable.values, torch.inf)
    if reach is not None:
        low, high = torch.maximum(low, values - reach), values + reach
    moved = values.clone().requires_grad_()
    mean, square = torch.zeros_like(values), torch.zeros_like(values)
    generator = torch.Generator().manual_seed(seed)
    shell = None if voxels is None else _shell(voxels)
    with one_tensor_thread(kernels=1):
        for step in range(plan.steps):
            if deadline.passed(f"the refinement after {step} of {plan.steps} steps"):
                break
            scene = tunable.scene(moved)
            if not bool(scene.mask.any()):
                break
            some = points[torch.randint(len(points), (plan.points,), generator=generator)]
            sample = sample_surface(scene, plan.samples, generator)
            surface_loss = (squared_distance(sample.points, points) * sample.weights).mean()
            loss = (signed_distance(scene, some) ** 2).mean() + surface_loss
            if shell is not None:
                cells = torch.randint(len(shell), (plan.cells,), generator=generator)
                loss = loss + 0.3 * _occupancy_loss(scene, shell[cells])
            moved.grad = None
            loss.backward()
            assert moved.grad is not None
            slope = moved.grad.nan_to_num_(0)
            # Adam (Kingma & Ba 2015) by hand: the first use of torch.optim imports its compiler, for 1.5 s.
            mean.lerp_(slope, 1 - 0.8)
            square.lerp_(slope**2, 1 - 0.95)
            rate = plan.rate * (0.55 + 0.45 * math.cos(math.pi * step / plan.steps)) / (1 - 0.8 ** (step + 1))
            with torch.no_grad():
                moved.sub_(rate * mean / ((square / (1 - 0.95 ** (step + 1))).sqrt() + 1e-8))
                moved.copy_(torch.minimum(torch.maximum(moved, low), high))
            if progress:
                progress("refining", (step + 1) / plan.steps)
    return tunable.settled(moved.detach())


def _shell(voxels: npt.NDArray[np.bool_]) -> Float[Tensor, "S 4"]:
    """Centres of the cells on either side of the boundary of a solid of cells, and whether they are in it."""
    from scipy import ndimage

    inner = ndimage.binary_erosion(voxels)
    outer = ndimage.binary_dilation(voxels)
    cells = np.argwhere(outer & ~inner)
    inside = voxels[tuple(cells.T)]
    return torch.from_numpy(np.column_stack([cells - HALF + 0.5, inside]).astype(np.float64))


def _occupancy_loss(scene: Scene, cells: Float[Tensor, "S 4"]) -> Float[Tensor, ""]:
    """Cross-entropy of touched cells: a solid touches a cell when it comes within half a cell of its centre."""
    logits = 6 * (0.5 - signed_distance(scene, cells[:, :3]))
    return torch.nn.functional.binary_cross_entropy_with_logits(logits, cells[:, 3])
