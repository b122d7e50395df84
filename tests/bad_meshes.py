"""Mesh files that cannot be read as shapes, one builder for each way to be bad; part of :mod:`bad_files`."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path

import trimesh

Builder = Callable[[Path], Path]
"""Writes a file (and what belongs to it) into a folder and returns its path."""

BAD: dict[str, Builder] = {}

BOX = trimesh.creation.box()


def bad(builder: Builder) -> Builder:
    BAD[builder.__name__] = builder
    return builder


def written(path: Path, content: bytes | str) -> Path:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def add(name: str, suffix: str, content: bytes | str) -> None:
    """A bad file that is nothing but its bytes."""
    BAD[name] = lambda folder: written(folder / f"{name}.{suffix}", content)


_V = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
add("obj_index_zero", "obj", f"{_V}f 0 1 2\n")
add("obj_index_beyond", "obj", f"{_V}f 1 2 4\n")
add("obj_index_too_far_back", "obj", f"{_V}f -1 -2 -4\n")
add("obj_word_for_a_number", "obj", "v 0 0 zero\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
add("obj_word_for_an_index", "obj", f"{_V}f 1 2 three\n")
add("obj_corner_without_vertex", "obj", f"{_V}f 1 2 /3\n")
add("obj_vertex_of_two_numbers", "obj", "v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
add("obj_edges_alone", "obj", "v 0 0 0\nv 0 0 0\nf 1 2\n")
add("obj_cut_within_a_line", "obj", f"{_V}f 1 2")
add("obj_not_text", "obj", b"v 0 0 0\n\0\0")
add("obj_huge_index", "obj", f"{_V}f 1 2 {'9' * 400}\n")
add("off_fewer_faces", "off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
add("off_fewer_vertices", "off", "OFF\n5 0 0\n0 0 0\n1 0 0\n0 1 0\n")
add("off_short_face", "off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n")
add("off_negative_index", "off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -2\n")
add("off_negative_width", "off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n")
add("off_without_counts", "off", "OFF\nmany\n")
add("off_in_no_encoding", "off", b"\xff\xfe\x9d\x81OFF\n3 1 0\n")
add("stl_facet_of_two", "stl", "solid a\nfacet normal 0 0 1\nvertex 0 0 0\nvertex 1 0 0\nendfacet\nendsolid a\n")
add("stl_text_cut", "stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n")
add("stl_word", "stl", "solid a\nfacet\nvertex 0 0 x\nvertex 1 0 0\nvertex 0 1 0\nendfacet\nendsolid a\n")
add("xyz_word", "xyz", "0 0 0\n1 x 0\n")
add("xyz_two_numbers", "xyz", "0 0 0\n1 1\n")


@bad
def off_cut_in_the_last_face(folder: Path) -> Path:
    return written(folder / "cut.off", BOX.export(file_type="off").rstrip()[:-4])


@bad
def stl_of_fewer_triangles(folder: Path) -> Path:
    return written(folder / "fewer.stl", BOX.export(file_type="stl")[:-50])


@bad
def stl_of_more_triangles(folder: Path) -> Path:
    return written(folder / "more.stl", BOX.export(file_type="stl") + bytes(50))


def ply(encoding: str) -> bytes:
    return BOX.export(file_type="ply", encoding=encoding)


@bad
def ply_text_cut_between_faces(folder: Path) -> Path:
    return written(folder / "cut.ply", b"\n".join(ply("ascii").rstrip().split(b"\n")[:-5]) + b"\n")


@bad
def ply_text_cut_between_vertices(folder: Path) -> Path:
    return written(folder / "cloud.ply", b"\n".join(ply("ascii").rstrip().split(b"\n")[:-15]) + b"\n")


@bad
def ply_text_cut_in_the_last_face(folder: Path) -> Path:
    return written(folder / "line.ply", ply("ascii").rstrip()[:-2])


@bad
def ply_binary_cut(folder: Path) -> Path:
    return written(folder / "binary.ply", ply("binary")[:-13])


@bad
def ply_binary_of_fewer_than_it_holds(folder: Path) -> Path:
    return written(folder / "less.ply", ply("binary").replace(b"face 12", b"face 11"))


@bad
def ply_of_a_negative_count(folder: Path) -> Path:
    return written(folder / "minus.ply", ply("ascii").replace(b"face 12", b"face -1"))


@bad
def ply_of_an_unknown_type(folder: Path) -> Path:
    return written(folder / "type.ply", ply("ascii").replace(b"float y", b"quad y"))


@bad
def ply_without_z(folder: Path) -> Path:
    return written(folder / "z.ply", ply("ascii").replace(b"float z", b"float w"))


@bad
def ply_whose_faces_have_no_corners(folder: Path) -> Path:
    return written(folder / "corners.ply", ply("ascii").replace(b"vertex_indices", b"texture"))


# ---- glTF


def glb(
    head: dict[str, object] | None = None, data: bytes | None = None, content: bytes | None = None, **changes: object
) -> bytes:
    """The bytes of a GLB of one box, with entries of its head changed, its data or the text of its head replaced."""
    vertices, faces = BOX.vertices.astype("<f4").tobytes(), BOX.faces.astype("<u2").tobytes()
    data = vertices + faces if data is None else data
    whole: dict[str, object] = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 96}, {"buffer": 0, "byteOffset": 96, "byteLength": 72},
        ],
        "buffers": [{"byteLength": len(data)}],
    }  # fmt: skip
    text = json.dumps({**whole, **(head or {}), **changes}).encode() if content is None else content
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def accessors(**changes: object) -> list[dict[str, object]]:
    first = {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"}
    second = {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}
    first.update(changes)
    return [{key: value for key, value in first.items() if value is not None}, second]


TRIANGLES = {"attributes": {"POSITION": 0}, "indices": 1}
for _name, _content in {
    "glb_cut": glb()[:-20],
    "glb_of_another_format": b"PK\x03\x04" + glb(),
    "glb_of_version_one": glb(asset={"version": "1.0"}),
    "glb_without_json": struct.pack("<4sII", b"glTF", 2, 12) + bytes(8),
    "glb_with_broken_json": glb(content=b'{"asset": {"version": "2.0"}, "nodes": ['),
    "glb_with_deep_json": glb(content=b"[" * 100_000),
    "glb_with_a_list_for_a_head": glb(content=b"[]"),
    "glb_accessor_without_a_view": glb(accessors=accessors(bufferView=None)),
    "glb_accessor_that_announces_more": glb(accessors=accessors(count=9)),
    "glb_accessor_of_a_negative_count": glb(accessors=accessors(count=-1)),
    "glb_accessor_of_a_count_in_words": glb(accessors=accessors(count="eight")),
    "glb_accessor_of_no_type": glb(accessors=accessors(componentType=1)),
    "glb_accessor_of_two_columns": glb(accessors=accessors(type="VEC2")),
    "glb_sparse_accessor": glb(accessors=accessors(sparse={"count": 1})),
    "glb_view_beyond_its_buffer": glb(bufferViews=[{"buffer": 0, "byteOffset": 150, "byteLength": 96}] * 2),
    "glb_view_of_no_buffer": glb(bufferViews=[{"buffer": 7, "byteLength": 96}] * 2),
    "glb_buffer_without_content": glb(buffers=[{"byteLength": 1, "uri": "missing.bin"}]),
    "glb_face_widths": glb(accessors=[*accessors()[:1], {**accessors()[1], "count": 35}]),
    "glb_node_below_itself": glb(nodes=[{"children": [0], "mesh": 0}]),
    "glb_node_that_is_not_there": glb(scenes=[{"nodes": [3]}]),
    "glb_without_geometry": glb(nodes=[{}]),
    "glb_compressed_by_draco": glb(
        meshes=[{"primitives": [{**TRIANGLES, "extensions": {"KHR_draco_mesh_compression": {}}}]}]
    ),
    "glb_of_lines": glb(meshes=[{"primitives": [{**TRIANGLES, "mode": 1}]}]),
    "glb_matrix_of_fifteen": glb(nodes=[{"mesh": 0, "matrix": [1.0] * 15}]),
}.items():
    add(_name, "glb", _content)
