"""Objects given as their physical parts: a folder for each object, a mesh for each part."""

from __future__ import annotations

from pathlib import Path

from shapeprog.data.folders import Skipped, files_below
from shapeprog.data.meshes import COMMON, read_mesh
from shapeprog.data.reading import in_words
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
        If there is no mesh file below it, or a folder below it may not be read.
    """
    objects: dict[str, list[Path]] = {}
    skipped: Skipped = []
    for file in files_below(root, {f".{suffix}" for suffix in COMMON}, skipped):
        name = "_".join(file.parent.relative_to(root).parts) or root.name
        objects.setdefault(name, []).append(file)
    if skipped:  # parts that are left out would be missed as if the object lacked them
        raise skipped[0][1]
    if not objects:
        raise InputError(f"{root} holds no parts", "name a folder with a folder of part meshes for each object")
    return objects


def read_parts(files: list[Path]) -> list[Part]:
    """The parts in these files that have a surface, in their order.

    Raises
    ------
    InputError
        If one cannot be read.
    """
    parts = []
    for file in files:
        with in_words(file):
            vertices, faces = read_mesh(file)
        if len(faces):
            parts.append((vertices, faces))
    return parts
