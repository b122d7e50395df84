"""The connected components of a mesh, whatever way its triangles were written down, and copies among them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from shapeprog.inference.pieces.oriented import Boxes
from shapeprog.space import Array, FloatArray

WELD = 2.0**-12
"""Vertices that round to the same multiple of this, in cells, are one: a hundred-thousandth of the longest side."""

ALIKE = 0.02
"""Distance in cells within which the vertices of copies meet."""

LARGEST_COPY = 2000
"""Vertices above which components are not compared."""

KINDS = 64
"""Different components of equal counts that are told apart."""

OPEN = 0.02
"""Share of its edges at which a component may be open and yet bound a solid."""

THICK = 0.2
"""Least thickness of such a solid in cells, on average: the volume of a crumpled sheet says nothing about its sides."""


class Components(NamedTuple):
    """Components by falling area, and the welded mesh they are made of.

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
        """The components that some faces are of."""
        return np.searchsorted(self.face_start, face, side="right") - 1


def components(vertices: Array, faces: Array) -> Components:
    """The components of a triangle mesh in cells, once vertices are welded and doubled and empty faces left out."""
    places, listed = weld(np.asarray(vertices, np.float64), np.asarray(faces, np.int64))
    listed, area = once_each(places, listed)
    count, label = _joined(listed, len(places))
    of_face = label[listed[:, 0]]
    total = np.bincount(of_face, area, minlength=count)
    used = np.flatnonzero(total > 0)
    order = used[np.argsort(-np.round(total[used], 6), kind="stable")]
    rank = np.full(count, count)
    rank[order] = np.arange(len(order))
    sequence = np.argsort(rank[of_face], kind="stable")
    corner = np.argsort(rank[label], kind="stable")
    bounds = np.arange(len(order) + 1)
    return Components(
        places,
        listed[sequence],
        np.searchsorted(rank[of_face][sequence], bounds),
        corner[: np.searchsorted(rank[label][corner], len(order))],
        np.searchsorted(rank[label][corner], bounds),
        np.asarray(total[order], np.float64),
    )


def weld(vertices: FloatArray, faces: npt.NDArray[np.int64]) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Vertices that coincide made one, in the order in which faces first use them, and the faces."""
    used = np.zeros(len(vertices), np.bool_)
    used[faces.reshape(-1)] = True
    cell = np.round(vertices[used] / WELD + 0.3).astype(np.int64)  # round numbers are well inside their cell
    cell -= cell.min(0)
    size = cell.max(0) + 1
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    _, kept, name = np.unique(key, return_index=True, return_inverse=True)
    corners = name[np.cumsum(used)[faces.reshape(-1)] - 1]
    seen = np.empty(len(kept), np.int64)
    seen[corners[::-1]] = np.arange(len(corners))[::-1]  # of several values the last, which is the first corner, stays
    order = np.argsort(seen, kind="stable")
    rank = np.empty(len(kept), np.int64)
    rank[order] = np.arange(len(kept))
    return vertices[used][kept][order], rank[corners].reshape(-1, 3)


def once_each(vertices: FloatArray, faces: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """The faces that have an area, each once whichever way round it is, and their areas."""
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    name = np.random.default_rng(0).integers(1 << 62, size=len(vertices), dtype=np.uint64)
    mixed = name[faces[:, 0]] + name[faces[:, 1]] + name[faces[:, 2]]  # the same for all orders of the corners
    order = np.argsort(mixed, kind="stable")
    likely = np.flatnonzero(mixed[order[1:]] == mixed[order[:-1]])
    same = (np.sort(faces[order[likely + 1]], axis=1) == np.sort(faces[order[likely]], axis=1)).all(1)
    again = np.zeros(len(faces), np.bool_)
    again[order[likely[same] + 1]] = True
    keep = ~again & (area > 0)
    return faces[keep], area[keep]


def solid_sides(vertices: FloatArray, faces: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Of each face (F,) 1 if it is of a component that bounds a solid and faces outwards, -1 if inwards, else 0.

    At each edge of a closed surface as many faces run one way as the other, and the volume that it encloses is above
    zero where they face outwards.
    """
    places, listed = weld(vertices, faces)
    count, of_vertex = _joined(listed, len(places))
    label = of_vertex[listed[:, 0]]
    start, end = listed.reshape(-1), listed[:, [1, 2, 0]].reshape(-1)
    name = np.minimum(start, end) * len(places) + np.maximum(start, end)
    _, edge = np.unique(name, return_inverse=True)
    uneven = np.bincount(edge, np.sign(end - start)) != 0
    many = np.bincount(label, minlength=count)
    gaps = np.bincount(np.repeat(label, 3), uneven[edge], minlength=count) / np.maximum(3 * many, 1)
    corners = places[listed]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.bincount(label, np.linalg.norm(across, axis=1), minlength=count) / 2
    volume = np.bincount(label, (corners[:, 0] * across).sum(1), minlength=count) / 6
    solid = (gaps <= OPEN) & (2 * np.abs(volume) > THICK * area)
    found: npt.NDArray[np.int64] = np.where(solid, np.sign(volume), 0).astype(np.int64)[label]
    return found


