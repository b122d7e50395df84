"""PLY files, as text and binary: vertices and faces, exactly as many as the head announces (Turk 1994).

A text is read as the binary file whose numbers are all float64, so that one reader serves both.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from shapeprog.data.reading import POINTS, check_count
from shapeprog.data.text import fans, numbers
from shapeprog.errors import InputError
from shapeprog.space import Array

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "float16": "f2", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_CORNERS = ("vertex_indices", "vertex_index")
_AGAIN = "write the file again"


@dataclass
class _Element:
    """A kind of row: its name, how many there are, and its properties as (name, type, type of the length or None)."""

    name: str
    count: int
    properties: list[tuple[str, np.dtype[Any], np.dtype[Any] | None]] = field(default_factory=list)


def read_ply(name: str, content: bytes) -> tuple[Array, Array]:
    """Vertices (V, 3) and triangles (F, 3) of a PLY file; polygons become fans, and a cloud has no triangles.

    Raises
    ------
    InputError
        If the file holds fewer or more numbers than its head announces, or has no positions.
    """
    elements, body = _head(name, content)
    vertices: Array = np.zeros((0, 3))
    faces: Array = np.zeros((0, 3), np.int64)
    at = 0
    for element in elements:
        columns, at = _rows(name, element, body, at)
        if element.name == "vertex" and element.count:
            if not {"x", "y", "z"} <= set(columns):
                raise InputError(f"{name} has vertices without x, y and z", "export the model again")
            vertices = np.stack([columns[axis][0] for axis in "xyz"], axis=1).astype(np.float64)
        elif element.name == "face" and element.count:
            corners, widths = next((columns[key] for key in _CORNERS if key in columns), (None, None))
            if corners is None or widths is None:
                raise InputError(f"{name} has faces without vertex_indices", "export the model again")
            faces = fans(corners.astype(np.int64), widths)
    if at != len(body):
        raise InputError(f"{name} holds more than its head announces", _AGAIN)
    return vertices, faces


def _head(name: str, content: bytes) -> tuple[list[_Element], bytes]:
    """The elements that a file announces, in their order, and its numbers as little- or big-endian bytes."""
    head, mark, body = content.partition(b"end_header")
    if content[:3].lower() != b"ply" or not mark:
        raise InputError(f"{name} is cut short, or no PLY file: its head has no end", _AGAIN)
    _, _, body = body.partition(b"\n")
    form, elements = "", list[_Element]()
    for line in head.decode("latin-1").splitlines():
        words = line.split()
        if words[:1] == ["format"]:
            form = words[1]
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2])))
            if elements[-1].count < 0:
                raise InputError(f"{name} announces {words[2]} of {words[1]}", _AGAIN)
        elif words[:1] == ["property"]:
            kinds = [_type(name, word, form) for word in (words[2:4] if words[1] == "list" else words[1:2])]
            elements[-1].properties.append((words[-1], kinds[-1], kinds[0] if len(kinds) == 2 else None))
    if form == "ascii":
        body = numbers(name, body).tobytes()
    return elements, body


def _type(name: str, word: str, form: str) -> np.dtype[Any]:
    if word not in _TYPES:
        raise InputError(f"{name} has numbers of the type {word[:40]!r}, which is not one of PLY", _AGAIN)
    if form == "ascii":
        return np.dtype(np.float64)
    return np.dtype(_TYPES[word]).newbyteorder(">" if form == "binary_big_endian" else "<")


def _rows(name: str, element: _Element, body: bytes, at: int) -> tuple[dict[str, tuple[Array, Array]], int]:
    """The columns of an element by name, each as its numbers and how many belong to each row, and where it ends."""
    check_count(name, f"{element.name} rows", element.count, 3 * POINTS)
    lists = [listed for listed in element.properties if listed[2] is not None]
    if not element.count:
        return {}, at
    first, _ = _ragged(name, element, body, at, 1)
    widths = {label: len(numbers) for label, (numbers, _) in first.items()}
    fields = list[tuple[str, np.dtype[Any]] | tuple[str, np.dtype[Any], tuple[int]]]()
    for label, kind, length in element.properties:
        if length is not None:
            fields += [(f"{label} length", length), (label, kind, (widths[label],))]
        else:
            fields.append((label, kind))
    row = np.dtype(fields)
    if at + element.count * row.itemsize <= len(body):
        table = np.frombuffer(body, row, element.count, at) if row.itemsize else np.zeros(element.count, row)
        if all((table[f"{label} length"] == widths[label]).all() for label, _, _ in lists):
            full = {label: np.full(element.count, widths[label]) for label, _, _ in element.properties}
            return {label: (table[label].reshape(-1), full[label]) for label in full}, at + table.nbytes
    if not lists:
        raise _short(name, element)
    return _ragged(name, element, body, at, element.count)


def _ragged(
    name: str, element: _Element, body: bytes, at: int, count: int
) -> tuple[dict[str, tuple[Array, Array]], int]:
    """The same of the first ``count`` rows, which may differ in length, as those of triangles among quads do."""
    columns: dict[str, list[Array]] = {label: [] for label, _, _ in element.properties}
    for _ in range(count):
        for label, kind, length in element.properties:
            width = 1
            if length is not None:
                width, at = int(_at(name, element, body, at, length, 1)[0]), at + length.itemsize
            columns[label].append(_at(name, element, body, at, kind, width))
            at += kind.itemsize * width
    full = {label: (np.concatenate(rows), np.array([*map(len, rows)])) for label, rows in columns.items()}
    return full, at


def _at(name: str, element: _Element, body: bytes, at: int, kind: np.dtype[Any], count: int) -> Array:
    if count < 0 or at + kind.itemsize * count > len(body):
        raise _short(name, element)
    return np.frombuffer(body, kind, count, at)


def _short(name: str, element: _Element) -> InputError:
    return InputError(f"{name} is cut short: it announces {element.count:,} of {element.name} and holds fewer", _AGAIN)
