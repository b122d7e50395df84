"""Proposals: oriented boxes that may be parts of a target, and the points of its surface.

Boxes of several sources overlap, and most are wrong: the selection of candidates decides.
"""

from __future__ import annotations

from enum import IntEnum
from itertools import compress, pairwise
from typing import NamedTuple

import numpy as np

from shapeprog.data.sampling import sample_with_faces
from shapeprog.geometry.mesh import triangle_normals
from shapeprog.inference.pieces.groups import distinct, groups
from shapeprog.inference.pieces.limbs import limbs
from shapeprog.inference.pieces.patches import planar_patches, sheets, slabs
from shapeprog.inference.pieces.point_kernels import near_boxes
from shapeprog.inference.pieces.rods import rods
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.surface.cloud import Cloud, cloud_of, is_clean, projected
from shapeprog.inference.surface.components import Components
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.inference.surface.oriented import Boxes, boxes_around, join
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.space import UP, BoolArray, FloatArray, IntArray


class Source(IntEnum):
    """What a piece is the box around."""

    COMPONENT = 0  # a connected component of the mesh
    GROUP = 1  # boxes that touch, such as the frame of a back
    ROD = 2  # points on a cylinder
    LIMB = 3  # points of clean scans whose inner balls run on in one direction
    SLAB = 4  # the space between two planar patches that face each other
    SHEET = 5  # one planar patch of unknown thickness


class Pieces(NamedTuple):
    """Boxes in cells, the most important first, the :class:`Source` of each (N,), and the points of the surface."""

    boxes: Boxes
    source: IntArray
    cloud: Cloud


class Support:
    """Points of a surface that boxes explain: ``explained`` (B, N), whether each box explains each tested point.

    ``filled`` (B,) is whether points lie near enough of the surface of each box for a solid; ``price`` (B,) is that of
    its surface without points, in points.
    """

    def __init__(self, cloud: Cloud, boxes: Boxes) -> None:
        every = -(-len(cloud.points) // SETTINGS.tested)
        distance = max(SETTINGS.cover_distance, 2 * cloud.noise)
        self.explained, fill = near(boxes, cloud.points[::every], distance)
        self.filled = fill >= SETTINGS.cover_filled
        area = 8 * (boxes.half * np.roll(boxes.half, -1, 1)).sum(1)
        self.price = SETTINGS.cover_price * area * (1 - fill) / (cloud.spacing**2 * every)

    def cover(self) -> IntArray:
        """The filled boxes that a greedy selection takes, best first."""
        counts, selected = self.explained.sum(1), list[int]()
        remaining = np.ones(self.explained.shape[1], np.bool_)
        for _ in range(min(SETTINGS.cover_boxes, len(counts))):
            gain = np.where(self.filled, counts - self.price, 0)
            best = int(gain.argmax())
            if gain[best] < SETTINGS.cover_gain:
                break
            selected.append(best)
            counts -= self.explained[:, remaining & self.explained[best]].sum(1)
            remaining &= ~self.explained[best]
        return np.array(selected, np.int64)


def near(boxes: Boxes, points: FloatArray, distance: float) -> tuple[BoolArray, FloatArray]:
    """Which points (N, 3) are near the surface of each box (B, N), and the share of it near which points lie (B,)."""
    rise = 1.001 * (np.abs(boxes.rotation[:, UP]) * (boxes.half + distance)).sum(1)
    order = np.argsort(points[:, UP])  # most points are above or below a box
    between = np.searchsorted(points[order, UP], boxes.centre[:, UP] + [-rise, rise])
    explained, fill = np.zeros((len(rise), len(points)), np.bool_), np.zeros(len(rise))
    near_boxes(points[order], order, *between, *map(np.ascontiguousarray, boxes), distance, explained, fill)
    return explained, fill


def find_pieces(evidence: Evidence) -> Pieces:
    """Pieces of a mesh or a point cloud: those of a greedy selection, then components, then groups, rods and limbs,
    then slabs and sheets; within each class, pieces that explain more points are first."""
    if evidence.mesh is not None:
        cloud, parts = _of_mesh(evidence.mesh, evidence.boxes)
    else:
        cloud = cloud_of(evidence.surface)
        if cloud.noise > SURFACE.noisy:
            cloud = cloud_of(projected(cloud.points))
        parts = _of_points(cloud, limbs(cloud) if is_clean(evidence.surface) else join([]))
    boxes = join([part for _, part in parts])
    source = np.repeat([source for source, _ in parts], [len(part.half) for _, part in parts])
    unique = np.union1d(np.flatnonzero(source == Source.COMPONENT), distinct(boxes))  # each once but for components
    boxes, source = boxes.take(unique), source[unique]
    support = Support(cloud, boxes)
    turn = np.searchsorted([Source.COMPONENT, Source.LIMB], source)
    value = support.explained.sum(1) - support.price
    ranked = np.lexsort((-np.round(value, 6), turn))
    order = np.array([*dict.fromkeys([*support.cover(), *ranked])], np.int64)[: SETTINGS.pieces]
    return Pieces(boxes.take(order), source[order], cloud)


def _of_mesh(mesh: Components, boxes: Boxes) -> tuple[Cloud, list[tuple[Source, Boxes]]]:
    """Pieces from the components of a mesh, whose boxes are given, and from points, with some on each of these."""
    runs = list(pairwise(mesh.start[: len(boxes.half) + 1]))
    samples = [sample_with_faces(mesh.vertices, mesh.faces, SETTINGS.points, 0)]
    counts = np.bincount(mesh.component_of(samples[0][1]), minlength=len(runs))
    for first, last in compress(runs, counts < SETTINGS.component_points):
        points, face = sample_with_faces(mesh.vertices, mesh.faces[first:last], SETTINGS.component_points, 0)
        samples.append((points, face + first))
    points, face = (np.concatenate(column) for column in zip(*samples, strict=True))
    cloud = cloud_of(points, triangle_normals(mesh.vertices, mesh.faces[face])[1])
    return cloud, [(Source.COMPONENT, boxes), (Source.GROUP, groups(boxes)), *_of_points(cloud, join([]))]


def _of_points(cloud: Cloud, along: Boxes) -> list[tuple[Source, Boxes]]:
    """Pieces from points with normals and limbs, by source, and groups of those that explain the points together."""
    if len(cloud.points) < SETTINGS.least_points:
        return [(Source.GROUP, boxes_around([cloud.points]))]
    patches = planar_patches(cloud)
    between = slabs(patches)
    support = Support(cloud, between)
    selected = np.flatnonzero(support.filled)
    selected = selected[np.argsort(-support.explained[selected].sum(1), kind="stable")[: SETTINGS.pieces]]
    parts = [
        (Source.ROD, rods(cloud)),
        (Source.LIMB, along),
        (Source.SLAB, between.take(selected)),
        (Source.SHEET, sheets(patches)),
    ]
    boxes = join([part for _, part in parts])
    return [*parts, (Source.GROUP, groups(boxes.take(Support(cloud, boxes).cover())))]
