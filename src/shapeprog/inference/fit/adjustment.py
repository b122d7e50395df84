"""Adjustment: all continuous numbers of a program together, so that its surface lies on that of a target.

Residuals of a few steps of Gauss and Newton are distances along normals, joints between parts are kept closed, and
numbers that the target does not determine, such as the thickness behind a sheet, are held by a weak prior.
"""

from __future__ import annotations

import math

import torch

from shapeprog.data import Shape, loaded
from shapeprog.geometry.arrays import one_thread
from shapeprog.inference.budget import NEVER, Deadline, Progress
from shapeprog.inference.fit.joints import Joints, find_joints, joining, moved, needs
from shapeprog.inference.fit.residuals import System, Target, of_target
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.fit.tunable import Poses, Tunable
from shapeprog.inference.surface.evidence import Evidence, evidence_of
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.language.program import Program, program_of


def refine(program: Program, shape: Shape | str, *, seed: int = 0) -> Program:
    """The same statements and loops with numbers that fit a shape, in hundredths of cells and tenths of degrees.

    It is written out in cells: names, expressions, functions and comments are lost, as by :func:`shapeprog.inline`.  To
    fit named numbers, use :class:`shapeprog.Parametric`.

    Parameters
    ----------
    program
        A program whose surface, in the grid of the shape, is within a cell or two of that of the shape.
    shape
        A mesh, a point cloud or voxels, or the path of such a file.
    seed
        Of the samples that each step draws.

    Raises
    ------
    ShapeProgError
        If an argument is of the wrong kind.
    """
    return adjust(program_of(program, (target := loaded(shape)).frame), evidence_of(target), seed=seed)


def adjust(
    program: Program,
    evidence: Evidence,
    *,
    steps: int = FIT.steps,
    reach: float = math.inf,
    seed: int = 0,
    deadline: Deadline = NEVER,
    progress: Progress | None = None,
) -> Program:
    """The same program with numbers that fit the evidence, tidy: hundredths of cells, tenths of degrees.

    No number changes by more than ``reach``.  The seed is that of the samples that each step draws.
    """
    if not program.size:
        return program
    tunable = Tunable(program)
    values, low, high = tunable.values, (tunable.values - reach).maximum(tunable.low), tunable.values + reach
    generator, target, angles = torch.Generator().manual_seed(seed), Target(evidence), tunable.are("angle")
    narrow = FIT.explained * evidence.tolerance
    wide = max(1.2, narrow)  # in cells, at first
    weights = torch.where(tunable.are("length") | angles, FIT.measure_prior, FIT.place_prior).double()
    prior, farthest = weights * tunable.scale**2, 0.7 / tunable.scale  # a step moves the surface by up to .7 cells
    # The lowest points of scans are noise: the floor is a tolerance above them.
    floor = float(evidence.surface[:, 0].min()) + evidence.tolerance * (evidence.tolerance > SURFACE.tolerance)
    with one_thread(kernels=1):
        joints = find_joints(tunable.scene(values), floor)
        for step in range(steps):
            if deadline.passed(f"the adjustment after {step} of {steps} steps"):
                break
            done = min(step / max(steps - FIT.last, 1), 1.0)
            closing = done == 1
            if closing:
                upright = values.abs() < 0.7  # degrees
                values = torch.where(angles, tunable.rounded(values * ~upright), values)
            poses = tunable.poses(values)
            joints = moved(poses.scene, joints)
            pairs = target.pairs(poses.scene, generator)
            systems = of_target(poses, pairs, wide ** (1 - done) * narrow**done), of_joints(poses, joints, closing)
            slope, curvature = (sum(parts) for parts in zip(*systems, strict=True))
            slope, curvature = slope + prior * (values - tunable.values), curvature + torch.diag(prior)
            move, free = torch.zeros_like(values), ~(angles & closing)
            move[free] = -torch.linalg.solve(curvature[free][:, free], slope[free])
            values = (values + move.clamp(-farthest, farthest)).clamp(low, high)
            if progress:
                progress("adjusting", (step + 1) / steps)
    return tunable.settled(values)


def of_joints(poses: Poses, joints: Joints, closing: bool) -> System:
    """The part of gaps, whose weight falls where the target opens them; if closing, gaps up to a cell that would divide
    the program are closed, and feet up to .15 cells above the floor are put on it."""
    residual, slopes = needs(poses, joints)
    weight = 0.003 * (FIT.nearly**2 / (FIT.nearly**2 + residual**2)) ** 2
    if closing:
        count = len(joints.pairs)
        needed = joining(joints.pairs, residual[:count], len(poses.scene.mask), 1.0)
        needed = torch.cat([needed, residual[count:].abs() < 0.15])
        weight = torch.where(needed, 0.03, weight)
    weighted = weight[:, None] * slopes
    return weighted.T @ residual, weighted.T @ slopes