def _joined(faces: npt.NDArray[np.int64], vertices: int) -> tuple[int, npt.NDArray[np.int64]]:
    """How many components faces join so many vertices to, and which each vertex is of (V,)."""
    links = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_matrix((np.ones(len(links), np.bool_), (links[:, 0], links[:, 1])), shape=(vertices, vertices))
    count, label = connected_components(graph, directed=False)
    return int(count), label


def align_copies(found: Components, boxes: Boxes) -> Boxes:
    """Boxes of components that are copies of each other, turned alike.

    Copies have their vertices in the same order; the motion between them, which may be a reflection, is the best fit
    (Kabsch 1976).  The copy whose box is turned least is the model of the others.
    """
    count = np.diff(found.corner_start)[: len(boxes.half)]
    rotation, centre, half = boxes.rotation.copy(), boxes.centre.copy(), boxes.half.copy()
    turned = np.abs(boxes.rotation).max(1).sum(1)  # 3 along the axes
    for size in np.unique(count[(count > 2) & (count <= LARGEST_COPY)]):
        left = np.flatnonzero(count == size)
        at = found.corner_start[left][:, None] + np.arange(size)
        middle = found.vertices[found.corner[at]].mean(1)
        cloud = found.vertices[found.corner[at]] - middle[:, None]
        for _ in range(KINDS):
            if len(left) < 2:
                break
            model = 0
            same, turn = _motions(cloud[model], cloud)
            members = np.flatnonzero(same)
            best = members[np.argmax(np.round(turned[left[members]], 3))]
            for each in members:
                motion = turn[each] @ turn[best].T
                source, goal = left[best], left[each]
                if each != best:
                    rotation[goal] = motion @ boxes.rotation[source]
                    half[goal] = boxes.half[source]
                    centre[goal] = middle[each] + motion @ (boxes.centre[source] - middle[best])
            keep = ~same
            left, cloud, middle = left[keep], cloud[keep], middle[keep]
    rotation[np.linalg.det(rotation) < 0, :, 2] *= -1
    return Boxes(centre, rotation, half)


def _motions(model: FloatArray, clouds: FloatArray) -> tuple[npt.NDArray[np.bool_], FloatArray]:
    """Which centred clouds (G, V, 3) are the model (V, 3) turned or reflected, and by what (G, 3, 3)."""
    u, _, vt = np.linalg.svd(np.einsum("gvi,vj->gij", clouds, model))
    turn = u @ vt
    off = np.abs(np.einsum("gij,vj->gvi", turn, model) - clouds).max((1, 2))
    return off < ALIKE, turn
