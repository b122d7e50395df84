"""Shapes of arrays in memory are those of the files that hold the same arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import trimesh

import shapeprog as sp

pytestmark = pytest.mark.wrong_types

BOX = trimesh.creation.box((4, 2, 1))
VERTICES, FACES = np.asarray(BOX.vertices), np.asarray(BOX.faces)
CLOUD = np.random.default_rng(0).random((300, 3))
CELLS = np.zeros((8, 8, 8), np.uint8)
CELLS[1:7, 2:4, 3:5] = 1


def assert_equal(shape: sp.Shape, other: sp.Shape) -> None:
    for each in fields(sp.Shape):
        np.testing.assert_array_equal(getattr(shape, each.name), getattr(other, each.name), each.name)


@pytest.mark.parametrize("axes", [{}, {"up": "-x"}, {"up": "+z", "front": "+x"}, {"up": "auto"}])
def test_a_shape_of_arrays_is_that_of_the_file_with_them(tmp_path: Path, axes: dict[str, str]) -> None:
    BOX.export(tmp_path / "a.ply")
    np.save(tmp_path / "cloud.npy", CLOUD)
    np.save(tmp_path / "cells.npy", CELLS)
    kept = {"points": 200, "seed": 3, "unit": "mm"}
    for made, file in [
        (sp.shape_from_mesh(VERTICES, FACES.tolist(), name="a", **kept, **axes), "a.ply"),
        (sp.shape_from_points(torch.from_numpy(CLOUD), name="cloud", **kept, **axes), "cloud.npy"),
        (sp.shape_from_voxels(CELLS.astype(bool), name="cells", unit="mm", **axes), "cells.npy"),
    ]:
        assert_equal(made, replace(sp.load_shape(tmp_path / file, **kept, **axes), source=None))


def test_a_shape_is_shown_in_one_line() -> None:
    shape = sp.shape_from_mesh(VERTICES, FACES, name="box", unit="cm")
    assert repr(shape) == "<Shape 'box': mesh, 5,000 points, 12 faces, 1,728 cells, longest side 4 cm>"
    assert repr(sp.shape_from_voxels(CELLS)) == "<Shape 'voxels': voxels, 1,536 cells, longest side 6>"


@pytest.mark.parametrize("side", [8, 32])
def test_an_export_of_voxels_has_their_size_and_place(tmp_path: Path, side: int) -> None:
    cells, size = np.zeros((side,) * 3, np.bool_), np.array([6, 2, 2]) * (side // 8)
    cells[tuple(slice(step, step + length) for step, length in zip((1, 2, 3), size, strict=True))] = True
    origin = np.array([100, -50, 7])
    shape = sp.shape_from_voxels(cells, pitch=20, origin=origin, unit="mm", up="+x", front="-z")
    program = sp.infer(shape).program
    assert program.unit is not None
    assert program.unit.name == "mm"
    sp.export(program, tmp_path / "a.ply")
    low = origin + 20 * np.array([1, 2, 3])
    assert trimesh.load(tmp_path / "a.ply").bounds == pytest.approx(np.array([low, low + 20 * size]), abs=20)
    sizes = trimesh.load(sp.export(program, tmp_path / "a.stl")).extents
    assert sorted(sizes) == pytest.approx(sorted(20 * size), abs=20)  # a cell


def test_a_shape_of_voxels_keeps_them_when_the_array_changes() -> None:
    cells = np.zeros((32, 32, 32), np.bool_)
    cells[4:28, 10:22, 10:22] = True
    shape = sp.shape_from_voxels(cells)
    cells[:] = False
    assert shape.voxels.sum() == 24 * 12 * 12


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sp.shape_from_mesh(VERTICES[:, :2], FACES), r"vertices holds an array of shape \(8, 2\)"),
        (lambda: sp.shape_from_mesh(VERTICES * np.nan, FACES), "mesh: 8 of 8 positions are not finite numbers"),
        (lambda: sp.shape_from_mesh(VERTICES.astype(str), FACES), "vertices holds <U"),
        (lambda: sp.shape_from_mesh(VERTICES, FACES + 1), "names vertex 8; it has 8, numbered from 0"),
        (lambda: sp.shape_from_mesh(VERTICES, FACES * 1.0), "faces is an array of float64"),
        (lambda: sp.shape_from_mesh(VERTICES, FACES[:0]), r"of shape \(0, 3\)\n  hint: .*shape_from_points"),
        (lambda: sp.shape_from_mesh(VERTICES, FACES, up="w"), "'w' is not an axis"),
        (lambda: sp.shape_from_mesh(VERTICES, FACES, unit="foot"), "foot"),
        (lambda: sp.shape_from_mesh(VERTICES, FACES, points=0), "points is 0"),
        (lambda: sp.shape_from_points([[1, 2, 3], [1, 2]]), "cloud is no array: .*\n  hint: give an array of NumPy"),
        (lambda: sp.shape_from_points(torch.ones(200, 3, requires_grad=True)), "cloud is no array: .*requires grad"),
        (lambda: sp.shape_from_points(CELLS), r"of shape \(8, 8, 8\)\n  hint: give the shape \(P, 3\)"),
        (lambda: sp.shape_from_points(CLOUD[:99]), "99 points"),
        (lambda: sp.shape_from_voxels(CELLS * 0.5), "holds voxels with the value 0.5"),
        (lambda: sp.shape_from_voxels(CELLS[:7]), r"voxels holds an array of shape \(7, 8, 8\)"),
        (lambda: sp.shape_from_voxels(CELLS[None]), r"\(1, 8, 8, 8\)\n  hint: give the shape \(R, R, R\)"),
        (lambda: sp.shape_from_voxels(CELLS, pitch=0), "pitch is 0\n  hint: give a number above 0"),
        (lambda: sp.shape_from_voxels(CELLS, pitch=(1, 1, 1)), r"pitch is \(1, 1, 1\)"),
        (lambda: sp.shape_from_voxels(CELLS, origin=3), "origin is 3\n  hint: give three finite numbers"),
        (lambda: sp.shape_from_voxels(CELLS, origin="abc"), "origin is 'abc'"),
        (lambda: sp.shape_from_voxels(CELLS, origin=(0, 0, np.nan)), "origin is"),
        (lambda: sp.shape_from_voxels(CELLS * 0), "occupied"),
    ],
)
def test_wrong_arrays_are_refused(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(sp.ShapeProgError, match=message):
        call()


GRID = np.ones((32, 32, 32), np.bool_)
GRID_POINTS, TRIANGLE = np.zeros((5, 3), np.float32), np.array([[0, 1, 2]], np.int32)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sp.Shape("a", torch.from_numpy(GRID)), "voxels of a shape is no array of NumPy but Tensor"),
        (
            lambda: sp.Shape("a", GRID[:8]),
            r"bool of the shape \(8, 32, 32\)\n  hint: give bool_? of the shape \(32, 32",
        ),
        (lambda: sp.Shape("a", GRID * 1), r"voxels of a shape is int64 of .*\n.*shape_from_voxels"),
        (lambda: sp.Shape("a", GRID, GRID_POINTS[:, :2]), r"\(5, 2\)\n  hint: give float32 of the shape \(..., 3\)"),
        (lambda: sp.Shape("a", GRID, GRID_POINTS.astype(str)), "points of a shape is <U"),
        (lambda: sp.Shape("a", GRID, GRID_POINTS / 0), "not finite"),
        (lambda: sp.Shape("a", GRID, scan=GRID_POINTS[0]), r"scan of a shape is float32 of the shape \(3,\)"),
        (lambda: sp.Shape("a", GRID, vertices=GRID_POINTS), "both vertices and faces"),
        (lambda: sp.Shape("a", GRID, vertices=GRID_POINTS, faces=TRIANGLE + 3), "names vertex 5; it has 5"),
        (lambda: sp.infer(CLOUD), r"ndarray is neither a shape nor the path of one\n  hint: arrays become shapes"),
        (lambda: sp.infer(torch.from_numpy(CLOUD)), "Tensor is neither a shape nor the path"),
        (lambda: sp.infer(None), "NoneType is neither"),
        (lambda: sp.refine(sp.parse("box(at=(0, 0, 0), size=(2, 2, 2))"), CLOUD), "ndarray is neither"),
        (lambda: sp.evaluate(sp.parse("box(at=(0, 0, 0), size=(2, 2, 2))"), CLOUD), "ndarray is neither"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_a_shape_with_wrong_arrays_is_refused_and_so_are_arrays_instead_of_a_shape(
    call: Callable[[], Any], message: str
) -> None:
    with pytest.raises(sp.InputError, match=message):
        call()
