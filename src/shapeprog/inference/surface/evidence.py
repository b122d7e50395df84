"""What is known of a target: points of its surface that a program should explain, and space that it should leave free.

=======  ============================================  ==========================================================
target   points and normals                            space known to be free
=======  ============================================  ==========================================================
mesh     drawn by area; faces that are doubled once    what can be seen from outside
points   as they are; normals of the planes near them  what can be seen through: a missing side shows nothing
cells    the exposed faces of the cells                the empty cells
=======  ============================================  ==========================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from shapeprog.data.sampling import sample_with_faces
from shapeprog.data.shape import Shape
from shapeprog.data.voxelise_kernels import mark_triangles
from shapeprog.geometry.arrays import over_threads
from shapeprog.geometry.mesh import union_mesh
from shapeprog.inference.surface.cells import INSET, exposed, exposed_faces
from shapeprog.inference.surface.cloud import planes, points_of_scan
from shapeprog.inference.surface.components import Components, components, solid_sides
from shapeprog.inference.surface.evidence_kernels import look_out
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import HALF, RESOLUTION, SPAN, FloatArray

POINTS, SURFACE = 6_000, 40_000
"""Points that are to be explained, and points of the same surface that tell whether a program has a reason."""

TOLERANCE = 0.008 * SPAN
"""How far a surface may be from a clean point and explain it; .8 % of the longest side."""

NOISE = 2.0
"""The same for scans, in standard deviations of their noise."""

CELL_TOLERANCE = 0.65
"""The same for cells: a surface is anywhere within the cells that it touches."""

THIN = 0.5
"""Thickness of what is one cell thick, on average: .50 of parts of furniture (IKEA, val)."""

AGREEMENT, SCANNED = 0.5, 0.6
"""Least cosine between normals that fit; and of scans, of which noise could pass for a surface otherwise.

