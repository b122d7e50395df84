"""Programs of very many parts: exact as ever, in memory that grows with their number, or refused in words."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
import twins
from geometry_helpers import make_scene, random_scene, require

from shapeprog import export, parse, unroll
from shapeprog.data.shape import Shape
from shapeprog.errors import OutputError, ShapeProgError
from shapeprog.evaluation.metrics import evaluate_program
from shapeprog.formats import build123d, meshes
from shapeprog.formats.json_form import program_to_json
from shapeprog.formats.parts import crease_normals, part_normals, parts
from shapeprog.formats.samples import npy
from shapeprog.geometry import mesh, surface
from shapeprog.geometry.arrays import table_of
from shapeprog.geometry.distance import each_distance, nearest_primitive
from shapeprog.view.viewer import viewer

ROW = "for i in translate(100000, by=(0, 0, 3)):\n    leg(at=(0, 0, 0), size=(2, 2, 2))\n"


def row(count: int, step: float) -> str:
    """Cubes of side 2 along left-right."""
    return ROW.replace("100000", str(count)).replace("0, 0, 3", f"0, 0, {step}")


def crowd(slots: int, spread: float):
    """Turned primitives of all kinds, of which every fifth slot is padding, over a space larger than they are."""
    scene = random_scene(3, slots=slots, dtype=torch.float64)
    mask = scene.mask & (torch.arange(slots) % 5 != 0)
    return require(scene, centre=scene.centre * torch.tensor([spread, 1, 1], dtype=torch.float64), mask=mask).flatten()


def test_points_of_many_parts_are_those_of_all_pairs():
    scene = crowd(500, 4.0)
    shares = surface.area_shares(surface.face_areas(scene), scene)
    fast, slow = surface.visible(table_of(scene), shares, 40, 7), twins.visible(scene, shares, 40, 7)
    assert (fast.chosen == slow.chosen).all()
    np.testing.assert_allclose(fast.places, slow.places, rtol=1e-7, atol=1e-7)


def test_distances_to_many_parts_are_those_of_all_pairs():
    scene = crowd(2000, 6.0)
    points = torch.cartesian_prod(torch.arange(-40.0, 40, 20), torch.tensor([0.0]), torch.arange(-12.0, 12)).double()
    slots, values = nearest_primitive(scene, points)
    expected = each_distance(scene, points).min(-1)
    assert (slots == expected.indices).all()
    torch.testing.assert_close(values, expected.values)


@pytest.mark.parametrize(("count", "step"), [(100_000, 3), (20_000, 0)])
def test_many_parts_have_points_with_gradient(count, step):
    scene = unroll(parse(row(count, step)))
    size = scene.size.clone().requires_grad_()
    points = require(scene, size=size).sample(2000)
    assert points[:, :2].min() >= 0
    assert points[:, 2].max() <= 2 + (count - 1) * step
    (slope,) = torch.autograd.grad(points.sum(), size)
    assert slope.isfinite().all()


def test_one_program_and_a_batch_have_their_own_limits(monkeypatch):
    room = sys.modules[unroll.__module__]
    monkeypatch.setattr(room, "MOST_COPIES", 20)
    monkeypatch.setattr(room, "MOST_PRIMITIVES", 50)
    assert unroll([parse(row(20, 3))] * 2).mask.shape == (2, 20)
    with pytest.raises(ShapeProgError, match="this program make more than 20 copies"):
        unroll([parse(row(20, 3)), parse(row(21, 3))])
    with pytest.raises(ShapeProgError, match="these 3 programs make more than 50 copies"):
        unroll([parse(row(20, 3))] * 3)


def test_copies_are_meshed_each_in_its_place():
    found = mesh.part_meshes(unroll(parse(row(100_000, 3))))
    assert [part.slot for part in found[::50_000]] == [0, 50_000]
    assert found[-1].vertices[:, 2].tolist().count(3 * 99_999) == 4


def test_too_many_triangles_are_refused_with_the_number_allowed(monkeypatch):
    monkeypatch.setattr(mesh, "MOST_TRIANGLES", 120)
    assert len(parts(parse(row(10, 3)))) == 10
    with pytest.raises(ShapeProgError, match="more than 120 triangles"):
        parts(parse(row(11, 3)))


def test_cells_and_lists_of_solids_need_no_limit_of_triangles(monkeypatch):
    program = parse(
        "width, depth, height = 24, 24, 24\nfor _ in translate(3, x=8):\n    cushion(left=0, width=8, edge=1)\n"
    )
    shape, before = Shape("a", np.ones((32, 32, 32), bool)), (npy(program), program_to_json(program))
    monkeypatch.setattr(mesh, "MOST_TRIANGLES", 12)
    assert before == (npy(program), program_to_json(program))
    assert len(json.loads(before[1])["solids"]) == 3
    with pytest.raises(ShapeProgError, match="resolution"):
        npy(program, resolution=513)
    far = parse("box(at=(1e8, 0, 0), size=(1, 1, 1))\nseat(box(at=(0, 0, 0), size=(1, 1, 1)))")
    assert evaluate_program(far, replace(shape, points=np.ones((100, 3), np.float32))).iou == 0


def test_parts_that_touch_nothing_are_put_into_the_union_as_they_are():
    vertices, faces = mesh.union_mesh(unroll(parse(row(mesh.MOST_JOINED, 3))))
    assert len(vertices) == 8 * mesh.MOST_JOINED
    assert trimesh.Trimesh(vertices, faces).volume == pytest.approx(8 * mesh.MOST_JOINED)


@pytest.mark.parametrize("step", [2, 1.5])
def test_a_long_chain_is_one_solid(step):
    vertices, faces = mesh.union_mesh(unroll(parse(row(192, step))))
    volume = np.linalg.det(vertices[faces]).sum() / 6
    assert volume == pytest.approx(4 * (2 + 191 * step), rel=1e-5)


def test_too_many_parts_for_one_solid_are_refused_with_the_number_allowed(monkeypatch):
    monkeypatch.setattr(mesh, "MOST_JOINED", 10)
    assert len(mesh.union_mesh(unroll(parse(row(10, 3))))[0]) == 80
    with pytest.raises(ShapeProgError, match="11 parts are too many to join into one solid: at most 10"):
        mesh.union_mesh(unroll(parse(row(11, 3))))


def test_normals_of_many_parts_are_those_of_each():
    program = parse(
        "line(start=(0, 0, 0), end=(3, 4, 5), radius=0.5)\ntop_circle(at=(1, 2, 3), thickness=1, radius=4)\n"
    )
    each = parts(program) * 3 + parts(parse(row(400, 3)))
    for part, normals in zip(each, part_normals(each), strict=True):
        assert (crease_normals(part.vertices, part.faces) == normals).all()


@pytest.mark.parametrize(
    ("write", "name", "room", "limit"),
    [
        (export, "a.glb", meshes, "MOST_NODES"),
        (export, "a.step", build123d, "MOST_SOLIDS"),
        (viewer, "a.html", sys.modules[viewer.__module__], "FINE"),
    ],
)
def test_files_of_too_many_parts_are_refused_with_the_number_allowed(
    tmp_path: Path, monkeypatch, write, name, room, limit
):
    monkeypatch.setattr(room, limit, 100)
    if name != "a.step":  # which needs another library
        write(parse(row(8, 3)), tmp_path / name)
    with pytest.raises(OutputError, match="at most 100"):
        write(parse(row(101, 3)), tmp_path / name)


def test_why_there_is_no_solid_is_said(tmp_path: Path):
    with pytest.raises(OutputError, match="too many to join"):
        export(parse(row(mesh.MOST_JOINED + 1, 0)), tmp_path / "a.stl")
    far = make_scene(["cuboid"], [[1.0, 1, 1]], [[0.0, 2.0**24, 0]])
    with pytest.raises(ShapeProgError, match="reach farther than 16777216 cells"):
        mesh.union_mesh(far)
