"""Whatever a file holds, reading it ends in a shape or in words, in little time and memory, and never stops others."""

from __future__ import annotations

import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bad_arrays import binvox
from bad_files import BAD, BOMBS, BOX, CELLS, PYTHON, archive, glb, npy, npz, written

from shapeprog.data import Shape, load, load_all, loading, prepare, read_pack
from shapeprog.data.folders import files_below
from shapeprog.data.meshes import read_mesh
from shapeprog.data.reading import in_words
from shapeprog.errors import InputError

TESTS = Path(__file__).parent


def in_plain_words(error: InputError) -> bool:
    """Whether an error says what to do, and repeats nothing that Python or a library said."""
    return bool(error.message and error.hint) and not PYTHON.search(str(error))


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_file_between_two_good_ones_is_told_in_words_and_stops_nothing(tmp_path, kind):
    if kind.startswith(("hdf5", "noise_h5", "empty_h5")):
        pytest.importorskip("h5py")
    bad = BAD[kind](tmp_path)
    good = [written(tmp_path / f"{name}.npy", npy(CELLS)) for name in ("a_good", "z_good")]
    first, found, last = load_all([good[0], bad, good[1]])
    assert isinstance(first[1], Shape)
    assert isinstance(last[1], Shape)
    assert isinstance(found[1], InputError), kind
    assert in_plain_words(found[1]), str(found[1])


@pytest.mark.parametrize(
    "error",
    [
        ValueError("x"), KeyError(3), AttributeError("'NoneType' object has no attribute 'a'"), AssertionError(),
        MemoryError(), RecursionError(), OverflowError(), NotImplementedError(), StopIteration(), SyntaxError(),
        ModuleNotFoundError("No module named 'charset_normalizer'"), OSError("of a library"), OSError(5, "of disks"),
        PermissionError(13, "Permission denied"), UnicodeDecodeError("ascii", b"x", 0, 1, "x"), EOFError(), Exception(),
        OSError(22, "Invalid argument"),
    ],
    ids=lambda error: type(error).__name__,
)  # fmt: skip
def test_whatever_a_reader_raises_becomes_words_and_keeps_its_cause(tmp_path, monkeypatch, error):
    def read(path):
        raise error

    paths = [written(tmp_path / f"{name}.npy", npy(CELLS)) for name in "ac"]
    bad = written(tmp_path / "b.obj", "v 0 0 0\n")
    monkeypatch.setattr(loading, "read_mesh", read)
    found = [shape for _, shape in load_all([paths[0], bad, paths[1]])]
    assert [type(each) for each in found] == [Shape, InputError, Shape]
    assert in_plain_words(found[1])
    assert found[1].__cause__ is error


def test_numbers_of_a_file_that_are_no_numbers_are_told_by_name_without_a_warning(tmp_path):
    signalling = np.array([0x7F800001] * 9, "<u4").view("<f4").reshape(3, 3)  # which warns when it is converted
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    ply = (head + "property float z\nend_header\n").encode() + signalling.tobytes()
    stl = bytes(80) + (1).to_bytes(4, "little") + bytes(12) + signalling.tobytes() + bytes(2)
    for name, content in (("x.ply", ply), ("x.stl", stl), ("x.npy", npy(signalling))):
        with pytest.raises(InputError, match="3 of 3 positions are not finite"):
            load(written(tmp_path / name, content))


@pytest.mark.parametrize("suffix", ["npy", "npz", "binvox", "h5"])
def test_a_grid_without_cells_is_told_by_name(suffix, tmp_path):
    empty, path = np.zeros((4, 4, 4), np.uint8), tmp_path / f"hollow.{suffix}"
    if suffix == "h5":
        with pytest.importorskip("h5py").File(path, "w") as file:
            file["data"] = empty
    else:
        written(path, {"npy": npy(empty), "npz": npz(voxels=empty), "binvox": binvox(4, bytes([0, 64]))}[suffix])
    with pytest.raises(InputError, match="hollow has no occupied cell"):
        load(path)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_who_wants_to_stop_is_not_held_up(tmp_path, stop):
    with pytest.raises(stop), in_words(tmp_path / "a.obj"):
        raise stop


