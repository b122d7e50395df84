"""Files of shapes that are valid and that none of the writers makes: what their formats allow besides."""

from __future__ import annotations

import itertools
import json
import struct

import numpy as np

OBJ = b"""mtllib parts.mtl
o seat
v 0 0 0
v 1 0 0
v 1 0 1
v 0 0 1
vt 0.5 0.5
vn 0 1 0
usemtl wood
f 1/1/1 2/1/1 3/1/1 4/1/1
g leg
v 0 -1 0 0.5 0.5 0.5
s 1
f -1//1 1//1 2//1
f 5 1 4
"""

OFF = b"""COFF # a table
5 3 0

0 0 0 255 0 0 255
1 0 0
1 0 1
0 0 1 # the last corner of the top
0 -1 0
4 0 1 2 3 0.5 0.5 0.5
3 4 0 1
2 4 3
"""

RAGGED_PLY = b"""ply
format ascii 1.0
element vertex 5
property double x
property double y
property double z
element face 3
property uchar red
property list uchar int vertex_indices
element edge 1
property int vertex1
property int vertex2
end_header
0 0 0
1 0 0
1 0 1
0 0 1
0 -1 0
9 4 0 1 2 3
9 3 4 0 1
9 2 4 3
0 4
"""

_BIG_ENDIAN = b"""ply
format binary_big_endian 1.0
comment by hand
element vertex 3
property float x
property float y
property float z
property uchar red
element face 1
property list uchar int vertex_indices
end_header
"""


def big_endian_ply() -> bytes:
    """A triangle in numbers of the other order, and a colour between them."""
    corners = np.zeros(3, [("at", ">f4", 3), ("red", "u1")])
    corners["at"] = np.eye(3)
    return _BIG_ENDIAN + corners.tobytes() + b"\x03" + np.arange(3, dtype=">i4").tobytes()


def glb() -> bytes:
    """Nodes below nodes, placed in every way; triangles, a strip, a fan and points; whole numbers, and gaps between."""
    corners = np.zeros(4, [("at", "<f4", 3), ("gap", "<u4")])
    corners["at"] = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0.5)]
    small = np.array([(0, 0, 0), (9, 0, 0), (0, 9, 0), (65535, 9, 9)], "<u2")
    order = np.array([0, 1, 2, 1, 2, 3], "<u1")
    buffer = corners.tobytes() + small.tobytes() + order.tobytes()
    ends = np.cumsum([0, corners.nbytes, small.nbytes, order.nbytes]).tolist()
    views = [{"buffer": 0, "byteOffset": at, "byteLength": end - at} for at, end in itertools.pairwise(ends)]
    views[0]["byteStride"] = 16
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5123, "count": 4, "type": "VEC3", "normalized": True},
        {"bufferView": 2, "byteOffset": 0, "componentType": 5121, "count": 6, "type": "SCALAR"},
    ]
    primitives = [{"attributes": {"POSITION": at}, "mode": mode} for at, mode in ((0, 5), (0, 6), (1, 0), (1, 1))]
    nodes = [
        {"children": [1, 2], "rotation": [0, 0.6, 0, 0.8], "scale": [2, 1, 1]},
        {"mesh": 0, "translation": [0, 1, 0], "children": [3]},
        {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]},
        {"mesh": 0, "camera": 0},
    ]
    head = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes, "bufferViews": views,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 2}]}, {"primitives": primitives}],
        "accessors": accessors, "buffers": [{"byteLength": len(buffer)}],
    }  # fmt: skip
    text = json.dumps(head).encode()
    text, buffer = text + b" " * (-len(text) % 4), buffer + bytes(-len(buffer) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
