"""Calls of functions of a library: found among fitted blocks, priced, and left alone by ties."""

from __future__ import annotations

import numpy as np
import pytest

import shapeprog as sp
from shapeprog.data.placement import shape_from_mesh
from shapeprog.data.shape import Shape
from shapeprog.formats.parts import parts
from shapeprog.inference.calls import called, with_calls
from shapeprog.inference.choice.coverage import Coverage, Prices
from shapeprog.inference.surface.evidence import evidence_of_program
from shapeprog.inference.ties.tying import tie
from shapeprog.language.ast import Call
from shapeprog.language.free import numbers, numbers_outside
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program, source_of
from shapeprog.language.program import Draw, Loop, Program
from shapeprog.library import Library, library_of, with_library

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


def library(text: str) -> Library:
    return library_of(parse(WHOLE + text))


def call(text: str, numbers: dict[str, float], *around: Loop) -> Program:
    program = called(library(text).patterns[-1], numbers, around)
    assert program is not None
    return program


def plain(program: Program) -> list[Draw]:
    """The blocks of a program without loops, and without their roles."""
    return [Draw(node.name, node.values) for node in program.walk() if isinstance(node, Draw)]


def written(text: str, program: Program, target: Program | None = None) -> tuple[Program, set[int]]:
    """The program with calls of the function of a text, against its own surface or that of another program."""
    evidence = evidence_of_program(target or Program(program.body))
    moved, drawn = with_calls(program, library(text), Coverage(evidence))
    return moved, {*drawn}


def values(program: Program) -> np.ndarray:
    return np.concatenate([node.values for node in program.walk()])


def calls_in(text: str, program: Program) -> list[str]:
    return [line.name for line in source_of(with_library(program, library(text))).walk() if isinstance(line, Call)]


def test_blocks_of_a_function_are_found_among_others_whatever_their_roles() -> None:
    others = [Draw("box", (-9.0, 2.0, -3.0 + k, 2.0, 1.0, 4.0 + k)) for k in range(3)]
    drawer = call(PULL_OUT, DRAWER)
    moved, drawn = written(PULL_OUT, Program((*others, *plain(drawer))))
    assert drawn == {3, 4}
    assert moved.body[:3] == tuple(others)
    assert Program(moved.body[3:]) == Program(drawer.body)
    assert calls_in(PULL_OUT, moved) == ["pull_out"]


def test_blocks_that_are_a_little_off_move_to_the_call_that_is_nearest() -> None:
    random = np.random.default_rng(0)
    drawer = call(PULL_OUT, DRAWER)
    off = [Draw(node.name, tuple(np.add(node.values, random.uniform(-0.1, 0.1, 6)).tolist())) for node in plain(drawer)]
    assert calls_in(PULL_OUT, Program(tuple(off))) == []
    moved, drawn = written(PULL_OUT, Program(tuple(off)), Program(drawer.body))
    assert drawn == {0, 1}
    assert np.abs(values(moved) - values(Program(drawer.body))).max() < 0.15
    assert calls_in(PULL_OUT, moved) == ["pull_out"]


@pytest.mark.parametrize("count", [2, 4])
def test_counts_of_a_function_are_those_of_its_blocks(count: int) -> None:
    box = {"bottom": -5.0, "front": 0.0, "left": -4.5, "height": 12.0, "depth": 0.5, "width": 9.0}
    ladder = call(LADDER, box | {"count": count})
    moved, drawn = written(LADDER, Program(ladder.body))
    assert drawn == {0, 1}
    assert moved.size == 2 + count


def test_blocks_in_loops_that_are_nearly_equal_become_calls_in_one_loop() -> None:
    drawer = call(PULL_OUT, DRAWER | {"bottom": -10.0})
    steps = (6.05, 5.95)
    loops = [Loop("translate", (3.0, step, 0.0, 0.0), (node,)) for node, step in zip(plain(drawer), steps, strict=True)]
    moved, drawn = written(PULL_OUT, Program(tuple(loops)))
    assert drawn == {0, 1}
    first, second = (chain[0].values for chain in moved.chains)
    assert first == second == pytest.approx((3, 6, 0, 0), abs=0.06)
    assert calls_in(PULL_OUT, moved) == ["pull_out"]


