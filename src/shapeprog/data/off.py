"""OFF files: vertices and polygons in text, as many as the head announces."""

from __future__ import annotations

import re

import numpy as np

from shapeprog.data.text import fans, numbers
from shapeprog.errors import InputError
from shapeprog.space import Array

_HEAD = re.compile(rb"^\s*(?:ST)?C?N?OFF\s*(\d+)\s+(\d+)(?:\s+\d+)?[ \t\r]*\n")
_COMMENT = re.compile(rb"#[^\n]*")
_AGAIN = "write the file again"


def read_off(name: str, content: bytes) -> tuple[Array, Array]:
    """Vertices (V, 3) and triangles (F, 3) of an OFF file; polygons become fans, colours and normals are left out.

    Raises
    ------
    InputError
        If it holds fewer vertices or faces than it announces, or one of them cannot be read.
    """
    if b"#" in content:
        content = _COMMENT.sub(b"", content)
    head = _HEAD.match(content)
    if head is None:
        raise InputError(f"{name} is no OFF file: its head does not count vertices and faces", "check the suffix")
    rows = [row for row in content[head.end() :].split(b"\n") if not row.isspace() and row]
    vertices, faces = int(head[1]), int(head[2])
    if len(rows) < vertices + faces:
        held = f"{min(len(rows), vertices):,} vertices of {vertices:,}, {max(len(rows) - vertices, 0):,} faces"
        raise InputError(f"{name} is cut short: {held} of {faces:,}", _AGAIN)
    coordinates = [row.split(None, 3)[:3] for row in rows[:vertices]]
    polygons = [row.split() for row in rows[vertices : vertices + faces]]
    widths = numbers(name, b" ".join(row[0] for row in polygons), np.int64)
    corners = [row[1 : width + 1] for row, width in zip(polygons, widths.tolist(), strict=True)]
    if any(len(row) < 3 for row in coordinates) or [len(row) for row in corners] != widths.tolist():
        raise InputError(f"{name} has a line with fewer numbers than it needs: it is cut short or damaged", _AGAIN)
    positions = numbers(name, b" ".join(word for row in coordinates for word in row))
    named = numbers(name, b" ".join(word for row in corners for word in row), np.int64)
    return positions.reshape(-1, 3), fans(named, widths)
