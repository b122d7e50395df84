"""Adjustment brings planted programs back, leaves alone what the target does not tell, and keeps parts together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from shapeprog.data.shape import Shape
from shapeprog.evaluation.likeness import Triangles
from shapeprog.evaluation.structure import one_piece
from shapeprog.geometry.mesh import union_mesh
from shapeprog.inference.budget import Deadline
from shapeprog.inference.fit.adjustment import adjust
from shapeprog.inference.fit.joints import find_joints, needs
from shapeprog.inference.fit.tunable import THINNEST, Tunable
from shapeprog.inference.surface.evidence import Evidence, evidence_of
from shapeprog.language.parser import parse
from shapeprog.language.program import Program
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import Plan, unroll

TABLE = """
top(box(at=(10, -8, -12), size=(2, 16, 24)))
for i in translate(2, by=(0, 13.5, 0)):
    for j in mirror(side):
        leg(box(at=(-12, -7.5, 9), size=(22, 2, 2)))
"""
CHAIR = """
seat(box(at=(-1, -7, -7.5), size=(1.2, 14, 15)))
for i in mirror(side):
    leg(rod(start=(-12, -7, 7.4), end=(-0.5, -5.5, 6), radius=0.6))
    leg(bar(start=(-12, 7.5, 6.8), end=(-0.5, 5.5, 6.2), section=(1, 1.2)))
back(board(at=(0.1, 5.8, -7), size=(11, 0.8, 14), tilt=12))
"""
OTHERS = """
for i in mirror(side):
    arm(bent_rod(start=(0, -5, 8), through=(5, -3, 9), end=(5, 6, 8), radius=0.5))
stretcher(bar(start=(-6, -6, -7), end=(-6, 6, 7), section=(1, 0.8)))
"""
EVERYTHING = """
for i in translate(3, by=(0.1, 4, 0.2)):
    for j in mirror(side, at=0.3):
        leg(taper(start=(-12, -7, 7.4), end=(-0.5, -5.5, 6), radius=(0.4, 0.7)))
        brace(bar(start=(-12, 7.5, 6.8), end=(-0.5, 5.5, 5), section=(1, 1.2), turn=9))
        arm(bent_rod(start=(0, -5, 8), through=(5, -3, 9), end=(5, 6, 8), radius=0.5))
