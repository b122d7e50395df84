"""Programs with names, expressions, functions and comments: what they come to, their text, and what is refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from placed import placed_text

import shapeprog as sp
from shapeprog.errors import ProgramError, ShapeProgError
from shapeprog.formats.json_form import program_from_json, program_to_json
from shapeprog.language import Program, evaluated
from shapeprog.language.ast import Assignment, Call, Comment, Draw, Function, Loop, Part, Source
from shapeprog.language.evaluate import placed_source
from shapeprog.language.expression import Binary, Expression, Linear, Name, Negative, combined
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program

WHOLE = "width, depth, height = 20, 20, 24\n"

CHAIR = """\
# A chair of one board and four legs.
width, depth, height = 10.25, 12, 24
seat_height, thick = 9.5, 2  # top of the seat above the floor; section of the legs

pairs = 2

def legs(thick=1):  # as many as a chair has
    # The left ones are mirrored.
    inset = depth / 2 - thick

    for _ in mirror(x=0):
        for _ in translate(pairs, y=2 * inset):
            leg(left=0, width=thick, front=0, depth=thick)
            # below the seat

seat(bottom=seat_height - 2.5, height=2.5)
legs(height=seat_height - 2.5, thick=thick)  # here they stand
back(rear=0, depth=1, bottom=seat_height)
"""


def test_names_expressions_and_functions_come_to_plain_numbers() -> None:
    leg = Draw("box", (-12.0, -6.0, 3.125, 7.0, 2.0, 2.0), "leg")
    pair = Loop("translate", (2.0, 0.0, 8.0, 0.0), (leg,))
    seat = Draw("box", (-5.0, -6.0, -5.125, 2.5, 12.0, 10.25), "seat")
    back = Draw("box", (-2.5, 5.0, -5.125, 14.5, 1.0, 10.25), "back")
    plain = (seat, Loop("mirror", (2.0, 2.0, 0.0), (pair,)), back)
    assert parse(CHAIR).body == plain
    assert parse(CHAIR) != Program(plain)


def test_text_as_it_is_formatted_comes_back_letter_by_letter() -> None:
    assert format_program(parse(CHAIR)) == CHAIR


def test_text_as_people_write_it_is_put_in_order() -> None:
    loose = (
        "\n\n#a table\nwidth,depth,height=(2, (((1+w0)))*+3, 3)#   twice\nk=w0\n\n\n\n"
        "def legs ( a , b = 2 ) :\n  pass\n"
        "  leg(width=a,left=(\n # inside\n\n  b)) # at the end\n\n  # of the block\n# below it\n"
        "legs(a=width,b=k)"
    )
    with pytest.raises(ProgramError, match="unknown name 'w0'"):
        parse(loose)
    assert format_program(parse("w0 = 1\n" + loose.replace("  pass\n", ""))) == (
        "w0 = 1\n\n# a table\nwidth, depth, height = 2, (1 + w0) * 3, 3  # twice\nk = w0\n\ndef legs(a, b=2):\n"
        "    leg(width=a, left=b)  # inside  at the end\n\n    # of the block\n# below it\n"
        "legs(a=width, b=k)\n"
    )


def test_statements_in_cells_have_no_source() -> None:
    assert parse("# one leg\nleg(at=(1, 2, 3), size=(1, 2, 4))  # this one").source is None


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ("w = 1\nleg(at=(1, 2, 3), size=(1, 2, w))", 1, 1, "no statement of a program in cells"),
        ("leg(at=(1, 2, 3), size=(1, 2, w))", 1, 31, "size of leg holds w, which is not a number"),
        ("leg(at=(1, 2, 3), size=(1, 2, 1 + 2))", 1, 31, "holds 1 \\+ 2, which is not a number"),
        ("def legs():\n    leg(at=(1, 2, 3), size=(1, 2, 3))\n", 1, 1, "no statement of a program in cells"),
        ("# unit: cm, 3 per cell\nleg(at=(1, 2, 3), size=(1, 2, 3))", 1, 1, "have no unit"),
    ],
)
def test_statements_in_cells_have_plain_numbers(text: str, line: int, column: int, words: str) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        parse(text)
    assert (caught.value.line, caught.value.column) == (line, column)
    assert "parts placed by keywords" in caught.value.hint


@given(st.integers(0, 1 << 30))
def test_written_programs_survive_as_text_and_as_json(seed: int) -> None:
    program = parse(placed_text(seed))
    again = program_from_json(program_to_json(program))
    assert repr((again.body, again.source)) == repr((program.body, program.source))


@pytest.mark.parametrize(
    "text", ["a - (b - c) - a", "a / (b * c) * -a", "-(a + b) / -a", "(a + b) * (a - -2)", "--a - -b", "2 - a * 0.1"]
)
def test_expressions_have_as_many_parentheses_as_they_need(text: str) -> None:
    scope = {"a": 3.0, "b": 5.0, "c": -7.0}
    program = parse(f"{WHOLE}a, b, c = 3, 5, -7\nbox(x={text}, width=1, depth=b, lean=c)")
    value = program.source.lines[2].keywords[0][1]
    assert value.at(scope) == pytest.approx(eval(text, scope))
    assert program.body[0].values[2] + 0.5 == pytest.approx(-eval(text, scope))
    assert str(value) == text


def test_expressions_are_built_with_operators() -> None:
    width, thick = Name("width"), Name("thick")
    assert str((width - 2 * thick) / 3) == "(width - 2 * thick) / 3"
    assert str(1 - -width) == "1 - -width"
    assert str(combined(0, [(width, 2 / 3), (thick, -1 / 3)])) == "2 * width / 3 - thick / 3"
    assert str(combined(0.25, [(width, -0.5), (thick, 1.0), (2.0, 3.0), (width * thick, 0.3)])) == (
        "-width / 2 + thick + 0.3 * (width * thick) + 6.25"
    )
    assert Binary("*", 0.1, width) == Binary("*", 0.10000000149011612, width)
    with pytest.raises(ShapeProgError, match="too large"):
        width + float("nan")


@pytest.mark.wrong_types
def test_numbers_have_signs_of_their_own() -> None:
    with pytest.raises(ShapeProgError, match="not an expression"):
        Negative(2.0)  # type: ignore[arg-type]


def test_linear_forms_are_found_by_evaluation() -> None:
    a, b = Name("a"), Name("b")
    numbers = {"a": Linear.of("a"), "b": Linear.of("b"), "c": Linear(2.0)}

    def form(expression: Expression) -> Linear:
        return expression.at(numbers)

    assert form((a - 2 * (b - a)) / 4 + 1) == Linear(1.0, (("a", 0.75), ("b", -0.5)))
    assert form(Name("c") * a - a / (1 / Name("c"))) == Linear(0.0)
    assert form(3 - a) == Linear(3.0, (("a", -1.0),))
    for bent in (a * b, 1 / a, a / b):
        with pytest.raises(ShapeProgError, match="linear"):
            form(bent)


def tower(levels: int, calls: int) -> str:
    text = WHOLE + "def f0():\n    box()\n"
    for level in range(1, levels):
        text += f"def f{level}():\n" + f"    f{level - 1}()\n" * calls
    return text + f"f{levels - 1}()\n"


def test_calls_that_multiply_are_refused_before_they_fill_the_memory() -> None:
    assert parse(tower(10, 2)).statements == 512
    with pytest.raises(ProgramError, match="more than 65536 statements"):
        parse(tower(60, 2))
    with pytest.raises(ProgramError, match="more than 64 deep"):
        parse(tower(400, 1))


def test_programs_are_written_by_hand_too_and_faults_are_told_without_a_place() -> None:
    long = Name("long")
    lines = (
        Comment("a post"),
        Comment(),
        Comment(),
        Assignment((("width", 4.0), ("depth", 4.0), ("height", 24.0))),
        Assignment((("long", 4.0),)),
        Function("upright", (("up", None),), (Part("box", (("bottom", Name("up")), ("height", long)), "leg"),)),
        Call("upright", (("up", long / 2),)),
        Comment(),
    )
    program = evaluated(placed_source(lines))
    assert program.body == (Draw("box", (-10.0, -2.0, -2.0, 4.0, 4.0, 4.0), "leg"),)
    assert parse(format_program(program)) == program
    with pytest.raises(ShapeProgError, match="upright needs up"):
        evaluated(placed_source((*lines[:-2], Call("upright", ()))))
    with pytest.raises(ShapeProgError, match="has 1 numbers instead of 6"):
        evaluated(Source((lines[4], Draw("leg", (long,)))))
    with pytest.raises(ShapeProgError, match="undefined function 'posts'"):
        evaluated(Source((Call("posts", ()),)))
    with pytest.raises(ShapeProgError, match="did you mean arm"):
        evaluated(Source((Function("four", (), ()), Call("four", (), role="arms"))))
    with pytest.raises(ShapeProgError, match="cannot be printed"):
        format_program(evaluated(placed_source((Comment("a\nleg()"), *lines))))


def test_everything_that_works_on_shapes_takes_programs_with_names() -> None:
    program = parse(CHAIR)
    plain = Program(program.body)
    assert sp.unroll(program).centre.tolist() == sp.unroll(plain).centre.tolist()
    assert (program.size, program.statements, program.blocks) == (plain.size, plain.statements, plain.blocks)
    assert program.snap() == plain.snap()


def test_a_sum_starts_with_what_is_added() -> None:
    depth, rear = Name("depth"), Name("rear")
    assert str(combined(4.0, [(depth, -1.0)])) == "4 - depth"
    assert str(combined(4.0, [(depth, -1.0), (rear, 2.0)])) == "-depth + 2 * rear + 4"
    assert str(combined(-4.0, [(depth, -1.0)])) == "-depth - 4"
    assert combined(4.0, [(2.0, -1.0)]) == 2.0
