"""Refinement finds the numbers of planted programs again, and inference holds its promises on hard input."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from shapeprog.data.random import outside_published
from shapeprog.data.shape import Shape
from shapeprog.geometry.cells import voxels as voxels_of
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference import Settings, infer, refine
from shapeprog.inference.cells.reconstruct import REACH, refined
from shapeprog.inference.fit.adjustment import adjust
from shapeprog.inference.fit.tunable import THINNEST
from shapeprog.inference.surface.evidence import evidence_of_program
from shapeprog.language.parser import parse
from shapeprog.language.program import Program
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll

TABLE = """
top_rectangle(at=(4.2, 0.3, -0.2), thickness=2.3, half=(8.8, 11.3))
for i in translate(2, by=(0, 0, 18.3)):
    for j in translate(2, by=(0, 13.8, 0)):
        leg(at=(-12.1, -7.8, -10.2), size=(16.3, 2.4, 1.8))
"""
PAIR = """
for i in translate(2, by=(0, 0, 10.3)):
    locker(at=(-6.2, -5.3, -8.1), size=(12.4, 9.7, 6.2))
"""
QUICK = Settings(rounds=20)


def cells(program):
    return voxels_of(unroll(program)).numpy().astype(bool)


def points(program, count=4000):
    return sample_surface(unroll(program), count, torch.Generator().manual_seed(0)).points.detach()


def numbers(program):
    return encode(program.flat()).parameters


def test_refinement_finds_planted_lengths_and_places():
    planted = parse(PAIR)
    shape = Shape("planted", cells(planted), points(planted).numpy())
    by_chamfer = refined(planted.snap(), points(planted))
    for found in (refine(planted.snap(), shape), by_chamfer):
        assert encode(found.flat()).ids.equal(encode(planted.flat()).ids)
        assert (found.blocks, found.size) == (planted.blocks, planted.size)
        assert float((numbers(found) - numbers(planted)).abs().max()) < 0.05


def test_refinement_leaves_no_part_thinner_than_fitting_does():
    for text, slot in (("leg(at=(0, 0, 0), size=(1, 9, 9))", 3), ("top_square(at=(0, 0, 0), thickness=9, half=1)", 4)):
        program = parse(text)
        flat = points(program) * torch.tensor([1e-3, 1, 1] if slot == 3 else [1, 1e-3, 1e-3])
        found = refined(program, flat)
        assert numbers(found)[0, 0, slot] >= (THINNEST if slot == 3 else THINNEST / 2) - 1e-6


def test_refinement_moves_no_number_farther_than_its_reach():
    planted = parse(TABLE)
    start = planted.snap()
    fitted = adjust(start, evidence_of_program(planted), reach=0.2)
    assert 0.19 < float((numbers(fitted) - numbers(start)).abs().max()) <= 0.2 + 1e-6
    by_chamfer = refined(start, points(planted) + 3.0)
    assert float((numbers(by_chamfer) - numbers(start)).abs().max()) <= REACH + 1e-6


def snapped_from(program, snapped):
    """Whether ``snapped`` is whole-numbered, has the same statements, and is within one of the rounded parameters."""
    mine, theirs = encode(program.flat()), encode(snapped.flat())
    if mine.ids.shape != theirs.ids.shape or bool((mine.ids != theirs.ids).any()):
        return False
    whole = bool((theirs.parameters == theirs.parameters.round()).all())
    return whole and bool(((theirs.parameters - mine.parameters.round()).abs() <= 1).all())


def check(result, blocks=10):
    assert snapped_from(result.program, result.snapped)
    assert outside_published(result.program) == []
    assert result.scores["blocks"] == result.program.blocks <= blocks
    assert result.scores["statements"] == result.program.statements
    assert result.scores["primitives"] == result.program.size
    assert result.reason.startswith("The search ended after")


@pytest.mark.parametrize("with_points", [False, True], ids=["cells", "points"])
def test_inference_rebuilds_a_table_from_cells_and_from_points(with_points):
    planted = parse(TABLE).snap()
    shape = Shape("table", cells(planted), points(planted).numpy() if with_points else None)
    result = infer(shape, settings=QUICK, statements="paper")
    check(result)
    assert result.scores["iou"] == 1
    assert infer(shape, settings=QUICK, statements="paper") == result


@pytest.mark.parametrize("kind", ["full", "cell", "sheet"])
def test_inference_survives_full_grids_single_cells_and_flat_sheets(kind):
    solid = np.zeros((32, 32, 32), np.bool_)
    solid[{"full": np.s_[:], "cell": np.s_[16, 16, 16], "sheet": np.s_[16, 4:28, 4:28]}[kind]] = True
    result = infer(Shape(kind, solid), blocks=1, settings=QUICK, statements="paper")
    check(result, 1)
    assert result.scores["iou"] == 1
    assert "the limit of --blocks 1 is reached" in result.reason


def test_refinement_writes_names_out():
    named = parse(
        "width, depth, height = 40, 30, 60\nthickness = 4\nbody(width=thickness)\ntop(top=0, height=thickness)\n"
    )
    inlined = Program(named.body)
    shape = Shape("planted", cells(named), points(named).numpy())
    fitted = refine(named, shape)
    assert fitted.source is None
    assert fitted.frame == shape.frame
    assert fitted == refine(inlined, shape)
    assert [node.role for node in fitted.walk()] == ["body", "top"]
