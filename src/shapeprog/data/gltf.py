"""glTF 2.0, binary (GLB) or text with further files: the triangles and points of its nodes, transformed.

Materials, skins and animations are left out.  The format is Khronos' glTF 2.0 Specification (2021); all sizes in
the file are checked against its content before they are used.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable
from typing import Any
from urllib.parse import unquote

import numpy as np

from shapeprog.data.reading import POINTS, check_count
from shapeprog.data.text import fans
from shapeprog.errors import InputError
from shapeprog.space import Array, FloatArray

Part = tuple[FloatArray, Array]
"""Vertices (V, 3) and triangles (F, 3) of a primitive; points have none."""

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_POINTS, _TRIANGLES, _STRIP, _FAN = 0, 4, 5, 6
_AGAIN = "write the file again"


def read_gltf(name: str, content: bytes, read_other: Callable[[str], bytes]) -> list[tuple[FloatArray, Part]]:
    """Every primitive of the scene with the matrix (4, 4) that places it.

    Parameters
    ----------
    name
        Name of the file, for errors.
    content
        The file, GLB or JSON.
    read_other
        Returns the bytes of another file that it refers to.

    Raises
    ------
    InputError
        If the file is cut short or incomplete.
    """
    text, chunk = _chunks(name, content) if content[:4] == b"glTF" else (content, None)
    head = json.loads(text.decode("utf-8-sig", "replace").rstrip("\0"))  # names may be in any encoding
    version = str(head.get("asset", {}).get("version", "2.0"))
    if not version.startswith("2."):
        raise InputError(f"{name} is glTF {version[:20]}; only glTF 2 is read", "convert it to glTF 2")
    return _Document(name, head, chunk, read_other).placed()


def _chunks(name: str, content: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a GLB file."""
    if len(content) < 20 or int.from_bytes(content[8:12], "little") > len(content):
        raise InputError(
            f"{name} is cut short: {len(content):,} bytes of the {int.from_bytes(content[8:12], 'little'):,} its head "
            f"announces", _AGAIN
        )  # fmt: skip
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= len(content):
        size, kind = int.from_bytes(content[at : at + 4], "little"), content[at + 4 : at + 8]
        chunks.setdefault(kind, content[at + 8 : at + 8 + size])
        if len(content) < at + 8 + size:
            raise InputError(f"{name} is cut short: a part of {size:,} bytes is not all there", _AGAIN)
        at += 8 + size
    if b"JSON" not in chunks:
        raise InputError(f"{name} is no glTF 2 file: it has no JSON part", "convert it to glTF 2")
    return chunks[b"JSON"], chunks.get(b"BIN\0")


