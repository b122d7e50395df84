"""Programs whose lengths are in a unit of the object: the same shapes, in other words."""

from __future__ import annotations

import time

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from placed import placed_text

import shapeprog as sp
from benchmarks.editing import multiplied
from shapeprog.language import Program, evaluated
from shapeprog.language.ast import Assignment, Comment
from shapeprog.language.dimensions import in_unit, lengths
from shapeprog.language.evaluate import placed_source
from shapeprog.language.free import free_numbers
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program
from shapeprog.language.unit import METRES, Unit
from shapeprog.space import Frame

WHOLE = "width, depth, height = 24, 12, 24\n"

CHAIR = """\
# A chair.
width, depth, height = 10, 10, 24
seat_height = 11.5  # the top of the seat
lean, slats, share, gap = 8, 4, 0.5, 1.25

def legs(long, thick=2, inset=0):
    # four of them
    far = width / 2 - thick - inset
    for _ in mirror(x=0):
        leg(x=-far, width=thick, rear=inset, depth=thick, height=long)

seat(bottom=seat_height - 1.5, height=1.5)
legs(long=seat_height - 3 / 2, thick=2 * gap)
legs(long=24)
for _ in translate(slats, x=(width - gap) / (slats - 1)):
    slat(left=0, width=gap, rear=0, depth=1, bottom=seat_height, height=share * width + 4, tilt=lean)
for _ in rotate(3):
    rod(start=at(), end=at(x=2 + 2, y=5, bottom=1), radius=0.5)
"""

units = st.builds(
    Unit, st.sampled_from([*METRES]), st.floats(0.03125, 400, width=32, allow_subnormal=False)
)  # fmt: skip


def close(one: Program, two: Program, within: float = 2e-5) -> None:
    first, second = sp.encode(one, dtype=torch.float64), sp.encode(two, dtype=torch.float64)
    assert torch.equal(first.ids, second.ids)
    torch.testing.assert_close(first.parameters, second.parameters, atol=within, rtol=within)


@given(st.integers(0, 1 << 30), units, units)
def test_a_program_draws_the_same_in_every_unit(seed: int, unit: Unit, other: Unit) -> None:
    program = parse(placed_text(seed))
    there = in_unit(program, unit)
    assert there.unit == unit
    assert in_unit(there, unit) is there
    for each in (there, in_unit(there, other), in_unit(there, None)):
        close(each, program, 1e-3)
    assert [each.name for each in sp.names(there)] == [each.name for each in sp.names(program)]
    assert free_numbers(there) == free_numbers(program)
    assert parse(format_program(there)).source.lines == there.source.lines


def test_statements_in_cells_have_no_unit() -> None:
    with pytest.raises(sp.ShapeProgError, match="no unit"):
        in_unit(parse("leg(at=(0, 0, 0), size=(1, 1, 1))"), Unit("cm", 4))


def test_names_expressions_functions_and_defaults_are_converted() -> None:
    program = parse(CHAIR)
    there = in_unit(program, Unit("cm", 4))
    close(there, program, 1e-6)
    assert format_program(there) == "# unit: cm\n" + (
        CHAIR.replace("10, 10, 24", "40, 40, 96").replace("11.5", "46").replace("0.5, 1.25", "0.5, 5")
        .replace("thick=2, inset=0", "thick=8, inset=0").replace("- 1.5,", "- 6,").replace("height=1.5", "height=6")
        .replace("3 / 2", "12 / 2").replace("long=24", "long=96").replace("width + 4,", "width + 16,")
        .replace("depth=1,", "depth=4,").replace("x=2 + 2, y=5, bottom=1", "x=8 + 8, y=20, bottom=4")
        .replace("radius=0.5", "radius=2")
    )  # fmt: skip
    assert in_unit(there, None).source.lines == program.source.lines
    assert lengths(there) == {"width", "depth", "height", "seat_height", "gap"}


