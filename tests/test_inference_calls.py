"""Calls of functions as what inference chooses from: started, priced, moved and tied as one."""

from __future__ import annotations

import numpy as np
import pytest

import shapeprog as sp
from shapeprog.data.placement import shape_from_mesh
from shapeprog.data.shape import Shape
from shapeprog.formats.parts import parts
from shapeprog.inference.budget import Deadline
from shapeprog.inference.candidates.calls import (
    Called,
    drawn,
    moved,
    named,
    placed,
    recognised,
    regrouped,
    relations,
)
from shapeprog.inference.candidates.recognition import proposed
from shapeprog.inference.choice.connecting import connected
from shapeprog.inference.choice.coverage import Coverage, Prices
from shapeprog.inference.fit.adjustment import adjust
from shapeprog.inference.fit.tunable import Tunable
from shapeprog.inference.surface.evidence import evidence_of_program
from shapeprog.inference.ties.tying import tie
from shapeprog.language.ast import Call
from shapeprog.language.free import numbers, numbers_outside
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program, source_of
from shapeprog.language.program import Draw, Loop, Program
from shapeprog.library import library_of, with_library
from shapeprog.library.matching import Pattern

WHOLE = "width, depth, height = 1, 1, 1\n"

PULL_OUT = """\
def pull_out(grip=0.8):
    drawer()
    handle(width=width / 2, z=0, height=grip, front=-grip, depth=grip)
"""

TRUMPET = """\
def trumpet(thickness):
    box(height=thickness)
    taper(bottom=thickness, radius=(width / 4, thickness))
"""

LADDER = """\
def ladder(count):
    for _ in mirror(x=0):
        box(left=0, width=1)
    for _ in row(count, last=at(top=0)):
        box(left=1, right=1, height=1)
"""

DRAWER = {"bottom": -4.0, "front": -3.0, "left": -8.0, "height": 5.0, "depth": 1.0, "width": 16.0, "grip": 0.7}
FOOT = {"bottom": -9.0, "front": -5.0, "left": -5.0, "height": 14.0, "depth": 10.0, "width": 10.0, "thickness": 1.2}


def pattern(text: str) -> Pattern:
    return library_of(parse(WHOLE + text)).patterns[-1]


def called(text: str, numbers: dict[str, float], *around: Loop) -> Called:
    found = Called.of(pattern(text), numbers, around)
    assert found is not None
    return found


def table(call: Called) -> dict[str, float]:
    return dict(zip(call.pattern.parameters, call.numbers, strict=True))


def test_a_function_is_found_from_its_blocks_among_others_whatever_their_roles() -> None:
    call = called(PULL_OUT, DRAWER)
    others = [Draw("box", (-9.0, 2.0, -3.0 + k, 2.0, 1.0, 4.0 + k)) for k in range(6)]
    plain = [Draw(node.name, node.values) for node in call.nodes if isinstance(node, Draw)]
    first = proposed([call.pattern], [*others, *plain])[0]
    assert table(first) == pytest.approx(DRAWER, abs=0.01)


def test_blocks_that_are_a_little_off_give_the_call_that_is_nearest_to_them() -> None:
    random = np.random.default_rng(0)
    call = called(PULL_OUT, DRAWER)
    nodes = [Draw(node.name, tuple(np.add(node.values, random.uniform(-0.1, 0.1, 6)).tolist())) for node in call.nodes]
    assert table(proposed([call.pattern], nodes)[0]) == pytest.approx(DRAWER, abs=0.25)


def test_a_block_that_nobody_found_is_guessed_from_the_others() -> None:
    wanted = FOOT
    base = called(TRUMPET, wanted).nodes[0]
    offered = [table(each) for each in proposed([pattern(TRUMPET)], [base])]
    for known in ("bottom", "front", "left", "depth", "width", "thickness"):
        assert all(each[known] == pytest.approx(wanted[known]) for each in offered)
    assert min(abs(each["height"] - wanted["height"]) for each in offered) <= 1, "within reach of the adjustment"


@pytest.mark.parametrize("count", [2, 4])
def test_how_often_something_is_repeated_is_told_by_the_blocks(count: int) -> None:
    box = {"bottom": -5.0, "front": 0.0, "left": -4.5, "height": 12.0, "depth": 0.5, "width": 9.0}
    wanted = box | {"count": count}
    call = called(LADDER, wanted)
    assert table(proposed([call.pattern], call.nodes)[0]) == pytest.approx(wanted, abs=0.01)


