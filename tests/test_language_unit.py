"""Programs whose lengths are in a unit of the object: the same shapes, in other words."""

from __future__ import annotations

from dataclasses import replace
from itertools import count

import pytest
import torch
from hypothesis import given, reject
from hypothesis import strategies as st
from written import written_program

import shapeprog as sp
from shapeprog.data.random import random_program
from shapeprog.language import Program, evaluated, language
from shapeprog.language.ast import Assignment, Draw, Line, Source
from shapeprog.language.dimensions import in_unit, lengths
from shapeprog.language.expression import Binary, Name, Negative, Value
from shapeprog.language.free import free_numbers, multiplied
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program, source_of
from shapeprog.language.program import Loop
from shapeprog.language.unit import METRES, Unit
from shapeprog.space import Frame

CHAIR = """\
# A chair.
width, seat_height = 10, 11.5  # the top of the seat
floor = -12
lean, slats, share, gap = 8, 4, 0.5, 1.25

def legs(long, thick=2, inset=0):
    # four of them
    far = width / 2 - thick - inset
    for i in mirror(side):
        leg(at=(floor, -far - thick, far), size=(long, thick, thick))

seat(box(at=(floor + seat_height - 1.5, -width / 2, -width / 2), size=(1.5, width, width)))
legs(long=seat_height - 3 / 2, thick=2 * gap)
legs(long=24)
for i in translate(slats, by=(0, 0, (width - gap) / (slats - 1))):
    slat(board(at=(floor + seat_height, width / 2, -width / 2), size=(share * width + 4, 1, gap), tilt=lean))
for i in rotate(3, step=1):
    rod(start=(floor, 0, 0), end=(floor + 1, 5, 2 + 2), radius=0.5)
"""

units = st.builds(
    Unit, st.sampled_from([*METRES]), st.floats(0.03125, 400, width=32, allow_subnormal=False)
)  # fmt: skip


def read_in(program: Program, unit: Unit | None) -> Program:
    """The program whose text is the same but for the unit; none where its numbers are too large in cells."""
    try:
        return evaluated(replace(source_of(program), unit=unit))
    except sp.ShapeProgError:
        reject()


def named(program: Program) -> Program:
    """A plain program with names and expressions for many of its numbers, as they are: lengths, angles and counts."""
    kinds = count()
    header: list[Assignment] = []

    def tied(value: float, kind: str) -> Value:
        number = next(kinds)
        name = f"{kind}_{number}"
        how = number % 6
        if kind == "axis" or not value or how == 0:
            return value
        if kind in ("count", "turn"):
            header.append(Assignment(((name, value),)))
            return Name(name)
        parts: list[Value] = [value, value / 2, value - 3, value, 2 * value]
        header.append(Assignment(((name, parts[how - 1]),)))
        word = Name(name)
        return (word, 2.0 * word, word + 3.0, -Negative(word), word / Binary("+", 1.0, 1.0))[how - 1]

    def line(node: sp.Draw | sp.Loop) -> Line:
        quantities = language()[node.name].quantities
        values = tuple(
            value if not quantity.written_out else tied(value, "length" if quantity.spatial else quantity.kind)
            for value, quantity in zip(node.values, quantities, strict=True)
        )
        if isinstance(node, Loop):
            return Loop(node.name, values, tuple(map(line, node.body)))
        return Draw(node.name, values, node.role)

    body = [line(node) for node in program.body]
    return evaluated(Source((*header, *body)))


def close(one: Program, two: Program, within: float = 2e-5) -> None:
    first, second = sp.encode(one, dtype=torch.float64), sp.encode(two, dtype=torch.float64)
    assert torch.equal(first.ids, second.ids)
    torch.testing.assert_close(first.parameters, second.parameters, atol=within, rtol=within)


@given(st.integers(0, 1 << 30), units)
def test_every_program_in_a_unit_survives_text_and_json(seed: int, unit: Unit) -> None:
    program = read_in(written_program(seed), unit)
    text = format_program(program)
    assert text.startswith(f"# unit: {unit.name}, ")
    assert parse(text) == program
    assert format_program(parse(text)) == text
    assert sp.program_from_json(sp.program_to_json(program)) == program


