"""Triangles (or bare points) of a mesh file, through trimesh, with nothing but geometry read and nothing fetched."""

from __future__ import annotations

import io
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from shapeprog.errors import InputError
from shapeprog.space import Array

_NO_MESH = {"bz2", "dict", "dict64", "dxf", "json", "msgpack", "stl_ascii", "svg", "tar.bz2", "tar.gz", "xyz", "zip"}
_OFF_COUNTS = re.compile(rb"^\s*(?:C?N?OFF)?\s*(\d+)\s+(\d+)\s+\d+", re.MULTILINE)
COMMON = ("obj", "off", "ply", "stl", "glb", "gltf")
"""Suffixes of mesh files that are read without asking trimesh whether it can, which takes it a while to say."""

_TEXTS = ("obj", "off")
_LAST_LINE = re.compile(rb"(?:^|\n)(v|f)[ \t]([^\n]*)$")


def mesh_formats() -> set[str]:
    """Suffixes, without the dot, of the mesh files that can be read: the common ones and what trimesh reads besides."""
    import trimesh

    return (set(trimesh.available_formats()) | set(COMMON)) - _NO_MESH


def read_mesh(path: Path) -> tuple[Array, Array]:
    """Vertices (V, 3) in float64 and faces (F, 3) of every part of a file, placed as its scene places them.

    A file with points but no faces gives no faces, (0, 3).

    Raises
    ------
    InputError
        If the file cannot be read as what its suffix says, or names vertices that it does not hold.
    """
    import trimesh

    suffix = path.suffix.lower().lstrip(".")
    content = path.read_bytes()
    if not content.strip():
        raise InputError(f"{path.name} is empty", "write the file again")
    _check_length(path.name, suffix, content)
    if suffix in _TEXTS:
        content = _in_utf8(path.name, suffix, content)
    resolver = _siblings(path) if suffix == "gltf" else None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about textures and materials, which are not used
            loaded = trimesh.load(
                io.BytesIO(content),
                file_type=suffix,
                resolver=resolver,
                process=False,
                maintain_order=True,
                skip_materials=True,
            )
        scene = loaded if isinstance(loaded, trimesh.Scene) else trimesh.Scene([loaded])
        parts = [(scene.graph[node][0], scene.geometry[scene.graph[node][1]]) for node in scene.graph.nodes_geometry]
    except (MemoryError, KeyboardInterrupt):
        raise
    except Exception as error:
        raise InputError(
            f"{path.name} cannot be read as {suffix.upper()}: {_reason(error)}",
            "the file may be cut short or of another format; write it again, or convert it to GLB or OBJ",
        ) from error
    vertices, faces = _joined(path.name, parts)
    if suffix == "off":
        counts = _OFF_COUNTS.search(content)
        if counts and len(faces) < int(counts[2]):
            raise InputError(
                f"{path.name} is cut short: {len(faces)} faces of {int(counts[2])}", "write the file again"
            )
    return vertices, faces


def _joined(name: str, parts: list[tuple[Array, Any]]) -> tuple[Array, Array]:
    vertices: list[Array] = []
    faces: list[Array] = []
    loose: list[Array] = [np.zeros((0, 3))]
    count = 0
    for matrix, part in parts:
        own = np.asarray(getattr(part, "vertices", np.zeros((0, 3))), np.float64).reshape(-1, 3)
        with np.errstate(invalid="ignore"):  # infinite coordinates are told by name later
            still = np.array_equal(matrix, np.eye(4))
            placed = own if still else own @ np.asarray(matrix)[:3, :3].T + np.asarray(matrix)[:3, 3]
        listed = getattr(part, "faces", None)
        if listed is None or len(listed) == 0:
            loose.append(placed)
            continue
        triangles = np.asarray(listed, np.int64).reshape(-1, 3)
        if triangles.min() < 0 or triangles.max() >= len(own):
            raise InputError(
                f"{name} has a face that names vertex {triangles.max()} of {len(own)}",
                "the file is cut short or damaged; write it again",
            )
        vertices.append(placed)
        faces.append(triangles + count if count else triangles)
        count += len(placed)
    if count == 0:
        return np.concatenate(loose), np.zeros((0, 3), np.int64)
    if len(vertices) == 1:
        return vertices[0], faces[0]
    return np.concatenate(vertices), np.concatenate(faces)


def _check_length(name: str, suffix: str, content: bytes) -> None:
    """Refuse the cut-short files that trimesh would read in part or explain badly."""
    expected = 0
    if suffix == "glb":
        if content[:4] != b"glTF" or len(content) < 12:
            raise InputError(f"{name} is not a GLB file", "check the suffix, or write the file again")
        expected = int.from_bytes(content[8:12], "little")
    elif suffix == "stl" and len(content) >= 84 and content[:5].lower() != b"solid":
        expected = 84 + 50 * int.from_bytes(content[80:84], "little")
    elif suffix == "obj" and (last := _LAST_LINE.search(content)) and len(last[2].split()) < 3:
        raise InputError(f"{name} is cut short: it ends within a line", "write the file again")
    elif suffix == "stl" and b"facet" in content[:1000] and b"endsolid" not in content[-1000:]:
        raise InputError(f"{name} ends before its 'endsolid': it is cut short", "write the file again")
    if len(content) < expected:
        raise InputError(
            f"{name} is cut short: {len(content):,} bytes of the {expected:,} its head announces",
            "write the file again",
        )


def _in_utf8(name: str, suffix: str, content: bytes) -> bytes:
    """A text file as UTF-8 whatever it was written in: only comments and names of materials can tell."""
    if b"\0" in content:
        raise InputError(f"{name} is not text, as {suffix.upper()} files are", "check the suffix")
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1").encode("utf-8")
    return content


def _reason(error: Exception) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:160]}" if text else type(error).__name__


def _siblings(path: Path) -> Any:
    """What a GLTF may read besides itself: plain files of its own folder or below, and nothing over a network."""
    from trimesh.resolvers import FilePathResolver

    folder = path.resolve().parent

    class Siblings(FilePathResolver):
        def get(self, name: str) -> bytes:
            place = (folder / name.strip()).resolve()
            if not place.is_relative_to(folder) or not place.is_file():
                raise FileNotFoundError(f"the part {name!r} is not beside the file")
            return place.read_bytes()

    return Siblings(str(path))
