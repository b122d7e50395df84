"""What a person sees of a program beside its target, on shapes whose answer is known."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from shapeprog.data.shape import Shape
from shapeprog.evaluation.likeness import Samples, Triangles, likeness, sampled, silhouette
from shapeprog.evaluation.metrics import evaluate_program
from shapeprog.evaluation.parts import oriented_box, overlaps, part_scores
from shapeprog.evaluation.structure import one_piece, slivers
from shapeprog.geometry.mesh import part_meshes, union_mesh
from shapeprog.language import unroll
from shapeprog.language.free import numbers
from shapeprog.language.parser import parse

TABLE = """
top_rectangle(at=(8, 0, 0), thickness=2, half=(9, 11))
for i in translate(2, by=(0, 0, 18)):
    for j in translate(2, by=(0, 14, 0)):
        leg(at=(-10, -8, -10), size=(18, 2, 2))
"""


def mesh(text):
    return Triangles(*union_mesh(unroll(parse(text))))


def target(text):
    vertices, faces = mesh(text)
    cells = np.zeros((32, 32, 32), bool)
    return Shape("it", cells, vertices=vertices.astype(np.float32), faces=faces.astype(np.int32))


def test_a_program_beside_its_own_mesh_reads_the_floors_and_outlines_are_equal():
    row = evaluate_program(parse(TABLE), target(TABLE), looks=True)
    assert row.f1_half_percent == pytest.approx(row.f1_half_percent_floor, abs=0.01)
    assert row.f1_percent == pytest.approx(row.f1_percent_floor, abs=0.01)
    assert row.normals == pytest.approx(row.normals_floor, abs=0.01)
    assert (row.silhouette, row.one_piece, row.slivers) == (1, 1, 0)
    assert repr(row) == repr(evaluate_program(parse(TABLE), target(TABLE), looks=True))  # some measures are not known


def test_a_plate_moved_along_its_normal_is_found_within_that_distance_alone():
    plate = np.random.default_rng(0).uniform(-1, 1, (4000, 3)) * [0, 1, 1]
    for height, expected in ((0.0049, (1, 1)), (0.0051, (0, 1)), (0.0101, (0, 0))):
        found = likeness(Samples(plate + np.array([height, 0, 0])), Samples(plate), diagonal=1.0)
        assert (found.f1_half_percent, found.f1_percent) == expected
        assert math.isnan(found.normals)


def test_half_of_what_should_be_there_is_an_f_score_of_two_thirds():
    whole, half = np.zeros((100, 3)), np.zeros((100, 3))
    whole[50:, 0] = 1
    assert likeness(Samples(half), Samples(whole), diagonal=1.0).f1_percent == pytest.approx(2 / 3)


def test_normals_are_told_whatever_their_sign_and_at_an_angle_by_its_cosine():
    points = np.random.default_rng(0).uniform(-1, 1, (500, 3))
    upright = np.tile([1.0, 0.0, 0.0], (500, 1))
    leaning = np.tile([-math.cos(0.6), math.sin(0.6), 0.0], (500, 1))
    assert likeness(Samples(points, upright), Samples(points, -upright), 1.0).normals == 1
    assert likeness(Samples(points, upright), Samples(points, leaning), 1.0).normals == pytest.approx(math.cos(0.6))


def test_the_normals_of_sampled_points_are_those_of_the_triangles_they_lie_on():
    box = Triangles(*union_mesh(unroll(parse("leg(at=(-1, -2, -3), size=(2, 4, 6))"))))
    points, normals = sampled(box, seed=0, count=300)
    assert np.allclose(np.abs((points * normals).sum(1)), np.abs(normals) @ [1, 2, 3], atol=1e-6)


def test_a_board_half_as_wide_has_half_the_silhouette_from_every_side():
    wide, narrow = (mesh(f"top_square(at=(0, 0, 0), thickness=20, half={half})") for half in (10, 5))
    tall = mesh("top_square(at=(0, 0, 0), thickness=10, half=10)")
    assert silhouette(wide, wide) == 1
    level = silhouette(narrow, wide)
    assert 0.3 < level < 0.52  # half as wide from the side, a quarter from above, larger for slanted views
    assert silhouette(tall, wide) < 0.75


def test_outlines_agree_with_the_area_of_a_projected_ball():
    ball = trimesh.creation.icosphere(4, radius=4.0)
    small = trimesh.creation.icosphere(4, radius=2.0)
    ratio = silhouette(Triangles(small.vertices, small.faces), Triangles(ball.vertices, ball.faces))
    assert ratio == pytest.approx(1 / 4, rel=0.02)


def test_a_touching_stack_is_one_piece_a_gap_makes_two_and_a_cavity_none():
    stack = "leg(at=(0, 0, 0), size=(4, 4, 4))\nleg(at=({}, 0, 0), size=(4, 4, 4))"
    assert one_piece(mesh(stack.format(4))) == 1
    assert one_piece(mesh(stack.format(4.01))) == 0
    closed = """