@given(st.integers(0, 1 << 30), units)
def test_lengths_of_the_text_are_divided_and_nothing_else_is(seed: int, unit: Unit) -> None:
    cells = written_program(seed)
    for one, two in zip(cells.walk(), read_in(cells, unit).walk(), strict=True):
        for mine, other, quantity in zip(one.values, two.values, language()[one.name].quantities, strict=True):
            by = unit.per_cell if quantity.spatial else 1.0
            assert other == pytest.approx(mine / by, rel=1e-6, abs=1e-40)


@given(st.integers(0, 1 << 30), units)
def test_what_is_written_out_stays_in_its_unit_and_draws_the_same(seed: int, unit: Unit) -> None:
    program = read_in(written_program(seed), unit)
    plain = sp.inline(program)
    assert plain.unit == unit
    assert plain.body == program.body
    assert parse(format_program(plain)) == plain
    assert sp.inline(plain) == plain
    assert sp.names(plain) == []


@given(st.integers(0, 1 << 30), units, units)
def test_a_program_draws_the_same_in_every_unit(seed: int, unit: Unit, other: Unit) -> None:
    cells = named(random_program(torch.Generator().manual_seed(seed), blocks=1 + seed % 4))
    there = in_unit(cells, unit)
    assert there.unit == unit
    assert in_unit(there, unit) is there
    for each in (there, in_unit(there, other), in_unit(there, None)):
        close(each, cells)
    assert [each.name for each in sp.names(there)] == [each.name for each in sp.names(cells)]
    assert free_numbers(there) == free_numbers(cells)


def test_names_expressions_functions_and_defaults_are_converted() -> None:
    program = parse(CHAIR)
    there = in_unit(program, Unit("cm", 4))
    close(there, program, 1e-6)
    assert format_program(there) == "# unit: cm, 4 per cell\n" + (
        CHAIR.replace("10, 11.5", "40, 46").replace("floor = -12", "floor = -48").replace("0.5, 1.25", "0.5, 5")
        .replace("thick=2, inset=0", "thick=8, inset=0").replace("- 1.5,", "- 6,").replace("(1.5,", "(6,")
        .replace("3 / 2", "12 / 2").replace("long=24", "long=96").replace("width + 4, 1,", "width + 16, 4,")
        .replace("floor + 1, 5, 2 + 2), radius=0.5", "floor + 4, 20, 8 + 8), radius=2")
    )  # fmt: skip
    assert in_unit(there, None) == program
    assert lengths(there) == {"width", "seat_height", "floor", "gap"}


def test_a_name_that_is_set_counts_in_the_unit() -> None:
    program = parse(CHAIR)
    there = in_unit(program, Unit("cm", 4))
    close(sp.set(there, seat_height=60, lean=3), sp.set(program, seat_height=15, lean=3), 1e-6)
    assert "seat_height = 40, 60" in format_program(sp.set(there, seat_height=60))
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


def test_lengths_are_rounded_to_decimals_and_thin_ones_to_two_digits() -> None:
    text = "box(at=(12.05, -0.0121, 0), size=(0.0123, 2.9, 24.001))\nboard(at=(9, 9, 9), size=(9, 9, 9), tilt=12.345)\n"
    for unit, digits, numbers in (
        (Unit("cm", 3.75), 1, "at=(45.2, -0.045, 0), size=(0.046, 10.9, 90)"),
        (Unit("mm", 37.5), 0, "at=(452, -0.45, 0), size=(0.46, 109, 900)"),
        (Unit("m", 0.0375), 3, "at=(0.452, -0.00045, 0), size=(0.00046, 0.109, 0.9)"),
    ):
        found = in_unit(parse(text), unit, digits=digits)
        assert format_program(found).splitlines()[1] == f"box({numbers})"
        assert format_program(found).endswith("tilt=12.345)\n")


