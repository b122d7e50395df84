"""Evidence of a target: points of its surface that a program should explain, and space that it should leave free."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from shapeprog.data.cells import exposed_faces
from shapeprog.data.sampling import sample_with_faces
from shapeprog.data.shape import Shape
from shapeprog.geometry.arrays import over_threads
from shapeprog.geometry.mesh import triangle_normals, union_mesh
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.voxelise_kernels import mark_triangles
from shapeprog.inference.surface.cloud import planes, points_of_scan, spiral
from shapeprog.inference.surface.components import Components, components, enclosed, solid_sides
from shapeprog.inference.surface.evidence_kernels import look_out
from shapeprog.inference.surface.oriented import Boxes, boxes_around, join, primitive_boxes
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import HALF, RESOLUTION, BoolArray, FloatArray, IntArray, cells_at

_SPREAD = spiral(1 - (2 * np.arange(32) + 1) / 32)
DIRECTIONS = _SPREAD / np.abs(_SPREAD).max(1, keepdims=True)
"""Directions (32, 3) spread evenly over the sphere, the largest coordinate 1 or -1."""


@dataclass(frozen=True)
class Evidence:
    """Evidence of a target, in the grid frame."""

    points: FloatArray  # points (P, 3) to be explained
    normals: FloatArray  # their unit normals (P, 3), zero where unknown
    weights: FloatArray  # their weights (P,), whose sum is 1
    outward: BoolArray  # whether a normal is known to point outwards (P,); others are of either sign
    tolerance: float  # distance within which a surface explains a point
    agreement: float  # least cosine between normals that agree
    surface: FloatArray  # more points (Q, 3) of the same surface: that of a program is supported by those near it
    surface_normals: FloatArray  # their unit normals (Q, 3), with which its own must agree
    surface_outward: BoolArray  # whether a normal is known to point outwards (Q,), as it bounds a solid
    reach: float  # distance within which one of these points supports a surface
    area: float  # of the surface that the points represent, in proportion to their weights, in square cells
    free: BoolArray  # cells (R, R, R) of the grid known to be free; without meaning outside the box of the surface
    mesh: Components | None = None  # the components of the target, if it is a mesh
    # Boxes around its largest components, open ones included, and those (K) of closed components that fill most of
    # their box, with the share of it that each fills
    boxes: Boxes = field(default_factory=lambda: join([]))
    parts: Boxes = field(default_factory=lambda: join([]))
    part_fill: FloatArray = field(default_factory=lambda: np.zeros(0))


def evidence_of(shape: Shape, seed: int = 0) -> Evidence:
    """The evidence of a shape, from its mesh, else from its points, else from its cells."""
    if shape.vertices is not None and shape.faces is not None and len(shape.faces):
        mesh = components(shape.vertices, shape.faces)
        if len(mesh.area):
            return _of_mesh(mesh, seed)
    if shape.points is not None and len(shape.points) > SURFACE.planes:
        return _of_points(points_of_scan(shape), shape.voxels, seed)
    return _of_cells(shape.voxels)


def off_parts(scene: Scene, evidence: Evidence, off_fill: float = SURFACE.off_box) -> FloatArray:
    """How far the faces of the box around each primitive are at most from those of each part of a mesh (..., N, K), in
    cells; infinitely if only one leans, or the two do not fill the same share of their boxes, to ``off_fill`` if they
    lean."""
    centre, rotation, half = boxes = primitive_boxes(scene)
    fill = scene.volumes.numpy() / np.maximum((2 * half).prod(-1), 1e-9)  # of padding 0, of parts of a mesh never
    off, straight = np.full((*fill.shape, len(evidence.part_fill)), np.inf), boxes.straight
    for k, (share, along) in enumerate(zip(evidence.part_fill, evidence.parts.straight, strict=True)):
        # Seen along the axes of the grid, a board that leans by a degree would be as thick as its ends are apart.
        alike = (straight == along) & (np.abs(fill - share) <= (SURFACE.off_fill if along else off_fill))
        away, reach = seen_along(rotation[alike], centre[alike], evidence.parts, k)
        off[alike, k] = (np.abs(away) + np.abs(reach - half[alike])).max(-1)
    return off


def seen_along(
    axes: FloatArray, origin: FloatArray, boxes: Boxes, index: int | IntArray
) -> tuple[FloatArray, FloatArray]:
    """How far some boxes are from origins (..., 3) along axes (..., 3, 3), and their half extents along these."""
    across = np.swapaxes(axes, -1, -2)
    away = (across @ (boxes.centre[index] - origin)[..., None])[..., 0]
    return away, (np.abs(across @ boxes.rotation[index]) @ boxes.half[index][..., None])[..., 0]


def evidence_of_program(program: Program, seed: int = 0) -> Evidence:
    """The evidence of the surface of a program, as for a mesh; a ``ShapeProgError`` if it has no volume."""
    return _of_mesh(components(*union_mesh(unroll(program))), seed)


def _of_mesh(mesh: Components, seed: int) -> Evidence:
    """The evidence of a mesh: samples by area; cells are free where they are visible from outside."""
    samples, face = sample_with_faces(mesh.vertices, mesh.faces, SURFACE.surface, seed)
    surface, corners = samples.astype(np.float64), mesh.vertices[mesh.faces]
    volume, (_, facing) = enclosed(mesh), triangle_normals(mesh.vertices, mesh.faces)
    sides = solid_sides(mesh, volume)
    normals = np.where(sides < 0, -1, 1)[face, None] * facing[face]
    barrier = np.zeros((SURFACE.looking,) * 3, np.bool_)
    # The longest side ends on cell boundaries: rounding would leave holes in faces there, which show the inside.
    mark_triangles(np.ascontiguousarray((corners + HALF) * (SURFACE.looking / RESOLUTION)), 0.5 + 1e-6, barrier)
    points, facing = surface[: SURFACE.points], normals[: SURFACE.points]
    runs = list(pairwise(mesh.start[: SURFACE.components + 1]))
    boxes = boxes_around([mesh.vertices[np.unique(mesh.faces[first:last])] for first, last in runs])
    fill = np.nan_to_num(np.abs(volume[: len(runs)]) / np.maximum((2 * boxes.half).prod(1), 1e-9))
    # Thin solids are no obstacle here; boxes hide what is inside of them and what touches them all the same.
    solid = boxes.take(np.flatnonzero(boxes.straight & (np.abs(fill - 1) < SURFACE.off_box))[: SURFACE.parts])
    front, back = (_visible(points, side, barrier, solid) for side in (facing, -facing))
    weights = np.where(front | back, 1.0, 0.1)  # what cannot be seen from outside counts little
    facing, oriented = _turned_outward(facing, front, back)
    seen = np.isin(np.arange(len(fill)), mesh.component_of(face[: SURFACE.points][front | back]))
    simple = np.flatnonzero(seen & (fill >= SURFACE.simple))[: SURFACE.parts]
    area = float(mesh.area.sum())
    coarse: BoolArray = barrier.reshape((SURFACE.free, SURFACE.looking // SURFACE.free) * 3)
    for axis in range(1, 4):  # faster than all at once
        coarse = np.any(coarse, axis)
    return Evidence(
        points, facing, weights / weights.sum(), oriented, SURFACE.tolerance, SURFACE.agreement,
        surface, normals, sides[face] != 0, _reach(SURFACE.tolerance, area, SURFACE.surface),
        area * float(weights.mean()), _free_cells(coarse, surface, through=False),
        mesh, boxes, boxes.take(simple), fill[simple],
    )  # fmt: skip


def _of_points(surface: FloatArray, voxels: BoolArray, seed: int) -> Evidence:
    """The evidence of a scan: normals are those of local planes; cells with clear rays in both directions are free."""
    distance, neighbours = cKDTree(surface).query(surface, k=SURFACE.planes)
    normals, squared = planes(surface, neighbours)
    # A low quantile: planes do not fit at edges and in thin parts.
    noise = float(np.quantile(np.sqrt(squared / (SURFACE.planes - 3)), 0.25))
    area = float(np.median(distance[:, -1]) ** 2 * math.pi / (SURFACE.planes - 1)) * len(surface)
    # With more noise, the position of the surface is too uncertain for a wider tolerance.
    tolerance = min(max(SURFACE.tolerance, 2 * noise), 0.75)
    free = _free_cells(np.kron(voxels, np.ones((SURFACE.free // RESOLUTION,) * 3, np.bool_)), surface, through=True)
    selected = np.sort(np.random.default_rng(seed).permutation(len(surface))[: SURFACE.points])
    points, facing = surface[selected], normals[selected]
    above = 1.5 * RESOLUTION / SURFACE.free * facing
    front, back = (free[tuple(cells_at(points + side, SURFACE.free).T)] for side in (above, -above))
    facing, oriented = _turned_outward(facing, front, back)
    return Evidence(
        points, facing, np.full(len(points), 1 / len(points)), oriented, tolerance, SURFACE.scanned, surface, normals,
        np.zeros(len(surface), np.bool_), _reach(tolerance, area, len(surface)), area, free,
    )  # fmt: skip


def _of_cells(voxels: BoolArray) -> Evidence:
    """The evidence of cells: one point for each exposed face, at the depth ``inset``.

    Parts that are one cell thick have .7 of that thickness: their two sides do not cross.
    """
    normals, cells, exact = exposed_faces(voxels)
    single = ~np.pad(voxels, 1)[tuple((cells + 1 - normals.astype(np.int64)).T)]  # one cell thick
    inset = np.where(exact, 0.0, np.where(single, 0.15, SURFACE.inset))
    surface = cells + 0.5 - HALF + (0.5 - inset)[:, None] * normals
    count = len(surface)
    return Evidence(
        surface, normals, np.full(count, 1 / count), np.ones(count, np.bool_),
        SURFACE.cell_tolerance, SURFACE.agreement, surface, normals, np.zeros(count, np.bool_),
        _reach(SURFACE.cell_tolerance, count, count), float(count), ~voxels,
    )  # fmt: skip


def _reach(tolerance: float, area: float, count: int) -> float:
    """The larger of one and a half tolerances, and the radius of a disc that contains four points on average."""
    return max(1.5 * tolerance, math.sqrt(4 * area / (math.pi * count)))


def _visible(points: FloatArray, normals: FloatArray, barrier: BoolArray, solid: Boxes) -> BoolArray:
    """Whether points (P,) of a surface are visible from outside, on the side of their normals; none inside of boxes."""
    offset = normals / np.maximum(np.abs(normals).max(1, keepdims=True), 1e-9)
    starts = (points + HALF) * (len(barrier) / RESOLUTION) + 1.5 * offset  # out of the cells that the surface touches
    visible, above = looking(barrier, starts, DIRECTIONS, 1, through=False), points + SURFACE.above * normals
    for centre, rotation, half in zip(*solid, strict=True):
        visible &= (np.abs((above - centre) @ rotation) >= half).any(1)
    return visible


def _turned_outward(normals: FloatArray, front: BoolArray, back: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Normals (P, 3) turned outwards, and whether their orientation is known (P,): where only the front or only the
    back of a point is free, or everywhere if nearly all such normals agree, as in a mesh with consistent winding."""
    oriented = front != back
    share = float(front[oriented].mean()) if oriented.any() else 0.5
    if max(share, 1 - share) >= 0.95:
        return normals * (1.0 if share > 0.5 else -1.0), np.ones(len(oriented), np.bool_)
    return normals * np.where(oriented & back, -1.0, 1.0)[:, None], oriented