@pytest.mark.wrong_types  # the checker takes shapes out of packs to see what they are
def test_a_shape_that_cannot_be_made_does_not_stop_the_others_of_its_file(tmp_path):
    packed = np.packbits(CELLS)
    voxels = np.stack([packed, np.zeros_like(packed), packed, packed])
    sides = np.array([1, 1, 5e-324, 1])
    path = written(tmp_path / "a.npz", npz(ids=np.array(list("abcd")), voxels=voxels, longest_side=sides))
    found = [shape for _, shape in load_all(path)]
    assert [type(each) for each in found] == [Shape, InputError, InputError, Shape]
    assert "b has no occupied cell" in str(found[1])
    assert "longest side of c" in str(found[2])
    with pytest.raises(InputError, match="no occupied cell"):
        read_pack(path)
    grids = np.stack([CELLS.astype(np.uint8), np.full_like(CELLS, 7, np.uint8)])
    found = [shape for _, shape in load_all([written(tmp_path / "b.npy", npy(grids))])]
    assert [type(each) for each in found] == [Shape, InputError]


def _count(error: InputError) -> list[int]:
    return [int(number.replace(",", "")) for number in re.findall(r"-?[\d,]*\d", error.message)]


@pytest.mark.parametrize(
    ("faces", "named"), [("f 0 1 2", 0), ("f 1 2 9", 9), ("f -1 -2 -9", -9), ("f 1//1 2//1 0//1", 0)]
)
def test_a_face_of_an_obj_that_names_no_vertex_is_refused_with_its_own_number(tmp_path, faces, named):
    path = written(tmp_path / "x.obj", f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n{faces}\n")
    with pytest.raises(InputError, match="face 2 names vertex") as caught:
        load(path)
    assert named in _count(caught.value)


def test_negative_indices_count_back_from_where_they_stand(tmp_path):
    part = "v {0} 0 0\nv {0} 1 0\nv {0} 0 1\nf -3 -2 -1\n"
    vertices, faces = read_mesh(written(tmp_path / "x.obj", "".join(part.format(place) for place in range(3))))
    np.testing.assert_array_equal(faces, np.arange(9).reshape(3, 3))
    np.testing.assert_array_equal(vertices[faces][:, :, 0], np.repeat(np.arange(3.0), 3).reshape(3, 3))


def test_an_obj_is_read_through_groups_textures_polygons_long_lines_and_comments(tmp_path):
    text = (
        "# a\r\nmtllib x.mtl\r\no a b\r\nv 0 0 0 1 1 1\r\n  v\t1 0 0 1\r\nv 1 1 0 # corner\r\nv 0 1 0\r\nv .5 1.5 0\r\n"
        "vt 0 0\r\nvn 0 0 1\r\nusemtl x\r\ng one two\r\ns off\r\nf 1/1/1 2/1/1 \\\r\n3/1/1 4/1/1\r\nl 1 2\r\nf 1 2\r\n"
        "usemtl y\r\nf 4//1 3//1 5//1 # roof\r\nf 1 2 3 5 4"
    )
    vertices, faces = read_mesh(written(tmp_path / "x.obj", text))
    assert vertices.shape == (5, 3)
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 4], [0, 1, 2], [0, 2, 4], [0, 4, 3]]


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_rows_of_a_ply_may_differ_in_length(tmp_path, encoding):
    form = "ascii" if encoding == "ascii" else "binary_big_endian"
    head = (
        f"ply\nformat {form} 1.0\ncomment Stühle\nelement vertex 5\nproperty double x\nproperty float y\n"
        "property uchar red\nproperty short z\nelement face 2\nproperty list uchar uint vertex_index\n"
        "property uchar flag\nelement edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    ).encode("latin-1")
    rows = [(0, 0, 9, 0), (1, 0, 9, 0), (1, 1, 9, 0), (0, 1, 9, 0), (0.5, 1.5, 9, 7)]
    if encoding == "ascii":
        body = "".join("{} {} {} {}\n".format(*row) for row in rows).encode() + b"4 0 1 2 3 1\n3 3 2 4 1\n0 1\n"
    else:
        kinds = np.dtype([("x", ">f8"), ("y", ">f4"), ("red", "u1"), ("z", ">i2")])
        quad = bytes([4]) + np.arange(4, dtype=">u4").tobytes() + b"\1"
        body = np.array(rows, kinds).tobytes() + quad + bytes([3]) + np.array([3, 2, 4], ">u4").tobytes() + b"\1"
        body += np.array([0, 1], ">i4").tobytes()
    vertices, faces = read_mesh(written(tmp_path / "x.ply", head + body))
    np.testing.assert_array_equal(vertices, np.array(rows)[:, [0, 1, 3]])
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 4]]