It only tells sides apart: near an edge of a thin part the nearest surface is often another, a slope of cells a stair.
"""

HIDDEN = 0.1
"""Weight of a point that cannot be seen from outside."""

MOST_TOLERANCE = 0.75
"""Beyond this a scan says too little about where its surface is: nothing is gained by believing it more."""

NEIGHBOURS = 16
"""Points of a scan that make a plane."""

FLAT = 0.25
"""Quantile of the noise about such planes that is believed: at edges and in thin parts they do not fit anyway."""

AGREED = 0.95
"""Share of the normals known to point outwards, or inwards, that must agree before those of all are believed."""

LOOKING, FREE = 128, 64
"""Cells along each side of the grids in which points look outwards, and in which space is free."""

WALL = 0.5 + 1e-6
"""Half the side in cells of what a triangle must meet: the longest side ends where cells do, and rounding would leave
holes in faces there, through which the whole inside is seen."""

DIRECTIONS = 32
"""Directions in which they look; half of them, and their opposites, where both ways must be clear."""

CLEAR, CLEAR_THROUGH = 2, 4
"""Of these, how many must be clear for a cell to be free; and where both ways must be: scans have holes."""

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Evidence:
    """What is known of a target, in the grid frame.

    Parameters
    ----------
    points, normals, weights
        Points (P, 3) to be explained, their unit normals (P, 3), zero where unknown; and what each counts (P,), 1 in
        all.
    outward
        Whose normals are known to point outwards (P,); others are of either sign.
    tolerance, agreement
        A surface explains a point within this distance, if the cosine between the normals is at least this.
    surface, surface_normals, reach
        The same surface in more points (Q, 3): a program has a reason for a surface where one of them is within
        ``reach`` and has a fitting normal.
    surface_outward
        Which of these normals are known to point outwards (Q,), as they bound a solid: what faces the other way
        within it has no reason there.
    area
        Area in cells that all points stand for, each for its weight.
    free
        Cells (R, R, R) of the cube of the grid that are known to be free; other space may be free or not.
    """

    points: FloatArray
    normals: FloatArray
    weights: FloatArray
    outward: Flags
    tolerance: float
    agreement: float
    surface: FloatArray
    surface_normals: FloatArray
    surface_outward: Flags
    reach: float
    area: float
    free: Flags


def evidence_of(shape: Shape, seed: int = 0) -> Evidence:
    """The evidence of a shape, from the best that it has: its mesh, its points, or its cells."""
    if shape.vertices is not None and shape.faces is not None and len(shape.faces):
        mesh = components(shape.vertices, shape.faces)
        if len(mesh.area):
            return _of_mesh(mesh, seed)
    if shape.points is not None and len(shape.points) > NEIGHBOURS:
        return _of_points(points_of_scan(shape), shape.voxels, seed)
    return _of_cells(shape.voxels)


def evidence_of_program(program: Program, seed: int = 0) -> Evidence:
    """The evidence of what a program draws, as if it had been given as a mesh.

    A ``ShapeProgError`` if nothing in it has a volume.
    """
    return _of_mesh(components(*union_mesh(unroll(program))), seed)


def _of_mesh(mesh: Components, seed: int) -> Evidence:
    samples, face = sample_with_faces(mesh.vertices, mesh.faces, SURFACE, seed)
    surface, corners = samples.astype(np.float64), mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[face]
    side = solid_sides(mesh)[face]
    normals = np.where(side < 0, -1, 1)[:, None] * across / np.linalg.norm(across, axis=1, keepdims=True)
    barrier = touched(corners, LOOKING)
    points = surface[:POINTS]
    front, back = (visible(points, sign * normals[:POINTS], barrier) for sign in (1, -1))
    weights = np.where(front | back, 1.0, HIDDEN)
    facing, oriented = outward(normals[:POINTS], front, back)
    area = float(mesh.area.sum())
    coarse: Flags = np.any(barrier.reshape((FREE, LOOKING // FREE) * 3), (1, 3, 5))
    return Evidence(
        points, facing, weights / weights.sum(), oriented, TOLERANCE, AGREEMENT, surface, normals, side != 0,
        _reach(TOLERANCE, area), area * float(weights.mean()), free_cells(coarse, surface, through=False),
    )  # fmt: skip


def _of_points(surface: FloatArray, voxels: Flags, seed: int) -> Evidence:
    """Of a scan: its noise is that about the planes, and the area what the distances between its points say."""
    normals, noise, point_area = local_planes(surface)
    selected = np.sort(np.random.default_rng(seed).permutation(len(surface))[:POINTS])
    tolerance, area = min(max(TOLERANCE, NOISE * noise), MOST_TOLERANCE), point_area * len(surface)
    reach = _reach(tolerance, area, len(surface))
    fine = voxels.repeat(FREE // RESOLUTION, 0).repeat(FREE // RESOLUTION, 1).repeat(FREE // RESOLUTION, 2)
    free = free_cells(fine, surface, through=True)
    weights, points = np.full(len(selected), 1 / len(selected)), surface[selected]
    above = 1.5 * RESOLUTION / FREE * normals[selected]
    facing, oriented = outward(normals[selected], *(_within(free, points + sign * above) for sign in (1, -1)))
    return Evidence(
        points, facing, weights, oriented, tolerance, SCANNED, surface, normals,
        np.zeros(len(surface), np.bool_), reach, area, free,
    )  # fmt: skip


def _of_cells(voxels: Flags) -> Evidence:
    """Of cells: one point for each exposed face, where the surface below it probably is; see ``INSET``.

    What is one cell thick has a thickness all the same: its two sides do not pass each other.
    """
    faces, occupied = exposed_faces(voxels), np.argwhere(voxels)
    cells, axis, sign = faces[:, :3], faces[:, 3], faces[:, 4]
    low, high = occupied.min(0)[axis], occupied.max(0)[axis] + 1
    coordinate = cells[np.arange(len(faces)), axis]
    exact = (high - low == SPAN) & (coordinate == np.where(sign < 0, low, high - 1))
    single = exposed(voxels, cells, axis, 1) & exposed(voxels, cells, axis, -1)
    inset = np.where(exact, 0.0, np.where(single, (1 - THIN) / 2, INSET))
    normals = sign[:, None] * np.eye(3)[axis]
    surface = cells + 0.5 - HALF + (0.5 - inset)[:, None] * normals
    count = len(surface)
    return Evidence(
        surface, normals, np.full(count, 1 / count), np.ones(count, np.bool_), CELL_TOLERANCE, AGREEMENT,
        surface, normals, np.zeros(count, np.bool_), _reach(CELL_TOLERANCE, count, count), float(count), ~voxels,
    )  # fmt: skip


def _reach(tolerance: float, area: float, count: int = SURFACE) -> float:
    """One and a half tolerances, or as far as four of so many points are found on a plane."""
    return max(1.5 * tolerance, math.sqrt(4 * area / (math.pi * max(count, 1))))


def touched(triangles: FloatArray, resolution: int) -> Flags:
    """The cells (R, R, R) of the cube of the grid that triangles (F, 3, 3) touch."""
    cells = np.zeros((resolution,) * 3, np.bool_)
    mark_triangles(np.ascontiguousarray((triangles + HALF) * (resolution / RESOLUTION)), WALL, cells)
    return cells


def visible(points: FloatArray, normals: FloatArray, barrier: Flags) -> Flags:
    """Which points (P,) of a surface can be seen from outside on the side that their normals point to; ``barrier`` are
    the cells it touches."""
    scale = len(barrier) / RESOLUTION
    offset = normals / np.maximum(np.abs(normals).max(1, keepdims=True), 1e-9)
    starts = (points + HALF) * scale + 1.5 * offset  # out of the cells that the surface itself touches
    return looking(barrier, starts, directions(DIRECTIONS), 1, through=False)


def outward(normals: FloatArray, front: Flags, back: Flags) -> tuple[FloatArray, Flags]:
    """Normals (P, 3) turned outwards, and of which of them it is known where that is (P,).

    It is where only the front or only the back of a point is free; and everywhere, thin parts included, if nearly all
    such normals agree, as those of a mesh do whose faces are all wound the same way.
    """
    oriented = (front != back) & ((normals**2).sum(1) > 0.25)
    share = float(front[oriented].mean()) if oriented.any() else 0.5
    if max(share, 1 - share) >= AGREED:
        return normals * (1.0 if share > 0.5 else -1.0), np.ones(len(oriented), np.bool_)
    return normals * np.where(oriented & back, -1.0, 1.0)[:, None], oriented


def _within(cells: Flags, points: FloatArray) -> Flags:
    """Which points (P,) of the grid lie in cells that are set."""
    index = np.floor((points + HALF) * (len(cells) / RESOLUTION)).astype(np.int64).clip(0, len(cells) - 1)
    inside: Flags = cells[tuple(index.T)]
    return inside


def free_cells(barrier: Flags, surface: FloatArray, *, through: bool) -> Flags:
    """The cells (R, R, R) from which enough directions lead out of the grid; ``through``: both ways.

    All that lies beyond the box of the surface is free; or, of a scan, not known to be: it may have been left out.
    """
    scale = len(barrier) / RESOLUTION
    low, high = ((end + HALF) * scale for end in (surface.min(0), surface.max(0)))
    starts = np.argwhere(np.ones_like(barrier)) + 0.5
    within = ((starts >= low) & (starts <= high)).all(1).reshape(barrier.shape)
    free: Flags = ~(barrier | within) & (not through)
    steps, minimum = (directions(DIRECTIONS)[::2], CLEAR_THROUGH) if through else (directions(DIRECTIONS), CLEAR)
    free[within] = looking(barrier, starts[within.reshape(-1)], steps, minimum, through=through)
    return free


def directions(count: int) -> FloatArray:
    """Directions (count, 3) spread evenly over the sphere on a spiral, the largest coordinate 1 or -1."""
    height = 1 - (2 * np.arange(count) + 1) / count
    turn = np.arange(count) * math.pi * (3 - math.sqrt(5))
    around = np.sqrt(1 - height**2)
    steps = np.stack([height, around * np.cos(turn), around * np.sin(turn)], 1)
    return steps / np.abs(steps).max(1, keepdims=True)


def looking(barrier: Flags, starts: FloatArray, steps: FloatArray, minimum: int, *, through: bool) -> Flags:
    """Which starts (N,) have so many directions that lead out of the grid; see the kernel."""
    result = np.zeros(len(starts), np.bool_)
    data = barrier, np.ascontiguousarray(starts), np.ascontiguousarray(steps), minimum, through, result
    over_threads(partial(look_out, *data), len(starts), least=1024)
    return result


def local_planes(points: FloatArray) -> tuple[FloatArray, float, float]:
    """Normals (P, 3) of the planes through the neighbours of each point, noise about them, and area of each point."""
    from scipy.spatial import cKDTree

    distance, neighbours = cKDTree(points).query(points, k=NEIGHBOURS)
    normals, squared = planes(points, neighbours)
    noise = float(np.quantile(np.sqrt(squared / (NEIGHBOURS - 3)), FLAT))
    area = float(np.median(distance[:, -1]) ** 2 * math.pi / (NEIGHBOURS - 1))
    return normals, noise, area
