"""Equal loops written once, and the way back."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest
from written import written_program

import shapeprog as sp
from shapeprog.language.evaluate import evaluated
from shapeprog.language.merging import merged
from shapeprog.language.printer import format_program, source_of
from shapeprog.language.program import Program
from shapeprog.library.rewriting import separate_loops

CHAIR = """\
width, depth = 12, 10
thick = 1
for i in mirror(side):
    leg(at=(-8, depth / 2 - thick, width / 2 - thick), size=(16, thick, thick))
seat(box(at=(0, -depth / 2, -width / 2), size=(thick, depth, width)))
for i in mirror(side):
    for j in translate(2, by=(3, 0, 0)):
        rail(box(at=(-5, -depth / 2, width / 2 - thick), size=(thick, depth, thick)))
for i in translate(2, by=(thick, 0, 0)):
    slat(box(at=(3, depth / 2 - thick, -width / 2), size=(thick, thick, width)))
for i in mirror(side):
    for j in translate(2, by=(3, 0, 0)):
        arm(box(at=(4, -depth / 2, width / 2), size=(thick, depth, thick)))
"""

MERGED = """\
width, depth = 12, 10
thick = 1
for i in mirror(side):
    leg(at=(-8, depth / 2 - thick, width / 2 - thick), size=(16, thick, thick))
    for j in translate(2, by=(3, 0, 0)):
        rail(box(at=(-5, -depth / 2, width / 2 - thick), size=(thick, depth, thick)))
        arm(box(at=(4, -depth / 2, width / 2), size=(thick, depth, thick)))
seat(box(at=(0, -depth / 2, -width / 2), size=(thick, depth, width)))
for i in translate(2, by=(thick, 0, 0)):
    slat(box(at=(3, depth / 2 - thick, -width / 2), size=(thick, thick, width)))
"""


def separate(program: Program) -> Program:
    source = source_of(program)
    return evaluated(replace(source, lines=tuple(separate_loops(source.lines))))


def test_equal_loops_become_one_at_the_place_of_the_first():
    assert format_program(merged(sp.parse(CHAIR))) == MERGED
    assert merged(sp.parse(MERGED)) == sp.parse(MERGED)


def test_loops_apart_have_one_statement_each():
    found = format_program(separate(sp.parse(MERGED)))
    assert found.count("for i in mirror(side):") == 3
    assert format_program(merged(sp.parse(found))) == MERGED


def test_a_comment_between_loops_keeps_them_apart():
    text = "for i in mirror(side):\n    box(at=(0, 0, 1), size=(thick, 1, 1))\n"
    commented = sp.parse(f"thick = 2\n{text}# the back\n{text.replace('0, 0, 1', '4, 0, 1')}")
    assert merged(commented) == commented
    other = text.replace("0, 0, 1", "4, 0, 1").replace("side):", "side):  # the back")
    noted = sp.parse(f"thick = 2\n{text}{other}")
    assert merged(noted) == noted


def test_no_loop_moves_above_a_name_that_it_needs():
    lines = "for i in mirror(side):\n    leg(at=({0}, 0, 1), size=(1, {0}, 1))\n"
    program = sp.parse(f"low = 3\n{lines.format('low')}high = 5\n{lines.format('high')}")
    assert merged(program) == program


@pytest.mark.parametrize("seed", range(60))
def test_whatever_is_written_draws_the_same_blocks(seed: int):
    program = written_program(seed)
    for found in (merged(program), separate(program), merged(separate(program))):
        assert Counter(found.chains) == Counter(program.chains)
        assert sp.parse(format_program(found)) == found
    assert merged(merged(program)) == merged(program)
