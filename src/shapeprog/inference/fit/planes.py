"""Straight faces of parts onto the planes of a mesh: a plane is exact, a fit to samples is not.

A least-squares fit leaves a face between two planes that it may stand for, and has few samples on small faces.  Here
each face takes the plane that covers most of it nearby; the numbers follow by iteratively reweighted least squares
(Holland & Welsch 1977), so that faces that share a number agree on one plane.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from shapeprog.geometry.mesh import triangle_normals
from shapeprog.geometry.primitive import SIZES
from shapeprog.geometry.primitives import KINDS
from shapeprog.geometry.scene import Scene
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.fit.tunable import Poses, Tunable
from shapeprog.inference.surface.components import Components, IntArray
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.inference.surface.oriented import Boxes
from shapeprog.language.program import Program
from shapeprog.space import FloatArray


class Faces(NamedTuple):
    """Faces of boxes along the axes of the grid, and where they should be."""

    slot: IntArray  # of each (R,) its primitive,
    axis: IntArray  # the axis that it is perpendicular to,
    side: IntArray  # -1 for the low and 1 for the high face of its box,
    at: FloatArray  # the coordinate of its plane, or its own where it has none,
    weight: FloatArray  # and how much of it the plane covers, as a share of the mesh; little where it has none

    def off(self, poses: Poses) -> tuple[FloatArray, FloatArray]:
        """How far the faces are from their planes (R,), and how that changes with the numbers (R, F)."""
        (centre, size, rotation), slopes = (poses.scene.centre, poses.scene.size, poses.scene.rotation), poses.slopes
        along = rotation[self.slot, self.axis].abs().argmax(-1)
        face = centre[self.slot, self.axis].numpy() + self.side * size[self.slot, along].numpy()
        moves = slopes[self.slot, SIZES + self.axis].numpy() + self.side[:, None] * slopes[self.slot, along].numpy()
        return face - self.at, moves


def faces_of(scene: Scene, mesh: Components) -> Faces:
    """The faces of the straight boxes of a scene (N,)."""
    centre, half, rotation = (tensor.numpy() for tensor in (scene.centre, scene.reach, scene.rotation))
    kind, upright = scene.kind.numpy(), scene.size[:, 3].numpy() == 0  # others have a lean
    square = ((kind == KINDS["cuboid"]) & upright) | (kind == KINDS["rounded_box"])
    slots = np.flatnonzero(scene.mask.numpy() & square & Boxes(centre, rotation, half).straight).tolist()
    normals, corners = triangle_normals(mesh.vertices, mesh.faces)[1], mesh.vertices[mesh.faces]
    rows = list[tuple[int, int, int, float, float]]()
    for axis in range(3):
        level = np.flatnonzero(np.abs(normals[:, axis]) >= FIT.level)
        level = level[np.argsort(corners[level, 0, axis], kind="stable")]
        height, flat = corners[level, 0, axis], np.delete(corners[level], axis, 2)
        low, high = flat.min(1), flat.max(1)
        for slot in slots:
            middle, reach = np.delete(centre[slot], axis), np.delete(half[slot], axis)
            ends = [centre[slot, axis] + side * half[slot, axis] for side in (-1, 1)]
            window = slice(*np.searchsorted(height, [ends[0] - FIT.plane, ends[1] + FIT.plane]))
            # Half of what the box around each triangle shares with the face.
            shared = np.minimum(high[window], middle + reach) - np.maximum(low[window], middle - reach)
            covered, total = shared.clip(0).prod(1) / 2, float((2 * reach).prod())
            (first, one), (last, other) = (_plane(end, height[window], covered, FIT.covered * total) for end in ends)
            if one and other and last - first < FIT.sheet:  # one plane for both
                first, last = (first + side * half[slot, axis] for side in (-1, 1))
                one, other = one / 2, other / 2
            rows += [
                (slot, axis, -1, first, one or FIT.stays * total),
                (slot, axis, 1, last, other or FIT.stays * total),
            ]
    *which, at, area = np.array(rows, np.float64).reshape(-1, 5).T
    slot, axis, side = np.array(which, np.int64)
    return Faces(slot, axis, side, at, area / mesh.area.sum())


def _plane(at: float, heights: FloatArray, covered: FloatArray, least: float) -> tuple[float, float]:
    """The coordinate of a plane near a face, and how much of the face it covers; the face itself, and zero, if none
    covers enough of it."""
    near = (covered > 0) & (np.abs(heights - at) <= FIT.plane)
    heights, covered = heights[near], covered[near]
    first = np.flatnonzero(np.diff(heights, prepend=-np.inf) > FIT.one_plane)
    if not len(first):
        return at, 0.0
    areas = np.add.reduceat(covered, first)
    planes = np.add.reduceat(covered * heights, first) / areas
    score = np.where(areas >= least, areas * np.exp(-(((planes - at) / FIT.near_plane) ** 2)), 0.0)
    best = int(score.argmax())
    return (float(planes[best]), float(areas[best])) if score[best] > 0 else (at, 0.0)


def on_planes(program: Program, evidence: Evidence) -> Program:
    """The program with the straight faces of its boxes on the planes of a mesh that cover them, where there are any."""
    if not program.size or evidence.mesh is None:
        return program
    tunable = Tunable(program)
    faces = faces_of(tunable.scene(tunable.values), evidence.mesh)
    off, slopes = faces.off(tunable.poses(tunable.values))
    slopes[:, tunable.are("angle").numpy()] = 0.0
    robust: FloatArray = np.ones(len(off))
    for _ in range(FIT.reweighted):
        weighted = (robust * faces.weight)[:, None] * slopes
        curvature = weighted.T @ slopes + np.diag(FIT.place_prior * tunable.scale.numpy() ** 2)
        move = torch.from_numpy(np.linalg.solve(curvature, weighted.T @ off))
        robust = 1 / (1 + ((off - slopes @ move.numpy()) / FIT.on_plane) ** 2)
    return tunable.drawn((tunable.values - move).maximum(tunable.low))
