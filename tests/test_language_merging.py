"""Equal loops written once, and the way back."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest
from placed import placed_text

import shapeprog as sp
from shapeprog.language.evaluate import evaluated
from shapeprog.language.merging import merged, separate_loops
from shapeprog.language.printer import format_program, source_of
from shapeprog.language.program import Program

WHOLE = "width, depth, height = 24, 10, 12\n"

CHAIR = """\
width, depth, height = 12, 10, 24
thick = 1
for _ in mirror(x=0):
    leg(left=0, width=thick, rear=0, depth=thick, height=16)
seat(bottom=12, height=thick)
for _ in mirror(x=0):
    for _ in translate(2, z=3):
        rail(left=0, width=thick, bottom=7, height=thick)
for _ in translate(2, z=thick):
    slat(rear=0, depth=thick, bottom=15, height=thick)
for _ in mirror(x=0):
    for _ in translate(2, z=3):
        arm(left=0, width=thick, bottom=16, height=thick)
"""

MERGED = """\
width, depth, height = 12, 10, 24
thick = 1
for _ in mirror(x=0):
    leg(left=0, width=thick, rear=0, depth=thick, height=16)
    for _ in translate(2, z=3):
        rail(left=0, width=thick, bottom=7, height=thick)
        arm(left=0, width=thick, bottom=16, height=thick)
seat(bottom=12, height=thick)
for _ in translate(2, z=thick):
    slat(rear=0, depth=thick, bottom=15, height=thick)
"""

CELLS = """\
for i in mirror(side):
    leg(at=(-8, 4, 5), size=(16, 1, 1))
    for j in translate(2, by=(3, 0, 0)):
        rail(box(at=(-5, -5, 5), size=(1, 10, 1)))
        arm(box(at=(4, -5, 6), size=(1, 10, 1)))
seat(box(at=(0, -5, -6), size=(1, 10, 12)))
"""


def separate(program: Program) -> Program:
    source = source_of(program)
    return evaluated(replace(source, lines=tuple(separate_loops(source.lines))))


def test_equal_loops_become_one_at_the_place_of_the_first():
    assert format_program(merged(sp.parse(CHAIR))) == MERGED
    assert merged(sp.parse(MERGED)) == sp.parse(MERGED)


def test_loops_apart_have_one_statement_each():
    found = format_program(separate(sp.parse(CELLS)))
    assert found.count("for i in mirror(side):") == 3
    assert format_program(merged(sp.parse(found))) == CELLS


def test_a_comment_between_loops_keeps_them_apart():
    text = "for _ in mirror(x=0):\n    box(left=0, width=2)\n"
    other = text.replace("left=0", "left=4")
    commented = sp.parse(f"{WHOLE}{text}# the back\n{other}")
    assert merged(commented) == commented
    noted = sp.parse(f"{WHOLE}{text}{other.replace('x=0):', 'x=0):  # the back')}")
    assert merged(noted) == noted
    assert merged(sp.parse(f"{WHOLE}{text}{other}")).statements == 3


def test_no_loop_moves_above_a_name_that_it_needs():
    lines = "for _ in mirror(x=0):\n    leg(left={0}, width=1)\n"
    program = sp.parse(f"{WHOLE}low = 3\n{lines.format('low')}high = 5\n{lines.format('high')}")
    assert merged(program) == program


@pytest.mark.parametrize("seed", range(60))
def test_whatever_is_written_draws_the_same_blocks(seed: int):
    program = sp.parse(placed_text(seed))
    cells = sp.inline(program)
    for given, found in ((program, merged(program)), (cells, separate(cells)), (cells, merged(separate(cells)))):
        assert Counter(found.chains) == Counter(given.chains)
        assert sp.parse(format_program(found)) == found
    assert merged(merged(program)) == merged(program)
