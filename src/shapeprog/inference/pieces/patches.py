"""Planar patches of points with normals, and the boards and bars between patches that face each other.

A patch is a rectangle: a box without thickness, whose last axis is the normal.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import convolve, find_objects
from scipy.ndimage import label as label_regions

from shapeprog.inference.pieces.groups import distinct
from shapeprog.inference.pieces.point_kernels import grow_patches
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.surface.cloud import Cloud
from shapeprog.inference.surface.oriented import Boxes, boxes_around, join, principal_axes
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.language.hints import STRAIGHT
from shapeprog.space import BoolArray, FloatArray


def planar_patches(cloud: Cloud) -> Boxes:
    """The planar patches of a surface and the bars that they consist of, largest first."""
    # Mean deviation of the normals around each point: seeds are the flattest first.
    facing = np.abs(np.einsum("nki,ni->nk", cloud.normals[cloud.neighbours], cloud.normals))
    order = np.argsort(np.round(1 - facing.mean(1), 6), kind="stable")
    label = np.full(len(cloud.points), -1)
    cosine = np.cos(np.radians(25 if cloud.noise > SURFACE.noisy else 15))
    grow_patches(*cloud[:3], order, cosine, cloud.tolerance, SETTINGS.patch_points, label)
    by_patch = np.split(cloud.points[np.argsort(label, kind="stable")], np.cumsum(np.bincount(label + 1))[:-1])[1:]
    sets = sorted(by_patch, key=len, reverse=True)[: SETTINGS.patches]
    if not sets:
        return join([])
    boxes = boxes_around(sets, upright(principal_axes(sets)[1][:, :, 2]), 2 * cloud.spacing)
    patches = boxes._replace(half=(boxes.half + cloud.spacing / 4) * [1, 1, 0])
    return join([patches, *_bars(sets, patches, 2.2 * cloud.spacing)])


def upright(normal: FloatArray) -> FloatArray:
    """Frames (P, 3, 3) about normals (P, 3), which snap to near axes of the world; so do the first columns."""
    nearest = np.eye(3)[np.abs(normal).argmax(1)]
    cosine = np.sum(nearest * normal, 1, keepdims=True)
    normal = np.where(np.abs(cosine) > STRAIGHT, nearest, np.sign(cosine) * normal)
    axis = np.eye(3)[np.abs(normal).argmin(1)]
    across = axis - normal * np.sum(axis * normal, 1, keepdims=True)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.stack([across, np.cross(normal, across), normal], 2)


def _bars(sets: list[FloatArray], patches: Boxes, side: float) -> Iterator[Boxes]:
    """The rectangles of the bars in patches with a low fill, such as frames, on a grid of cells of about ``side``."""
    for points, middle, axes, half in zip(sets, *patches, strict=True):
        extent = 2 * half[:2]
        shape = np.maximum(np.ceil(extent / side).astype(int), 1)
        grid = np.zeros(shape, np.bool_)
        at = ((points - middle) @ axes[:, :2] + half[:2]) / extent * shape
        grid[tuple(np.minimum(at.astype(int), shape - 1).T)] = True
        grid |= convolve(grid.astype(int), np.ones((3, 3), int), mode="constant", cval=1) >= 7  # holes between samples
        if grid.mean() > SETTINGS.full or shape.max() < 6:
            continue
        ends = np.reshape(_bars_of(grid), (-1, 2, 2)) / shape * extent - half[:2]
        centre = middle + (axes[:, :2] @ ends.mean(1)[..., None])[..., 0]
        half_bars = np.pad((ends[:, 1] - ends[:, 0]) / 2, ((0, 0), (0, 1)))
        yield Boxes(centre, np.broadcast_to(axes, (len(ends), 3, 3)), half_bars)


def _bars_of(grid: BoolArray) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Rectangles of cells, low and high corners, formed by long runs along either axis of a grid."""
    corners = []
    for axis in range(2):
        runs, _ = label_regions(grid, np.swapaxes([[0, 0, 0], [1, 1, 1], [0, 0, 0]], axis, 1))
        length = np.bincount(runs.reshape(-1))[runs] * grid
        for least in dict.fromkeys(np.maximum(np.ceil(np.array(SETTINGS.bar_runs) * grid.shape[axis]), 3).tolist()):
            regions, _ = label_regions(length >= least)
            for number, place in enumerate(find_objects(regions), 1):
                rows, columns = place
                region = regions[place] == number
                if region.sum() >= SETTINGS.bar_full * region.size:
                    corners.append(((rows.start, columns.start), (rows.stop, columns.stop)))
    return list(dict.fromkeys(corners))


def slabs(patches: Boxes) -> Boxes:
    """Distinct boxes between pairs of patches: intersection and bounds of both rectangles, and each of them."""
    normal, area = patches.rotation[:, :, 2], patches.half[:, :2].prod(1)
    parallel = np.abs(normal @ normal.T) > np.cos(np.radians(SETTINGS.parallel))
    i, j = np.nonzero(parallel & (area[:, None] >= area))
    depth = ((patches.centre[j] - patches.centre[i]) * normal[i]).sum(1)
    thick = (np.abs(depth) >= SETTINGS.thickness[0]) & (np.abs(depth) <= SETTINGS.thickness[1])
    i, j, depth = i[thick], j[thick], depth[thick]
    corner = patches.corners()[j, ::2] - patches.centre[i][:, None]  # patches have four
    flat = np.einsum("nck,nka->nca", corner, patches.rotation[i][:, :, :2])
    low, high = flat.min(1), flat.max(1)
    half = patches.half[i, :2]
    inner = np.maximum(low, -half), np.minimum(high, half)
    shared = np.maximum(inner[1] - inner[0], 0).prod(1)
    keep = shared >= SETTINGS.shared * np.minimum(4 * half.prod(1), (high - low).prod(1))
    spans = np.array([inner, (np.minimum(low, -half), np.maximum(high, half)), (-half, half), (low, high)])
    low, high = np.concatenate(spans[:, :, keep], 1)
    i, depth = np.tile(i[keep], len(spans)), np.tile(depth[keep], len(spans))
    frame, deep = patches.rotation[i], depth[:, None]
    centre = patches.centre[i] + np.einsum("nij,nj->ni", frame, np.concatenate([(low + high) / 2, deep / 2], 1))
    boxes = Boxes(centre, frame, np.concatenate([(high - low) / 2, np.abs(deep) / 2], 1))
    middle = np.sort(boxes.half, 1)[:, 1]
    boxes = boxes.take((boxes.half > 0).all(1) & (boxes.half[:, 2] <= SETTINGS.stretch * middle))
    return boxes.take(distinct(boxes))


def sheets(patches: Boxes) -> Boxes:
    """Thin boxes about the largest patches."""
    largest = np.argsort(-np.round(patches.half[:, :2].prod(1), 6), kind="stable")[: SETTINGS.sheets]
    boxes = patches.take(largest)
    return boxes._replace(half=np.maximum(boxes.half, [0, 0, SETTINGS.thickness[0] / 2]))