def test_equal_calls_at_equal_steps_are_offered_as_one_in_a_loop() -> None:
    copies = [called(PULL_OUT, DRAWER | {"bottom": -10.0 + 6 * k}) for k in range(3)]
    found = proposed([copies[0].pattern], [node for copy in copies for node in copy.nodes])
    loops = [each for each in found if each.around == (Loop("translate", (3.0, 6.0, 0.0, 0.0), ()),)]
    assert any(table(each)["bottom"] == pytest.approx(-10) for each in loops)
    assert all(each.program.size == 6 for each in loops)


def test_no_call_is_offered_of_which_a_part_lies_inside_another() -> None:
    case = Draw("box", (-10.0, -6.0, -8.0, 20.0, 12.0, 16.0))
    shelf = Draw("box", (-2.0, -5.0, -8.0, 1.0, 11.0, 16.0))
    function = pattern("def shelved(up, thickness):\n    box()\n    box(front=1, bottom=up, height=thickness)\n")
    assert all(each.nodes != (case, shelf) for each in proposed([function], [case, shelf]))
    above = Draw("box", (12.0, *shelf.values[1:]))
    assert any(each.nodes == (case, above) for each in proposed([function], [case, above]))


NOTHING = """\
def nothing():
    cushion(height=1, edge=0.3)
    cylinder(radius=width)
"""

AREA = """\
def area():
    box(height=width * depth)
    box(left=5)
"""


@pytest.mark.parametrize("text", [NOTHING, AREA])
def test_a_function_that_fits_nothing_or_is_not_linear_offers_nothing(text: str) -> None:
    assert proposed([pattern(text)], called(PULL_OUT, DRAWER).nodes) == []


def test_no_call_is_looked_for_after_the_time_budget_and_the_result_says_so() -> None:
    late = Deadline(at=0.0)
    assert proposed([pattern(PULL_OUT)], called(PULL_OUT, DRAWER).nodes, late) == []
    assert late.cut == "the search for calls of functions"


def test_a_call_costs_less_than_what_it_draws_and_more_than_its_first_block() -> None:
    prices = Prices()
    call = called(PULL_OUT, DRAWER)
    assert prices.of(call.program) == pytest.approx(prices.statement + prices.loop + 7 * prices.number)
    assert prices.of(Program(call.nodes[:1])) < prices.of(call.program) < prices.of(drawn([call]))
    usual = called(PULL_OUT, DRAWER | {"grip": 0.8})
    assert prices.of(call.program) - prices.of(usual.program) == pytest.approx(prices.number)
    looped = called(PULL_OUT, DRAWER, Loop("translate", (3.0, 6.0, 0.0, 0.0), ()))
    assert prices.of(looped.program) - prices.of(call.program) == pytest.approx(prices.loop + prices.number)


def test_numbers_of_functions_are_not_said_by_their_calls_and_counts_are_none() -> None:
    box = {"bottom": -5.0, "front": 2.0, "left": -4.5, "height": 12.0, "depth": 0.5, "width": 9.0}
    ladder = called(LADDER, box | {"count": 3}).program
    assert numbers_outside(ladder) == 6
    assert numbers(ladder) > 6
    plain = parse(f"width, depth, height = 6, 4, 9\n{PULL_OUT}pull_out(bottom=1, height=2, width=4, depth=1)\n")
    assert numbers_outside(Program(plain.body)) == numbers(Program(plain.body)) == 12


@pytest.mark.parametrize(
    ("text", "one", "other"),
    [
        (PULL_OUT, DRAWER, {
                "bottom": 2.0, "front": 1.0, "left": -2.0, "height": 7.0, "depth": 2.0, "width": 5.0, "grip": 0.5,
            }),
        (
            TRUMPET,
            {"bottom": 3.0, "front": 1.0, "left": 2.0, "height": 5.0, "depth": 2.0, "width": 3.0, "thickness": 3.0},
            {"bottom": 1.0, "front": 2.0, "left": 1.0, "height": 8.0, "depth": 3.0, "width": 6.0, "thickness": 2.0},
        ),
    ],
)  # fmt: skip
def test_relations_hold_for_all_arguments_and_leave_as_many_numbers_free(text: str, one, other) -> None:
    loop = Loop("translate", (2.0, 9.0, 0.0, 0.0), ())
    for around in ((), (loop,)):
        programs = [drawn([called(text, each, *around)]) for each in (one, other)]
        rows = relations(programs[0], placed([called(text, one, *around)]))
        values = [Tunable(program).values.numpy() for program in programs]
        assert np.abs(rows @ values[0]).max() < 0.01
        assert np.abs(rows @ values[1]).max() < 0.01
        assert np.linalg.matrix_rank(rows) == len(rows) == rows.shape[1] - len(one) - len(around)


