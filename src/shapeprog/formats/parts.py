"""The parts of a program as named meshes, and the solid they make together."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapeprog.errors import OutputError, ShapeProgError
from shapeprog.geometry.contacts import linked
from shapeprog.geometry.mesh import joined, part_meshes, triangle_normals, union_mesh
from shapeprog.language.parameters import LARGEST
from shapeprog.language.program import Program
from shapeprog.language.reader import BEGIN
from shapeprog.language.unroll import exact_scene
from shapeprog.space import Frame

CREASE = math.radians(40)  # angle between the normals of two triangles from which their common edge is sharp

Vertices = npt.NDArray[np.float64]
Faces = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Part:
    """One primitive of an unrolled program.

    Parameters
    ----------
    name
        Role or statement and number, such as ``leg_3``.
    word
        That role or statement.
    block
        Which of the program's drawing statements, in the order of the text, from 0.
    vertices, faces
        Watertight triangles, (V, 3) and (F, 3), counter-clockwise from outside.
    """

    name: str
    word: str
    block: int
    vertices: Vertices
    faces: Faces


def parts(program: Program, frame: Frame | None = None) -> list[Part]:
    """The parts of a program in the order they are drawn, in the world of ``frame`` (the grid by default).

    Parts without volume, such as boards of zero thickness, are left out.

    Raises
    ------
    ShapeProgError
        If there are too many or they are too far away, see :func:`shapeprog.geometry.mesh.part_meshes`.
    OutputError
        If the frame maps them beyond single precision, which mesh files store.
    """
    with exact_scene(program) as scene:
        blocks, meshes = scene.block.tolist(), part_meshes(scene)
    numbers: Counter[str] = Counter()
    result = []
    words = [draw.word for draw in program.draws]
    for slot, vertices, faces in meshes:
        word = words[block := blocks[slot]]
        numbers[word] += 1
        result.append(Part(f"{word}_{numbers[word]}", word, block, placed(vertices, frame), faces))
    return result


def placed(points: npt.NDArray[Any], frame: Frame | None = None) -> Vertices:
    """Points of the grid in the world of ``frame``, or unchanged without one; an ``OutputError`` if a coordinate
    exceeds float32, which most files store."""
    result = np.asarray(points, np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        result = result if frame is None else frame.to_world(result)
    if not (np.abs(result) <= LARGEST).all():
        message = "a part of this program, or its frame, is too large or too far away to be drawn in single precision"
        raise OutputError(message, f"coordinates go from -{LARGEST:.7e} to {LARGEST:.7e}")
    return result


def drawn_parts(program: Program, frame: Frame | None = None) -> list[Part]:
    """The same, but never empty; an ``OutputError`` if the program draws nothing."""
    result = parts(program, frame)
    if not result:
        raise OutputError("this program draws nothing, so there is no mesh of it", "add a statement, or save as .shape")
    return result


def solid(program: Program, frame: Frame | None = None) -> tuple[Vertices, Faces]:
    """The union of all parts as one watertight mesh; an ``OutputError`` if no part has a volume, there are too many to
    join, or a coordinate exceeds single precision."""
    try:
        with exact_scene(program) as scene:
            vertices, faces = union_mesh(scene)
    except ShapeProgError as error:
        if not program.body:
            cure = "write a part below its size" if program.scale else f"{BEGIN} and a part below it"
            raise OutputError("this program is empty", f"{cure}, such as box(height=2)") from error
        raise OutputError(f"this program makes no solid: {error.message}", error.hint) from error
    return placed(vertices, frame), faces


def part_normals(solids: Sequence[Part]) -> list[Vertices]:
    """The :func:`crease_normals` of every part."""
    if not solids:
        return []
    normals = crease_normals(*joined([(part.vertices, part.faces) for part in solids]))
    return np.split(normals, np.cumsum([len(part.faces) for part in solids[:-1]]))


def crease_normals(vertices: Vertices, faces: Faces) -> Vertices:
    """Unit normals (F, 3, 3) of the corners of every triangle: smooth across shallow edges, sharp across steep ones.

    The normal of a corner is the area-weighted mean over the triangles at its vertex that belong to the same smooth
    surface: those that are connected by edges with less than ``CREASE`` between the normals on both sides.
    """
    area, flat = triangle_normals(vertices, faces)
    pairs = _shared_edges(faces) // 3
    pairs = pairs[:, (flat[pairs[0]] * flat[pairs[1]]).sum(1) > math.cos(CREASE)]
    surface = linked(pairs.T, len(faces))
    _, corner = np.unique(faces * len(faces) + surface[:, None], return_inverse=True)
    corner = corner.reshape(-1)
    total = np.stack([np.bincount(corner, np.repeat(area[:, axis], 3)) for axis in range(3)], 1)[corner]
    size = np.linalg.norm(total, axis=1, keepdims=True)
    normals: Vertices = np.where(size > 1e-30, total / np.where(size > 1e-30, size, 1), np.repeat(flat, 3, 0))
    return normals.reshape(-1, 3, 3)


def crease_edges(faces: Faces, normals: Vertices) -> Faces:
    """The edges of triangles (F, 3) across which the normals (F, 3, 3) of their corners jump, and those at borders.

    An edge (E, 2) is given by its ends as indices of corners, 3 for each triangle.
    """
    across = (normals + np.roll(normals, -1, 1)).reshape(-1, 3)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    one, other = _shared_edges(faces)
    smooth = (across[one] * across[other]).sum(1) > math.cos(CREASE)
    start = np.delete(np.arange(faces.size), np.concatenate([one[smooth], other]))
    return np.stack([start, start - start % 3 + (start + 1) % 3], 1)


def _shared_edges(faces: Faces) -> Faces:
    """Pairs (2, P) of edges with the same ends; edge 3 f + k goes from corner k of triangle f to the next."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, 1)], -1), -1).reshape(-1, 2)
    edge = ends[:, 0] * (faces.max(initial=0) + 1) + ends[:, 1]
    order = np.argsort(edge, kind="stable")
    shared = edge[order[1:]] == edge[order[:-1]]
    return np.stack([order[:-1][shared], order[1:][shared]])
