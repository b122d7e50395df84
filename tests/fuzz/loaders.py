"""Files that hold shapes: valid ones of every format that is read, and broken ones."""

from __future__ import annotations

import functools
import io
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from . import by_hand
from .containers import change_glb, change_hdf5, change_head, change_json, change_npy, change_zip
from .mutations import BYTES, TEXT, Mutation, mutants_of

WAYS: dict[str, tuple[Mutation, ...]] = {
    ".obj": (*BYTES, *TEXT, *TEXT),
    ".off": (*BYTES, *TEXT, *TEXT),
    ".xyz": (*BYTES, *TEXT, *TEXT),
    ".stl": (*BYTES, *TEXT),
    ".ply": (*BYTES, *TEXT, *4 * (change_head,)),
    ".binvox": (*BYTES, *4 * (change_head,)),
    ".gltf": (*BYTES, *12 * (change_json,)),
    ".glb": (*BYTES, *12 * (change_glb,)),
    ".npy": (*BYTES, *8 * (change_npy,)),
    ".npz": (*BYTES, *12 * (change_zip,)),
    ".h5": (*BYTES, *4 * (change_hdf5,)),
    ".hdf5": (*BYTES, *4 * (change_hdf5,)),
}
"""How files of a suffix are broken: as bytes, and in the way of their format."""


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """The broken files alone; those that are crafted are a corpus of their own, ``tests/bad_files.py``."""
    return mutants(seed)


def mutants(seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and contents of broken files without an end."""
    return mutants_of(seeds(), WAYS, seed)


@functools.cache
def seeds() -> dict[str, bytes]:
    """Small valid files by name: every format, and every kind of content that readers treat in a way of its own."""
    with tempfile.TemporaryDirectory() as folder:
        _write_programs(Path(folder))
        _write_shapes(Path(folder))
        files = sorted(Path(folder).iterdir())
        return {path.name: path.read_bytes() for path in files if path.suffix in WAYS}


def _write_programs(folder: Path) -> None:
    """What our own writers make of a program."""
    import shapeprog as sp

    program = sp.parse(
        "top_rectangle(at=(4, 0, 0), thickness=2, half=(9, 11))\nleg(at=(-12, -8, -10), size=(16, 2, 2))"
    )
    for suffix in (".glb", ".obj", ".ply", ".stl"):
        sp.export(program, folder / f"program{suffix}")
    sp.export(program, folder / "program.npy", resolution=8)
    sp.export(program, folder / "program.xyz", points=40)


def _write_shapes(folder: Path) -> None:
    """What trimesh, numpy and h5py make of a stool, and what none of them writes."""
    import h5py
    import trimesh
    from trimesh.exchange.gltf import export_gltf

    from shapeprog.data.packs import write_pack
    from shapeprog.data.placement import shape_from_mesh

    seat, leg = trimesh.creation.box((4, 1, 4)), trimesh.creation.box((1, 3, 1))
    scene = trimesh.Scene([seat])
    scene.add_geometry(leg, transform=trimesh.transformations.translation_matrix((0, -2, 0)))
    stool: Any = scene.to_mesh()
    cloud = trimesh.PointCloud(stool.vertices, colors=np.full((len(stool.vertices), 4), 9, np.uint8))
    for name in ("stool.obj", "stool.off", "stool.ply", "stool.stl"):
        stool.export(folder / name)
    scene.export(folder / "scene.glb")
    cloud.export(folder / "cloud.ply")
    (folder / "ascii.ply").write_bytes(stool.export(file_type="ply", encoding="ascii"))
    (folder / "ascii.stl").write_text(stool.export(file_type="stl_ascii"))
    (folder / "stool.gltf").write_bytes(export_gltf(scene, embed_buffers=True)["model.gltf"])
    (folder / "hand.obj").write_bytes(by_hand.OBJ)
    (folder / "hand.off").write_bytes(by_hand.OFF)
    (folder / "hand.glb").write_bytes(by_hand.glb())
    (folder / "ragged.ply").write_bytes(by_hand.RAGGED_PLY)
    (folder / "swapped.ply").write_bytes(by_hand.big_endian_ply())

    cells = np.zeros((2, 8, 8, 8), np.bool_)
    cells[:, 1:7, 2:6, :3] = True
    points = np.asarray(stool.vertices)
    np.save(folder / "points.npy", points)
    np.save(folder / "grids.npy", cells)
    np.savez(folder / "points.npz", points=points.astype(np.float32), other=np.arange(3))
    np.savez_compressed(folder / "cells.npz", voxels=cells)
    np.savetxt(folder / "points.xyz", points)
    shape = shape_from_mesh(points, np.asarray(stool.faces), name="stool", points=20)
    write_pack(folder / "pack.npz", [shape, shape])
    for name, data in (("grids.h5", cells.astype(np.uint8)), ("grid.hdf5", cells[0])):
        with h5py.File(folder / name, "w") as file:
            file.create_dataset("data", data=data, compression="gzip" if data.ndim == 4 else None)
    with io.BytesIO() as stream:
        np.save(stream, cells[0].astype(np.float32), allow_pickle=False)
        (folder / "cells.npy").write_bytes(stream.getvalue())
