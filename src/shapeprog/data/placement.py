"""Meshes, points and voxels of the world, placed in the grid: centred, turned, the longest side 24 cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapeprog.data.shape import Shape
from shapeprog.errors import InputError
from shapeprog.space import HALF, LEAST_SIDE, MOST_SIDE, RESOLUTION, SPAN, Array, Frame

SCAN = 20_000
"""Maximum number of points of a cloud that inference uses."""

LEAST_POINTS = 100
"""Minimum number of points of a cloud: fewer do not show where the surface lies."""

_NO_EXTENT = 1e-12
"""Share of the largest variance of positions in any direction below which they have no extent in another."""

_NEAREST = 1e-12
"""Minimum longest side of a shape as a share of its distance from the origin: below, float64 cannot resolve cells."""


def shape_from_mesh(
    vertices: Array,
    faces: Array,
    *,
    name: str = "mesh",
    axes: Array | None = None,
    points: int = 5000,
    seed: int = 0,
    source: Path | None = None,
) -> Shape:
    """The shape of a triangle mesh in the world, vertices (V, 3) and faces (F, 3).

    Raises
    ------
    InputError
        If it has no faces, no area, extent in one direction only, or coordinates that are not finite.
    """
    from shapeprog.data.sampling import sample_surface
    from shapeprog.geometry.voxelise import voxelise_mesh

    used = np.zeros(len(vertices), np.bool_)
    used[np.asarray(faces, np.int64).reshape(-1)] = True
    everything = bool(used.all())
    frame = _frame(vertices if everything else vertices[used], name, axes)
    corners = frame.to_grid(vertices if everything else np.where(used[:, None], vertices, np.asarray(frame.centre)))
    cells = voxelise_mesh(corners, faces)
    if not cells.any():
        raise InputError(f"{name} has no area: its faces are lines or points", "export the model again with its faces")
    return Shape(
        name=name,
        voxels=cells,
        points=sample_surface(corners, faces, points, seed),
        frame=frame,
        vertices=corners.astype(np.float32),
        faces=np.asarray(faces, np.int32),
        source=source,
        kind="mesh",
        note=_flatness(corners if everything else corners[used], name),
    )


def shape_from_points(
    cloud: Array,
    *,
    name: str = "points",
    axes: Array | None = None,
    points: int = 5000,
    seed: int = 0,
    source: Path | None = None,
) -> Shape:
    """The shape of a point cloud (P, 3) in the world; its box is that of the points.

    Raises
    ------
    InputError
        If there are fewer than :data:`LEAST_POINTS`, extent in one direction only, or coordinates that are not finite.
    """
    from shapeprog.geometry.voxelise import voxelise_points

    frame = _frame(cloud, name, axes)
    if len(cloud) < LEAST_POINTS:
        raise InputError(
            f"{name} has no faces and {len(cloud)} points; a point cloud needs at least {LEAST_POINTS}",
            "export the model again with its faces, or with more points",
        )
    placed = frame.to_grid(cloud)
    sample, scan = some(placed, points, seed), some(placed, SCAN, seed)
    return Shape(
        name, voxelise_points(placed), sample, frame, source=source, kind="points", note=_flatness(placed, name),
        scan=scan if len(scan) > len(sample) else None,
    )  # fmt: skip


def some(cloud: Array, count: int, seed: int) -> npt.NDArray[np.float32]:
    """So many of the points of a cloud, in their order."""
    if len(cloud) > count:
        cloud = cloud[np.sort(np.random.default_rng(seed).choice(len(cloud), count, replace=False))]
    return cloud.astype(np.float32)


def shape_from_voxels(
    voxels: Array,
    *,
    name: str = "voxels",
    axes: Array | None = None,
    corner: Array | None = None,
    cell: float = 1.0,
    source: Path | None = None,
) -> Shape:
    """The shape of a voxel grid (R, R, R) whose corner lies at ``corner`` of the world, with cells of side ``cell``.

    A grid of 32^3 that fits the grid frame already (within a cell or two, as published data do) is kept cell for
    cell; every other one is fitted into the grid, where a cell is occupied that an occupied cell touches.

    Raises
    ------
    InputError
        If no cell is occupied.
    """
    from shapeprog.geometry.voxelise import occupied_bounds, resample_voxels

    turn = np.eye(3) if axes is None else np.asarray(axes, np.float64)
    order = np.abs(turn).argmax(0)  # the world axis along each grid axis
    backward = tuple(axis for axis in range(3) if turn[order[axis], axis] < 0)
    turned = np.flip(np.asarray(voxels, np.bool_).transpose(order), backward)
    start, size = np.zeros(3) if corner is None else np.asarray(corner, np.float64), len(turned)
    first, last = occupied_bounds(voxels, name)
    frame = _around(start + cell * first, start + cell * last, name, turn)
    low, high = first[order], last[order]
    low, high = np.where(np.isin(range(3), backward), (size - high, size - low), (low, high))
    middle, longest = (low + high) / 2 - HALF, (high - low).max()
    if size == RESOLUTION and abs(longest - SPAN) <= 2 and np.abs(middle).max() <= 1.5:
        return Shape(name, np.ascontiguousarray(turned), frame=Frame.of(cell, start + cell * HALF, turn), source=source)
    ends = frame.to_grid([start, start + cell * size])
    return Shape(name, resample_voxels(turned, ends.min(0), cell / frame.scale), frame=frame, source=source)


def _frame(positions: Array, name: str, axes: Array | None) -> Frame:
    if len(positions) == 0:
        raise InputError(
            f"{name} is empty: it has neither faces nor points", "export the model again with its geometry"
        )
    if not np.isfinite(positions).all():
        count = int((~np.isfinite(positions)).any(1).sum())
        raise InputError(f"{name}: {count} of {len(positions)} positions are not finite numbers", "remove or mend them")
    return _around(positions.min(0), positions.max(0), name, axes)


def _flatness(placed: Array, name: str) -> str:
    """A note if positions in the grid lie in a plane; an ``InputError`` if they lie on a line."""
    mean = placed.mean(0)
    thinnest, second, widest = np.linalg.eigvalsh(placed.T @ placed / len(placed) - np.outer(mean, mean))
    if second < _NO_EXTENT * widest:
        raise InputError(f"{name} is a line: it has extent in one direction only", "check how it was exported")
    return "The input is flat: all of it lies in one plane." if thinnest < _NO_EXTENT * widest else ""


def _around(low: Array, high: Array, name: str, axes: Array | None) -> Frame:
    """The frame around a box of the world."""
    with np.errstate(over="ignore", invalid="ignore"):
        longest, farthest = float((high - low).max()), float(np.maximum(np.abs(low), np.abs(high)).max())
    if not LEAST_SIDE < longest < MOST_SIDE:
        raise InputError(
            f"{name} has no usable extent: its box spans {low.tolist()} to {high.tolist()}", "check its scale"
        )
    if longest < _NEAREST * farthest:
        raise InputError(
            f"{name} lies too far from the origin for its size: its box spans {low.tolist()} to {high.tolist()}",
            "move it to the origin",
        )
    return Frame.around(low, high, axes)
