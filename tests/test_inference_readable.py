"""Programs in a unit with the decimals that a person expects."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from shapeprog.data.random import random_program
from shapeprog.inference.connecting import floating
from shapeprog.inference.readable import COARSE, DRIFT, in_readable_unit
from shapeprog.language import language
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program
from shapeprog.language.program import Loop
from shapeprog.language.unit import METRES, Unit

CHAIR = "width, height = 10.213, 24.004\nseat(box(at=(0, -5, -width / 2), size=(height / 9, 10.1, width)))\n"


@pytest.mark.parametrize(
    ("unit", "names", "depth"),
    [
        (Unit("cm", 3.75), "38.3, 90", "37.9"),
        (Unit("mm", 37.5), "383, 900", "379"),
        (Unit("m", 0.0375), "0.383, 0.9", "0.379"),
        (Unit("in", 1.476), "15.07, 35.43", "14.91"),
        (Unit("cm", 10), "102.1, 240", "101"),
    ],
)
def test_lengths_have_the_decimals_that_a_person_expects(unit: Unit, names: str, depth: str) -> None:
    text = format_program(in_readable_unit(parse(CHAIR), unit))
    assert f"width, height = {names}\n" in text
    assert f"size=(height / 9, {depth}, width)" in text


@given(st.integers(0, 1 << 30), st.builds(Unit, st.sampled_from([*METRES]), st.floats(0.03125, 400, width=32)))
def test_no_number_moves_far_and_no_copy_of_a_loop(seed: int, unit: Unit) -> None:
    program = random_program(torch.Generator().manual_seed(seed), blocks=3, copies=30)
    moved = in_readable_unit(program, unit)
    assert moved.unit == unit
    for one, two in zip(program.walk(), moved.walk(), strict=True):
        copies = max(1, one.count - 1) if isinstance(one, Loop) else 1
        for mine, other, quantity in zip(one.values, two.values, language()[one.name].quantities, strict=True):
            assert abs(mine - other) <= (COARSE / 2 + 1e-4 if quantity.spatial else 0)
            assert quantity.kind != "shift" or abs(mine - other) * copies <= DRIFT / 2 + 1e-4


def test_parts_that_touch_keep_as_many_decimals_as_hold_them_together() -> None:
    unit = Unit("cm", 4)
    for height, top, shown in ((2.5, 2.76, "at=(11, 0, 0)"), (2.51, 2.77, "at=(11.08, 0, 0)")):
        program = parse(f"box(at=(0.26, 0, 0), size=({height}, 4, 4))\nbox(at=({top}, 0, 0), size=(1, 4, 4))\n")
        found = in_readable_unit(program, unit)
        assert floating(program) == floating(found) == []
        assert shown in format_program(found)


def test_a_program_in_its_unit_is_left_as_it_is() -> None:
    program = in_readable_unit(parse(CHAIR), Unit("cm", 3.75))
    assert in_readable_unit(program, Unit("cm", 3.75)) is program
    assert in_readable_unit(in_readable_unit(program, None), Unit("cm", 3.75)) == program


def test_several_parts_in_one_loop_are_told_apart() -> None:
    program = parse(
        "box(at=(0, 0, -2), size=(4, 4, 4))\n"
        "for i in mirror(side):\n"
        "    leg(at=(-4, 0, 0.26), size=(4, 1, 1))\n"
        "    arm(box(at=(8, 0, 0.26), size=(1, 4, 1)))\n"
    )
    assert floating(program) == [2]
    unit = Unit("cm", 4)
    assert floating(in_readable_unit(program, unit)) == [2]
