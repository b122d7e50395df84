"""Meshes of separate closed parts: their components are known exactly, and so are the numbers of the program."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import shapeprog as sp
from shapeprog.data.placement import shape_from_mesh
from shapeprog.data.shape import Shape
from shapeprog.formats.parts import parts
from shapeprog.geometry.mesh import part_meshes
from shapeprog.inference.fit.snapping import snapped
from shapeprog.inference.pieces.patches import planar_patches
from shapeprog.inference.surface.cloud import cloud_of
from shapeprog.inference.surface.evidence import evidence_of, evidence_of_program, off_parts
from shapeprog.inference.surface.oriented import boxes_around, primitive_boxes
from shapeprog.inference.ties.tying import tie
from shapeprog.language.hints import Box, level_ends, upright_box
from shapeprog.language.parser import parse
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll

PIECES = Path(__file__).parent.parent / "examples" / "pieces"

ENDS = "box(at=(-8, -5, -12), size=(16, 10, 1))\nbox(at=(-8, -5, 11), size=(16, 10, 1))\n"
"""Two boards that make the whole as long as the grid, so that its numbers are those of the mesh."""

CARCASS = """\
# unit: mm
width, depth, height = 800, 350, 600
top_thickness, thickness = 22, 18
top(top=0, height=top_thickness)
with inside(top=top_thickness):
    for _ in mirror(x=0):
        side(left=0, width=thickness)
    with inside(left=thickness, right=thickness):
        shelf(bottom=40, height=thickness)
        shelf(bottom=310, height=thickness)
"""


def apart(text: str) -> Shape:
    """A program as a mesh with a closed component for each of its parts."""
    meshes = [(part.vertices, part.faces) for part in parts(parse(text))]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=False)]
    return shape_from_mesh(np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces), axes=np.eye(3))


def values(program: Program) -> list[list[float]]:
    """The values of all drawing statements and loops."""
    return [list(node.values) for node in program.walk()]


def prism(profile: list[tuple[float, float]], caps: list[tuple[int, int, int]], axis: int, length: float) -> Shape:
    """A closed surface between two copies of a profile in the other two axes, which triangles of its corners fill."""
    count = len(profile)
    edge = np.arange(count)
    following = np.roll(edge, -1)
    vertices = np.concatenate([np.insert(np.array(profile), axis, end, axis=1) for end in (0, length)])
    walls = np.stack([edge, following + count, following, edge, edge + count, following + count], 1).reshape(-1, 3)
    cap = np.array(caps)
    return shape_from_mesh(vertices, np.concatenate([cap, cap[:, ::-1] + count, walls]), axes=np.eye(3))


def test_a_case_in_one_closed_surface_with_its_overhanging_top_is_two_parts():
    profile = [(0.0, 0.0), (0.0, 600.0), (900.0, 600.0), (900.0, -60.0), (870.0, -60.0), (870.0, 0.0)]
    shape = prism(profile, [(0, 1, 5), (1, 4, 5), (1, 2, 4), (2, 3, 4)], axis=2, length=620)
    assert sp.format_program(sp.infer(shape, unit="mm").program).splitlines()[1:] == [
        "width, depth, height = 620, 660, 900",
        "top_thickness = 30",
        "top(top=0, height=top_thickness)",
        "body(front=60, top=top_thickness)",
    ]


@pytest.mark.parametrize("seed", range(3))
def test_a_patch_with_an_inner_corner_consists_of_two_bars_whatever_the_samples(seed):
    flat = np.random.default_rng(seed).uniform(-12, 12, (6000, 2))
    flat = flat[(flat < -2).any(1)]
    bars = planar_patches(cloud_of(np.insert(flat, 0, 0.0, axis=1), np.tile([1.0, 0.0, 0.0], (len(flat), 1))))
    assert (np.abs(np.sort(bars.half, 1) - [0, 5, 12]).max(1) < 0.6).sum() == 2


def test_boards_of_two_thicknesses_keep_them_and_the_whole_its_size():
    program = sp.infer(apart(CARCASS), unit="mm").program  # 24 cells are 240 mm
    found = {name.name: round(name.value / 0.3, 1) for name in sp.names(program)}
    assert found == {"width": 800, "depth": 350, "height": 600, "top_thickness": 22, "thickness": 18}


def test_the_whole_is_that_of_the_mesh_though_its_parts_are_fitted_a_little_off():
    text = ENDS + "box(at=(7, -4, -11), size=(1, 8, 22))\n"
    off = text.replace("at=(-8, -5, -12), size=(16, 10, 1)", "at=(-7.9, -5.04, -11.8), size=(15.94, 10.08, 0.8)")
    sizes = {name.name: name.value for name in sp.names(tie(parse(off), evidence_of(apart(text)), floor=-8.0))}
    assert np.allclose([sizes["width"], sizes["depth"], sizes["height"]], [24, 10, 16], atol=0.015)


def test_the_whole_is_as_large_as_the_mesh_though_a_tie_would_move_it():
    # Equal clearances would be .05 cells off, which the width could give.
    boards = "box(at=(-12, -5, -11), size=(22, 10, 2))\nbox(at=(-12, -5, 8.9), size=(22, 10, 2))\n"
    text = "box(at=(10, -6, -12), size=(2, 12, 24))\n" + boards
    program = tie(parse(text), evidence_of(apart(text)))
    sizes = {name.name: name.value for name in sp.names(program)}
    assert abs(sizes["width"] - 24) < 0.01
    assert abs(sizes["height"] - 24) < 0.01


def test_a_part_is_drawn_on_its_component_and_a_row_ends_at_one():
    given = """\
