"""Straight faces of parts onto the planes of a mesh: a plane is exact, a fit to samples is not.

A least-squares fit leaves a face between two planes that it may stand for, and has few samples on small faces.  Here
each face is assigned the plane nearby that covers most of it.  Where faces that share a number disagree, the number
follows the larger area: weights are those of Cauchy, by iteratively reweighted least squares (Holland & Welsch 1977).
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
from shapeprog.inference.fit.tunable import THINNEST, Poses, Tunable
from shapeprog.inference.surface.components import Components
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.inference.surface.oriented import LEAN, Boxes
from shapeprog.language.program import Program
from shapeprog.space import FloatArray, IntArray


class Faces(NamedTuple):
    """Faces of boxes along the axes of the grid, with the planes on which they should lie."""

    slot: IntArray  # index of the primitive (R,)
    axis: IntArray  # axis of the normal (R,)
    side: IntArray  # -1 for the low, 1 for the high face (R,)
    target: FloatArray  # coordinate of the plane (R,), in cells; that of the face itself where it has none
    weight: FloatArray  # area that the plane covers (R,), as a share of the mesh; little where there is none

    def residuals(self, poses: Poses) -> tuple[FloatArray, FloatArray]:
        """The distances of the faces from their planes (R,), and their derivatives by the numbers (R, F)."""
        scene, slopes = poses
        along = scene.rotation[self.slot, self.axis].abs().argmax(-1)
        face = scene.centre[self.slot, self.axis].numpy() + self.side * scene.size[self.slot, along].numpy()
        moves = slopes[self.slot, SIZES + self.axis].numpy() + self.side[:, None] * slopes[self.slot, along].numpy()
        return face - self.target, moves


def faces_of(scene: Scene, mesh: Components) -> Faces:
    """The straight faces of the boxes of a scene (N,), and the planes of a mesh on which they should lie."""
    centre, half, rotation = (tensor.numpy() for tensor in (scene.centre, scene.reach, scene.rotation))
    kind, upright = scene.kind.numpy(), scene.size[:, LEAN].numpy() == 0
    square = ((kind == KINDS["cuboid"]) & upright) | (kind == KINDS["rounded_box"])
    slots = np.flatnonzero(scene.mask.numpy() & square & Boxes(centre, rotation, half).straight).tolist()
    normals, corners = triangle_normals(mesh.vertices, mesh.faces)[1], mesh.vertices[mesh.faces]
    rows = list[tuple[int, int, int, float, float]]()
    for axis in range(3):
        level = corners[np.abs(normals[:, axis]) >= FIT.level]
        level = level[np.argsort(level[..., axis].mean(1), kind="stable")]
        height, flat = level[..., axis].mean(1), np.delete(level, axis, 2)
        low, high = flat.min(1), flat.max(1)
        for slot in slots:
            middle, reach = np.delete(centre[slot], axis), np.delete(half[slot], axis)
            total, ends = float((2 * reach).prod()), centre[slot, axis] + half[slot, axis] * np.array([-1.0, 1.0])
            planes = []
            for end in ends.tolist():
                near = slice(*np.searchsorted(height, [end - FIT.plane_reach, end + FIT.plane_reach]))
                # The shared area of right triangles along the axes, and an upper bound of that of others.
                shared = np.minimum(high[near], middle + reach) - np.maximum(low[near], middle - reach)
                planes.append(_plane(end, height[near], shared.clip(0).prod(1) / 2, total))
            (first, _), (last, _) = planes
            if last - first < THINNEST:  # one plane for both faces, of which the nearer one takes it
                farther = int(abs(first - ends[0]) < abs(last - ends[1]))
                planes[farther] = float(ends[farther]), 0.0
            for side, (plane, area) in zip((-1, 1), planes, strict=True):
                rows.append((slot, axis, side, plane, area or FIT.uncovered * total))
    *which, target, weight = np.array(rows, np.float64).reshape(-1, 5).T
    owner, axes, sides = np.array(which, np.int64)
    return Faces(owner, axes, sides, target, weight / mesh.area.sum())


def _plane(face: float, heights: FloatArray, shared: FloatArray, total: float) -> tuple[float, float]:
    """The coordinate of the plane of a face of area ``total``, and how much of it this covers; its own and zero if it
    has none.  Triangles at these heights (T,), in order, share so much area (T,) with the face."""
    heights, shared = heights[shared > 0], shared[shared > 0]
    first = np.flatnonzero(np.diff(heights, prepend=-np.inf) > FIT.plane_step)
    if not len(first):
        return face, 0.0
    sums = np.add.reduceat(shared, first)
    planes = np.add.reduceat(shared * heights, first) / sums
    wide = np.maximum.reduceat(heights, first) - heights[first] > FIT.plane_width  # a surface that is curved
    areas = np.where(wide, 0.0, np.minimum(sums, total))
    score = areas * np.exp(-(((planes - face) / FIT.plane_falloff) ** 2))
    best = int(score.argmax())
    return (float(planes[best]), float(areas[best])) if score[best] >= FIT.covered * total else (face, 0.0)


def on_planes(program: Program, evidence: Evidence) -> Program:
    """The program with the straight faces of its boxes on the planes of a mesh that cover them, where there are any."""
    if not program.size or evidence.mesh is None:
        return program
    tunable = Tunable(program)
    poses = tunable.poses(tunable.values)
    faces = faces_of(poses.scene, evidence.mesh)
    residuals, slopes = faces.residuals(poses)
    # A box that is turned or sheared would leave all of its planes.
    cuboids = poses.scene.kind == KINDS["cuboid"]
    bent = tunable.are("angle") | (poses.slopes[cuboids, LEAN] != 0).any(0)
    slopes[:, bent.numpy()] = 0.0
    # The prior of places holds sizes as well: that of sizes outweighs the area of a small face.
    prior = np.diag(FIT.place_prior * tunable.scale.numpy() ** 2)
    robust: FloatArray = np.ones(len(residuals))
    for _ in range(FIT.reweighted):
        weighted = (robust * faces.weight)[:, None] * slopes
        move = torch.from_numpy(np.linalg.solve(weighted.T @ slopes + prior, weighted.T @ residuals))
        robust = 1 / (1 + ((residuals - slopes @ move.numpy()) / FIT.on_plane) ** 2)
    return tunable.with_values((tunable.values - move).maximum(tunable.low))
