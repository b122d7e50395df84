"""Neighbours of a program, and how parts that float are connected: planted programs whose answer is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shapeprog.data.placement import shape_from_mesh
from shapeprog.geometry.mesh import pieces, union_mesh
from shapeprog.inference.candidates.loops import rows
from shapeprog.inference.candidates.neighbours import neighbours
from shapeprog.inference.choice.choice import choose
from shapeprog.inference.choice.connecting import connected, floating
from shapeprog.inference.choice.coverage import Coverage
from shapeprog.inference.fit.adjustment import adjust
from shapeprog.inference.surface.evidence import Evidence, evidence_of
from shapeprog.language import Loop, Program
from shapeprog.language.hints import Box
from shapeprog.language.parser import parse
from shapeprog.language.program import Node
from shapeprog.language.unroll import unroll

SEAT = "box(at=(2, -8, -12), size=(1, 16, 24))\n"
LEGS = "for i in mirror(side):\n    box(at=(-12, -1, 8), size=({height}, 2, 2))\n"
TABLE = SEAT + LEGS.format(height=14)


def evidence(text: str) -> Evidence:
    vertices, faces = union_mesh(unroll(parse(text)))
    shape = shape_from_mesh(vertices, faces)
    where_it_is = replace(shape, vertices=vertices.astype(np.float32), faces=faces.astype(np.int32))
    return evidence_of(where_it_is)


def best(start: str, target: str) -> Program:
    """What is chosen of a program's own blocks and their neighbours."""
    program = parse(start)
    near: list[Node] = [*program.body, *neighbours(program)]
    chosen = choose(Coverage(evidence(target)).table([Program((node,)) for node in near]), 10)
    return Program(tuple(near[index] for index in chosen))


def same(found: Program, wanted: str) -> bool:
    one, two = (unroll(each) for each in (found, parse(wanted)))
    return len(one.centre) == len(two.centre) and bool(
        ((one.centre[:, None] - two.centre).abs().amax(-1) < 0.1).any(1).all()
    )


def test_two_halves_of_one_board_become_one_board():
    halves = "box(at=(2, -8, -12), size=(1, 16, 12.1))\nbox(at=(2, -8, 0), size=(1, 16, 12))\n"
    found = best(halves, SEAT)
    assert len(found.body) == 1
    assert same(found, SEAT)


def test_a_run_of_two_halves_becomes_one_board():
    run = "for i in translate(2, by=(0, 0, 12)):\n    box(at=(2, -8, -12), size=(1, 16, 12))\n"
    assert best(run, SEAT).body == parse(SEAT).body


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("count", [4, 6])
def test_a_run_with_a_copy_more_or_less_is_mended_at_either_end(first, count):
    slats = "for i in translate({count}, by=(0, 0, 5)):\n    box(at=(-12, 0, {start}), size=(24, 1, 2))\n"
    frame = "box(at=(-12, 1, -12), size=(2, 2, 24))\n"
    start = -12 + 5 * first * (1 if count == 4 else -1)
    found = best(frame + slats.format(count=count, start=start), frame + slats.format(count=5, start=-12))
    assert same(found, frame + slats.format(count=5, start=-12))
    assert [node.count for node in found.body if isinstance(node, Loop)] == [5]


@pytest.mark.parametrize("ends", [(-11, 7), (-7, 10.5)])
def test_a_seat_whose_ends_nobody_sees_is_put_in_the_middle(ends):
    sofa = "for i in mirror(side):\n    box(at=(-8, -9, 7), size=(14, 18, 5))\n"
    seat = "box(at=(-7, -9, {low}), size=(6, 17, {width}))\n"
    found = best(sofa + seat.format(low=ends[0], width=ends[1] - ends[0]), sofa + seat.format(low=-9, width=18))
    middle = [unroll(Program((node,))).centre[:, 2].mean().item() for node in found.body]
    assert len(middle) == 2
    assert middle == pytest.approx([0, 0], abs=1e-4)


def test_a_missing_mirror_image_is_found():
    found = best(SEAT + "box(at=(-12, -1, 8), size=(14, 2, 2))\n", TABLE)
    assert same(found, TABLE)
    assert found.blocks == 2


def test_a_block_ends_where_the_next_begins():
    found = best(SEAT + LEGS.format(height=12), TABLE)
    assert sorted(unroll(found).size[:, 0].tolist()) == pytest.approx([0.5, 7, 7], abs=0.05)


def test_neighbours_are_new_and_each_of_them_stands_once():
    program = parse(TABLE)
    near = neighbours(program)
    assert len(set(near)) == len(near) > 10
    assert not set(near) & set(program.body)
    assert neighbours(Program()) == []


@pytest.mark.parametrize("height", [10.5, 13.2])
def test_a_floating_leg_reaches_the_seat(height):
    program = parse(SEAT + LEGS.format(height=height))
    assert floating(program) == [1]
    found = connected(program, Coverage(evidence(TABLE)))
    assert floating(found) == []
    assert found.blocks == 2
    assert pieces(*union_mesh(unroll(found))) == 1


