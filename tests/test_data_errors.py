"""Bad input of every kind gets an error with cause and cure."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from shapeprog.data import load, load_all, read_pack
from shapeprog.errors import InputError
from tests.geometry_helpers import write_binvox

BOX = trimesh.creation.box()


def refused(path, match):
    with pytest.raises(InputError, match=match) as caught:
        load(path)
    assert caught.value.hint


def test_missing_unknown_and_empty_files(tmp_path):
    refused(tmp_path / "nothing.obj", "there is no file")
    (tmp_path / "a.docx").write_text("hello")
    refused(tmp_path / "a.docx", "no shapes are read from files that end in '.docx'")
    refused(tmp_path, "is a folder")
    for suffix in ("obj", "ply", "glb", "stl", "off", "xyz", "npy", "npz", "binvox", "h5"):
        (tmp_path / f"e.{suffix}").write_bytes(b"")
        refused(tmp_path / f"e.{suffix}", "e")
    ((_, error),) = load_all([tmp_path / "sub.obj"])
    assert isinstance(error, InputError)
    (tmp_path / "bare").mkdir()
    ((_, error),) = load_all([tmp_path / "bare"])
    assert "holds no file" in str(error)


@pytest.mark.parametrize("kind", ["glb", "stl", "stl_ascii", "ply", "off"])
@pytest.mark.parametrize("part", [0.3, 0.6, 0.95])
def test_truncated_meshes(tmp_path, kind, part):
    path = tmp_path / f"a.{kind.removesuffix('_ascii')}"
    content = BOX.export(file_type=kind)
    content = content if isinstance(content, bytes) else content.encode()
    path.write_bytes(content[: int(len(content) * part)])
    refused(path, "a")


def test_truncated_obj_whose_vertices_are_missing(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nf 1 2 3\n")
    refused(tmp_path / "a.obj", "a.obj")


@pytest.mark.parametrize("suffix", ["npy", "npz", "binvox", "h5"])
@pytest.mark.parametrize("part", [0.2, 0.5, 0.9])
def test_truncated_arrays(tmp_path, suffix, part):
    cells = np.random.default_rng(0).random((32, 32, 32)) < 0.3
    path = tmp_path / f"a.{suffix}"
    if suffix == "npy":
        np.save(path, cells)
    elif suffix == "npz":
        np.savez_compressed(path, voxels=cells)
    elif suffix == "binvox":
        write_binvox(path, cells)
    else:
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            file["data"] = cells[None]
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * part)])
    refused(path, "a")


@pytest.mark.parametrize("suffix", ["obj", "ply", "glb", "stl", "off", "xyz", "npy", "npz", "binvox", "h5"])
def test_bytes_of_no_format_at_all(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(np.random.default_rng(1).bytes(2000))
    refused(path, "a")


@pytest.mark.parametrize("bad", ["nan", "inf"])
def test_coordinates_that_are_not_finite(tmp_path, bad):
    (tmp_path / "a.obj").write_text(f"v 0 0 0\nv 1 0 {bad}\nv 0 1 0\nf 1 2 3\n")
    refused(tmp_path / "a.obj", "not finite")
    np.save(tmp_path / "a.npy", np.array([[0, 0, 0], [1, 1, float(bad)]]))
    refused(tmp_path / "a.npy", "not finite")


def test_a_bad_vertex_that_no_face_uses_does_no_harm(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nf 1 2 3\n")
    assert load(tmp_path / "a.obj").voxels.any()


def test_empty_meshes_and_meshes_without_extent(tmp_path):
    (tmp_path / "a.obj").write_text("# nothing\n")
    refused(tmp_path / "a.obj", "a")
    (tmp_path / "b.obj").write_text("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n")
    refused(tmp_path / "b.obj", "no usable extent")
    np.save(tmp_path / "c.npy", np.ones((5, 3)))
    refused(tmp_path / "c.npy", "no usable extent")
    np.save(tmp_path / "d.npy", np.zeros((0, 3)))
    refused(tmp_path / "d.npy", "is empty")


def test_wrong_arrays(tmp_path):
    for name, array, match in [
        ("a", np.zeros((4, 5)), "shape"),
        ("b", np.zeros((4, 5, 6)), "shape"),
        ("c", np.full((8, 8, 8), 0.3), "only 0 and 1"),
        ("d", np.full((8, 8, 8), np.nan), "only 0 and 1"),
        ("e", np.zeros((8, 8, 8)), "no occupied cell"),
        ("f", np.array([None, "x"], dtype=object), "pickle"),
        ("g", np.array(["x", "y"]), "numbers"),
        ("h", np.float64(3), "shape"),
    ]:
        np.save(tmp_path / f"{name}.npy", array, allow_pickle=True)
        refused(tmp_path / f"{name}.npy", match)
    np.savez(tmp_path / "i.npz", a=np.zeros(3), b=np.zeros(3))
    refused(tmp_path / "i.npz", "holds a, b")
    np.savez(tmp_path / "j.npz", voxels=np.array([{}], dtype=object))
    refused(tmp_path / "j.npz", "pickle")


def test_bad_binvox_heads(tmp_path):
    for name, content, match in [
        ("a", b"#binvox 1\ndim 2 2 3\ndata\n\x01\x0c", "no cube"),
        ("b", b"#binvox 1\ndim two\ndata\n\x01\x08", "head"),
        ("c", b"#binvox 1\ndim 2 2 2\ndata\n\x07\x08", "only 0 and 1"),
        ("d", b"#binvox 1\ndim 2 2 2\ndata\n\x01\x07", "cut short"),
        ("e", b"#binvox 1\ndim 2 2 2\ndata\n\x00\x08", "no occupied cell"),
        ("f", b"#binvox 1\ndim 2 2 2\nscale nan\ndata\n\x01\x08", "no cube"),
    ]:
        (tmp_path / f"{name}.binvox").write_bytes(content)
        refused(tmp_path / f"{name}.binvox", match)


def test_a_gltf_reads_nothing_from_elsewhere(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    for name, content in BOX.export(file_type="gltf").items():
        place = inner / "a.gltf" if name == "model.gltf" else tmp_path / name
        place.write_bytes(content)
        if name != "model.gltf":
            buffer = name
    text = (inner / "a.gltf").read_text()
    refused(inner / "a.gltf", "not in its folder")
    (inner / "a.gltf").write_text(text.replace(buffer, f"../{buffer}"))
    refused(inner / "a.gltf", "not in its folder")


def test_bad_packs(tmp_path):
    np.savez(tmp_path / "a.npz", ids=np.array(["x"]), voxels=np.zeros((2, 4096), np.uint8))
    with pytest.raises(InputError, match="voxels are"):
        read_pack(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", voxels=np.zeros((2, 4096), np.uint8))
    with pytest.raises(InputError, match="no ids"):
        read_pack(tmp_path / "b.npz")
    with pytest.raises(InputError, match=r"there is no pack(.|\n)*shapeprog prepare"):
        read_pack(tmp_path / "c.npz")


def test_an_obj_that_ends_within_a_line(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 3")
    refused(tmp_path / "a.obj", "ends within a line")


def test_faces_without_area(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    refused(tmp_path / "a.obj", "has no area")


def test_text_in_an_older_encoding_is_read(tmp_path):
    path = tmp_path / "a.obj"
    path.write_bytes("# Stühle\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".encode("latin-1"))
    assert load(path).kind == "mesh"
