"""Packs come back as they were written; prepared directories do not depend on order and lose nothing."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
import trimesh

from shapeprog.data import Pack, Shape, load, load_all, prepare, read_pack, shape_from_mesh, write_pack
from shapeprog.data.preparation import split_of
from shapeprog.errors import InputError, OutputError
from shapeprog.space import Frame
from tests.geometry_helpers import write_binvox


def box(sides, **options):
    mesh = trimesh.creation.box(sides)
    return shape_from_mesh(mesh.vertices, mesh.faces, points=50, **options)


@pytest.fixture
def shapes():
    return [box((1, 2, 3), name="a"), box((3, 1, 1), name="b"), box((2, 2, 2), name="c")]


def test_a_pack_comes_back_as_it_was_written(tmp_path, shapes):
    assert write_pack(tmp_path / "p.npz", shapes) == 3
    pack = read_pack(tmp_path / "p.npz")
    assert isinstance(pack, Pack)
    assert len(pack) == 3
    for before, after in zip(shapes, pack, strict=True):
        assert after.name == before.name
        np.testing.assert_array_equal(after.voxels, before.voxels)
        np.testing.assert_allclose(after.points, before.points, atol=24 / 65535)
        assert after.frame.scale == pytest.approx(before.frame.scale)
    assert pack[-1].name == "c"
    with pytest.raises(IndexError):
        pack[3]


def test_a_pack_holds_the_arrays_that_its_manual_names(tmp_path, shapes):
    write_pack(tmp_path / "p.npz", shapes)
    arrays = np.load(tmp_path / "p.npz")
    assert arrays["voxels"].shape == (3, 4096)
    assert arrays["points"].dtype == np.uint16
    np.testing.assert_allclose(arrays["longest_side"], [3, 3, 2])
    world = (arrays["points"][0] / 65535 - 0.5) * arrays["longest_side"][0]
    np.testing.assert_allclose(np.abs(world).max(0), [0.5, 1, 1.5], atol=1e-3)


def test_writing_what_was_read_changes_nothing(tmp_path, shapes):
    write_pack(tmp_path / "p.npz", shapes)
    write_pack(tmp_path / "q.npz", read_pack(tmp_path / "p.npz"))
    first, second = np.load(tmp_path / "p.npz"), np.load(tmp_path / "q.npz")
    for name in first.files:
        np.testing.assert_array_equal(first[name], second[name])


def test_voxels_and_splits_alone_make_a_pack(tmp_path, shapes):
    bare = [Shape(s.name, s.voxels, split=split) for s, split in zip(shapes, ("train", "test", "train"), strict=True)]
    write_pack(tmp_path / "p.npz", bare)
    assert [shape.split for shape in read_pack(tmp_path / "p.npz")] == ["train", "test", "train"]
    assert read_pack(tmp_path / "p.npz")[0].points is None


def test_the_shapes_of_a_pack_are_chosen_by_number_or_name(tmp_path, shapes):
    write_pack(tmp_path / "p.npz", shapes)
    assert load(f"{tmp_path}/p.npz#1").name == "b"
    assert load(f"{tmp_path}/p.npz#c").name == "c"
    with pytest.raises(InputError, match="holds 3 shapes"):
        load(tmp_path / "p.npz")
    assert [(path.name, shape.name) for path, shape in load_all([tmp_path])] == [
        ("p.npz#0", "a"),
        ("p.npz#1", "b"),
        ("p.npz#2", "c"),
    ]


@pytest.mark.parametrize("kind", ["f2", "f4", "f8", "i2", "u8"])
def test_the_longest_sides_of_a_pack_are_numbers_of_any_kind(tmp_path, kind):
    voxels = np.full((3, 4096), 255, np.uint8)
    sides = np.array([1, 24, 7], kind)
    np.savez(tmp_path / "p.npz", ids=np.array(["a", "b", "c"]), voxels=voxels, longest_side=sides)
    assert [24 * shape.frame.scale for shape in read_pack(tmp_path / "p.npz")] == [1, 24, 7]


def test_a_truncated_pack_is_refused(tmp_path, shapes):
    write_pack(tmp_path / "p.npz", shapes)
    whole = (tmp_path / "p.npz").read_bytes()
    for part in (0.3, 0.7, 0.99):
        (tmp_path / "p.npz").write_bytes(whole[: int(len(whole) * part)])
        with pytest.raises(InputError, match=r"p\.npz"):
            load(f"{tmp_path}/p.npz#0")


def test_a_file_of_another_format_is_called_no_pack_and_not_damaged(tmp_path):
    trimesh.creation.box().export(tmp_path / "box.obj")
    with pytest.raises(InputError, match=r"^box\.obj is no pack\n  hint: make packs with 'shapeprog prepare'"):
        read_pack(tmp_path / "box.obj")
    with pytest.raises(InputError, match="is a folder"):
        read_pack(tmp_path)


@pytest.fixture
def directory(tmp_path):
    """Two synsets with eight boxes each, two of a kind, and one broken model."""
    rng = np.random.default_rng(0)
    for synset in ("03001627", "04379243"):
        for index in range(8):
            models = tmp_path / "in" / synset / f"id{index}" / "models"
            models.mkdir(parents=True)
            trimesh.creation.box(rng.uniform(1, 3, 3)).export(models / "model_normalized.obj")
        shutil.copytree(tmp_path / "in" / synset / "id0", tmp_path / "in" / synset / "twin")
    broken = tmp_path / "in" / "03001627" / "broken" / "models"
    broken.mkdir(parents=True)
    (broken / "model_normalized.obj").write_text("v 0 0 0\nf 1 2 3\n")
    return tmp_path / "in"


def test_a_directory_is_prepared_whole_and_the_broken_is_reported(tmp_path, directory):
    records = list(prepare(directory, tmp_path / "out", points=100))
    assert [record.done for record in records[:-1]] == list(range(1, 20))
    assert records[-1].total == 19
    ((path, error),) = records[-1].failures
    assert "broken" in str(path)
    assert isinstance(error, InputError)
    names = {}
    for pack, count in records[-1].packs:
        category, split = pack.stem.split("_")
        shapes = list(read_pack(pack))
        assert len(shapes) == count
        for shape in shapes:
            assert shape.split == split == split_of(shape)
            extents = np.ptp(np.asarray(shape.points) * shape.frame.scale, axis=0)
            assert 0.85 < np.linalg.norm(extents) <= 1.001
            names[category, shape.name] = split
    assert len(names) == 18
    assert {category for category, _ in names} == {"chair", "table"}
    for category in ("chair", "table"):
        assert names[category, "id0"] == names[category, "twin"]


def test_preparing_again_or_in_parts_gives_the_same_packs(tmp_path, directory):
    first = {path.name: path.read_bytes() for path, _ in list(prepare(directory, tmp_path / "a", points=50))[-1].packs}
    shutil.rmtree(directory / "04379243")
    again = {path.name: path.read_bytes() for path, _ in list(prepare(directory, tmp_path / "b", points=50))[-1].packs}
    assert again == {name: content for name, content in first.items() if name.startswith("chair")}


def test_plain_folders_are_categories(tmp_path):
    for category in ("my chairs", "desk"):
        (tmp_path / "in" / category / "sub").mkdir(parents=True)
        trimesh.creation.box((1, 2, 3)).export(tmp_path / "in" / category / "a.obj")
        trimesh.creation.box((1, 2, 3)).export(tmp_path / "in" / category / "a.stl")
        trimesh.creation.box((1, 1, 3)).export(tmp_path / "in" / category / "sub" / "b.glb")
    *_, last = prepare(tmp_path / "in", tmp_path / "out", points=50, shares=(1, 0, 0))
    assert [(path.name, count) for path, count in last.packs] == [("desk_train.npz", 2), ("my_chairs_train.npz", 2)]
    assert [shape.name for shape in read_pack(tmp_path / "out" / "desk_train.npz")] == ["a", "sub/b"]


def test_a_folder_of_models_is_one_category_and_a_pack_without_points_is_told(tmp_path):
    (tmp_path / "desk").mkdir()
    for name in ("a.obj", "a.glb", "b.ply"):
        trimesh.creation.box((1, 2, 3)).export(tmp_path / "desk" / name)
    *_, last = prepare(tmp_path / "desk", tmp_path / "out", points=50, shares=(1, 0, 0))
    assert (last.total, last.packs, last.failures) == (2, ((tmp_path / "out" / "desk_train.npz", 2),), ())
    write_binvox(tmp_path / "desk" / "c.binvox", np.ones((32, 32, 32), bool))
    write_binvox(tmp_path / "desk" / "a.binvox", np.ones((32, 32, 32), bool))
    *_, last = prepare(tmp_path / "desk", tmp_path / "out", points=50, shares=(1, 0, 0))
    ((path, error),) = last.failures
    assert (last.total, path.name) == (3, "desk_train.npz")
    assert "1 of its 3 models are voxels, as c" in error.message


def test_old_packs_do_not_stay_beside_new_ones(tmp_path):
    (tmp_path / "in" / "desk").mkdir(parents=True)
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "in" / "desk" / "a.obj")
    for shares, counts in (((1, 0, 0), {"desk_train": 1}), ((0, 0, 1), {"desk_train": 0, "desk_test": 1})):
        *_, last = prepare(tmp_path / "in", tmp_path / "out", points=50, shares=shares)
        assert {path.stem: count for path, count in last.packs} == counts
    assert len(read_pack(tmp_path / "out" / "desk_train.npz")) == 0


def test_shares_are_kept_on_the_whole():
    rng = np.random.default_rng(0)
    drawn = [split_of(Shape("x", rng.random((32, 32, 32)) < 0.5, frame=Frame())) for _ in range(600)]
    assert abs(drawn.count("train") / 600 - 0.7) < 0.1
    assert abs(drawn.count("test") / 600 - 0.2) < 0.1


def test_bad_directories_and_shares_are_refused(tmp_path):
    (tmp_path / "in").mkdir()
    for call, match in [
        (lambda: prepare(tmp_path / "nowhere", tmp_path / "out"), "no folder"),
        (lambda: prepare(tmp_path / "in", tmp_path / "out"), "no models"),
        (lambda: prepare(tmp_path / "in", tmp_path / "out", shares=(1, 1, 1)), "shares"),
    ]:
        with pytest.raises(InputError, match=match):
            list(call())
    (tmp_path / "in" / "chair").mkdir()
    trimesh.creation.box().export(tmp_path / "in" / "chair" / "a.obj")
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="cannot make the folder"):
        list(prepare(tmp_path / "in", tmp_path / "file"))
