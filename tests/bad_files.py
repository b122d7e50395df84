"""Files that cannot be read as shapes, one builder for each way to be bad: the corpus of the tests of reading.

``BAD`` holds every builder by its name; each writes its file (and what belongs to it) into a folder and returns its
path.  ``BOMBS`` are those that ask for far more memory or time than their few bytes look like; they may be honest, so
that reading them ends in a shape or in an error.  ``SLOW_BOMBS`` take seconds even so.
"""

from __future__ import annotations

import os
import re
import struct
import zlib
from pathlib import Path

import numpy as np
import trimesh
from bad_arrays import CELLS, archive, binvox, npy, npy_that_announces, npz
from bad_meshes import BAD, BOX, TRIANGLES, Builder, add, bad, glb, ply, written

__all__ = ["BAD", "BOMBS", "BOX", "CELLS", "PYTHON", "SLOW_BOMBS", "archive", "glb", "npy", "npz", "written"]

PYTHON = re.compile(
    r"[A-Z]\w+(Error|Exception)\b|Traceback|NoneType|codec|literal|object has no|<class|\bdtype\b|errno"
)
"""What Python and its libraries say, and no refusal repeats."""

BOMBS: dict[str, Builder] = {}
SLOW_BOMBS: dict[str, Builder] = {}


def slow_bomb(builder: Builder) -> Builder:
    SLOW_BOMBS[builder.__name__] = builder
    return builder


def bomb(builder: Builder) -> Builder:
    BOMBS[builder.__name__] = builder
    return builder


# ---- no files at all


@bad
def fifo(folder: Path) -> Path:
    os.mkfifo(folder / "pipe.obj")
    return folder / "pipe.obj"


@bad
def link_to_an_endless_device(folder: Path) -> Path:
    (folder / "zero.stl").symlink_to("/dev/zero")
    return folder / "zero.stl"


@bad
def link_to_itself(folder: Path) -> Path:
    (folder / "loop.glb").symlink_to(folder / "loop.glb")
    return folder / "loop.glb"


@bad
def missing(folder: Path) -> Path:
    return folder / "missing.ply"


for _suffix in ("obj", "off", "ply", "stl", "glb", "gltf", "xyz", "npy", "npz", "binvox", "h5"):
    add(f"empty_{_suffix}", _suffix, b"")
    add(f"noise_{_suffix}", _suffix, np.random.default_rng(1).bytes(2000))
add("unknown_suffix", "docx", "hello")


# ---- bombs


def zeros(shape: str, size: int) -> bytes:
    """An NPZ whose ``voxels`` announce ``shape`` and unpack to ``size`` bytes of zeros, made without writing them."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    head = npy_that_announces(shape)
    block = bytes(1 << 20)
    start = packer.compress(head + block) + packer.flush(zlib.Z_FULL_FLUSH)
    again = packer.compress(block) + packer.flush(zlib.Z_FULL_FLUSH)  # whole in itself, so that it may be repeated
    data = start + again * (size // len(block) - 1) + packer.flush()
    held, name = len(head) + size, b"voxels.npy"
    entry = struct.pack("<HHHHHIIIHH", 20, 0, 8, 0, 0, 0, len(data), held, len(name), 0)
    listed = b"PK\x01\x02\x14\x00" + entry + struct.pack("<HHHII", 0, 0, 0, 0, 0) + name
    local = b"PK\x03\x04" + entry + name + data
    return local + listed + struct.pack("<4sHHHHIIH", b"PK\x05\x06", 0, 0, 1, 1, len(listed), len(local), 0)


def full(size: int) -> bytes:
    """A binvox in which every cell is occupied."""
    return binvox(size, bytes([1, 255]) * (size**3 // 255) + bytes([1, size**3 % 255]))


@slow_bomb
def binvox_1024_full(folder: Path) -> Path:
    return written(folder / "full.binvox", full(1024))


@slow_bomb
def npz_of_as_many_zeros_as_can_be_read(folder: Path) -> Path:
    return written(folder / "zeros.npz", zeros("(1024, 1024, 1024)", 2**30))


@bomb
def npz_of_zeros(folder: Path) -> Path:
    return written(folder / "zeros.npz", zeros("(1500, 1024, 1024)", 3 * 2**29))


@bomb
def npz_that_holds_more_than_it_announces(folder: Path) -> Path:
    return written(folder / "more.npz", zeros("(64, 64, 64)", 3 * 2**30))


@bomb
def binvox_512_full(folder: Path) -> Path:
    return written(folder / "half.binvox", full(512))


@bomb
def npz_of_many_points(folder: Path) -> Path:
    content = archive({"points": npy(np.zeros((20_000_000, 3), np.int8))})
    return written(folder / "many.npz", content)


@bomb
def obj_of_many_materials(folder: Path) -> Path:
    parts = (
        f"usemtl m{part}\ng g{part}\nv {part} 0 0\nv {part} 9999 0\nv {part} 0 9999\nf -1 -2 -3\n"
        for part in range(20_000)
    )
    return written(folder / "groups.obj", "".join(parts))


@bomb
def glb_of_many_primitives(folder: Path) -> Path:
    return written(folder / "primitives.glb", glb(meshes=[{"primitives": [TRIANGLES] * 20_000}]))


@bomb
def glb_of_a_long_chain(folder: Path) -> Path:
    nodes = [{"mesh": 0, "translation": [1, 0, 0], "children": [place + 1]} for place in range(5_000)]
    return written(folder / "chain.glb", glb(nodes=[*nodes, {"mesh": 0}]))


@bomb
def glb_of_many_copies(folder: Path) -> Path:
    ball = trimesh.creation.icosphere(4)
    places = [{"mesh": 0, "translation": [place, 0, 0]} for place in range(2_000)]
    vertices, faces = ball.vertices.astype("<f4").tobytes(), ball.faces.astype("<u2").tobytes()
    head = {
        "nodes": places, "scenes": [{"nodes": list(range(2_000))}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(ball.vertices), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": ball.faces.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(vertices)},
            {"buffer": 0, "byteOffset": len(vertices), "byteLength": len(faces)},
        ],
    }  # fmt: skip
    return written(folder / "copies.glb", glb(head, vertices + faces))


@bomb
def stl_of_many_solids(folder: Path) -> Path:
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    return written(folder / "solids.stl", f"solid a\n{facet}endsolid a\n" * 20_000)


@bomb
def ply_of_a_billion(folder: Path) -> Path:
    return written(folder / "billion.ply", ply("ascii").replace(b"vertex 8", b"vertex 8000000000"))


@bomb
def sparse_file(folder: Path) -> Path:
    path = written(folder / "sparse.stl", b"solid a\n")
    os.truncate(path, 2**35)
    return path


@bomb
def hdf5_chunk(folder: Path) -> Path:
    import h5py

    path = folder / "chunk.h5"
    with h5py.File(path, "w") as file:
        data = file.create_dataset("data", (40_000, 32, 32, 32), "u1", chunks=(40_000, 32, 32, 32), compression=1)
        assert data.chunks is not None
    return path