@pytest.mark.parametrize(("bottom", "drawn"), [(4.0, {0, 1}), (4.2, set())])
def test_calls_do_not_move_parts_that_touch_apart(bottom: float, drawn: set[int]) -> None:
    lower, upper = Draw("box", (-6.0, -5.0, -5.0, 4.0, 10.0, 10.0)), Draw("box", (-2.0, -5.0, -5.0, 5.0, 10.0, 10.0))
    function = f"def pair():\n    box(height=4)\n    box(bottom={bottom}, top=0)\n"
    assert written(function, Program((lower, upper)))[1] == drawn


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
def test_a_function_that_fits_nothing_or_is_not_linear_changes_nothing(text: str) -> None:
    drawer = Program(tuple(plain(call(PULL_OUT, DRAWER))))
    assert written(text, drawer) == (drawer, set())


def test_a_call_costs_less_than_what_it_draws_and_more_than_its_first_block() -> None:
    prices = Prices()
    drawer = call(PULL_OUT, DRAWER)
    assert prices.of(drawer) == pytest.approx(prices.statement + prices.loop + 7 * prices.number)
    assert prices.of(Program(drawer.body[:1])) < prices.of(drawer) < prices.of(Program(drawer.body))
    usual = call(PULL_OUT, DRAWER | {"grip": 0.8})
    assert prices.of(drawer) - prices.of(usual) == pytest.approx(prices.number)
    looped = call(PULL_OUT, DRAWER, Loop("translate", (3.0, 6.0, 0.0, 0.0), ()))
    assert prices.of(looped) - prices.of(drawer) == pytest.approx(prices.loop + prices.number)


def test_numbers_inside_of_functions_are_not_those_of_their_calls_and_counts_are_none() -> None:
    box = {"bottom": -5.0, "front": 2.0, "left": -4.5, "height": 12.0, "depth": 0.5, "width": 9.0}
    ladder = call(LADDER, box | {"count": 3})
    assert numbers_outside(ladder) == 6
    assert numbers(ladder) > 6
    plain = parse(f"width, depth, height = 6, 4, 9\n{PULL_OUT}pull_out(bottom=1, height=2, width=4, depth=1)\n")
    assert numbers_outside(Program(plain.body)) == numbers(Program(plain.body)) == 12


def test_parts_without_a_role_in_their_function_share_the_commonest_of_their_blocks() -> None:
    blocks = plain(call(TRUMPET, FOOT))
    named = Program(
        tuple(Draw(node.name, node.values, role) for node, role in zip(blocks, ("base", "base"), strict=True))
    )
    moved, _ = written(TRUMPET, named)
    assert [chain[-1].word for chain in moved.chains] == ["base", "base"]  # type: ignore[union-attr]
    moved, _ = written(PULL_OUT, Program(tuple(plain(call(PULL_OUT, DRAWER)))))
    assert [chain[-1].word for chain in moved.chains] == ["drawer", "handle"]  # type: ignore[union-attr]


def test_ties_leave_what_a_call_draws_to_its_function() -> None:
    # The drawer is nearly as wide as the body: alone it would be made as wide, and its handle left as it is.
    body = parse("body(box(at=(-6, -2, -8.1), size=(12, 8, 16.2)))\n").body
    program, drawn = written(PULL_OUT, Program((*body, *call(PULL_OUT, DRAWER).body)))
    assert drawn == {1, 2}
    tied = tie(program, evidence_of_program(program), held=drawn)
    assert calls_in(PULL_OUT, tied) == ["pull_out"]


def chest() -> Shape:
    text = f"width, depth, height = 19, 11, 21\n{PULL_OUT}body()\n"
    for bottom in (0.4, 10.8):
        text += f"pull_out(width=18, front=-1.2, depth=1.2, bottom={bottom}, height=9.6, grip=0.7)\n"
    pieces = parts(parse(text))
    starts = np.cumsum([0, *(len(part.vertices) for part in pieces)])
    faces = np.concatenate([part.faces + first for part, first in zip(pieces, starts, strict=False)])
    return shape_from_mesh(np.concatenate([part.vertices for part in pieces]), faces, name="chest", axes=np.eye(3))


def test_a_chest_of_drawers_is_written_with_the_drawer_of_a_user() -> None:
    found = sp.infer(chest(), libraries=[library(PULL_OUT)], budget=600).program
    assert {line.name for line in source_of(found).walk() if isinstance(line, Call)} == {"pull_out"}
    assert format_program(found).count("def pull_out") == 1
    handles = [node for node in found.flat().body if "handle" in format_program(Program((node,)))]
    assert Program(tuple(handles)).size == 2
