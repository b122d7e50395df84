"""Models to draw: triangles with normals, colours and part indices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shapeprog.data.shape import Shape
from shapeprog.formats.colours import colour
from shapeprog.formats.parts import Part, crease_normals, part_normals
from shapeprog.geometry.mesh import joined, triangle_normals
from shapeprog.space import RESOLUTION, Array

INPUT_COLOUR = (212, 215, 220)  # light grey of inputs
MOST_POINTS = 2500  # points of a cloud that are drawn, each as a small ball
FINE = 200_000  # from this number of triangles on a mesh is shaded flat: they are smaller than the pixels


@dataclass(frozen=True)
class Model:
    """Triangles in the grid frame, ready to be drawn.

    Parameters
    ----------
    vertices, faces
        (V, 3) in cells and (F, 3).
    normals
        Unit normals (F, 3, 3) of the corners of each face; either side may be seen.
    colours
        Red, green, blue (F, 3) in 0 to 255.
    group
        The part (F,) that a face belongs to; lines are drawn between parts.
    """

    vertices: Array
    faces: Array
    normals: Array
    colours: Array
    group: Array


def of_parts(parts: Sequence[Part]) -> Model:
    """Parts in the colours of their statements."""
    if not parts:
        return Model(np.zeros((0, 3)), np.zeros((0, 3), np.int64), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros(0))
    return Model(
        *joined([(part.vertices, part.faces) for part in parts]),
        np.concatenate(part_normals(parts)),
        np.concatenate([np.tile(colour(part.word), (len(part.faces), 1)) for part in parts]),
        np.concatenate([np.full(len(part.faces), number) for number, part in enumerate(parts)]),
    )


def of_shape(shape: Shape) -> Model:
    """An input in light grey: its mesh where there is one, else its points as small balls, else its cells."""
    if shape.vertices is not None and shape.faces is not None and len(shape.faces):
        return of_mesh(shape.vertices, shape.faces)
    if shape.kind == "points" and shape.points is not None:
        return of_points(shape.points)
    return of_cells(shape.voxels)


def of_mesh(vertices: Array, faces: Array) -> Model:
    """A mesh in one colour; vertices at one place are taken as one."""
    import trimesh

    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    if len(faces) >= FINE:
        _, flat = triangle_normals(vertices, faces)
        return _plain(vertices, faces, np.broadcast_to(flat[:, None], (len(faces), 3, 3)))
    extent = max(float(np.ptp(vertices, axis=0).max(initial=0)), 1e-30)
    unique_rows: Any = trimesh.grouping.unique_rows
    first, place = unique_rows((vertices - vertices.min(0, initial=np.inf)) / extent, digits=6)
    vertices, faces = vertices[first], place[faces]
    return _plain(vertices, faces, crease_normals(vertices, faces))


def of_cells(cells: Array) -> Model:
    """Occupied cells (R, R, R): the faces between occupied and empty ones."""
    padded = np.pad(np.asarray(cells, np.bool_), 1)
    size = RESOLUTION / cells.shape[0]
    corners, normals = [], []
    for axis in range(3):
        for sign in (-1, 1):
            open_side = padded & ~np.roll(padded, -sign, axis)
            corner = np.argwhere(open_side).astype(np.float64) - 1
            corner[:, axis] += (sign + 1) / 2
            first_edge, second_edge = np.zeros(3), np.zeros(3)
            first_edge[(axis + 1) % 3], second_edge[(axis + 2) % 3] = 1, 1
            quad = np.stack([corner, corner + first_edge, corner + first_edge + second_edge, corner + second_edge], 1)
            corners.append(quad if sign > 0 else quad[:, ::-1])
            normals.append(np.tile(sign * np.eye(3)[axis], (2 * len(corner), 3, 1)))
    vertices, index = np.unique(np.concatenate(corners).reshape(-1, 3), axis=0, return_inverse=True)
    faces = index.reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return _plain(vertices * size - RESOLUTION / 2, faces, np.concatenate(normals))


def of_points(points: Array) -> Model:
    """A cloud (P, 3) as small balls."""
    import trimesh

    sample = np.asarray(points, np.float64)
    sample = sample[:: max(1, -(-len(sample) // MOST_POINTS))]
    ball: Any = trimesh.creation.icosahedron()
    unit, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    unit = unit / np.linalg.norm(unit, axis=1, keepdims=True)
    radius = 0.2 * np.sqrt(MOST_POINTS / max(len(sample), MOST_POINTS / 4))
    vertices = (sample[:, None] + radius * unit).reshape(-1, 3)
    all_faces = (len(unit) * np.arange(len(sample))[:, None, None] + faces).reshape(-1, 3)
    return _plain(vertices, all_faces, np.tile(unit[faces], (len(sample), 1, 1)))


def _plain(vertices: Array, faces: Array, normals: Array) -> Model:
    """A model in one colour and one part."""
    colours = np.broadcast_to(np.array(INPUT_COLOUR, np.uint8), (len(faces), 3))
    return Model(vertices, faces, normals, colours, np.zeros(len(faces), np.int64))
