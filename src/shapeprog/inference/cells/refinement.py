"""Refinement: all continuous parameters of a program, by gradient of a chamfer distance through the renderer.

One direction is exact: target points to the surface of the union by signed distance; points sampled on the visible
surface have their nearest target points.
"""

from __future__ import annotations

import math

import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.geometry.arrays import one_tensor_thread
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.nearest import squared_distance
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.budget import NEVER, Deadline
from shapeprog.inference.fit.tunable import Tunable
from shapeprog.language.program import Program

REACH = 1.49
"""Largest change of a parameter from a whole number, in cells: rounding and one step lead back."""


def refined(
    program: Program,
    target: Float[Tensor, "P 3"],
    *,
    steps: int = 50,
    rate: float = 0.12,
    seed: int = 0,
    deadline: Deadline = NEVER,
) -> Program:
    """The same program with continuous parameters, each within ``REACH`` of that of ``program``.

    Parameters
    ----------
    target
        Points on the surface of the target, in the grid frame, finite; at least one.
    steps
        Gradient steps, of 1,000 target points and 1,000 points of the program each.
    rate
        First step size of Adam in cells; it falls to a tenth by a cosine.
    seed
        Of the points that each step draws.
    deadline
        When no further step starts.
    """
    points = target.double()
    if not program.size:
        return program
    tunable = Tunable(program)
    values = tunable.values
    low, high = torch.maximum(tunable.low, values - REACH), values + REACH
    moved = values.clone().requires_grad_()
    mean, square = torch.zeros_like(values), torch.zeros_like(values)
    generator = torch.Generator().manual_seed(seed)
    with one_tensor_thread(kernels=1):
        for step in range(steps):
            if deadline.passed(f"the refinement after {step} of {steps} steps"):
                break
            scene = tunable.scene(moved)
            if not bool(scene.mask.any()):
                break
            some = points[torch.randint(len(points), (1000,), generator=generator)]
            sample = sample_surface(scene, 1000, generator)
            surface_loss = (squared_distance(sample.points, points) * sample.weights).mean()
            loss = (signed_distance(scene, some) ** 2).mean() + surface_loss
            (slope,) = torch.autograd.grad(loss, moved)
            slope = slope.nan_to_num(0)
            # Adam (Kingma & Ba 2015) by hand: the first use of torch.optim imports its compiler, for 1.5 s.
            mean.lerp_(slope, 1 - 0.8)
            square.lerp_(slope**2, 1 - 0.95)
            pace = rate * (0.55 + 0.45 * math.cos(math.pi * step / steps)) / (1 - 0.8 ** (step + 1))
            with torch.no_grad():
                moved.sub_(pace * mean / ((square / (1 - 0.95 ** (step + 1))).sqrt() + 1e-8))
                moved.copy_(torch.minimum(torch.maximum(moved, low), high))
    return tunable.settled(moved.detach())
