"""STL files, binary and text: bare triangles, as many as their head announces."""

from __future__ import annotations

import re

import numpy as np

from shapeprog.data.text import numbers
from shapeprog.errors import InputError
from shapeprog.space import Array

_HEAD, _RECORD = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+([^\r\n]+)", re.MULTILINE)
_AGAIN = "write the file again"


def read_stl(name: str, content: bytes) -> tuple[Array, Array]:
    """Vertices (3F, 3) and triangles (F, 3) of an STL file; no two triangles share a vertex.

    Raises
    ------
    InputError
        If it holds fewer or more triangles than it announces, or cannot be read.
    """
    count = int.from_bytes(content[80:_HEAD], "little")
    expected = _HEAD + _RECORD.itemsize * count
    if len(content) == expected:  # the one sure sign of a binary file: some begin with 'solid' too
        corners = np.frombuffer(content, _RECORD, count, _HEAD)["corners"].astype(np.float64)
    elif content[:1000].lstrip()[:5].lower() == b"solid":
        corners = _read_text(name, content.lower())
    elif len(content) < expected:
        raise InputError(f"{name} is cut short: {len(content):,} bytes of the {expected:,} its head announces", _AGAIN)
    else:
        raise InputError(f"{name} holds more than the {count:,} triangles its head announces", "check the suffix")
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def _read_text(name: str, content: bytes) -> Array:
    if b"endsolid" not in content[-1000:]:
        raise InputError(f"{name} ends before its 'endsolid': it is cut short", _AGAIN)
    rows = _VERTEX.findall(content)
    facets = content.count(b"endfacet")
    values = numbers(name, b" ".join(rows))
    if len(values) != 9 * facets:
        raise InputError(f"{name} has {len(rows)} vertices in {facets} facets of three", _AGAIN)
    return values.reshape(-1, 3, 3)
