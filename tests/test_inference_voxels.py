"""Shapes that are known by their cells alone: what is chosen, by how long the description is."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
import torch

import shapeprog as sp
from shapeprog.data.placement import shape_from_mesh
from shapeprog.data.shape import Shape
from shapeprog.formats.parts import solid
from shapeprog.geometry.mesh import union_mesh
from shapeprog.inference.assembly import Assembly
from shapeprog.inference.cells.reconstruct import description_length
from shapeprog.inference.fit.residuals import Target
from shapeprog.inference.fit.tunable import Tunable
from shapeprog.inference.surface.evidence import evidence_of
from shapeprog.language.parser import parse
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll

TABLE = """\
box(at=(6.3, -7.7, -11.7), size=(1.4, 15.4, 23.4))
for i in mirror(side):
    for j in mirror(depth):
        box(at=(-7.7, 4.3, 8.3), size=(14, 1.4, 1.4))
"""

CHAIR = """\
top_square(at=(-1.7, 0, 0), thickness=1.4, half=7.7)
for i in translate(2, by=(0, 0, 14)):
    for j in translate(2, by=(0, 14, 0)):
        leg(at=(-12, -7.7, -7.7), size=(10.7, 1.4, 1.4))
back(at=(-0.6, 6.3, -7.7), size=(12.6, 1.4, 15.4), tilt=0)
"""

SHELF = """\
for i in mirror(side):
    box(at=(-12, -3.7, 8.3), size=(24, 7.4, 0.4))
for i in translate(4, by=(7.6, 0, 0)):
    box(at=(-11.7, -3.7, -8.7), size=(0.4, 7.4, 17.4))
"""


def cells_of(text: str) -> Shape:
    """The cells that a program touches, and nothing else of it."""
    made = shape_from_mesh(*solid(parse(text)), name="planted", axes=np.eye(3))
    return Shape("planted", made.voxels)


def test_both_sides_of_what_is_one_cell_thick_keep_their_order():
    cells = np.zeros((32, 32, 32), bool)
    cells[16, 4:28, 8:24] = True
    found = evidence_of(Shape("board", cells))
    top, bottom = (found.points[found.normals[:, 0] == sign, 0] for sign in (1, -1))
    assert top.min() > bottom.max()


@pytest.mark.parametrize("text", [TABLE, SHELF])
def test_planted_furniture_is_found_in_its_cells(text):
    shape = cells_of(text)
    found = sp.infer(shape)
    assert found.program.blocks <= 4
    assert found.scores["iou"] > 0.95
    planted = description_length(parse(text), shape.voxels)
    assert description_length(found.program, shape.voxels, found.snapped) <= planted + 0.02


@pytest.mark.parametrize("kind", ["full", "cell", "sheet"])
def test_full_grids_single_cells_and_flat_sheets_are_one_block(kind):
    solid = np.zeros((32, 32, 32), bool)
    solid[{"full": np.s_[:], "cell": np.s_[16, 16, 16], "sheet": np.s_[16, 4:28, 4:28]}[kind]] = True
    found = sp.infer(Shape(kind, solid), blocks=1)
    assert found.scores["iou"] == 1
    assert found.program.size == 1


def test_a_program_found_on_cells_is_tied():
    shape = cells_of(CHAIR)
    tied, plain = (sp.infer(shape, ties=ties) for ties in (True, False))
    assert [each.name for each in sp.names(tied.program)][:2] == ["width", "depth"]
    assert tied.scores["numbers"] < plain.scores["numbers"]
    assert tied.scores["iou"] >= plain.scores["iou"] - 0.02


def test_cells_without_any_order_have_pairs():
    solid = np.indices((32, 32, 32)).sum(0) % 2 == 0
    tunable = Tunable(parse(TABLE))
    pairs = Target(evidence_of(Shape("checkerboard", solid))).pairs(
        tunable.scene(tunable.values), torch.Generator().manual_seed(0)
    )
    assert pairs.weights.isfinite().all()


def test_a_mesh_whose_surface_gives_no_program_is_searched_on_cells_and_scored_by_them(monkeypatch: pytest.MonkeyPatch):
    inferring = importlib.import_module("shapeprog.inference.infer")  # the package has a function of this name
    monkeypatch.setattr(inferring, "assemble", lambda *_, **__: Assembly(Program(), 0.0, ""))
    program = sp.parse("box(at=(-8, -4, -6), size=(16, 8, 12))")
    mesh = shape_from_mesh(*union_mesh(unroll(program)), name="a box", axes=np.eye(3))
    result = sp.infer(mesh)
    assert result.program.size
    assert "explained" not in result.scores
    assert "explained" not in str(result)
