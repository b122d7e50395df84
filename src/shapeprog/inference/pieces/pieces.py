"""Proposals: oriented boxes that may be parts of a target, and the points of its surface.

========= ==========================================================================================
source    box around
========= ==========================================================================================
component a connected component of the mesh
group     boxes that touch, such as the frame of a back
rod       points on a cylinder
limb      points of clean scans whose inner balls run on in one direction
slab      the space between two planar patches that face each other
sheet     one planar patch of unknown thickness
========= ==========================================================================================

They overlap, and most are wrong: the selection of candidates decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.data.sampling import sample_with_faces
from shapeprog.data.shape import Shape
from shapeprog.inference.pieces.covering import Support
from shapeprog.inference.pieces.grouping import groups
from shapeprog.inference.pieces.limbs import limbs
from shapeprog.inference.pieces.oriented import Boxes, bounds, boxes_around, distinct, join
from shapeprog.inference.pieces.patches import planar_patches
from shapeprog.inference.pieces.rods import rods
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.pieces.slabs import sheets, slabs
from shapeprog.inference.surface.cloud import Cloud, cloud_of, is_clean, points_of_scan
from shapeprog.inference.surface.components import Components, components


class Source(Enum):
    """Source of a piece."""

    COMPONENT = 0
    GROUP = 1
    ROD = 2
    LIMB = 3
    SLAB = 4
    SHEET = 5


class Pieces(NamedTuple):
    """Boxes in cells, the most important first, and the points of the surface.

    Parameters
    ----------
    boxes
        Centres, axes and half extents.
    source
        Source of each piece (N,), as values of :class:`Source`.
    cloud
        The surface as points with normals.
    """

    boxes: Boxes
    source: npt.NDArray[np.int64]
    cloud: Cloud


def find_pieces(shape: Shape) -> Pieces:
    """Pieces of a mesh or a point cloud.

    Pieces of a greedy selection are first, then components, then groups, rods and limbs, then slabs and sheets; within
    each class, pieces that explain more points are first.
    """
    if shape.vertices is not None and shape.faces is not None and len(shape.faces):
        mesh = components(shape.vertices, shape.faces)
        if len(mesh.area):
            return _of_mesh(mesh)
    points = points_of_scan(shape)
    cloud = cloud_of(points)
    return _ranked(cloud, _of_points(cloud, limbs(cloud) if is_clean(points) else []), join([]))


def _of_mesh(mesh: Components) -> Pieces:
    """Pieces of a mesh: from its components, and from sampled points, with at least some on each large component."""
    count = min(len(mesh.area), SETTINGS.components)
    corner = mesh.corner[: mesh.corner_start[count]]
    boxes = boxes_around(mesh.vertices[corner], mesh.corner_start[: count + 1])
    samples = [sample_with_faces(mesh.vertices, mesh.faces, SETTINGS.points, 0)]
    counts = np.bincount(mesh.component_of(samples[0][1]), minlength=count)
    for component in np.flatnonzero(counts[:count] < SETTINGS.component_points):
        first, last = mesh.face_start[component : component + 2]
        points, face = sample_with_faces(mesh.vertices, mesh.faces[first:last], SETTINGS.component_points, 0)
        samples.append((points, face + first))
    points, face = (np.concatenate(column) for column in zip(*samples, strict=True))
    corners = mesh.vertices[mesh.faces[face]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cloud = cloud_of(points, normals / np.linalg.norm(normals, axis=1, keepdims=True))
    return _ranked(cloud, [(Source.GROUP, groups(boxes)), *_of_points(cloud, [])], boxes)


def _of_points(cloud: Cloud, along: Sequence[npt.NDArray[np.int64]]) -> list[tuple[Source, Boxes]]:
    """Pieces from points with normals, by source, and groups of those that explain the points together.

    ``along`` has the indices of the points of each limb.
    """
    if len(cloud.points) < SETTINGS.least_points:
        return [(Source.GROUP, boxes_around(cloud.points, np.array([0, len(cloud.points)])))]
    patches = planar_patches(cloud)
    between = slabs(patches)
    between = between.take(distinct(between, SETTINGS.same))
    support = Support(cloud, between)
    selected = np.flatnonzero(support.filled)
    selected = selected[np.argsort(-support.explained[selected].sum(1), kind="stable")[: SETTINGS.slabs]]
    along = along[: SETTINGS.limbs]
    members = cloud.points[np.concatenate(along)] if along else np.zeros((0, 3))
    sources = [
        (Source.ROD, rods(cloud)),
        (Source.LIMB, boxes_around(members, bounds(along))),
        (Source.SLAB, between.take(selected)),
        (Source.SHEET, sheets(patches, SETTINGS.sheets)),
    ]
    boxes = join([part for _, part in sources])
    return [*sources, (Source.GROUP, groups(boxes.take(Support(cloud, boxes).cover())))]


def _ranked(cloud: Cloud, listed: list[tuple[Source, Boxes]], component_boxes: Boxes) -> Pieces:
    """All pieces, each once, the most important first."""
    count = len(component_boxes.half)
    listed = [(Source.COMPONENT, component_boxes), *listed]
    boxes = join([boxes for _, boxes in listed])
    source = np.concatenate([np.full(len(boxes.half), source.value) for source, boxes in listed])
    unique = distinct(boxes, SETTINGS.same)
    unique = np.concatenate([np.arange(count), unique[unique >= count]])
    boxes, source = boxes.take(unique), source[unique]
    support = Support(cloud, boxes)
    first = np.full(len(unique), len(unique))
    cover = support.cover()
    first[cover] = np.arange(len(cover))
    turn = np.searchsorted([Source.COMPONENT.value, Source.LIMB.value], source)
    order = np.lexsort((-np.round(support.value, 6), turn, first))[: SETTINGS.pieces]
    return Pieces(boxes.take(order), source[order], cloud)
