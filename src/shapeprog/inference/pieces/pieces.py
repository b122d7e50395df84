"""Proposals: oriented boxes that a target may consist of, and the points that each comes from.

========= ==========================================================================================
source    box around
========= ==========================================================================================
component a connected component of the mesh
group     boxes that touch, such as the frame of a back
rod       points on a cylinder
limb      points of clean scans whose inner balls run on in one direction
slab      the space between two planar patches that face each other
sheet     one planar patch; how thick it is, is not known
========= ==========================================================================================

They overlap, and most are wrong: the choice among candidates decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.data.sampling import sample_with_faces
from shapeprog.data.shape import Shape
from shapeprog.inference.pieces.copies import align_copies
from shapeprog.inference.pieces.covering import Support
from shapeprog.inference.pieces.grouping import groups
from shapeprog.inference.pieces.limbs import limbs
from shapeprog.inference.pieces.oriented import Boxes, bounds, boxes_around, distinct, join
from shapeprog.inference.pieces.patches import planar_patches
from shapeprog.inference.pieces.rods import rods
from shapeprog.inference.pieces.slabs import sheets, slabs
from shapeprog.inference.surface.cloud import Cloud, cloud_of, is_clean, points_of_scan
from shapeprog.inference.surface.components import Components, components

POINTS = 20_000
"""Points in which the surface of a mesh is seen."""

OWN = 48
"""Points that each component has at least."""

COMPONENTS, SLABS, SHEETS, LIMBS = 300, 600, 60, 100
"""Most pieces of these sources."""

MOST = 600
"""Most pieces of one target."""

SAME = 0.25
"""Difference in cells in place and size below which two pieces are the same; a component's is kept as it is."""

LEAST = 32
"""Points below which there is no surface to speak of."""


class Source(Enum):
    """Where a piece comes from."""

    COMPONENT = 0
    GROUP = 1
    ROD = 2
    LIMB = 3
    SLAB = 4
    SHEET = 5


class Pieces(NamedTuple):
    """Boxes in cells, the most important first, and the points of the surface that each of them comes from.

    Parameters
    ----------
    boxes
        Centres, axes and half extents.
    source
        Where each comes from (N,), as values of :class:`Source`.
    cloud
        The surface as points with normals.
    """

    boxes: Boxes
    source: npt.NDArray[np.int64]
    cloud: Cloud


def find_pieces(shape: Shape, seed: int = 0) -> Pieces:
    """Pieces of a mesh or a point cloud; the same for the same seed.

    Those that a greedy choice takes come first, then components, then the few of groups, rods and limbs, then the many
    of slabs and sheets; among these, those that explain most.
    """
    if shape.vertices is not None and shape.faces is not None and len(shape.faces):
        mesh = components(shape.vertices, shape.faces)
        if len(mesh.area):
            return _of_mesh(mesh, seed)
    points = points_of_scan(shape)
    cloud = cloud_of(points)
    return _ranked(cloud, _of_points(cloud, seed, limbs(cloud) if is_clean(points) else []), join([]))


def _of_mesh(mesh: Components, seed: int) -> Pieces:
    """Pieces of a mesh: of its components, and of points on it, among which each large component has some."""
    count = min(len(mesh.area), COMPONENTS)
    corner = mesh.corner[: mesh.corner_start[count]]
    boxes = align_copies(mesh, boxes_around(mesh.vertices[corner], mesh.corner_start[: count + 1]))
    drawn = [sample_with_faces(mesh.vertices, mesh.faces, POINTS, seed)]
    own = np.bincount(mesh.component_of(drawn[0][1]), minlength=count)
    for each in np.flatnonzero(own[:count] < OWN):
        first, last = mesh.face_start[each : each + 2]
        points, face = sample_with_faces(mesh.vertices, mesh.faces[first:last], OWN, seed)
        drawn.append((points, face + first))
    points, face = (np.concatenate(each) for each in zip(*drawn, strict=True))
    corners = mesh.vertices[mesh.faces[face]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cloud = cloud_of(points, normals / np.linalg.norm(normals, axis=1, keepdims=True))
    return _ranked(cloud, [(Source.GROUP, groups(boxes)), *_of_points(cloud, seed, [])], boxes)


def _of_points(cloud: Cloud, seed: int, along: Sequence[npt.NDArray[np.int64]]) -> list[tuple[Source, Boxes]]:
    """Pieces from points with normals, by source, and groups of those that explain the points together.

    ``along`` has the points of each limb.
    """
    if len(cloud.points) < LEAST:
        return [(Source.GROUP, boxes_around(cloud.points, np.array([0, len(cloud.points)])))]
    patches = planar_patches(cloud)
    between = slabs(patches)
    between = between.take(distinct(between, SAME))
    support = Support(cloud, between)
    kept = np.flatnonzero(support.filled)
    kept = kept[np.argsort(-support.near[kept].sum(1), kind="stable")[:SLABS]]
    along = along[:LIMBS]
    members = cloud.points[np.concatenate(along)] if along else np.zeros((0, 3))
    found = [
        (Source.ROD, rods(cloud, seed)),
        (Source.LIMB, boxes_around(members, bounds(along))),
        (Source.SLAB, between.take(kept)),
        (Source.SHEET, sheets(patches, SHEETS)),
    ]
    boxes = join([each for _, each in found])
    return [*found, (Source.GROUP, groups(boxes.take(Support(cloud, boxes).cover())))]


def _ranked(cloud: Cloud, listed: list[tuple[Source, Boxes]], whole: Boxes) -> Pieces:
    """All pieces, each once, the most important first."""
    count = len(whole.half)
    listed = [(Source.COMPONENT, whole), *listed]
    boxes = join([boxes for _, boxes in listed])
    source = np.concatenate([np.full(len(boxes.half), source.value) for source, boxes in listed])
    once = distinct(boxes, SAME)
    once = np.concatenate([np.arange(count), once[once >= count]])
    boxes, source = boxes.take(once), source[once]
    support = Support(cloud, boxes)
    first = np.full(len(once), len(once))
    cover = support.cover()
    first[cover] = np.arange(len(cover))
    turn = np.searchsorted([Source.COMPONENT.value, Source.LIMB.value], source)
    order = np.lexsort((-np.round(support.value, 6), turn, first))[:MOST]
    return Pieces(boxes.take(order), source[order], cloud)
