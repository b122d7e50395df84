"""Surfaces, points and foreign grids into cells: everything that the surface touches or the solid holds.

Real meshes are soups: open, doubled, turned inside out.  So no normal, no winding and no parity is trusted.  A cell
belongs to the solid when none of the six views along the axes sees its centre (the rule of the binvox grids that
ShapeNet is distributed with); the views meet the surface on a lattice of half cells and pass no hole of a cell's width.
"""

from __future__ import annotations

import numpy as np

from shapeprog.errors import InputError
from shapeprog.geometry.voxelise_kernels import mark_triangles
from shapeprog.space import HALF, RESOLUTION, Array, BoolArray

SHRINK = 1 / 256
"""How far, in cells, a surface must reach into a cell to touch it: a face on a boundary touches neither side."""

HOLE = 2
"""Widest hole, in half cells, that lets no view through."""


AT_ONCE = 1 << 17
"""Triangles enlarged at once: meshes may have millions."""


def voxelise_mesh(vertices: Array, faces: Array, resolution: int = RESOLUTION) -> BoolArray:
    """Every cell that the surface touches or the solid contains, (R, R, R).

    A box from boundary to boundary fills exactly its cells; a sheet without thickness between two layers fills one.

    Parameters
    ----------
    vertices
        Corners (V, 3) in the grid frame: cells, origin at the centre of the grid.
    faces
        Triangles (F, 3) as indices of vertices; their order, their direction and their being joined do not matter.
    resolution
        Cells along each side.
    """
    corners = np.asarray(vertices, np.float64) + resolution / 2
    triangles = corners[np.asarray(faces, np.int64).reshape(-1, 3)]
    touched = np.zeros((resolution,) * 3, np.bool_)
    # Half cells that straddle the boundaries of the cells: a wall on a boundary has one clear place among them.
    barrier = np.zeros((2 * resolution + 1,) * 3, np.bool_)
    for start in range(0, len(triangles), AT_ONCE):
        some = triangles[start : start + AT_ONCE]
        mark_triangles(some, 0.5 - SHRINK, touched)
        mark_triangles(2 * some + 0.5, 0.5 + 1e-6, barrier)
    _carve(barrier, HOLE, 1, 2, touched)
    _mark_boundary_sheets(triangles, touched)
    return touched


