"""Proposals: oriented boxes that a target may consist of, and the points that each comes from.

========= ==========================================================================================
source    box around
========= ==========================================================================================
component a connected component of the mesh
group     boxes that touch, such as the frame of a back
rod       points on a cylinder
limb      thin stretches of scans and of cells; of these also points whose inner balls run on in one direction
slab      the space between two planar patches that face each other
sheet     one planar patch; how thick it is, is not known
========= ==========================================================================================

They overlap, and most are wrong: what explains the target best is for others to choose.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.data.sampling import sample_with_faces
from shapeprog.data.shape import Shape
from shapeprog.inference.cells.stacks import stacks
from shapeprog.inference.pieces.covering import Support
from shapeprog.inference.pieces.grouping import groups
from shapeprog.inference.pieces.limbs import limbs
from shapeprog.inference.pieces.oriented import Boxes, bounds, boxes_around, distinct, join
from shapeprog.inference.pieces.patches import planar_patches
from shapeprog.inference.pieces.rods import rods
from shapeprog.inference.pieces.slabs import sheets, slabs
from shapeprog.inference.pieces.strands import strands
from shapeprog.inference.surface.cells import faces_of_cells
from shapeprog.inference.surface.cloud import Cloud, cloud_of
from shapeprog.inference.surface.components import Components, align_copies, components
from shapeprog.inference.surface.scans import points_of_scan
from shapeprog.space import FloatArray

POINTS = 20_000
"""Points in which the surface of a mesh or of cells is seen."""

OWN = 48
"""Points that each component has at least."""

COMPONENTS, SLABS, SHEETS, LIMBS = 300, 600, 60, 100
"""Most pieces of these sources."""

MOST = 600
"""Most pieces of one target."""

SAME = 0.25
"""Difference in cells in place and size below which two pieces are the same; a component's is kept as it is."""

TOO_FAT = 0.5
"""How far the surface is below the outer faces of touched cells on average, in cells."""

ABOUT = 0.3
"""Distance in cells outside a box up to which points belong to it."""

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
    component
        Which component of the mesh each is (N,); -1 for the others.
    cloud
        The surface as points with normals.
    owner
        Which component each point lies on (P,); -1 where that is not known.
    """

    boxes: Boxes
    source: npt.NDArray[np.int64]
    component: npt.NDArray[np.int64]
    cloud: Cloud
    owner: npt.NDArray[np.int64]

    def points_of(self, piece: int) -> npt.NDArray[np.int64]:
        """Indices of the points that a piece comes from: of its component, else in its box or close to it."""
        if self.component[piece] >= 0:
            return np.flatnonzero(self.owner == self.component[piece])
        at = np.abs((self.cloud.points - self.boxes.centre[piece]) @ self.boxes.rotation[piece])
        return np.flatnonzero((at <= self.boxes.half[piece] + ABOUT).all(1))


def find_pieces(shape: Shape, seed: int = 0) -> Pieces:
    """Pieces of a mesh, a point cloud or cells; the same for the same seed.

    Those that a greedy choice takes come first, then components, then the few of groups, rods and limbs, then the many
    of slabs and sheets; among these, those that explain most.
    """
    mesh = None
    if shape.vertices is not None and shape.faces is not None:
        mesh = components(shape.vertices, shape.faces)
    if mesh is not None and len(mesh.area):
        return _of_mesh(mesh, seed)
    if shape.points is not None:
        cloud = cloud_of(points_of_scan(shape))
        return _of_points(cloud, _told(cloud, seed, [*strands(cloud), *limbs(cloud)]))
    cloud = cloud_of(*faces_of_cells(shape.voxels, POINTS, seed=seed))
    found = _of_points(cloud, [(Source.LIMB, stacks(shape.voxels)), *_told(cloud, seed, limbs(cloud))])
    return found._replace(boxes=shrunk(found.boxes, TOO_FAT))


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
    points, face = np.concatenate([each[0] for each in drawn]), np.concatenate([each[1] for each in drawn])
    corners = mesh.vertices[mesh.faces[face]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cloud = cloud_of(points, normals / np.linalg.norm(normals, axis=1, keepdims=True))
    listed = [(Source.GROUP, groups(boxes)), *_told(cloud, seed, [])]
    return _ranked(cloud, listed, boxes, mesh.component_of(face))


def _of_points(cloud: Cloud, listed: list[tuple[Source, Boxes]]) -> Pieces:
    """Pieces of points alone."""
    return _ranked(cloud, listed, join([]), np.full(len(cloud.points), -1))


def _told(cloud: Cloud, seed: int, along: Sequence[npt.NDArray[np.int64]]) -> list[tuple[Source, Boxes]]:
    """Pieces that points with normals tell of, by source, and groups of those that explain the points together.

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


def _ranked(cloud: Cloud, listed: list[tuple[Source, Boxes]], whole: Boxes, owner: npt.NDArray[np.int64]) -> Pieces:
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
    return Pieces(boxes.take(order), source[order], np.where(order < count, order, -1), cloud, owner)


def shrunk(boxes: Boxes, by: float) -> Boxes:
    """Boxes whose sides are moved inwards, but not by more than half of what is there."""
    half: FloatArray = np.maximum(boxes.half - by, boxes.half / 2)
    return Boxes(boxes.centre, boxes.rotation, half)