def test_numbers_of_a_function_of_its_own_keep_their_ratios() -> None:
    text = "def two():\n    box(height=height / 4)\n    box(left=0, width=1, front=0, depth=1, top=0, height=1)\n"
    box = {"bottom": -3.0, "front": 0.0, "left": 0.0, "height": 8.0, "depth": 3.0, "width": 1.0}
    call = called(text, box)
    rows = relations(drawn([call]), placed([call]))
    values = Tunable(drawn([call])).values.numpy()
    assert np.abs(rows @ values).max() < 1e-6
    twice = np.where(np.arange(12) == 0, 2 * values[0], 2 * values)
    assert np.abs(rows @ twice).max() < 1e-6
    assert len(rows) == 5, "of twelve numbers, where the box is and how large, and a scale"


def test_what_a_call_draws_is_adjusted_as_one() -> None:
    body = "body(box(at=(-6, -2, -9), size=(12, 8, 18)))\n"
    evidence = evidence_of_program(parse(body + format_program(drawn([called(PULL_OUT, DRAWER)]))))
    start = [*parse(body).body, called(PULL_OUT, DRAWER | {"bottom": -3.6, "height": 4.6, "left": -7.8, "width": 15.6})]
    program, calls = drawn(start), placed(start)
    rows = relations(program, calls)
    adjusted = adjust(program, evidence, relations=rows)
    before, after = (rows @ Tunable(each).values.numpy() for each in (program, adjusted))
    np.testing.assert_allclose(before, after, atol=0.03)  # but for rounding
    call = moved(start, adjusted)[1]
    assert isinstance(call, Called)
    assert table(call) == pytest.approx(DRAWER, abs=0.05)


def test_a_call_that_floats_is_not_taken_apart() -> None:
    seat = "seat(box(at=(0, -6, -6), size=(1, 12, 12)))\n"
    call = called(PULL_OUT, DRAWER | {"bottom": -6.0, "left": -4.0, "width": 8.0})
    whole = Program((*parse(seat).body, *call.nodes))
    evidence = evidence_of_program(whole)
    assert connected(whole, Coverage(evidence), {*call.nodes}) == whole
    (one,) = parse(seat).body
    assert regrouped([one, call], whole) == [one, call]
    twice = [call.nodes[1], call, one, call]
    assert regrouped(twice, drawn(twice)) == twice


def test_what_a_function_leaves_open_has_one_role_in_a_call() -> None:
    call = called(TRUMPET, FOOT | {"height": 12.0})
    (top,) = parse("box(at=(3, -9, -9), size=(1, 18, 18))").body
    words = [chain[-1].word for chain in named([top, call], drawn([top, call])).chains]  # type: ignore[union-attr]
    assert words[0] == "top"
    assert words[1] == words[2] in ("pedestal", "base")
    drawer = called(PULL_OUT, DRAWER)
    words = [chain[-1].word for chain in named([drawer], drawn([drawer])).chains]  # type: ignore[union-attr]
    assert words == ["drawer", "handle"]


def test_ties_leave_what_a_call_draws_to_its_function() -> None:
    # The drawer is nearly as wide as the body: alone it would be made as wide, and its handle left as it is.
    body = "body(box(at=(-6, -2, -8.1), size=(12, 8, 16.2)))\n"
    library = library_of(parse(WHOLE + PULL_OUT))
    program = Program((*parse(body).body, *called(PULL_OUT, DRAWER).nodes))
    calls = recognised(program, [library])
    assert [table(call) for call, _ in calls] == [pytest.approx(DRAWER, abs=0.01)]
    held = {index for _, indices in calls for index in indices}
    tied = tie(program, evidence_of_program(program), held=held).program
    assert [line.name for line in source_of(with_library(tied, library)).lines if isinstance(line, Call)] == [
        "pull_out"
    ]


def chest() -> Shape:
    text = f"width, depth, height = 19, 11, 21\n{PULL_OUT}body()\n"
    for bottom in (0.4, 10.8):
        text += f"pull_out(width=18, front=-1.2, depth=1.2, bottom={bottom}, height=9.6, grip=0.7)\n"
    pieces = parts(parse(text))
    starts = np.cumsum([0, *(len(part.vertices) for part in pieces)])
    faces = np.concatenate([part.faces + first for part, first in zip(pieces, starts, strict=False)])
    return shape_from_mesh(np.concatenate([part.vertices for part in pieces]), faces, name="chest", axes=np.eye(3))


def test_a_chest_of_drawers_is_written_with_the_drawer_of_a_user() -> None:
    found = sp.infer(chest(), libraries=[library_of(parse(WHOLE + PULL_OUT))], budget=600).program
    assert {line.name for line in source_of(found).walk() if isinstance(line, Call)} == {"pull_out"}
    assert format_program(found).count("def pull_out") == 1
    handles = [node for node in found.flat().body if "handle" in format_program(Program((node,)))]
    assert Program(tuple(handles)).size == 2
