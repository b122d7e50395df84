"""The connected components of a mesh, independent of the order and winding of its triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shapeprog.geometry.contacts import linked
from shapeprog.geometry.mesh import triangle_normals
from shapeprog.space import Array, FloatArray, IntArray


class Components(NamedTuple):
    """Components by falling area, and the welded mesh that contains them.

    ``vertices`` (V, 3) in the order of the file; ``faces`` (F, 3), each once, those of one component after another;
    ``start`` (G + 1,), the first face of each component and the end of the last; ``area`` (G,).
    """

    vertices: FloatArray
    faces: IntArray
    start: IntArray
    area: FloatArray

    def component_of(self, face: IntArray) -> IntArray:
        """The indices of the components that contain some faces."""
        return np.searchsorted(self.start, face, side="right") - 1


def components(vertices: Array, faces: Array) -> Components:
    """The components of a triangle mesh in cells, after welding vertices and removing duplicate and empty faces.

    Closed surfaces that share vertices or edges only, such as a door and its case, are separate components.
    """
    welded, listed = _weld(np.asarray(vertices, np.float64), np.asarray(faces, np.int64))
    listed, area = _unique_faces(welded, listed)
    welded, listed = _separated(welded, listed)
    label = linked(np.concatenate([listed[:, :2], listed[:, 1:]]), len(welded))[listed[:, 0]]
    total = np.bincount(label, area)
    order = np.argsort(-np.round(total, 6), kind="stable")
    rank = np.argsort(order)[label]
    sequence = np.argsort(rank, kind="stable")
    start = np.searchsorted(rank[sequence], np.arange(len(order) + 1))
    return Components(welded, listed[sequence], start, np.asarray(total[order], np.float64))


def _weld(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """The mesh with vertices merged that round to the same multiple of 2^-12 cells, 10^-5 of the longest side."""
    used, corner = np.unique(faces, return_inverse=True)
    cell = np.round(vertices[used] * 2**12 + 0.3).astype(np.int64)  # round numbers are well inside their cell
    key = np.ravel_multi_index((cell - cell.min(0)).T, np.ptp(cell, 0) + 1)
    _, unique, name = np.unique(key, return_index=True, return_inverse=True)
    return vertices[used[unique]], name[corner.reshape(-1, 3)]


def _unique_faces(vertices: FloatArray, faces: IntArray) -> tuple[IntArray, FloatArray]:
    """The faces with an area, without duplicates of either winding, and their areas."""
    ordered, count = np.sort(faces, axis=1), len(vertices)
    _, pair = np.unique(ordered[:, 0] * count + ordered[:, 1], return_inverse=True)
    _, first = np.unique(pair * count + ordered[:, 2], return_index=True)
    faces = faces[np.sort(first)]
    area = np.linalg.norm(triangle_normals(vertices, faces)[0], axis=1) / 2
    return faces[area > 0], area[area > 0]


def _separated(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """The mesh with separate vertices for each closed surface, in the order of the faces.

    Faces belong to one surface if edges that exactly two faces share link them.  It is closed if equally many of its
    faces run in both directions at each edge.
    """
    edge, direction = _edges(faces, len(vertices))
    manifold = np.bincount(edge)[edge] == 2
    face = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(edge[manifold], kind="stable")
    surface = linked(face[manifold][order].reshape(-1, 2), len(faces))
    own, name = np.unique(surface[face] * len(edge) + edge, return_inverse=True)
    closed = np.bincount(own // len(edge), np.bincount(name, direction) != 0) == 0
    surface = np.where(closed[surface], surface + 1, 0)
    corner = (faces + len(vertices) * surface[:, None]).reshape(-1)
    _, first, name = np.unique(corner, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return vertices[faces.reshape(-1)[first[order]]], np.argsort(order)[name].reshape(-1, 3)


def _edges(faces: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """The index of each edge (3 F,) of faces over ``count`` vertices, equal for both directions, and its direction."""
    start, end = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    _, edge = np.unique(np.minimum(start, end) * count + np.maximum(start, end), return_inverse=True)
    return edge, np.sign(end - start)


def solid_sides(mesh: Components, volume: FloatArray) -> IntArray:
    """For each face (F,) of a component that bounds a solid, 1 if it faces outwards and -1 if inwards; 0 for others,
    and for those less than .2 cells thick on average: the sign of the volume of a crumpled sheet is random."""
    # NaN, of open components, compares false.
    sign = np.where(2 * np.abs(volume) > 0.2 * mesh.area, np.sign(volume), 0).astype(np.int64)
    return np.repeat(sign, np.diff(mesh.start))


def enclosed(mesh: Components) -> FloatArray:
    """The signed volume of each component (K,), NaN if it is open.

    At each edge of a closed surface, equally many faces run in both directions; some 2 % of the edges may be open.
    """
    edge, direction = _edges(mesh.faces, len(mesh.vertices))
    open_edges = (np.bincount(edge, direction) != 0)[edge].reshape(-1, 3).sum(1)
    gaps = np.add.reduceat(open_edges, mesh.start[:-1]) / (3 * np.diff(mesh.start))
    volume = np.add.reduceat(np.linalg.det(mesh.vertices[mesh.faces]), mesh.start[:-1]) / 6
    return np.where(gaps <= 0.02, volume, np.nan)
