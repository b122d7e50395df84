from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from geometry_helpers import make_scene, random_scene

import shapeprog as sp
from benchmarks.editing import gaps
from shapeprog.data.random import random_program
from shapeprog.errors import ShapeProgError
from shapeprog.geometry import mesh
from shapeprog.geometry.contacts import TOUCHING, contact_groups
from shapeprog.geometry.mesh import part_meshes, pieces, pieces_of_parts, union_mesh
from shapeprog.geometry.primitives import primitives


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
    slots = zip(scene.kind[:5].tolist(), scene.size[:5], strict=True)
    assert total == pytest.approx(sum(float(primitives[kind].volume(size)) for kind, size in slots), rel=1e-6)


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


@pytest.mark.parametrize("radii", [(2, 0), (0, 2)])
def test_a_cone_with_a_point_has_a_mesh_with_its_volume(radii):
    scene = make_scene(["frustum"], [[3.0, *radii]], [[1.0, 2, 3]])
    for vertices, faces in (part_meshes(scene)[0][1:], union_mesh(scene)):
        mesh = trimesh.Trimesh(vertices, faces)
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(np.pi * 2**2 * 6 / 3, rel=1e-5)


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        ("cuboid", [2.0, 0, 2, 3]),  # its lean gives it a box with a volume
        ("cuboid", [2.0, 1e-6, 2, 3]),
        ("cuboid", [2.0, 2, 1e-6]),
        ("cylinder", [2.0, 0]),
        ("frustum", [0.0, 2, 1]),
        ("frustum", [2.0, 0, 0]),
        ("arc", [3.0, 0, 1]),
        ("arc", [0.0, 2, 0]),
        ("rounded_box", [2.0, 0, 2, 1]),
    ],
)
def test_parts_without_thickness_have_no_mesh(kind, size):
    assert not part_meshes(make_scene([kind], [size], [[0.0, 0, 0]]))


def test_a_thin_ring_has_a_mesh_though_it_fills_little_of_its_box():
    (part,) = part_meshes(make_scene(["arc"], [[1.0, 0.002, 20]], [[0.0, 0, 0]]))
    assert trimesh.Trimesh(part.vertices, part.faces).volume > 0


def groups(scene, within):
    """How many groups the primitives of a scene form across gaps of meshes."""
    group = {slot: slot for slot in np.flatnonzero(scene.mask.numpy()).tolist()}
    for one, other in gaps(scene, within):
        group = {slot: group[one] if each == group[other] else each for slot, each in group.items()}
    return len({*group.values()})


def test_groups_of_touching_parts_are_those_of_their_meshes():
    pieces = sorted((Path(__file__).parents[1] / "examples" / "pieces").glob("*.shape"))
    programs = [sp.load(path) for path in pieces]
    programs += [random_program(torch.Generator().manual_seed(seed), blocks=4, copies=6) for seed in range(20)]
    for program, found in zip(programs, contact_groups(sp.unroll(programs)), strict=True):
        scene = sp.unroll(program)
        assert groups(scene, 0.2) <= found <= groups(scene, 0.002)


def turned_about_side(*angles):
    """Rotations by angles in degrees about the axis left-right."""
    angle = torch.deg2rad(torch.tensor(angles, dtype=torch.float64))
    low, high, zero, one = angle.sin(), angle.cos(), 0 * angle, 1 + 0 * angle
    return torch.stack([high, -low, zero, low, high, zero, zero, zero, one], -1).reshape(-1, 3, 3)


@pytest.mark.parametrize("angle", [3, 10, 90])
@pytest.mark.parametrize("gap", [0.5, 1.5])
def test_rods_that_lean_touch_by_the_gap_at_their_ends(angle, gap):
    """The second rod leaves the first at an end of its axis, in a plane beside it."""
    low, high = np.sin(np.deg2rad(angle)), np.cos(np.deg2rad(angle))
    centre = [[0.0, 0, 0], [5 + 5 * high, 5 * low, 1 + TOUCHING * gap]]
    rods = make_scene(["cylinder"] * 2, [[5.0, 0.5]] * 2, centre, turned_about_side(0, angle), torch.float64, (1,))
    assert contact_groups(rods) == [1 if gap < 1 else 2]


def test_a_bent_rod_touches_with_both_ends_and_not_with_what_it_spans():
    sizes, centres = [[5.0, 0.5, 5.0], [1.0, 1, 1], [1.0, 1, 1], [1.0, 1, 1]], [[0.0, 0, 0]]
    centres += [[-5.0, -3.5, 0], [5.0, -3.5, 0], [0.0, -2.5, 0]]
    scene = make_scene(["arc", "cuboid", "cuboid", "cuboid"], sizes, centres, lead=(1,))
    assert contact_groups(scene) == [2]


def test_parts_that_meet_along_an_edge_alone_are_separate_pieces():
    face = "box(at=(-12, 0, 0), size=(2, 2, 2))\nbox(at=(-10, 0, 0), size=(2, 2, 2))\n"
    edge = "box(at=(-8, 2, 0), size=(2, 2, 2))\n"
    inside = "box(at=(-11.5, 0.5, 0.5), size=(1, 1, 1))\n"
    scene = sp.unroll(sp.parse(face + edge + inside))
    assert pieces_of_parts(scene).tolist() == [0, 0, 1, 0]
    assert contact_groups(sp.unroll([sp.parse(face + edge + inside)])) == [1]
    assert pieces(*union_mesh(scene)) == 2


def test_parts_without_a_union_count_as_one_piece(monkeypatch):
    apart = sp.unroll(sp.parse("box(at=(0, 0, 0), size=(1, 1, 1))\nbox(at=(3, 0, 0), size=(1, 1, 1))\n"))
    assert pieces_of_parts(apart).tolist() == [0, 1]
    monkeypatch.setattr(mesh, "MOST_JOINED", 1)
    assert pieces_of_parts(apart).tolist() == [0, 0]
    assert pieces_of_parts(sp.unroll(sp.Program())).tolist() == []
