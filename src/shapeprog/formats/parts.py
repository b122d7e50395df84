"""The parts of a program as named meshes, and the solid they make together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapeprog.errors import OutputError, ShapeProgError
from shapeprog.geometry.mesh import joined, part_meshes, union_mesh
from shapeprog.language.parameters import LARGEST
from shapeprog.language.program import Program
from shapeprog.language.statement import language
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import on_numpy_if_shipped, unroll
from shapeprog.lazy_torch import torch
from shapeprog.space import Frame

Vertices = npt.NDArray[np.float64]
Faces = npt.NDArray[np.int64]

_LARGEST_FAN = 400
"""Vertices with more corners keep the normals of their triangles, since all pairs of corners are compared."""

_AT_ONCE = 1 << 15  # triangles whose pairs of corners are compared together


@dataclass(frozen=True)
class Part:
    """One primitive of an unrolled program.

    Parameters
    ----------
    name
        Role or statement and number, such as ``leg_3``.
    statement
        Id of that role or statement.
    word
        Its name.
    block
        Which of the program's drawing statements, in the order of the text, from 0.
    vertices, faces
        Watertight triangles, (V, 3) and (F, 3), counter-clockwise from outside.
    """

    name: str
    statement: int
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
    with on_numpy_if_shipped(program):
        scene = unroll(encode(program, dtype=torch.float64))
        blocks, meshes = scene.block.tolist(), part_meshes(scene)
    numbers: Counter[str] = Counter()
    result = []
    called = [language().called(draw.word) for draw in program.draws]
    for slot, vertices, faces in meshes:
        block = blocks[slot]
        word = called[block].name
        numbers[word] += 1
        where = placed(vertices, frame)
        result.append(Part(f"{word}_{numbers[word]}", called[block].id, word, block, where, faces))
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
        with on_numpy_if_shipped(program):
            vertices, faces = union_mesh(unroll(encode(program, dtype=torch.float64)))
    except ShapeProgError as error:
        if not program.body:
            raise OutputError("this program is empty", "write a part below its size, such as box(height=2)") from error
        raise OutputError(f"this program makes no solid: {error.message}", error.hint) from error
    return placed(vertices, frame), faces


def part_normals(solids: Sequence[Part]) -> Iterator[Vertices]:
    """The :func:`crease_normals` of every part; many small parts are worked on together."""
    start = 0
    while start < len(solids):
        stop, triangles = start + 1, len(solids[start].faces)
        while stop < len(solids) and triangles + len(solids[stop].faces) <= _AT_ONCE:
            triangles += len(solids[stop].faces)
            stop += 1
        some = solids[start:stop]
        vertices, faces = joined([(part.vertices, part.faces) for part in some])
        owner = np.repeat(range(len(some)), [len(part.vertices) for part in some])
        normals = crease_normals(vertices, faces, owner=owner)
        yield from np.split(normals, np.cumsum([len(part.faces) for part in some[:-1]]))
        start = stop


def crease_normals(
    vertices: npt.NDArray[Any], faces: npt.NDArray[Any], angle: float = 40.0, owner: npt.NDArray[np.int64] | None = None
) -> Vertices:
    """Unit normals (F, 3, 3) of the corners of every triangle: smooth across shallow edges, sharp across steep ones.

    The normal of a corner is the area-weighted mean over the triangles at its vertex whose own normals are within
    ``angle`` degrees of its triangle's.  Vertices at one place are taken as one, if they have the same ``owner`` (V,),
    in rising order.
    """
    corners = np.asarray(vertices, np.float64)[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(area, axis=1, keepdims=True)
    flat = area / np.where(length > 0, length, 1)
    vertex = _places(np.asarray(vertices, np.float64), owner)[faces].reshape(-1)
    order = np.argsort(vertex, kind="stable")
    starts = np.flatnonzero(np.diff(vertex[order], prepend=-1))
    counts = np.diff(starts, append=len(order))
    group = np.repeat(np.arange(len(starts)), counts)
    # All pairs of corners that share a place, without a loop over places.
    repeats = np.where(counts < _LARGEST_FAN, counts, 0)[group]
    first = np.repeat(np.arange(len(order)), repeats)
    within = np.arange(len(first)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
    corner, partner = order[first], order[starts[group[first]] + within]
    smooth = np.einsum("pc,pc->p", flat[corner // 3], flat[partner // 3]) > np.cos(np.radians(angle))
    total = np.zeros((len(faces) * 3, 3))
    for axis in range(3):
        total[:, axis] = np.bincount(corner[smooth], area[partner[smooth] // 3, axis], minlength=len(total))
    size = np.linalg.norm(total, axis=1, keepdims=True)
    fallback = np.repeat(flat, 3, axis=0)
    normals: Vertices = np.where(size > 1e-30, total / np.where(size > 1e-30, size, 1), fallback).reshape(-1, 3, 3)
    return normals


def _places(vertices: Vertices, owner: npt.NDArray[np.int64] | None) -> npt.NDArray[np.int64]:
    """A number for each vertex, the same for those of one owner within a millionth of its extent."""
    if not len(vertices):
        return np.zeros(0, np.int64)
    owner = np.zeros(len(vertices), np.int64) if owner is None else owner
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    low, counts = np.minimum.reduceat(vertices, first), np.diff(first, append=len(owner))
    extent = (np.maximum.reduceat(vertices, first) - low).max(-1)
    scale = np.repeat(np.maximum(extent, 1e-30), counts)[:, None]
    keys = np.column_stack([owner, np.rint((vertices - np.repeat(low, counts, 0)) / scale * 1e6).astype(np.int64)])
    order = np.lexsort(keys.T[::-1])
    result = np.empty(len(vertices), np.int64)
    result[order] = np.cumsum((np.diff(keys[order], axis=0, prepend=keys[order[:1]]) != 0).any(-1))
    return result
