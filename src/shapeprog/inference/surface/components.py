"""The connected components of a mesh, independent of the order and winding of its triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from shapeprog.space import Array, FloatArray


class Components(NamedTuple):
    """Components by falling area, and the welded mesh that contains them.

    ``vertices`` (V, 3); ``faces`` (F, 3), each once, those of one component after another, ``face_start`` (G + 1,);
    ``corner`` (C,) the vertices of each component in the order of the file, ``corner_start`` (G + 1,); ``area`` (G,).
    """

    vertices: FloatArray
    faces: npt.NDArray[np.int64]
    face_start: npt.NDArray[np.int64]
    corner: npt.NDArray[np.int64]
    corner_start: npt.NDArray[np.int64]
    area: FloatArray

    def component_of(self, face: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """The indices of the components that contain some faces."""
        return np.searchsorted(self.face_start, face, side="right") - 1


def components(vertices: Array, faces: Array) -> Components:
    """The components of a triangle mesh in cells, after welding vertices and removing duplicate and empty faces.

    Closed surfaces that share vertices or edges only, such as a door and its case, are separate components.
    """
    welded, listed = weld(np.asarray(vertices, np.float64), np.asarray(faces, np.int64))
    listed, area = unique_faces(welded, listed)
    welded, listed = separated(welded, listed)
    label = linked(np.concatenate([listed[:, :2], listed[:, 1:]]), len(welded))
    count, of_face = int(label.max(initial=-1)) + 1, label[listed[:, 0]]
    total = np.bincount(of_face, area, minlength=count)
    used = np.flatnonzero(total > 0)
    order = used[np.argsort(-np.round(total[used], 6), kind="stable")]
    rank = np.full(count, count)
    rank[order] = np.arange(len(order))
    sequence = np.argsort(rank[of_face], kind="stable")
    corner = np.argsort(rank[label], kind="stable")
    bounds = np.arange(len(order) + 1)
    return Components(
        welded,
        listed[sequence],
        np.searchsorted(rank[of_face][sequence], bounds),
        corner[: np.searchsorted(rank[label][corner], len(order))],
        np.searchsorted(rank[label][corner], bounds),
        np.asarray(total[order], np.float64),
    )


def weld(vertices: FloatArray, faces: npt.NDArray[np.int64]) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Vertices with coinciding ones merged, in the order of first use by faces, and the faces.

    Vertices coincide if they round to the same multiple of 2^-12 cells, a hundred-thousandth of the longest side.
    """
    used = np.zeros(len(vertices), np.bool_)
    used[faces.reshape(-1)] = True
    cell = np.round(vertices[used] * 2**12 + 0.3).astype(np.int64)  # round numbers are well inside their cell
    cell -= cell.min(0)
    size = cell.max(0) + 1
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    _, unique, name = np.unique(key, return_index=True, return_inverse=True)
    corners = name[np.cumsum(used)[faces.reshape(-1)] - 1]
    first = np.empty(len(unique), np.int64)
    first[corners[::-1]] = np.arange(len(corners))[::-1]  # the last value, of the first corner, stays
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(unique), np.int64)
    rank[order] = np.arange(len(unique))
    return vertices[used][unique][order], rank[corners].reshape(-1, 3)


def unique_faces(vertices: FloatArray, faces: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """The faces with an area, without duplicates of either winding, and their areas."""
    ordered, count = np.sort(faces, axis=1), len(vertices)
    _, pair = np.unique(ordered[:, 0] * count + ordered[:, 1], return_inverse=True)
    _, first = np.unique(pair * count + ordered[:, 2], return_index=True)
    faces = faces[np.sort(first)]
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    return faces[area > 0], area[area > 0]


def separated(vertices: FloatArray, faces: npt.NDArray[np.int64]) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """The mesh with separate vertices for each closed surface.

    Faces belong to one surface if edges that exactly two faces share link them.  It is closed if equally many of its
    faces run in both directions at each edge.
    """
    edge = edges(faces, len(vertices))
    manifold = np.bincount(edge)[edge] == 2
    face = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(edge[manifold], kind="stable")
    surface = linked(face[manifold][order].reshape(-1, 2), len(faces))
    direction = np.sign(faces[:, [1, 2, 0]] - faces).reshape(-1)
    own, name = np.unique(surface[face] * len(edge) + edge, return_inverse=True)
    closed = np.bincount(own // len(edge), np.bincount(name, direction) != 0) == 0
    surface = np.where(closed[surface], surface + 1, 0)
    key = (faces + len(vertices) * surface[:, None]).reshape(-1)
    _, first, name = np.unique(key, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))  # in the order of the file
    return vertices[faces.reshape(-1)[np.sort(first)]], rank[name].reshape(-1, 3)


def edges(faces: npt.NDArray[np.int64], count: int) -> npt.NDArray[np.int64]:
    """The index (3 F,) of each edge of the faces, equal for both directions, of ``count`` vertices."""
    start, end = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    name: npt.NDArray[np.int64] = np.unique(
        np.minimum(start, end) * count + np.maximum(start, end), return_inverse=True
    )[1]
    return name


def solid_sides(mesh: Components) -> npt.NDArray[np.int64]:
    """For each face (F,) of a component that bounds a solid, 1 if it faces outwards and -1 if inwards; 0 for others.

    At each edge of a closed surface, equally many faces run in both directions, and the signed volume is positive if
    the faces point outwards.  Some 2 % of the edges may be open.  The solid is at least .2 cells thick on average: the
    sign of the volume of a crumpled sheet is random.
    """
    faces, counts = mesh.faces, np.diff(mesh.face_start)
    component = np.repeat(np.arange(len(counts)), counts)
    start, end = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    edge = edges(faces, len(mesh.vertices))
    uneven = np.bincount(edge, np.sign(end - start)) != 0
    gaps = np.bincount(np.repeat(component, 3), uneven[edge], minlength=len(counts)) / (3 * counts)
    corners = mesh.vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volume = np.bincount(component, (corners[:, 0] * across).sum(1), minlength=len(counts)) / 6
    solid = (gaps <= 0.02) & (2 * np.abs(volume) > 0.2 * mesh.area)
    sides: npt.NDArray[np.int64] = np.where(solid, np.sign(volume), 0).astype(np.int64)[component]
    return sides


def simple_parts(mesh: Components, sides: npt.NDArray[np.int64], seen: npt.NDArray[np.int64]) -> FloatArray:
    """Low and high corners (K, 2, 3) of the boxes of solid, visible components that fill most of their box.

    ``sides`` (F,) are those of :func:`solid_sides`; ``seen`` has the indices of visible faces.
    """
    at, face, corner = mesh.vertices[mesh.corner], mesh.face_start[:-1], mesh.corner_start[:-1]
    low, high = np.minimum.reduceat(at, corner), np.maximum.reduceat(at, corner)
    volume = np.abs(np.add.reduceat(np.linalg.det(mesh.vertices[mesh.faces]), face)) / 6
    simple = (sides[face] != 0) & (volume >= 0.5 * (high - low).prod(1))  # a ball fills .52 of its box
    return np.stack([low, high], 1)[simple & np.isin(np.arange(len(face)), mesh.component_of(seen))]


def linked(pairs: Array, count: int) -> npt.NDArray[np.int64]:
    """The connected component (count,) of each of ``count`` items, from linked pairs (P, 2)."""
    graph = coo_matrix((np.ones(len(pairs), np.bool_), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)
