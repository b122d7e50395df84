"""OBJ files: positions and faces, with materials, groups and everything else left out.

One pass finds the lines of vertices and one those of faces, however many groups part them.
"""

from __future__ import annotations

import re

import numpy as np

from shapeprog.data.reading import POINTS, check_count
from shapeprog.data.text import fans, numbers
from shapeprog.errors import InputError
from shapeprog.space import Array

_VERTEX = re.compile(rb"^[ \t]*v[ \t]+(\S+[ \t]+\S+[ \t]+\S+)?", re.MULTILINE)
_FACE = re.compile(rb"^[ \t]*f[ \t]([^\n#]*)", re.MULTILINE)
_KIND = re.compile(rb"^[ \t]*([vf])[ \t]", re.MULTILINE)
_TEXTURE = re.compile(rb"/\S*")
_CUT = re.compile(rb"(?:^|\n)[ \t]*[vf](?:[ \t]+\S+){0,2}[ \t]*\Z")
_CURE = "the file is damaged; write it again"


def read_obj(name: str, content: bytes) -> tuple[Array, Array]:
    """Vertices (V, 3) and triangles (F, 3) of an OBJ file; polygons become fans.

    Raises
    ------
    InputError
        If a line of vertices or faces cannot be read, or a face names a vertex that is not there.
    """
    if _CUT.search(content[-1000:]):
        raise InputError(f"{name} is cut short: it ends within a line", "write the file again")
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b"\\\n" in content:
        content = content.replace(b"\\\n", b" ")  # a continued line
    rows = _VERTEX.findall(content)
    if b"" in rows:
        raise InputError(f"{name}: vertex {rows.index(b'') + 1} has fewer than three coordinates", _CURE)
    vertices = numbers(name, b" ".join(rows)).reshape(-1, 3)
    check_count(name, "vertices", len(vertices), 3 * POINTS)
    return vertices, _triangles(name, content, len(vertices))


def _triangles(name: str, content: bytes, count: int) -> Array:
    rows = _FACE.findall(content)
    widths = np.fromiter(map(len, map(bytes.split, rows)), np.int64, len(rows))
    text = b" ".join(rows)
    corners = numbers(name, _TEXTURE.sub(b"", text) if b"/" in text else text, np.int64)
    if len(corners) != widths.sum():
        raise InputError(f"{name} has a corner of a face that names no vertex", _CURE)
    count_above: Array = np.full(len(corners), count)
    if (corners < 0).any():  # counted back from the vertices above the face
        kinds = np.array(_KIND.findall(content))
        count_above = np.repeat(np.cumsum(kinds == b"v")[kinds == b"f"], widths)
    corner_index = np.where(corners < 0, count_above + corners, corners - 1)
    wrong = np.flatnonzero((corner_index < 0) | (corner_index >= count))
    if len(wrong):
        face = int(np.searchsorted(np.cumsum(widths), wrong[0], side="right"))
        raise InputError(f"{name}: face {face + 1} names vertex {corners[wrong[0]]} of {count}, counted from 1", _CURE)
    return fans(corner_index, widths)