back(board(at=(0.1, 5.8, -7), size=(11, 0.8, 14), tilt=12))
"""


def evidence(text: str) -> Evidence:
    """What is known of the mesh of a program, which stays where it is."""
    vertices, faces = union_mesh(unroll(parse(text)))
    cells = np.ones((32, 32, 32), np.bool_)
    mesh = {"vertices": vertices.astype(np.float32), "faces": faces.astype(np.int32)}
    return evidence_of(Shape("planted", cells, None, **mesh))


def perturbed(text: str, seed: int, most: float = 0.5, degrees: float = 4.0) -> Program:
    tunable, random = Tunable(parse(text)), np.random.default_rng(seed)
    moves = random.uniform(0.3, most, len(tunable.kinds)) * random.choice([-1, 1], len(tunable.kinds))
    turns = random.choice([-degrees, degrees], len(moves))
    moved = torch.where(tunable.are("angle"), torch.from_numpy(turns), torch.from_numpy(moves) / tunable.scale)
    return tunable.settled(torch.maximum(tunable.values + moved, tunable.low))


def farthest(found: Program, text: str) -> float:
    """Largest distance of a point of the surface of either program to that of the other, apart from hidden ends."""
    one, two = unroll(found), unroll(parse(text))
    there = two.distance(one.sample(3000, torch.Generator().manual_seed(0)))
    back = one.distance(two.sample(3000, torch.Generator().manual_seed(0)))
    return float(torch.cat([there, back]).abs().quantile(0.99))


def in_one_piece(program: Program) -> bool:
    return one_piece(Triangles(*union_mesh(unroll(program)))) == 1


@pytest.fixture(scope="module")
def chair() -> Evidence:
    return evidence(CHAIR)


@pytest.mark.parametrize("text", [TABLE, CHAIR], ids=["table", "splayed chair"])
def test_a_planted_program_comes_back_in_one_piece(text):
    found = adjust(perturbed(text, 1), evidence(text))
    assert farthest(found, text) < 0.05
    assert in_one_piece(found)
    assert [node.name for node in found.walk()] == [node.name for node in parse(text).walk()]


def test_what_no_part_explains_moves_no_part():
    known = evidence(CHAIR + OTHERS)
    exact = adjust(parse(CHAIR), known)
    assert farthest(exact, CHAIR) < 0.03
    assert farthest(adjust(perturbed(CHAIR, 1), known), CHAIR) < 0.1


def test_the_same_seed_gives_the_same_numbers(chair):
    start = perturbed(CHAIR, 2)
    assert adjust(start, chair, steps=5, seed=3) == adjust(start, chair, steps=5, seed=3)


def test_a_deadline_says_what_it_cut(chair):
    late = Deadline(0.0)
    assert adjust(parse(CHAIR), chair, deadline=late) == parse(CHAIR)
    assert late.cut == "the adjustment after 0 of 12 steps"


def test_progress_ends_at_one(chair):
    told = []
    adjust(parse(CHAIR), chair, steps=2, progress=lambda what, share: told.append((what, share)))
    assert told == [("adjusting", 0.5), ("adjusting", 1.0)]


def test_nothing_is_adjusted_of_a_program_that_draws_nothing(chair):
    assert adjust(Program(), chair) == Program()


@pytest.mark.parametrize("known", [True, False], ids=["outward", "either way"])
def test_a_board_behind_a_sheet_keeps_its_thickness_and_moves(known):
    board = "side(box(at=(-12, -6, 0.4), size=(24, 12, 0.9)))"
    sheet = evidence("side(box(at=(-12, -6, -0.01), size=(24, 12, 0.02)))")
    front = sheet.normals[:, 2] < -0.9
    half = replace(
        sheet, points=sheet.points[front], normals=sheet.normals[front], outward=sheet.outward[front] & known,
        weights=np.full(front.sum(), 1 / front.sum()),
    )  # fmt: skip
    low, size = (adjust(parse(board), half).chains[0][0].values[k] for k in (2, 5))
    assert size == pytest.approx(0.9, abs=0.02)
    assert low == pytest.approx(0, abs=0.05)


def test_a_board_becomes_as_thick_as_both_of_its_sides_say_and_never_a_sliver():
    thick = evidence("side(box(at=(-12, -6, -0.4), size=(24, 12, 0.8)))")
    thin = evidence("side(box(at=(-12, -6, -0.01), size=(24, 12, 0.02)))")
    start = parse("side(box(at=(-12, -6, -0.1), size=(24, 12, 0.3)))")
    assert adjust(start, thick).chains[0][0].values[5] == pytest.approx(0.8, abs=0.03)
    assert adjust(start, thin).chains[0][0].values[5] >= THINNEST


def test_joints_are_points_where_parts_touch_or_nearly_do():
    stacked = "body(box(at=(-12, -3, -3), size=(8, 6, 6)))\nbody(box(at=({}, -2, -2), size=(8, 4, 4)))"
    for height, count in ((-4, 1), (-3.8, 1), (-3.2, 0)):
        tunable = Tunable(parse(stacked.format(height)))
        poses = tunable.poses(tunable.values)
        known = find_joints(poses.scene, -12.0)
        gaps = needs(poses, known)[0]
        assert len(known.pairs) == count
        assert known.standing.tolist() == [0]
        assert gaps[:count].tolist() == pytest.approx([height + 4.02] * count, abs=1e-3)


def test_feet_stand_on_the_floor_and_zeros_stay_zero():
    found = adjust(perturbed(TABLE, 3), evidence(TABLE))
    foot = found.chains[1][-1]
    assert foot.values[0] == -12
    mirror = next(node for node in found.walk() if node.name == "mirror")
    shift = next(node for node in found.walk() if node.name == "translate")
    assert mirror.values[2] == 0
    assert (shift.values[1], shift.values[3]) == (0, 0)


def test_small_angles_become_none_and_numbers_are_tidy(chair):
    found = adjust(parse(CHAIR.replace("section=(1, 1.2))", "section=(1, 1.2), turn=3)")), chair)
    bar = next(node for node in found.walk() if node.name == "bar")
    assert bar.values[8] == 0
    for values in (node.values for node in found.walk()):
        assert values == pytest.approx(np.round(values, 2), abs=1e-5)


@pytest.mark.parametrize(
    "text", [EVERYTHING, "rod(start=(0, 0, 0), end=(5, 0, 0), radius=.5)\n"], ids=["all", "upright"]
)
def test_the_slopes_of_poses_are_those_of_the_renderer(text):
    tunable = Tunable(parse(text))

    def rows(values):
        scene = tunable.scene(values)
        return torch.cat([scene.size, scene.centre, scene.rotation.flatten(-2)], -1)

    exact = torch.autograd.functional.jacobian(rows, tunable.values)
    assert torch.allclose(tunable.poses(tunable.values).slopes, exact, atol=1e-6)


def test_the_gradient_flows_through_every_statement_loops_and_mirrors_included():
    code = encode(parse(EVERYTHING), dtype=torch.float64)
    plan, index = Plan(code), (code.parameters != 0) & (torch.arange(code.parameters.shape[-1]) > 0)
    index[:, :2] &= code.ids[:, :2, None] != 80
    points = torch.randn(20, 3, generator=torch.Generator().manual_seed(0)).double() * 6

    def distances(free):
        return plan.scene(code.parameters.masked_scatter(index, free)).distance(points)

    assert torch.autograd.gradcheck(distances, code.parameters[index].requires_grad_(), eps=1e-6, atol=1e-5)
