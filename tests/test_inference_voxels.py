"""Shapes that are known by their cells alone: what is chosen, by how long the description is."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from test_inference_search import CHAIR, cells

import shapeprog as sp
from shapeprog.data.placement import shape_from_mesh
from shapeprog.data.shape import Shape
from shapeprog.formats.parts import solid
from shapeprog.geometry.cells import rasterise, unpack
from shapeprog.inference import Schedule, Settings
from shapeprog.inference.assembly import assemble
from shapeprog.inference.choice.cell_coverage import choose_on_cells, cost_on_cells, covers_of_cells
from shapeprog.inference.choice.coverage import Prices
from shapeprog.inference.fit.residuals import Target
from shapeprog.inference.fit.tunable import Tunable
from shapeprog.inference.surface.evidence import evidence_of
from shapeprog.language import Program
from shapeprog.language.parser import parse
from shapeprog.language.printer import numbers_written

TABLE = """\
box(at=(6.3, -7.7, -11.7), size=(1.4, 15.4, 23.4))
for i in mirror(side):
    for j in mirror(depth):
        box(at=(-7.7, 4.3, 8.3), size=(14, 1.4, 1.4))
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


def covered(program: Program, shape: Shape):
    return covers_of_cells(
        [Program((node,)) for node in program.body], shape.voxels, evidence_of(shape), Prices(number=0, statement=0)
    )


def test_a_box_covers_the_cells_that_it_touches():
    program = parse("box(at=(-2.8, -1.7, 0.4), size=(5.6, 3.4, 3.3))")
    wanted = np.zeros((32, 32, 32), bool)
    wanted[13:19, 14:18, 16:20] = True
    found = covered(program, Shape("box", wanted))
    assert choose_on_cells(found, 1).best.value == pytest.approx(1)


def test_a_solid_on_whole_cells_does_not_cover_those_that_its_faces_meet():
    program = parse("box(at=(-3, -2, 0), size=(6, 4, 4))")
    wanted = unpack(rasterise(sp.unroll(program))).numpy().astype(bool)
    assert choose_on_cells(covered(program, Shape("box", wanted)), 1).best.value == pytest.approx(1)


def test_boards_of_a_shelf_are_chosen_before_the_body_that_fills_it():
    shape = cells_of(SHELF)
    body = parse("box(at=(-12, -3.7, -8.7), size=(24, 7.4, 17.4))")
    found = covered(Program(body.body + parse(SHELF).body), shape)
    assert sorted(choose_on_cells(found, 3).best.chosen) == [1, 2]


def test_both_sides_of_what_is_one_cell_thick_keep_their_order():
    cells = np.zeros((32, 32, 32), bool)
    cells[16, 4:28, 8:24] = True
    found = evidence_of(Shape("board", cells))
    top, bottom = (found.points[found.normals[:, 0] == sign, 0] for sign in (1, -1))
    assert top.min() > bottom.max()


@pytest.mark.parametrize("text", [TABLE, SHELF])
def test_planted_furniture_is_found_in_its_cells(text):
    shape = cells_of(text)
    found = assemble(shape, more=parse(text).flat().body).program
    assert found.blocks == 2
    assert cost_on_cells(found, shape.voxels) <= cost_on_cells(parse(text), shape.voxels) + 0.02


def test_cells_are_described_no_longer_than_in_the_statements_of_the_paper():
    shape = cells_of(TABLE)
    paper, every = (sp.infer(shape, statements=which) for which in ("paper", "all"))
    assert every.scores["iou"] > paper.scores["iou"] - 0.02
    assert cost_on_cells(every.program, shape.voxels, snapped=every.snapped) <= cost_on_cells(
        paper.program, shape.voxels, snapped=paper.snapped
    )
    written = [sum(numbers_written(node) for node in each.program.walk()) for each in (every, paper)]
    assert written[0] <= written[1]


@pytest.mark.parametrize("kind", ["full", "cell", "sheet"])
def test_full_grids_single_cells_and_flat_sheets_are_one_block(kind):
    solid = np.zeros((32, 32, 32), bool)
    solid[{"full": np.s_[:], "cell": np.s_[16, 16, 16], "sheet": np.s_[16, 4:28, 4:28]}[kind]] = True
    found = sp.infer(Shape(kind, solid), blocks=1)
    assert found.scores["iou"] == 1
    assert found.program.size == 1


def test_a_program_found_on_cells_is_tied_where_it_gets_no_longer():
    shape, quick = Shape("planted", cells(CHAIR)), {"settings": Settings(rounds=20), "schedule": Schedule(steps=2)}
    tied, plain = (sp.infer(shape, ties=ties, **quick) for ties in (True, False))
    assert plain.snapped is not None
    assert tied.snapped is None
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
