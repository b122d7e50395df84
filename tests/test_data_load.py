"""Every kind of file leads to the same shape, and the frame leads back to the file."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh

from shapeprog.data import load, load_all
from shapeprog.data.binvox import read_binvox
from shapeprog.data.orientation import axes_of, default_axes
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.space import Frame, grid_axes
from tests.geometry_helpers import write_binvox

EXAMPLES = Path(__file__).parent.parent / "examples"


def steps():
    """Two boxes like a stair, no two axes alike: +y up, front +z, a tower at the rear, to its +x."""
    low = trimesh.creation.box(bounds=[[0, 0, 0], [6, 2, 4]])
    tower = trimesh.creation.box(bounds=[[4, 0, 0], [6, 3, 2]])
    return trimesh.Trimesh(
        np.concatenate([low.vertices, tower.vertices]), np.concatenate([low.faces, tower.faces + 8]), process=False
    )


def steps_in_grid():
    """Its cells: 4 to a unit; up from -6, rear at + (z from 4 down to 0), left-right = -x of a shape that faces +z."""
    cells = np.zeros((32, 32, 32), bool)
    cells[10:18, 8:24, 4:28] = True
    cells[10:22, 16:24, 4:12] = True
    return cells


def write(mesh, path, kind):
    if kind in ("stl", "stl_ascii"):  # the STL convention: +z up, front -y
        mesh = mesh.copy()
        mesh.vertices = mesh.vertices[:, [0, 2, 1]] * [1, -1, 1]
    mesh.export(path, file_type=kind)


@pytest.mark.parametrize("kind", ["obj", "off", "ply", "stl", "stl_ascii", "glb", "gltf"])
def test_every_mesh_format_gives_the_same_cells_and_leads_back(tmp_path, kind):
    path = tmp_path / f"steps.{kind.removesuffix('_ascii')}"
    if kind == "gltf":
        for name, content in steps().export(file_type="gltf").items():
            (tmp_path / ("steps.gltf" if name == "model.gltf" else name)).write_bytes(content)
    else:
        write(steps(), path, kind)
    shape = load(path)
    np.testing.assert_array_equal(shape.voxels, steps_in_grid())
    assert shape.kind == "mesh"
    assert shape.name == "steps"
    assert shape.points.shape == (5000, 3)
    assert shape.points.dtype == np.float32
    back = shape.frame.to_world(shape.vertices)
    wanted = ([0, 0, 0], [6, 3, 4]) if "stl" not in kind else ([0, -4, 0], [6, 0, 3])
    np.testing.assert_allclose((back.min(0), back.max(0)), wanted, atol=1e-5)
    assert np.linalg.det(np.asarray(shape.frame.axes)) == pytest.approx(1)


def test_the_nodes_of_a_scene_are_placed(tmp_path):
    scene = trimesh.Scene()
    unit = trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]])
    for index, (low, size) in enumerate([((0, 0, 0), (6, 2, 4)), ((4, 0, 0), (2, 3, 2))]):
        matrix = np.diag([*size, 1.0])
        matrix[:3, 3] = low
        scene.add_geometry(unit, node_name=f"part{index}", geom_name="unit", transform=matrix)
    scene.export(tmp_path / "scene.glb")
    np.testing.assert_array_equal(load(tmp_path / "scene.glb").voxels, steps_in_grid())


def test_polygons_and_negative_indices_of_obj_are_read(tmp_path):
    text = "\n".join(f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1))
    text += "\nf -8 -7 -5 -6\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\nmtllib ../../secret.mtl\n"
    (tmp_path / "box.obj").write_text(text)
    assert load(tmp_path / "box.obj").voxels.sum() == 24**3


def test_axes_given_turn_the_shape(tmp_path):
    mesh = steps()
    mesh.vertices = mesh.vertices[:, [2, 0, 1]]  # x -> y, y -> z, z -> x: a turn
    mesh.export(tmp_path / "turned.obj")
    np.testing.assert_array_equal(load(tmp_path / "turned.obj", up="+z", front="+x").voxels, steps_in_grid())
    tipped = steps()
    tipped.vertices = tipped.vertices[:, [0, 2, 1]] * [1, -1, 1]
    tipped.export(tmp_path / "tipped.obj")
    np.testing.assert_array_equal(load(tmp_path / "tipped.obj", up="+z").voxels, steps_in_grid())


@pytest.mark.parametrize(
    ("name", "axes"),
    [
        ("a.obj", ("+y", "+z")),
        ("a.GLB", ("+y", "+z")),
        ("a.stl", ("+z", "-y")),
        ("a.xyz", ("+z", "-y")),
        ("02828884/abc/models/model_normalized.obj", ("+y", "-z")),
        ("02828884/abc/models/model_normalized.solid.binvox", ("+y", "-z")),
    ],
)
def test_default_axes_by_format(name, axes):
    assert default_axes(Path(name)) == axes


def test_voxels_of_arrays_are_in_grid_axes_already_and_points_are_like_meshes():
    np.testing.assert_array_equal(axes_of(Path("a.npy"), None, None), np.eye(3))
    assert default_axes(Path("a.npz"), cloud=True) == ("+y", "+z")
    assert default_axes(Path("a.xyz"), cloud=True) == ("+z", "-y")


@pytest.mark.parametrize(("up", "front"), [("+w", "+z"), ("+y", "-y"), ("yy", "+z"), ("", "up")])
def test_bad_axes_are_refused_in_words(up, front):
    with pytest.raises(InputError, match="--up"):
        axes_of(Path("a.obj"), up, front)


@pytest.mark.parametrize("up", ["+x", "-x", "+y", "-y", "+z", "-z"])
@pytest.mark.parametrize("file", ["a.obj", "a.stl", "a.npy"])
def test_up_alone_is_enough(file, up):
    axes = axes_of(Path(file), up, None)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert axes["xyz".index(up[1]), 0] == (1 if up[0] == "+" else -1)


@pytest.mark.parametrize("kind", ["ply", "xyz", "npy", "npz"])
def test_point_clouds(tmp_path, kind):
    points = trimesh.sample.sample_surface(steps(), 6000, seed=1)[0]
    path = tmp_path / f"cloud.{kind}"
    if kind == "ply":
        trimesh.PointCloud(points).export(path)
    elif kind == "xyz":
        np.savetxt(path, points[:, [0, 2, 1]] * [1, -1, 1], header="x y z")
    elif kind == "npy":
        np.save(path, points)
    else:
        np.savez(path, points=points, colour=np.zeros(3))
    shape = load(path, points=1000)
    wanted = steps_in_grid()
    assert (shape.voxels & wanted).sum() / (shape.voxels | wanted).sum() > 0.93
    assert shape.kind == "points"
    assert shape.points.shape == (1000, 3)


def test_voxels_of_the_grid_are_kept_cell_for_cell(tmp_path):
    cells = steps_in_grid()
    cells[0, 0, 0] = False
    for name, array in {"a.npy": cells, "b.npy": cells.astype(np.uint8), "c.npy": cells.astype(float)}.items():
        np.save(tmp_path / name, array)
        shape = load(tmp_path / name)
        np.testing.assert_array_equal(shape.voxels, cells)
        assert shape.points is None
        assert shape.kind == "voxels"
    np.savez(tmp_path / "d.npz", anything=cells)
    np.testing.assert_array_equal(load(tmp_path / "d.npz").voxels, cells)


def test_a_grid_of_32_that_fills_its_cube_is_fitted_too(tmp_path):
    np.save(tmp_path / "full.npy", np.ones((32, 32, 32), np.bool_))
    shape = load(tmp_path / "full.npy")
    assert shape.voxels.sum() == 24**3
    assert shape.voxels[4:28, 4:28, 4:28].all()
    np.testing.assert_allclose(shape.frame.to_world([[-12, -12, -12], [12, 12, 12]]), [[0, 0, 0], [32, 32, 32]])


@pytest.mark.parametrize("factor", [2, 3])
def test_voxels_of_other_resolutions_are_fitted(tmp_path, factor):
    fine = np.pad(steps_in_grid()[10:22, 8:24, 4:28].repeat(factor, 0).repeat(factor, 1).repeat(factor, 2), 1)
    size = max(fine.shape)
    fine = np.pad(fine, [(0, size - side) for side in fine.shape])
    np.save(tmp_path / "fine.npy", fine)
    shape = load(tmp_path / "fine.npy")
    np.testing.assert_array_equal(shape.voxels, steps_in_grid())
    np.testing.assert_allclose(shape.frame.to_world([-6, -8, -12]), [1, 1, 1])  # the corner after the padding
    assert shape.frame.scale == pytest.approx(factor)


@pytest.mark.parametrize(("up", "front"), [("+y", "+z"), ("+y", "-z"), ("+z", "-y"), ("-x", "+y")])
def test_binvox_files_lie_where_the_shape_lies(tmp_path, up, front):
    frame = Frame.around([1, 2, 3], [7, 5, 7], grid_axes(up, front))
    cells = steps_in_grid()
    write_binvox(tmp_path / "a.binvox", cells, frame)
    world, corner, cell = read_binvox(tmp_path / "a.binvox")
    centres = np.sort(corner + (np.argwhere(world) + 0.5) * cell, axis=0)
    expected = np.sort(frame.to_world(np.argwhere(cells) - 15.5), axis=0)
    np.testing.assert_allclose(centres, expected, atol=1e-6)
    shape = load(tmp_path / "a.binvox", up=up, front=front)
    np.testing.assert_array_equal(shape.voxels, cells)
    np.testing.assert_allclose(shape.frame.matrix(), frame.matrix(), atol=1e-6)


def test_binvox_agrees_with_the_mesh_library(tmp_path):
    write_binvox(tmp_path / "a.binvox", steps_in_grid(), Frame.around([0, 0, 0], [6, 3, 4], grid_axes("+y", "+z")))
    content = io.BytesIO((tmp_path / "a.binvox").read_bytes())
    theirs = trimesh.exchange.binvox.load_binvox(content, axis_order="xzy").matrix
    np.testing.assert_array_equal(theirs, read_binvox(tmp_path / "a.binvox")[0])


def test_a_binvox_of_many_short_runs_is_read_cell_for_cell(tmp_path):
    cells = np.random.default_rng(0).random((64,) * 3) < 0.5
    write_binvox(tmp_path / "a.binvox", cells)
    found = read_binvox(tmp_path / "a.binvox")[0]
    np.testing.assert_array_equal(found, cells)


def test_published_hdf5(tmp_path):
    h5py = pytest.importorskip("h5py")
    cells = np.stack([steps_in_grid(), steps_in_grid()[:, :, ::-1]])
    with h5py.File(tmp_path / "many.h5", "w") as file:
        file["data"] = cells.astype(np.uint8)
    np.testing.assert_array_equal(load(f"{tmp_path}/many.h5#1").voxels, cells[1])
    with pytest.raises(InputError, match="holds 2 shapes"):
        load(tmp_path / "many.h5")
    assert [shape.name for _, shape in load_all([tmp_path / "many.h5"])] == ["many#0", "many#1"]
    with pytest.raises(InputError, match="numbered from 0 to 1"):
        load(f"{tmp_path}/many.h5#2")


def test_a_folder_gives_all_its_shapes_and_broken_ones_stop_nothing(tmp_path):
    steps().export(tmp_path / "a.obj")
    (tmp_path / "b.obj").write_text("v 0 0 0\n")
    (tmp_path / "inner").mkdir()
    steps().export(tmp_path / "inner" / "c.stl")
    (tmp_path / "README.md").write_text("not a shape")
    found = list(load_all([tmp_path, tmp_path / "missing.obj"]))
    assert [path.name for path, _ in found] == ["a.obj", "b.obj", "c.stl", "missing.obj"]
    assert [isinstance(result, ShapeProgError) for _, result in found] == [False, True, False, True]


def test_in_shapenet_layout_the_mesh_stands_for_its_voxels_and_is_named_by_its_id(tmp_path):
    models = tmp_path / "03001627" / "abc" / "models"
    models.mkdir(parents=True)
    steps().export(models / "model_normalized.obj")
    write_binvox(models / "model_normalized.solid.binvox", steps_in_grid())
    ((_, shape),) = load_all([tmp_path])
    assert shape.name == "abc"
    assert shape.kind == "mesh"
    np.testing.assert_array_equal(shape.voxels, steps_in_grid()[:, ::-1, ::-1])  # front -z: turned half round


def test_all_examples_load_and_stand_in_the_grid():
    results = dict(load_all([EXAMPLES], points=500))
    assert 40 <= len(results) <= 60
    for path, shape in results.items():
        assert not isinstance(shape, ShapeProgError), path
        assert np.ptp(shape.vertices, axis=0).max() == pytest.approx(24, abs=1e-4)
        occupied = np.argwhere(shape.voxels)
        assert (occupied.min(0) >= 4).all(), path
        assert (occupied.max(0) < 28).all(), path
        assert (np.ptp(occupied, axis=0).max() + 1) == 24, path
        assert (np.abs(shape.points) <= 12 + 1e-4).all()


def test_the_backs_of_the_example_chairs_are_at_the_rear():
    for path in sorted(EXAMPLES.glob("chair_*.obj")):
        cells = load(path, points=10).voxels
        top = np.argwhere(cells[cells.any((1, 2)).nonzero()[0][-1]])
        assert top[:, 0].mean() > 16, path