def test_every_mesh_format_gives_the_same_triangles_in_the_same_order(tmp_path):
    for suffix in ("obj", "off", "ply", "stl", "glb"):
        path = tmp_path / f"box.{suffix}"
        BOX.export(path)
        vertices, faces = read_mesh(path)
        np.testing.assert_allclose(vertices[faces], BOX.vertices[BOX.faces], atol=1e-7)


@pytest.mark.parametrize("suffix", ["off", "ply", "stl", "glb"])
def test_a_file_that_announces_counts_is_never_read_in_part(tmp_path, suffix):
    content = BOX.export(file_type=suffix, **({"encoding": "ascii"} if suffix == "ply" else {}))
    content = content if isinstance(content, bytes) else content.encode().rstrip() + b"\n"
    assert len(read_mesh(written(tmp_path / f"whole.{suffix}", content))[1]) == 12
    for size in np.random.default_rng(0).integers(0, len(content) - 3, 60):
        path = written(tmp_path / f"cut.{suffix}", content[:size])
        with pytest.raises(InputError):
            load(path)


def test_nodes_of_a_gltf_are_placed_by_all_above_them(tmp_path):
    turn = [0, 0, 2**-0.5, 2**-0.5]  # a quarter about z
    nodes = [
        {"children": [1, 2], "translation": [10, 0, 0], "rotation": turn, "scale": [2, 1, 1]},
        {"mesh": 0, "translation": [1, 0, 0]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 5, 0, 1]},
    ]
    vertices, faces = read_mesh(written(tmp_path / "a.glb", glb(nodes=nodes)))
    assert len(faces) == 24
    second, first = vertices[:8], vertices[8:]  # the last child first
    np.testing.assert_allclose((first.min(0), first.max(0)), [[9.5, 1, -0.5], [10.5, 3, 0.5]], atol=1e-6)
    np.testing.assert_allclose((second.min(0), second.max(0)), [[4.5, -1, -0.5], [5.5, 1, 0.5]], atol=1e-6)


@pytest.mark.parametrize(
    ("mode", "order", "wanted"),
    [
        (4, [0, 1, 2, 2, 1, 3], [[0, 1, 2], [2, 1, 3]]),
        (5, [0, 1, 2, 3], [[0, 1, 2], [3, 2, 1]]),
        (6, [0, 1, 2, 3], [[0, 1, 2], [0, 2, 3]]),
        (0, [0, 1, 2, 3], []),
    ],
)
def test_triangles_strips_fans_and_points_of_a_gltf(tmp_path, mode, order, wanted):
    data = BOX.vertices[:4].astype("<f4").tobytes() + np.array(order, "<u2").tobytes()
    head = {
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": len(order), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 2 * len(order)},
        ],
    }  # fmt: skip
    assert read_mesh(written(tmp_path / "a.glb", glb(head, data)))[1].tolist() == wanted


def test_of_an_archive_only_what_is_wanted_is_read(tmp_path):
    path = written(tmp_path / "a.npz", archive({"voxels": npy(CELLS), "other": b"no array", "last": b""}))
    np.testing.assert_array_equal(load(path).voxels, CELLS)