class _Document:
    """The lists of a glTF file; buffers and accessors are read once, when they are first named."""

    def __init__(
        self, name: str, head: dict[str, Any], chunk: bytes | None, read_other: Callable[[str], bytes]
    ) -> None:
        self.name, self._head, self._chunk, self._read_other = name, head, chunk, read_other
        self._files: dict[str, bytes] = {}
        self._arrays: dict[int, Array] = {}

    def placed(self) -> list[tuple[FloatArray, Part]]:
        placed: list[tuple[FloatArray, Part]] = []
        total = 0
        waiting = [(node, np.eye(4)) for node in self._roots()]
        visited = set()
        while waiting:
            node, above = waiting.pop()
            if node in visited:
                raise InputError(f"{self.name}: node {node} hangs below itself or two others", _AGAIN)
            visited.add(node)
            entry = self._entry("nodes", node)
            matrix = above @ _matrix(entry)
            waiting += [(child, matrix) for child in entry.get("children", [])]
            for primitive in self._entry("meshes", entry["mesh"])["primitives"] if "mesh" in entry else ():
                vertices, faces = self._primitive(primitive)
                placed.append((matrix, (vertices, faces)))
                total += max(len(vertices) // 3, len(faces))
                check_count(self.name, "triangles, all parts placed,", total, POINTS)
        return placed

    def _roots(self) -> list[int]:
        if self._head.get("scenes"):
            return list(self._entry("scenes", self._head.get("scene", 0)).get("nodes", []))
        nodes = self._head.get("nodes", [])
        below = {child for node in nodes for child in node.get("children", [])}
        return [node for node in range(len(nodes)) if node not in below]

    def _primitive(self, primitive: dict[str, Any]) -> Part:
        mode = primitive.get("mode", _TRIANGLES)
        nothing = np.zeros((0, 3), np.int64)
        if mode not in (_POINTS, _TRIANGLES, _STRIP, _FAN):
            return np.zeros((0, 3)), nothing  # lines have no surface
        if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
            raise InputError(f"{self.name} is compressed by Draco, which is not read", "export it uncompressed")
        vertices = self._array(primitive["attributes"]["POSITION"])
        if vertices.shape[1] != 3:
            raise InputError(f"{self.name} has positions of {vertices.shape[1]} numbers, not three", _AGAIN)
        if mode == _POINTS:
            return vertices, nothing
        order = np.arange(len(vertices))
        if "indices" in primitive:
            order = self._array(primitive["indices"]).reshape(-1).astype(np.int64)
        if mode == _TRIANGLES:
            if len(order) % 3:
                raise InputError(f"{self.name} has triangles of {len(order):,} corners, no multiple of three", _AGAIN)
            return vertices, order.reshape(-1, 3)
        if mode == _FAN:
            return vertices, fans(order, np.array([len(order)]))
        strip = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)
        strip[1::2] = strip[1::2, ::-1]  # every second one turns the other way
        return vertices, strip

    def _array(self, index: int) -> Array:
        """The numbers of an accessor, a row for each element: float64 for positions, whole for indices."""
        if index not in self._arrays:
            self._arrays[index] = self._read(self._entry("accessors", index))
        return self._arrays[index]

    def _read(self, accessor: dict[str, Any]) -> Array:
        if "sparse" in accessor or "bufferView" not in accessor:
            raise InputError(f"{self.name} has numbers that are sparse or compressed", "export it uncompressed")
        view = self._entry("bufferViews", accessor["bufferView"])
        if "EXT_meshopt_compression" in view.get("extensions", {}):
            raise InputError(f"{self.name} is compressed by meshopt, which is not read", "export it uncompressed")
        kind, width = np.dtype(_COMPONENTS[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        count, row = _whole(accessor["count"]), kind.itemsize * width
        stride = _whole(view.get("byteStride", row))
        buffer = self._buffer(view["buffer"])
        start = _whole(view.get("byteOffset", 0)) + _whole(accessor.get("byteOffset", 0))
        room = min(_whole(view.get("byteOffset", 0)) + _whole(view["byteLength"]), len(buffer)) - start
        if stride < row or (count and (count - 1) * stride + row > room):
            raise InputError(f"{self.name} is cut short: it announces {count:,} elements that are not there", _AGAIN)
        if count == 0:
            return np.zeros((0, width), kind)
        numbers: Array = np.ndarray((count, width), kind, buffer, start, (stride, kind.itemsize))
        if kind.kind == "f" or accessor.get("normalized", False):
            numbers = numbers.astype(np.float64) / (1 if kind.kind == "f" else np.iinfo(kind).max)
        return numbers

    def _buffer(self, index: int) -> bytes:
        uri = self._entry("buffers", index).get("uri")
        if uri is None:
            if self._chunk is None or index:
                raise InputError(f"{self.name} has a buffer without content", "export it uncompressed")
            return self._chunk
        if uri not in self._files:
            data = uri.startswith("data:")
            self._files[uri] = base64.b64decode(uri.partition(",")[2]) if data else self._read_other(unquote(uri))
        return self._files[uri]

    def _entry(self, what: str, index: int) -> dict[str, Any]:
        listed = self._head.get(what, [])
        if not 0 <= _whole(index) < len(listed):
            raise InputError(f"{self.name} names {what} {index} of {len(listed)}", _AGAIN)
        entry: dict[str, Any] = listed[index]
        return entry


def _whole(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError(f"{value!r} is no count")
    return value


def _matrix(node: dict[str, Any]) -> FloatArray:
    """The matrix (4, 4) from the coordinates of a node to those of its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = (float(number) for number in node.get("rotation", (0, 0, 0, 1)))
    size = math.hypot(x, y, z, w)
    if size > 0:
        x, y, z, w = x / size, y / size, z / size, w / size
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    matrix[:3, :3] *= np.array(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix
