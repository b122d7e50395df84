"""Triangles (or points) of a mesh file; only geometry is read, and only from local files.

The common formats are read here, in time and memory linear in the file however many parts it has; what trimesh reads
besides, through trimesh.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shapeprog.data.gltf import Part, read_gltf
from shapeprog.data.obj import read_obj
from shapeprog.data.off import read_off
from shapeprog.data.ply import read_ply
from shapeprog.data.reading import ANY_NUMBERS, POINTS, check_count, read_whole
from shapeprog.data.stl import read_stl
from shapeprog.errors import InputError
from shapeprog.space import Array, FloatArray

_READERS = {"obj": read_obj, "off": read_off, "ply": read_ply, "stl": read_stl}
_NO_MESH = {"bz2", "dict", "dict64", "dxf", "json", "msgpack", "stl_ascii", "svg", "tar.bz2", "tar.gz", "xyz", "zip"}
_TEXTS = ("obj", "off")

COMMON = (*_READERS, "glb", "gltf")
"""Suffixes of mesh files that are read without trimesh, which takes a while to load."""


def mesh_formats() -> set[str]:
    """Suffixes, without the dot, of the mesh files that can be read: the common ones and what trimesh reads besides."""
    import trimesh

    return (set(trimesh.available_formats()) | set(COMMON)) - _NO_MESH


@ANY_NUMBERS
def read_mesh(path: Path) -> tuple[Array, Array]:
    """Vertices (V, 3) in float64 and faces (F, 3) of every part of a file, placed as its scene places them.

    A file with points but no faces gives no faces, (0, 3).

    Raises
    ------
    InputError
        If the file cannot be read as its suffix declares, or refers to vertices that it does not hold.
    """
    suffix, name, content = path.suffix.lower().lstrip("."), path.name, read_whole(path)
    if suffix in _TEXTS and b"\0" in content:
        raise InputError(f"{name} is not text, as {suffix.upper()} files are", "check the suffix")
    if suffix in _READERS:
        vertices, faces = _READERS[suffix](name, content)
    elif suffix in COMMON:
        vertices, faces = _joined(read_gltf(name, content, lambda other: _beside(path, other)))
    else:
        vertices, faces = _joined(_through_trimesh(suffix, content))
    check_faces(name, faces, len(vertices), "the file is cut short or damaged; write it again")
    return vertices, faces


def check_faces(name: str, faces: Array, vertices: int, cure: str) -> None:
    """Refuse faces (F, 3) that name other vertices than so many, and too many faces."""
    if len(faces) and not 0 <= faces.min() <= faces.max() < vertices:
        wrong = faces.min() if faces.min() < 0 else faces.max()
        raise InputError(f"{name} has a face that names vertex {wrong}; it has {vertices}, numbered from 0", cure)
    check_count(name, "triangles", len(faces), POINTS)


def _joined(parts: Sequence[tuple[FloatArray, Part]]) -> Part:
    """The triangles of all parts in one mesh; where there are none, the points of all."""
    solid = [part for part in parts if len(part[1][1])]
    vertices: list[Array] = [np.zeros((0, 3))]
    faces: list[Array] = [np.zeros((0, 3), np.int64)]
    count = 0
    for matrix, (corners, listed) in solid or parts:
        still = np.array_equal(matrix, np.eye(4))
        vertices.append(corners if still else corners @ matrix[:3, :3].T + matrix[:3, 3])
        valid = (listed >= 0) & (listed < len(corners))  # a face names no vertex of another part
        faces.append(np.where(valid, listed + count, -1))
        count += len(corners)
    return np.concatenate(vertices), np.concatenate(faces)


def _through_trimesh(suffix: str, content: bytes) -> list[tuple[FloatArray, Part]]:
    import trimesh

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about textures and materials, which are not used
        loaded = trimesh.load(
            io.BytesIO(content), file_type=suffix, process=False, maintain_order=True, skip_materials=True
        )
    scene = loaded if isinstance(loaded, trimesh.Scene) else trimesh.Scene([loaded])
    nodes = (scene.graph[node] for node in scene.graph.nodes_geometry)
    return [(np.asarray(matrix), _part(scene.geometry[geometry])) for matrix, geometry in nodes]


def _part(part: Any) -> Part:
    faces = getattr(part, "faces", None)
    vertices = np.asarray(getattr(part, "vertices", np.zeros((0, 3))), np.float64)
    return vertices.reshape(-1, 3), np.asarray(np.zeros((0, 3)) if faces is None else faces, np.int64).reshape(-1, 3)


def _beside(path: Path, name: str) -> bytes:
    """The further files of a GLTF: regular files in the same folder or below, nothing over a network."""
    folder = path.resolve().parent
    file = (folder / name.strip()).resolve()
    if not file.is_relative_to(folder) or not file.is_file():
        raise InputError(f"{path.name} needs the file {name!r}, which is not in its folder", "put it there")
    return read_whole(file)