def test_a_name_that_is_set_counts_in_the_unit() -> None:
    program = parse(CHAIR)
    there = in_unit(program, Unit("cm", 4))
    close(sp.set(there, seat_height=60, lean=3), sp.set(program, seat_height=15, lean=3), 1e-6)
    assert "seat_height = 60" in format_program(sp.set(there, seat_height=60))
    assert sp.set(there, width=41).unit == there.unit
    place = 0  # the width
    close(multiplied(there, place, 1.5), multiplied(program, place, 1.5), 1e-6)


@pytest.mark.parametrize("text", [CHAIR, CHAIR.replace("share * width", "share * width * width / 9")])
def test_gradients_reach_names_in_their_unit(text: str) -> None:
    program, unit = parse(text), Unit("mm", 40)
    here, there = sp.Parametric(program), sp.Parametric(in_unit(program, unit))
    assert (here.matrix is None) == (there.matrix is None)
    by = there.values / here.values
    assert by[there.names.index("width")] == unit.per_cell
    torch.testing.assert_close(there.at(there.values).parameters, here.at(here.values).parameters)
    found = []
    for each in (here, there):
        values = each.values.clone().requires_grad_()
        sp.unroll(each.at(values)).centre.square().sum().backward()
        found.append(values.grad)
    torch.testing.assert_close(found[1] * by, found[0])


@pytest.mark.parametrize(
    "text",
    [
        "n = 3\nfor _ in translate(n, x=n):\n    leg(width=1)\n",
        "a = 3\nbox(depth=a, tilt=a + 1)\n",
        "a, b = 3, 2\nbox(width=b, depth=a, tilt=a + b)\n",
        "def support(a):\n    leg(width=a, depth=a, height=a * a)\n\nsupport(a=2)\n",
        "def tilted(a):\n    box(tilt=a)\n\nw = 2\ntilted(a=w)\nleg(bottom=w)\n",
    ],
)
def test_a_name_that_is_a_length_in_one_place_only_is_not_converted(text: str) -> None:
    program = parse(WHOLE + text)
    with pytest.raises(sp.ShapeProgError, match="stands for a length in one place") as caught:
        in_unit(program, Unit("cm", 4))
    assert "name of its own" in caught.value.hint
    assert lengths(program) == frozenset()
    assert parse(f"# unit: cm\n{WHOLE}{text}").unit, "it may be written in a unit by hand"


def test_a_number_that_follows_from_a_length_keeps_its_value() -> None:
    program = parse(f"{WHOLE}a = 3\nbox(width=a * a / 10, depth=a, height=9, tilt=2 * a)\n")
    there = in_unit(program, Unit("cm", 4))
    close(there, program, 1e-6)
    assert format_program(there).splitlines()[3] == "box(width=a * a / 40, depth=a, height=36, tilt=0.5 * a)"


def test_a_chain_of_names_takes_linear_time() -> None:
    chain = "".join(f"a{index} = a{index - 1} + 0.001\n" for index in range(1, 1000))
    program = parse(f"{WHOLE}a0 = 1\n{chain}box(left=a999)\n")
    started = time.process_time()
    close(in_unit(program, Unit("cm", 4)), program, 1e-6)
    assert time.process_time() - started < 2


def test_a_comment_that_reads_like_a_unit_is_not_written() -> None:
    size = Assignment(tuple((word, 1.0) for word in ("width", "depth", "height")))
    with pytest.raises(sp.ShapeProgError, match="read as the unit"):
        format_program(evaluated(placed_source((Comment("unit: left"), size))))
    inside = "for _ in translate(2, x=1):\n    # unit: left\n    leg(width=1)\n"
    assert format_program(parse(WHOLE + inside)) == WHOLE + inside


def test_units_follow_from_the_frame_of_an_object() -> None:
    frame = Frame(scale=0.0375)
    assert Unit.of(frame, "cm") == Unit("cm", 3.75)
    assert Unit.of(frame, "cm", "in").per_cell == pytest.approx(0.0375 * 2.54)
