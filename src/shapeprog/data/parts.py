"""Objects given as their physical parts: a folder for each object, a mesh for each part."""

from __future__ import annotations

from pathlib import Path

from shapeprog.data.meshes import COMMON, read_mesh
from shapeprog.errors import InputError
from shapeprog.space import Array

Part = tuple[Array, Array]
"""Vertices (V, 3) in the world of the file, and triangles (F, 3)."""


def part_files(root: Path) -> dict[str, list[Path]]:
    """The part files of every object below a folder, by the names of its folders joined with ``_``.

    ``root/Chair/bekvam/00.ply`` is a part of ``Chair_bekvam``, and ``root/00.ply`` one of the object called as root is.

    Raises
    ------
    InputError
        If there is no mesh file below it.
    """
    found: dict[str, list[Path]] = {}
    for file in sorted(root.rglob("*")):
        if file.suffix.lower().lstrip(".") in COMMON and file.is_file():
            name = "_".join(file.parent.relative_to(root).parts) or root.name
            found.setdefault(name, []).append(file)
    if not found:
        raise InputError(f"{root} holds no parts", "name a folder with a folder of part meshes for each object")
    return found


def read_parts(files: list[Path]) -> list[Part]:
    """The parts in these files that have a surface, in their order.

    Raises
    ------
    InputError
        If one cannot be read.
    """
    return [(vertices, faces) for vertices, faces in map(read_mesh, files) if len(faces)]