@pytest.mark.parametrize(
    "text",
    [
        "n = 3\nfor i in translate(n, by=(0, 0, n)):\n    leg(at=(0, 0, 0), size=(1, 1, 1))\n",
        "a = 3\nboard(at=(0, 0, 0), size=(9, a, 9), tilt=a + 1)\n",
        "a, b = 3, 2\nboard(at=(0, 0, 0), size=(9, a, b), tilt=a + b)\n",
        "def support(a):\n    leg(at=(0, 0, 0), size=(a, a, a * a))\n\nsupport(a=2)\n",
        "def tilted(a):\n    board(at=(0, 0, 0), size=(1, 1, 1), tilt=a)\n\nw = 2\ntilted(a=w)\n"
        "leg(at=(w, 0, 0), size=(1, 1, 1))\n",
    ],
)
def test_a_name_that_is_a_length_in_one_place_only_is_not_converted(text: str) -> None:
    program = parse(text)
    with pytest.raises(sp.ShapeProgError, match="stands for a length in one place") as caught:
        in_unit(program, Unit("cm", 4))
    assert "name of its own" in caught.value.hint
    assert lengths(program) == frozenset()
    assert parse("# unit: cm, 4 per cell\n" + text).unit, "it may be written in a unit by hand"


def test_a_number_that_follows_from_a_length_keeps_its_value() -> None:
    program = parse("a = 3\nboard(at=(0, 0, 0), size=(9, a, a * a), tilt=2 * a)\n".replace("a * a", "a * a / 10"))
    there = in_unit(program, Unit("cm", 4))
    close(there, program, 1e-6)
    assert format_program(there).splitlines()[2] == "board(at=(0, 0, 0), size=(36, a, a * a / 40), tilt=0.5 * a)"


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ("# unit: furlong, 3 per cell", 1, 9, "unknown unit 'furlong'\n  # unit"),
        ("# unit: CM, 3 per cell", 1, 9, "did you mean cm?"),
        ("#unit:", 1, 7, "known: mm, cm, m, in"),
        ("# A box.\n# unit: cm", 2, 9, "missing number of cm per cell"),
        ("# unit: cm, 3", 1, 9, "missing cell size"),
        ("# unit: cm, 0 per cell", 1, 13, "invalid cell size '0'"),
        ("# unit: cm, -3 per cell", 1, 13, "expected a positive number"),
        ("# unit: cm, three per cell", 1, 13, "write it as # unit: cm, 3.75 per cell"),
        ("# unit: cm, nan per cell", 1, 13, "invalid cell size 'nan'"),
        ("# unit: cm, 1e99 per cell", 1, 13, "invalid cell size '1e99'"),
        ("# unit: cm, 3 per cell\n# unit: cm, 3 per cell", 2, 1, "duplicate unit"),
        ("leg(at=(0, 0, 0), size=(1, 1, 1))\n# unit: cm, 3 per cell", 2, 1, "above all statements"),
        ("# unit: m, 0.001 per cell\nleg(at=(0, 0, 0), size=(1, 1e37, 1))", 2, 28, "in cells this number is too large"),
        ("# unit: m, 0.001 per cell\na = 1e37\nleg(at=(0, 0, 0), size=(1, a, 1))", 3, 28, "too large"),
    ],
)
def test_a_wrong_unit_is_told_with_its_place(text: str, line: int, column: int, words: str) -> None:
    with pytest.raises(sp.ProgramError) as caught:
        parse(text)
    assert (caught.value.line, caught.value.column) == (line, column)
    assert words in str(caught.value)


def test_a_comment_that_reads_like_a_unit_is_not_written() -> None:
    from shapeprog.language.ast import Comment

    with pytest.raises(sp.ShapeProgError, match="read as the unit"):
        format_program(evaluated(Source((Comment("unit: the left one"),), Unit("cm", 4))))
    inside = "for i in translate(2, by=(0, 0, 1)):\n    # unit: the left one\n    leg(at=(0, 0, a), size=(a, a, a))\n"
    assert format_program(parse("a = 1\n" + inside)) == "a = 1\n" + inside


def test_units_follow_from_the_frame_of_an_object() -> None:
    frame = Frame(scale=0.0375)
    assert Unit.of(frame, "cm") == Unit("cm", 3.75)
    assert Unit.of(frame, "cm", "in").per_cell == pytest.approx(0.0375 * 2.54)
    assert Unit.of(frame, "cm").to("mm").per_cell == pytest.approx(37.5)
