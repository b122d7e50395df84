import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

import shapeprog as sp
from shapeprog.data.shape import Shape
from shapeprog.evaluation.metrics import Metrics, evaluate_program, summarise, target_samples, world_scale
from shapeprog.geometry.cells import voxels
from shapeprog.geometry.mesh import union_mesh
from shapeprog.language import Draw, Loop, Program, unroll

TABLE = Program(
    (
        Draw("top_rectangle", (8.0, 0.0, 0.0, 2.0, 9.0, 11.0)),
        Loop(
            "translate",
            (2.0, 0.0, 0.0, 18.0),
            (Loop("translate", (2.0, 0.0, 14.0, 0.0), (Draw("leg", (-10.0, -8.0, -10.0, 18.0, 2.0, 2.0)),)),),
        ),
    )
)


@pytest.fixture(scope="module")
def table():
    scene = unroll(TABLE)
    vertices, faces = union_mesh(scene)
    cells = voxels(scene).numpy().astype(bool)
    return Shape("table", cells, vertices=vertices.astype(np.float32), faces=faces.astype(np.int32))


def moved(program, up):
    top = program.body[0]
    return Program((Draw(top.name, (top.values[0] + up, *top.values[1:])), *program.body[1:]))


def test_a_program_against_itself_reads_the_floor_of_the_cd(table):
    row = evaluate_program(TABLE, table, points=2000)
    assert row.iou == 1
    assert row.f1_cell > 0.98
    assert row.cd == pytest.approx(row.cd_floor, rel=0.1)
    assert (row.blocks, row.statements, row.primitives) == (2, 4, 5)
    assert repr(row) == repr(evaluate_program(TABLE, table, points=2000))  # some measures are not known
    assert row.cd != evaluate_program(TABLE, table, points=2000, seed=1).cd


def test_the_world_has_a_bounding_box_of_diagonal_one(table):
    diagonal = math.sqrt(20**2 + 18**2 + 22**2)
    assert world_scale(table) == pytest.approx(1 / diagonal)
    cells = replace(table, vertices=None, faces=None)
    assert world_scale(cells) == pytest.approx(1 / diagonal)


def test_distances_are_squared_world_lengths_and_a_cell_is_a_cell(table):
    plate = Program((Draw("locker", (0.0, -6.0, -6.0, 0.0, 12.0, 12.0)),))
    flat = np.random.default_rng(0).uniform(-6, 6, (20000, 3)) * [0, 1, 1]
    for height, f1 in ((0.9, 1.0), (1.1, 0.0)):
        target = Shape("plate", np.zeros((32, 32, 32), bool), (flat + np.array([height, 0, 0])).astype(np.float32))
        row = evaluate_program(plate, target, points=10000)
        assert row.to_target == pytest.approx(height**2 / 288, rel=0.02)
        assert row.cd == pytest.approx(row.to_target + row.from_target)
        assert row.f1_cell == f1


def test_iou_is_of_the_snapped_program_and_cd_of_the_program_as_it_is(table):
    shifted = moved(TABLE, 0.4)
    row = evaluate_program(shifted, table, points=2000)
    assert row.iou == 1
    assert row.cd > 1.2 * row.cd_floor
    assert evaluate_program(TABLE, table, snapped=moved(TABLE, 1.0), points=500).iou < 1


def test_targets_without_a_surface_have_an_iou_only(table):
    row = evaluate_program(TABLE, Shape("cells", table.voxels))
    assert row.iou == 1
    assert math.isnan(row.cd)
    assert math.isnan(row.f1_cell)
    assert target_samples(Shape("cells", table.voxels), 10, 0) is None


def test_a_program_that_draws_nothing_has_the_worst_figures(table):
    row = evaluate_program(Program(()), table, points=200)
    assert (row.iou, row.f1_cell, row.cd) == (0, 0, math.inf)
    assert row.primitives == 0


def test_the_two_samplings_of_points_share_none():
    points = torch.rand(100, 3).numpy()
    one, two = target_samples(Shape("p", np.zeros((32, 32, 32), bool), points), 80, 0)
    assert len(one) == len(two) == 50
    assert not set(map(tuple, one.tolist())) & set(map(tuple, two.tolist()))


def test_summaries_state_mean_standard_error_and_median():
    rows = [Metrics(str(i), cd, cd / 2, cd / 2, 0.0, 0.5, 0.25 * i, 1, 2, 3) for i, cd in enumerate((1.0, 2.0, 6.0))]
    summary = summarise([*rows, Metrics("cells", *[math.nan] * 5, 0.75, 1, 2, 3)])
    assert summary["cd"].mean == 3
    assert summary["cd"].error == pytest.approx(math.sqrt(7 / 3))
    assert (summary["cd"].median, summary["cd"].count) == (2, 3)
    assert summary["iou"].count == 4
    assert summary["blocks"].error == 0
    assert "name" not in summary
    assert summarise([]) == {}


def test_a_program_is_measured_where_it_lies_however_it_is_handed_over(tmp_path: Path) -> None:
    body, handle = trimesh.creation.box((40, 60, 30)), trimesh.creation.box((8, 1, 2))  # the handle moves the middle
    handle.apply_translation((0, 5, 17))
    path = tmp_path / "cabinet.obj"
    trimesh.util.concatenate([body, handle]).apply_translation((100, 0, 0)).export(path)
    result = sp.infer(path)
    sp.save(result.program, tmp_path / "a.json")
    sp.save(sp.load(tmp_path / "a.json"), tmp_path / "b.shape")
    read = sp.load(tmp_path / "b.shape")
    changed = sp.set(sp.set(read, width=20), width=next(each.value for each in sp.names(read) if each.name == "width"))
    best = sp.evaluate(result, path, points=1000).f1_percent
    assert best > 0.95
    same = [result.program, read, changed, sp.in_unit(read, sp.Unit("m", 0.5)), tmp_path / "a.json"]
    for program in [*same, str(tmp_path / "b.shape")]:
        assert sp.evaluate(program, path, points=1000).f1_percent == pytest.approx(best, abs=0.01)
        assert sp.evaluate(program, sp.load_shape(path), points=1000).f1_percent == pytest.approx(best, abs=0.01)
    in_grid_of_target = replace(read, frame=None)
    assert sp.evaluate(in_grid_of_target, path, points=1000).f1_percent < 0.8
    sp.export(read, tmp_path / "out.obj")
    sides = trimesh.load(tmp_path / "out.obj", force="mesh").bounds
    assert sides == pytest.approx(np.array([[80, -30, -15], [120, 30, 15]]), abs=0.1)


def test_the_axes_of_the_input_are_those_of_its_program(tmp_path: Path) -> None:
    trimesh.creation.box((4, 2, 1)).export(tmp_path / "a.obj")
    program = sp.infer(sp.load_shape(tmp_path / "a.obj", up="+z", front="-y")).program
    assert sp.evaluate(program, tmp_path / "a.obj", points=1000).f1_percent > 0.99
