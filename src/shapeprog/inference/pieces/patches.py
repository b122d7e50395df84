"""Planar patches of points with normals, as rectangles: boxes without thickness, whose last axis is the normal."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from scipy.ndimage import label as label_regions

from shapeprog.inference.pieces.oriented import Boxes, bounds, boxes_around, join, principal_axes
from shapeprog.inference.pieces.patch_kernels import grow_patches
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.surface.cloud import Cloud, tolerance
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.space import Array, FloatArray


def planar_patches(cloud: Cloud) -> Boxes:
    """The planar patches of a surface and the bars that they consist of, largest first."""
    order = np.argsort(flatness(cloud), kind="stable")
    label = np.empty(len(cloud.points), np.int64)
    angle = np.cos(np.radians(25 if cloud.noise > SURFACE.noisy else 15))
    count = grow_patches(
        cloud.points, cloud.normals, cloud.neighbours, order, angle, tolerance(cloud), SETTINGS.patch_points, label
    )
    sizes = np.bincount(label[label >= 0], minlength=count)
    largest = np.argsort(-sizes, kind="stable")[: SETTINGS.patches]
    sequence = np.argsort(label, kind="stable")
    first = np.searchsorted(label[sequence], np.arange(count + 1))
    members = [sequence[first[k] : first[k + 1]] for k in largest]
    patches = rectangles(cloud, members)
    return join([patches, *bars(cloud, members, patches)])


def flatness(cloud: Cloud) -> FloatArray:
    """Mean deviation of the normals around each point (N,)."""
    facing = np.abs(np.einsum("nki,ni->nk", cloud.normals[cloud.neighbours], cloud.normals))
    return np.round(1 - facing.mean(1), 6)


def rectangles(cloud: Cloud, members: list[npt.NDArray[np.int64]]) -> Boxes:
    """The rectangle around each planar set of points, along the world's axes where these are near."""
    if not members:
        return join([])
    start, points = bounds(members), cloud.points[np.concatenate(members)]
    normal = principal_axes(points, start)[1][:, :, 2]
    boxes = boxes_around(points, start, upright(normal), 2 * cloud.spacing)
    return boxes._replace(half=(boxes.half + cloud.spacing / 4) * [1, 1, 0])


def upright(normal: FloatArray) -> FloatArray:
    """Frames (P, 3, 3) about normals (P, 3), which snap to near axes of the world; so do the first columns."""
    normal = normal * np.sign(np.take_along_axis(normal, np.abs(normal).argmax(1)[:, None], 1))
    nearest = np.eye(3)[np.abs(normal).argmax(1)]
    snapped = np.abs(normal).max(1) > np.cos(np.radians(SETTINGS.snap))
    normal = np.where(snapped[:, None], nearest, normal)
    axis = np.eye(3)[np.abs(normal).argmin(1)]
    across = axis - normal * np.sum(axis * normal, 1, keepdims=True)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.stack([across, np.cross(normal, across), normal], 2)


def bars(cloud: Cloud, members: list[npt.NDArray[np.int64]], patches: Boxes) -> Iterator[Boxes]:
    """The rectangles of the bars in patches with a low fill, such as frames."""
    side = 1.8 * cloud.spacing
    for indices, middle, axes, reach in zip(members, *patches, strict=True):
        flat = (cloud.points[indices] - middle) @ axes[:, :2] + reach[:2]
        shape = np.maximum(np.ceil(2 * reach[:2] / side).astype(int), 1)
        grid = np.zeros(shape, np.bool_)
        at = np.minimum((flat / (2 * reach[:2]) * shape).astype(int), shape - 1)
        grid[at[:, 0], at[:, 1]] = True
        if grid.mean() > SETTINGS.full or shape.max() < 6:
            continue
        for low, high in bars_of(grid):
            ends = np.stack([low, high]) / shape * 2 * reach[:2] - reach[:2]
            centre, half = middle + axes[:, :2] @ ends.mean(0), np.append((ends[1] - ends[0]) / 2, 0)
            yield Boxes(centre[None], axes[None], half[None])


def bars_of(grid: npt.NDArray[np.bool_]) -> list[tuple[Array, Array]]:
    """Rectangles of cells, low and high corners, formed by long runs along either axis of a grid."""
    corners: dict[tuple[int, ...], None] = {}
    for axis in range(2):
        length = run_lengths(grid if axis else grid.T)
        length = length if axis else length.T
        for share in SETTINGS.bar_runs:
            min_length = max(share * grid.shape[axis], 3)
            regions, count = label_regions(length >= min_length)
            for k in range(1, count + 1):
                cells = np.argwhere(regions == k)
                low, high = cells.min(0), cells.max(0) + 1
                if len(cells) >= SETTINGS.bar_full * np.prod(high - low):
                    corners[(*low.tolist(), *high.tolist())] = None
    return [(np.array(key[:2]), np.array(key[2:])) for key in corners]


def run_lengths(grid: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """For each cell the length of the run of set cells along the last axis that it is in, 0 where it is not set."""
    padded = np.pad(grid, ((0, 0), (1, 1))).astype(np.int8)
    change = np.diff(padded, axis=1)
    row, first = np.nonzero(change == 1)
    last = np.nonzero(change == -1)[1]
    length = np.zeros(grid.shape, np.int64)
    for i, a, b in zip(row, first, last, strict=True):
        length[i, a:b] = b - a
    return length
