import numpy as np
import pytest
import torch
import trimesh
from geometry_helpers import ellipsoid_kind, make_scene, primitives_restored, random_scene

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.losses import volume
from shapeprog.geometry.mesh import part_meshes, union_mesh


@pytest.fixture(autouse=True)
def restored():
    with primitives_restored():
        yield


@pytest.mark.parametrize("seed", range(3))
def test_parts_are_watertight_outward_and_hold_their_exact_volume(seed):
    scene = random_scene(seed, slots=6, dtype=torch.float64)
    parts = part_meshes(scene)
    assert [part.slot for part in parts] == list(range(5))
    total = 0.0
    for part in parts:
        mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        total += mesh.volume
    assert total == pytest.approx(float(volume(scene)), rel=1e-6)


def test_the_union_is_watertight_and_has_the_exact_volume():
    scene = make_scene(["cuboid"] * 3, [[2.0, 2, 2], [2, 2, 2], [1, 1, 1]], [[0.0, 0, 0], [2, 2, 2], [9, 9, 9]])
    mesh = trimesh.Trimesh(*union_mesh(scene))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(64 + 64 - 8 + 8, rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_the_union_of_turned_and_touching_parts_is_watertight(seed):
    scene = random_scene(seed, slots=8)
    vertices, faces = union_mesh(scene)
    assert trimesh.Trimesh(vertices, faces, process=False).is_watertight
    touching = make_scene(["cuboid", "cylinder"], [[1.0, 3, 3], [2, 1, 0]], [[0.0, 0, 0], [3, 0, 0]])
    assert trimesh.Trimesh(*union_mesh(touching)).is_watertight


def test_flat_and_missing_parts_are_left_out():
    scene = make_scene(["cuboid", "cuboid", "cylinder"], [[0.0, 2, 2], [1, 1, 1], [2, 0, 0]], [[0.0, 0, 0]] * 3)
    assert [part.slot for part in part_meshes(scene)] == [1]
    assert np.isfinite(union_mesh(scene)[0]).all()
    with pytest.raises(ShapeProgError, match="no solid part"):
        union_mesh(make_scene(["cuboid"], [[0.0, 2, 2]], [[0.0, 0, 0]]))
    with pytest.raises(ShapeProgError, match="batch"):
        part_meshes(random_scene(0, lead=(2,)))


def test_a_user_primitive_is_meshed():
    scene = make_scene([ellipsoid_kind(), "cuboid"], [[3.0, 2, 1], [1, 1, 1]], [[0.0, 0, 0], [2, 0, 0]])
    assert trimesh.Trimesh(*union_mesh(scene)).is_watertight