def voxelise_points(points: Array) -> BoolArray:
    """Every cell that holds a point, and those that the points enclose, (R, R, R).

    Views along the six axes are stopped by the cells with points, and by holes between them no wider than about four
    times the spacing of the points; cells that no view reaches are inside.

    Parameters
    ----------
    points
        Positions (P, 3) in the grid frame.
    """
    from scipy.spatial import cKDTree

    positions = np.asarray(points, np.float64) + HALF
    touched = np.zeros((RESOLUTION,) * 3, np.bool_)
    # A point on the last boundary of the shape belongs to the shape's last cell: pulled in by a hair.
    inner = positions + SHRINK * np.sign(positions.mean(0) - positions) * (
        np.abs(positions - np.rint(positions)) < 1e-4
    )
    cells = np.floor(inner).astype(np.int64)
    cells = cells[((cells >= 0) & (cells < RESOLUTION)).all(1)]
    touched[tuple(cells.T)] = True
    some = positions[:: max(1, len(positions) // 2000)]
    distance, _ = cKDTree(positions).query(some, k=[min(2, len(positions))])
    spacing = float(np.median(np.asarray(distance)))
    _carve(touched, int(np.clip(np.ceil(4 * spacing), 1, 4)), 0, 1, touched)
    return touched


def resample_voxels(voxels: Array, low: Array, scale: float) -> BoolArray:
    """Every cell of the grid that an occupied cell of another grid reaches, (R, R, R).

    A finer cell reaches the cell that holds its centre, as in the packs; a coarser one every cell that it touches.

    Parameters
    ----------
    voxels
        Occupied cells (A, B, C), axes up, depth, left-right.
    low
        Grid position, with the origin at the grid's centre, of the corner of cell (0, 0, 0).
    scale
        Side of one of its cells in cells of the grid.
    """
    reduced = np.asarray(voxels, np.bool_)
    for axis, corner in enumerate(np.asarray(low, np.float64) + HALF):
        start = corner + np.arange(reduced.shape[axis]) * scale
        margin = scale / 2 if scale < 1 else SHRINK  # all of a finer cell is drawn together into its centre
        first = np.floor(start + margin)
        last = np.maximum(np.ceil(start + scale - margin) - 1, first)
        # The cells that reach cell k lie side by side, and which they are does not depend on the other axes.
        numbers = np.arange(RESOLUTION)
        spans = zip(np.searchsorted(last, numbers), np.searchsorted(first, numbers, side="right"), strict=True)
        layers = np.moveaxis(reduced, axis, 0)
        reduced = np.moveaxis(np.stack([layers[begin:end].any(0) for begin, end in spans]), 0, axis)
    return np.ascontiguousarray(reduced)


def occupied_bounds(voxels: Array, name: str = "the voxel grid") -> tuple[Array, Array]:
    """Lowest and highest boundary of the occupied cells along each axis, in cells from the corner of the array.

    Parameters
    ----------
    voxels
        Occupied cells (A, B, C).
    name
        Their name, for errors.

    Raises
    ------
    InputError
        If no cell is occupied.
    """
    layer: Array = np.any(voxels, 0)  # reduces a large grid to a layer
    sides = [np.flatnonzero(line) for line in (np.any(voxels, (1, 2)), layer.any(1), layer.any(0))]
    if len(sides[0]) == 0:
        raise InputError(f"{name} has no occupied cell", "give a grid in which at least one is")
    return np.array([side[0] for side in sides]), np.array([side[-1] + 1 for side in sides])


def _carve(barrier: BoolArray, hole: int, start: int, stride: int, cells: BoolArray) -> None:
    """Mark the cells that none of the six views along the axes can see (Nooruddin & Turk 2003, ray stabbing).

    A ray that passes where the rays around it, within ``hole`` lines on all four sides, are stopped earlier, is stopped
    as late as the latest of those four: a missing triangle lets nothing through, while a slot, open along one
    direction, stays.  Cell ``k`` along an axis is cell ``start + stride * k`` of the barrier (N, N, N).
    """
    size, place = len(barrier), start + stride * np.arange(len(cells))
    hidden = np.ones_like(cells)
    for axis in range(3):
        for reverse in (False, True):
            layers = np.moveaxis(barrier, axis, 0)[:: -1 if reverse else 1]
            depth = np.where(layers.any(0), layers.argmax(0), size)
            around = np.pad(depth, hole, constant_values=size)
            steps = range(1, hole + 1)
            sides = [
                np.min([np.roll(around, (step * down, step * right), (0, 1)) for step in steps], 0)
                for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1))
            ]
            closed = np.minimum(depth, np.max(sides, 0)[hole:-hole, hole:-hole])[np.ix_(place, place)]
            behind = size - 1 - place if reverse else place
            hidden &= np.moveaxis(closed <= behind[:, None, None], 0, axis)
    cells |= hidden


def _mark_boundary_sheets(triangles: Array, cells: BoolArray) -> None:
    """Give a sheet that lies exactly between two layers of cells to one of them, where neither is marked yet.

    The layer nearer the middle of the grid gets it, so that mirrored shapes stay mirrored and nothing grows.
    """
    size = len(cells)
    for axis in range(3):
        first = triangles[:, 0, axis]
        near_one = triangles[np.abs(first - np.rint(first)) <= SHRINK]  # usually few
        planes = np.rint(near_one[:, 0, axis])
        flat = np.abs(near_one[:, :, axis] - planes[:, None]).max(1) <= SHRINK
        for plane in np.unique(planes[flat]).astype(int):
            near = plane if 2 * plane < size else plane - 1
            far = 2 * plane - 1 - near
            if not 0 <= near < size:
                continue
            sheet = near_one[flat & (planes == plane)]
            sheet[:, :, axis] = near + 0.5
            marked = np.zeros_like(cells)
            mark_triangles(sheet, 0.5 - SHRINK, marked)
            layers, layer = np.moveaxis(cells, axis, 0), np.moveaxis(marked, axis, 0)[near]
            layers[near] |= layer & ~layers[far] if 0 <= far < size else layer