box(at=(11, -6, -8), size=(1, 12, 16))
for i in translate(3, by=(0, 0, 7)):
    box(at=(-12, -6, -8), size=(23, 12, 2))
"""
    fitted = """\
box(at=(10.9, -5.8, -8), size=(1.2, 11.9, 16.1))
for i in translate(3, by=(0, 0, 6.9)):
    box(at=(-11.9, -6, -8.2), size=(23, 12.2, 2.1))
"""
    evidence = evidence_of(apart(given))
    assert float(off_parts(unroll(parse(fitted)), evidence).min(-1).max()) > 0.15
    assert np.allclose(np.concatenate(values(snapped(parse(fitted), evidence))), np.concatenate(values(parse(given))))


def test_ends_that_other_parts_hide_are_those_of_the_component():
    board, post = "box(at=(-6, -0.25, {}), size=(12, 0.5, {}))\n", "box(at=(-12, -1, {}), size=(24, 2, 2))\n"
    evidence = evidence_of(apart(board.format(-9, 18) + post.format(-11) + post.format(9)))
    longer, shorter = parse(board.format(-9, 19.5)), parse(board.format(-9, 12))
    assert np.allclose(values(snapped(longer, evidence))[0], values(parse(board.format(-9, 18)))[0])
    assert values(snapped(shorter, evidence))[0] == values(shorter)[0]


def test_copies_near_one_component_stay_apart():
    row = parse("for i in translate(2, by=(0, 0, 0.4)):\n    box(at=(-12, -6, -6.2), size=(24, 12, 12))\n")
    found = snapped(row, evidence_of(apart("box(at=(-12, -6, -6), size=(24, 12, 12))")))
    assert values(found)[0] == values(row)[0]


@pytest.mark.parametrize(
    "draw", ["cylinder(at=(-6, 0, 0), height=12, radius=2)", "box(at=(-6, -0.3, -2), size=(12, 0.6, 4))"]
)
def test_what_is_round_or_upright_is_not_drawn_on_a_box_or_on_a_board_that_leans(draw: str):
    program = parse(draw)
    for component in ("box(at=(-6, -2, -2), size=(12, 4, 4))", "board(at=(-6, -0.3, -2), size=(12, 0.5, 4), tilt=2)"):
        assert snapped(program, evidence_of(apart(component + "\n" + ENDS))) == program


def test_boards_of_a_row_stay_as_long_as_they_are():
    boards = "".join(f"box(at=(-6, {y}, {-z}), size=(12, 1, {2 * z}))\n" for y, z in ((-4, 5), (0, 6), (4, 6)))
    row = parse("for i in translate(3, by=(0, 4, 0)):\n    box(at=(-6, -4, -6), size=(12, 1, 12))\n")
    assert snapped(row, evidence_of(apart(boards + ENDS))).body[0] == row.body[0]


@pytest.mark.parametrize(
    ("given", "fitted"),
    [
        (
            "rod(start=(-6, -4, {}), end=(6, 3, {}), radius=0.5)",
            "rod(start=(-5.8, -4, {}), end=(6.1, 3, {}), radius=0.6)",
        ),
        (
            "board(at=(-6, -4, {}), size=(12, 0.5, 3), tilt=12)",
            "board(at=(-5.8, -4.1, {}), size=(11.9, 0.6, 3.1), tilt=12.5)",
        ),
        (
            "leaning_box(at=(-6, -4, {}), size=(12, 1, 3), lean=3)",
            "board(at=(-5.9, -4, {}), size=(12.4, 1, 3), tilt=14)",
        ),
    ],
)
def test_what_leans_is_drawn_on_its_component_as_well(given: str, fitted: str):
    target, start = (parse(text.replace("{}", "2")) for text in (given, fitted))
    found = snapped(start, evidence_of(apart(given.replace("{}", "2") + "\n" + ENDS)))
    assert np.allclose(values(found)[0], values(target)[0], atol=0.03)
    assert not np.allclose(values(start)[0], values(target)[0], atol=0.03)


def test_a_mitred_board_is_not_sheared_though_it_fills_as_much_of_its_box():
    sheared = parse("leaning_box(at=(-6, -4, 2), size=(12, 1, 3), lean=3)\n" + ENDS)
    (part, *others), along = part_meshes(unroll(sheared)), np.array([12, 3, 0]) / np.hypot(12, 3)
    vertices, top = part.vertices.copy(), part.vertices[:, 0] > 0
    rear = np.where(vertices[:, 1] > -0.5, -1, 1)[top]  # of the upper end, which then runs the other way
    vertices[top] += (rear * along[1])[:, None] * along
    start = parse("board(at=(-5.9, -4, 2), size=(12.4, 1, 3), tilt=14)")
    for points, name in ((part.vertices, "leaning_box"), (vertices, "board")):
        faces, count = [part.faces, *(other.faces for other in others)], np.cumsum([0, 8, 8])
        mesh = np.concatenate([points, *(other.vertices for other in others)])
        stacked = np.concatenate([face + first for face, first in zip(faces, count, strict=True)])
        evidence = evidence_of(shape_from_mesh(mesh, stacked, axes=np.eye(3)))
        assert np.allclose(evidence.part_fill.min(), 1 - along[1] * along[0] * 0.97 / 12.6, atol=0.01)
        assert snapped(start, evidence).draws[0].name == name


@pytest.mark.parametrize(
    "text", ["leaning_box(at=(-6, -4, 2), size=(12, {}, 3), lean={})", "box(at=(-6, {}, {}), size=(3, 4, 5))"]
)
@pytest.mark.parametrize(("depth", "lean"), [(0.5, 2.0), (2.0, -3.0), (3.0, 7.0)])
def test_the_box_of_a_primitive_is_the_smallest_around_its_corners(text: str, depth: float, lean: float):
    scene = unroll(parse(text.format(depth, lean)))
    (mesh,) = part_meshes(scene)
    box, around = primitive_boxes(scene), boxes_around([mesh.vertices])
    assert np.allclose(box.half.prod(), around.half.prod(), rtol=1e-4)
    assert np.allclose(np.sort(box.half[0]), np.sort(around.half[0]), atol=1e-4)
    assert np.allclose(box.centre, around.centre, atol=1e-4)
    (start,) = (level_ends if "lean" in text else upright_box)(Box(*(column[0] for column in around)))
    assert np.allclose(start, parse(text.format(depth, lean)).draws[0].values, atol=1e-4)


def test_a_shelf_with_sheared_sides_comes_back_as_it_was_written():
    text = (PIECES / "ladder_shelf.shape").read_text()
    shape = apart(text)
    program = sp.infer(shape).program
    evidence = evidence_of(shape)
    assert off_parts(unroll(program), evidence).min(-1).max() < 0.02
    (side,) = [node for node in program.walk() if node.name == "leaning_box"]
    assert abs(side.values[-1] - side.values[4] * 5) < 0.03  # the lean of 35 is five times the depth of 7


def test_a_round_part_is_not_on_a_square_one_of_the_same_box():
    evidence = evidence_of(apart("box(at=(-12, -2, -2), size=(24, 4, 4))"))
    square, round_ = (unroll(parse(text)) for text in (
        "box(at=(-12, -2, -2), size=(24, 4, 4))", "cylinder(at=(-12, 0, 0), height=24, radius=2)"
    ))  # fmt: skip
    assert off_parts(square, evidence).item() < 1e-5
    assert off_parts(round_, evidence).item() == np.inf


def test_a_face_is_hidden_by_a_thin_board_that_touches_it():
    # The board is .2 cells thick, less than rays start above a face.
    evidence = evidence_of(
        apart("box(at=(-12, -6, -6), size=(24, 12, 12))\nbox(at=(-11, -6.2, -5), size=(22, 0.2, 10))")
    )
    points = evidence.points - [0, evidence.surface[:, 1].min(), 0]
    facing = (np.abs(evidence.normals[:, 1]) > 0.9) & (np.abs(points[:, [0, 2]]) < [10.9, 4.9]).all(1)
    between, outside = (facing & (np.abs(points[:, 1] - depth) < 0.01) for depth in (0.2, 0.0))
    assert min(between.sum(), outside.sum()) > 100
    assert evidence.weights[between].max() < evidence.weights[outside].min() / 5


def test_numbers_of_a_union_are_not_exact():
    program = parse("box(at=(0, -4, -4), size=(8, 8, 8))\nrod(start=(-9, 0, 0), end=(7.7, 0, 0), radius=1)\n")
    rod = next(node for node in tie(program, evidence_of_program(program)).walk() if node.name == "rod")
    assert abs(rod.values[3] - 8) < 0.1