def test_a_folder_without_permission_is_told_and_the_rest_is_read(tmp_path, monkeypatch):
    closed = tmp_path / "chairs" / "closed"
    closed.mkdir(parents=True)
    for place in (tmp_path / "chairs", closed):
        written(place / "good.npy", npy(CELLS))
    listed, walked = os.listdir, os.scandir

    def refuse(open_folder):
        def open_or_refuse(path="."):
            if Path(path) == closed:
                raise PermissionError(13, "Permission denied", str(path))
            return open_folder(path)

        return open_or_refuse

    monkeypatch.setattr(os, "listdir", refuse(listed))
    monkeypatch.setattr(os, "scandir", refuse(walked))
    (_, shape), (path, error) = load_all([tmp_path])
    assert isinstance(shape, Shape)
    assert path == closed
    assert "no permission" in str(error)
    *_, last = prepare(tmp_path, tmp_path / "out", shares=(1, 0, 0))
    assert [count for _, count in last.packs] == [1]
    assert [path for path, _ in last.failures] == [closed]


def test_links_to_nothing_are_left_out_of_a_folder_and_pipes_are_told(tmp_path):
    (tmp_path / "a.obj").symlink_to(tmp_path / "nowhere.obj")
    BAD["fifo"](tmp_path)
    assert [path.name for path in files_below(tmp_path, {".obj"}, [])] == ["pipe.obj"]
    ((_, error),) = load_all([tmp_path])
    assert "a pipe, a socket or a device" in str(error)


@pytest.mark.parametrize("low", [0.0, 1e19, -3e38])
@pytest.mark.parametrize("side", [1e-38, 1e-20, 1.0, 1e20, 3e38])
def test_extreme_coordinates_end_in_a_shape_or_in_words(tmp_path, low, side):
    corners = low + side * (BOX.vertices + 0.5)
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()] + ["f {} {} {}".format(*f) for f in BOX.faces + 1]
    paths = [
        written(tmp_path / "a.obj", "\n".join(rows)),
        written(tmp_path / "b.npy", npy(np.tile(corners, (13, 1)))),
        written(tmp_path / "c.binvox", f"#binvox 1\ndim 2 2 2\ntranslate {low} 0 0\nscale {side}\ndata\n\1\x08"),
    ]
    for _, found in load_all(paths):
        if isinstance(found, InputError):
            assert in_plain_words(found)
            assert not (low == 0 and 1e-20 <= side <= 1e20), str(found)
            continue
        assert found.voxels.any()
        centre = found.frame.to_world(np.zeros(3))
        assert np.isfinite(centre).all()
        assert found.points is None or np.abs(found.points).max() <= 12 + 1e-3


def test_bombs_end_in_a_shape_or_in_words_within_two_gigabytes_and_a_few_seconds(tmp_path):
    pytest.importorskip("h5py")
    (tmp_path / "paths.json").write_text(json.dumps([str(build(tmp_path)) for build in BOMBS.values()]))

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (2 * 2**30, 2 * 2**30))

    child = subprocess.run(
        [sys.executable, str(TESTS / "read_each.py"), str(tmp_path / "paths.json")],
        preexec_fn=limited, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert child.returncode == 0, child.stderr[-2000:]
    told = [json.loads(line) for line in child.stdout.splitlines()]
    assert len(told) == len(BOMBS)
    for name, each in zip(BOMBS, told, strict=True):
        assert each["seconds"] < 10, (name, each)  # of the processor, so that a loaded machine changes nothing
        assert each["end"] in ("a shape", "an error"), (name, each)
        assert "memory" not in each["words"], (name, each)
    shapes = {name for name, each in zip(BOMBS, told, strict=True) if each["end"] == "a shape"}
    assert {"binvox_512_full", "obj_of_many_materials", "glb_of_many_primitives", "stl_of_many_solids"} <= shapes