def _free_cells(barrier: BoolArray, surface: FloatArray, *, through: bool) -> BoolArray:
    """The cells (R, R, R) in the box around the surface from which enough directions lead out of the grid; with
    ``through``, both ways: parts of a shape may be missing from its scan."""
    scale = len(barrier) / RESOLUTION
    low, high = ((end + HALF) * scale for end in (surface.min(0), surface.max(0)))
    middle = np.arange(len(barrier))[:, None] + 0.5
    steps, minimum = (DIRECTIONS[::2], 4) if through else (DIRECTIONS, 2)
    within, free = np.zeros_like(barrier), np.zeros_like(barrier)
    within[np.ix_(*((middle >= low) & (middle <= high)).T)] = True
    free[within] = looking(barrier, np.argwhere(within).astype(np.float64) + 0.5, steps, minimum, through=through)
    return free


def looking(barrier: BoolArray, starts: FloatArray, steps: FloatArray, minimum: int, *, through: bool) -> BoolArray:
    """Whether at least ``minimum`` directions lead out of the grid from each start (N,); see the kernel."""
    ways, result = np.stack([steps, -steps] if through else [steps]), np.zeros(len(starts), np.bool_)
    data = barrier, np.ascontiguousarray(starts), ways, minimum, result
    over_threads(partial(look_out, *data), len(starts), least=1024)
    return result