for i in translate(2, by=(9, 0, 0)):
    layer(at=(-5, 0, 0), thickness=1, half=(5, 5))
for i in translate(2, by=(0, 9, 0)):
    locker(at=(-5, -5, -5), size=(10, 1, 10))
for i in translate(2, by=(0, 0, 9)):
    locker(at=(-5, -5, -5), size=(10, 10, 1))
"""
    assert one_piece(mesh(closed)) == 1
    assert math.isnan(one_piece(None))


def test_slivers_are_thinner_than_a_250th_of_the_grid_and_shear_does_not_thicken_them():
    def share(text):
        return slivers(unroll(parse(text)))

    assert share("leg(at=(0, 0, 0), size=(4, 4, .095))") == 1
    assert share("leg(at=(0, 0, 0), size=(4, 4, .097))") == 0
    assert share("back(at=(0, 0, 0), size=(9, .09, 9), tilt=5)") == 1
    assert share("line(start=(0, 0, 0), end=(4, 0, 0), radius=.05)") == 0
    assert share("line(start=(0, 0, 0), end=(4, 0, 0), radius=.047)") == 1
    assert share("for i in translate(3, by=(0, 0, 5)):\n    leg(at=(0, 0, 0), size=(4, 4, .05))\n" + TABLE) == 3 / 8


def test_numbers_are_all_that_is_written_but_counts_and_quarter_turns():
    assert numbers(parse(TABLE)) == 6 + 3 + 3 + 6
    crossed = "for i in rotate(4, step=1):\n    base_cross(at=(0, 0, 0), thickness=1, length=5, turn=0)"
    assert numbers(parse(crossed)) == 5


def parts_of(text):
    return [Triangles(part.vertices, part.faces) for part in part_meshes(unroll(parse(text)))]


def test_a_program_recovers_its_own_parts_and_a_box_around_them_none():
    assert part_scores(parts_of(TABLE), unroll(parse(TABLE))) == (1, 1)
    block = parse("locker(at=(-10, -9, -11), size=(20, 18, 22))")
    assert part_scores(parts_of(TABLE), unroll(block)) == (0, 0)


def test_two_primitives_cannot_stand_for_one_part_nor_one_for_two():
    twice = TABLE + "top_rectangle(at=(8, 0, 0), thickness=2, half=(9, 11))"
    assert part_scores(parts_of(TABLE), unroll(parse(twice))) == (1, pytest.approx(5 / 6))
    halved = "for i in translate(2, by=(0, 2, 0)):\n    leg(at=(0, 0, 0), size=(9, 2, 2))"
    joined = "leg(at=(0, 0, 0), size=(9, 4, 2))"
    assert part_scores(parts_of(halved), unroll(parse(joined))) == (0.5, 1)


def test_the_overlap_with_a_shifted_copy_is_that_of_boxes_whatever_way_they_are_turned():
    scene = unroll(parse("leg(at=(0, 0, 0), size=(8, 4, 2))"))
    for shift, iou in ((0.0, 1.0), (2.0, 6 / 10), (8.0, 0.0)):
        part = parts_of(f"leg(at=({shift}, 0, 0), size=(8, 4, 2))")[0]
        assert overlaps([oriented_box(part)], scene)[0, 0] == pytest.approx(iou, abs=0.01)
    turned = unroll(parse("for i in rotate(8, step=1):\n    leg(at=(0, 4, -1), size=(8, 4, 2))"))
    boxes = [oriented_box(Triangles(part.vertices, part.faces)) for part in part_meshes(turned)]
    assert np.allclose(np.diag(overlaps(boxes, turned)), 1, atol=0.01)


def test_points_alone_have_f_scores_and_no_normals_and_cells_alone_have_neither():
    known = target(TABLE)
    cloud = replace(known, points=sampled(mesh(TABLE), 0).points.astype(np.float32), vertices=None, faces=None)
    row = evaluate_program(parse(TABLE), cloud, looks=True)
    assert row.f1_percent > 0.98
    assert math.isnan(row.normals)
    assert math.isnan(row.silhouette)
    row = evaluate_program(parse(TABLE), replace(known, vertices=None, faces=None), looks=True)
    assert math.isnan(row.f1_percent)
    assert row.slivers == 0


def test_a_program_that_draws_nothing_looks_like_nothing():
    row = evaluate_program(parse(""), target(TABLE), looks=True)
    assert (row.f1_half_percent, row.f1_percent, row.normals, row.silhouette) == (0, 0, 0, 0)
    assert math.isnan(row.slivers)
    assert math.isnan(row.one_piece)