def test_a_rail_that_floats_between_legs_reaches_both_and_stays_in_the_middle():
    rail = "box(at=(-6, -0.5, -7), size=(1, 1, 14))\n"
    found = connected(parse(TABLE + rail), Coverage(evidence(TABLE + "box(at=(-6, -0.5, -8), size=(1, 1, 16))\n")))
    scene = unroll(found)
    assert scene.centre[-1, 2] == 0
    assert scene.reach[-1, 2] == pytest.approx(8, abs=0.1)


def test_a_leaning_leg_is_stretched_along_itself():
    leg = "for i in mirror(side):\n    bar(start=(-12, 0, 11), end=({up}, 0, {side}), section=(1, 1))\n"
    program = parse(SEAT + leg.format(up=0, side=8.43))
    found = connected(program, Coverage(evidence(SEAT + leg.format(up=2.2, side=7.96))))
    assert floating(found) == []
    ends = np.array(found.body[1].body[0].values)  # type: ignore[union-attr]
    assert ends[3:6] == pytest.approx([2.1, 0, 8.0], abs=0.2)


def test_a_crumb_that_floats_is_left_out_and_what_says_much_is_not():
    crumb = "box(at=(-6, 0, 0), size=(0.5, 0.5, 0.5))\n"
    found = connected(parse(TABLE + crumb), Coverage(evidence(TABLE)))
    assert found == parse(TABLE)
    shelf = "box(at=(-8, -8, -7), size=(1, 16, 14))\n"  # as far from both legs
    assert connected(parse(TABLE + shelf), Coverage(evidence(TABLE + shelf))).blocks == 3


FRONT = "for i in mirror(depth):\n    box(at=(-12, {at}, -8), size=(20, {thick}, 16))\n"
CASE = "box(at=(-12, -9.5, -8), size=(20, {depth}, 16))\n"


@pytest.mark.parametrize("gap", [0.05, 0.2])
def test_only_a_copy_floats_and_either_side_closes_the_gap(gap):
    program = parse(CASE.format(depth=19 - gap) + FRONT.format(at=9.5, thick=0.5))
    assert floating(program) == [1]  # the rear board touches the case, its image in front does not
    found = connected(program, Coverage(evidence(CASE.format(depth=19) + FRONT.format(at=9.5, thick=0.5))))
    assert floating(found) == []
    assert found.blocks == 2
    assert pieces(*union_mesh(unroll(found))) == 1


def test_parts_of_one_run_are_joined_by_what_crosses_them():
    slats = "for i in translate(5, by=(0, 4, 0)):\n    box(at=(0, -8.5, -10), size=(0.5, 1, 20))\n"
    beam = "box(at=({low}, -9, -1), size=({height}, 18, 2))\n"
    program = parse(slats + beam.format(low=-1.02, height=1))
    assert floating(program) == [0]  # no two slats touch, and the beam is the largest part
    found = connected(program, Coverage(evidence(slats + beam.format(low=-1, height=1))))
    assert floating(found) == []
    assert found.blocks == 2


def test_what_is_one_piece_stays_as_it_is():
    assert connected(parse(TABLE), Coverage(evidence(TABLE))) == parse(TABLE)
    assert connected(Program(), Coverage(evidence(TABLE))) == Program()


def test_closing_a_gap_does_not_move_what_the_target_holds():
    apart = SEAT + "box(at=(3.25, -8, -12), size=(1, 16, 24))\nbox(at=(-12, -1, -1), size=(14, 2, 2))\n"
    found = unroll(adjust(parse(apart), evidence(apart))).centre
    assert (found - unroll(parse(apart)).centre).abs().max() < 0.1


def test_parts_of_one_size_at_equal_steps_are_one_row_whatever_draws_them():
    upper = "for i in translate(3, by=(6, 0, 0)):\n    box(at=(-9, -1, -6), size=(.6, 1, 12))\n"
    lower = "for i in translate(3, by=(6, 0, 0)):\n    cushion(at=(-6.1, -1, -6), size=(.7, 1.1, 12), edge=.3)\n"
    rows = [node for node in neighbours(parse(upper + lower)) if isinstance(node, Loop) and node.count == 6]
    assert any(node.body[0].name == "box" and np.allclose(node.values[1:], (3, 0, 0), atol=0.05) for node in rows)
    table = neighbours(parse(SEAT + LEGS.format(height=14)))
    assert not any(node.count > 2 for node in table if isinstance(node, Loop))


def test_sheets_that_coincide_are_no_row() -> None:
    def sheets(*sides: float) -> list[list[Box]]:
        return [[Box(np.array([0.0, 0.0, side]), np.eye(3), np.array([2.0, 2.0, 0.0]))] for side in sides]

    assert not list(rows(sheets(0, 0, 0, 0)))
    assert list(rows(sheets(-3, -1, 1, 3)))
