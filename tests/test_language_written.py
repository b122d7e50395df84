"""Programs with names, expressions, functions and comments: what they come to, their text, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from written import written_program

import shapeprog as sp
from shapeprog.errors import ProgramError, ShapeProgError
from shapeprog.formats.json_form import program_from_json, program_to_json
from shapeprog.language import Program, evaluated
from shapeprog.language.ast import Assignment, Call, Comment, Draw, Function, Loop, Source
from shapeprog.language.expression import Binary, Expression, Linear, Name, Negative, combined
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program

CHAIR = """\
# A chair of one board and four legs.
width, depth, height = 10.25, 12, 23.5
seat_height, thick = 9.5, 2  # top of the seat above the floor; section of the legs
floor = -height / 2

def legs(long, thick=1):  # as many as a chair has
    # The left ones are mirrored.
    inset = depth / 2 - thick

    for i in mirror(side):
        for j in translate(pairs, by=(0, -2 * inset, 0)):
            leg(at=(floor, inset, width / 2 - thick), size=(long, thick, thick))
            # below the seat

top_square(at=(floor + seat_height - 2.5, 0, 0), thickness=2.5, half=width / 2)
legs(long=seat_height - 2.5, thick=thick)  # here they stand
"""
CHAIR = CHAIR.replace("\ndef legs", "pairs = 2\n\ndef legs")

LEG = "leg(at=(1, 2, 3), size=(1, 2, w))"


def test_names_expressions_and_functions_come_to_plain_numbers() -> None:
    leg = Draw("leg", (-11.75, 4.0, 3.125, 7.0, 2.0, 2.0))
    pair = Loop("translate", (2.0, 0.0, -8.0, 0.0), (leg,))
    plain = (Draw("top_square", (-4.75, 0.0, 0.0, 2.5, 5.125)), Loop("mirror", (2.0, 2.0, 0.0), (pair,)))
    assert parse(CHAIR).body == plain
    assert parse(CHAIR) != Program(plain)


def test_a_role_around_a_call_is_that_of_all_parts_in_it_that_have_none() -> None:
    inner = "def two(up):\n    leg(at=(up, 0, 0), size=(1, 1, 1))\n    box(at=(up, 2, 0), size=(1, 1, 1))\n\n"
    outer = "def four():\n    two(up=1)\n    rail(two(up=2))\n    seat(box(at=(9, 0, 0), size=(1, 1, 1)))\n\n"
    program = parse(f"{inner}{outer}arm(four())\ntwo(up=3)\n")
    assert [node.word for node in program.walk()] == ["leg", "arm", "leg", "rail", "seat", "leg", "box"]
    assert format_program(program).endswith("\narm(four())\ntwo(up=3)\n")
    assert program_from_json(program_to_json(program)) == program
    with pytest.raises(ShapeProgError, match="did you mean arm"):
        evaluated(Source((Function("four", (), ()), Call("four", (), role="arms"))))


def test_text_as_it_is_formatted_comes_back_letter_by_letter() -> None:
    assert format_program(parse(CHAIR)) == CHAIR


def test_text_as_people_write_it_is_put_in_order() -> None:
    loose = (
        "\n\n#a table\nw,h=(2, (((1+w0)))*+3)#   twice\nk=w0\n\n\n\ndef legs ( a , b = 2 ) :\n  pass\n"
        "  leg(size=(a,b,1),at=(1,\n # inside\n\n  2,3)) # at the end\n\n  # of the block\n# below it\n"
        "legs(w,b=h)\nlegs(b=k,a=h)"
    )
    with pytest.raises(ProgramError, match="unknown name 'w0'"):
        parse(loose)
    assert format_program(parse("w0 = 1\n" + loose.replace("  pass\n", ""))) == (
        "w0 = 1\n\n# a table\nw, h = 2, (1 + w0) * 3  # twice\nk = w0\n\ndef legs(a, b=2):\n"
        "    leg(at=(1, 2, 3), size=(a, b, 1))  # inside  at the end\n\n    # of the block\n# below it\n"
        "legs(a=w, b=h)\nlegs(a=h, b=k)\n"
    )


def test_what_a_text_says_is_kept_only_where_it_says_more_than_its_statements() -> None:
    assert parse(f"# one leg\n{LEG.replace('w', '4')}  # this one").source is None
    assert parse(LEG.replace("w", "2 + 2")).source is not None


@given(st.integers(0, 1 << 30))
def test_written_programs_survive_as_text_and_as_json(seed: int) -> None:
    program = written_program(seed)
    assert repr(parse(format_program(program))) == repr(program)
    assert repr(program_from_json(program_to_json(program))) == repr(program)


@pytest.mark.nightly
@pytest.mark.parametrize("thousand", range(100))
def test_many_written_programs_survive_as_text(thousand: int) -> None:
    for seed in range(1000 * thousand, 1000 * (thousand + 1)):
        program = written_program(seed)
        assert parse(format_program(program)) == program


@pytest.mark.parametrize(
    "text", ["a - (b - c) - a", "a / (b * c) * -a", "-(a + b) / -a", "(a + b) * (a - -2)", "--a - -b", "2 - a * 0.1"]
)
def test_expressions_have_as_many_parentheses_as_they_need(text: str) -> None:
    scope = {"a": 3.0, "b": 5.0, "c": -7.0}
    line = f"a, b, c = 3, 5, -7\ntop_square(at=({text}, b, c), thickness=1, half=1)"
    (drawn,) = parse(line).body
    assert parse(line).source.lines[1].values[0].at(scope) == pytest.approx(eval(text, scope))
    assert drawn.values[0] == pytest.approx(eval(text, scope))
    assert str(parse(line).source.lines[1].values[0]) == text


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


def function(*body: str, head: str = "def legs(w):") -> str:
    return "\n".join([head, *(f"    {line}" for line in body), ""])


@pytest.mark.parametrize(
    ("text", "line", "column", "words", "hint"),
    [
        ("w = 1 / 0\n" + LEG, 1, 5, "1 / 0 divides by zero", "another number"),
        (
            "a, w = 2, 1\nn = w / (a - 2)\n" + LEG.replace("w", "n"),
            2,
            5,
            r"w / \(a - 2\) divides by zero",
            "let a be more than 2",
        ),
        ("w = 1\nw = 2\n" + LEG, 2, 1, "'w' is declared twice", "another name"),
        (function(LEG, head="def legs(w, w):"), 1, 13, "'w' is declared twice", "another name"),
        ("w, h = 1\n" + LEG, 1, 1, "2 names for 1 number", "as many"),
        ("w = h = 1\n" + LEG, 1, 5, "two = on this line", "then the other"),
        ("w[0] = 1\n" + LEG, 1, 1, r"w\[0\] is not a name", "name = number"),
        ("w = 2 ** 3\n" + LEG, 1, 5, "not a number", r"\+ - \* /"),
        ("w = max(1, 2)\n" + LEG, 1, 5, "not a number", r"\+ - \* /"),
        ("width = 1\n" + LEG.replace("w", "widht + width"), 2, 31, "unknown name 'widht'", "did you mean width"),
        (LEG + "\nw = 1", 1, 31, "unknown name 'w'", "declare it above"),
        ("w = w + 1\n" + LEG, 1, 5, "unknown name 'w'", "declare it above"),
        ("w = 2.5\nfor i in translate(w, by=(0, 0, 1)):\n    pass", 2, 20, "count of translate is 2.5", "whole"),
        ("w = 1e20\nfor i in translate(w, by=(0, 0, 1)):\n    pass", 2, 20, "end of exact whole numbers", "whole"),
        ("w = 3e38\n" + LEG.replace("w", "w * 2"), 2, 31, "too large", "numbers go"),
        (
            "for i in translate(2, by=(0, 0, 1)):\n    " + LEG.replace("w", "i"),
            2,
            35,
            "it is the variable of a loop",
            "",
        ),
        ("w = 1\nfor w in translate(2, by=(0, 0, 1)):\n    " + LEG, 2, 5, "the variable w", "such as i"),
        ("for i in translate(2, by=(0, 0, 1)):\n    w = 1\n    " + LEG, 2, 5, "inside a loop", "above it"),
        ("leg = 1\n" + LEG.replace("w", "leg"), 1, 1, "'leg' is a word of the language", "another name"),
        (
            "seat = 1\nseat(box(at=(1, 2, 3), size=(1, 1, seat)))",
            1,
            1,
            "'seat' is a word of the language",
            "another name",
        ),
        ("legs = 1\n" + function(LEG) + "legs(w=legs)", 2, 1, "'legs' has a meaning already", "another name"),
        (function(LEG) + "legs()", 3, 1, "legs needs w", r"write legs\(w=_\)"),
        (function(LEG) + "legs(1, 2)", 3, 9, "legs takes 1 numbers, not 2", "leave"),
        (function(LEG) + "legs(1, w=2)", 3, 9, "w of legs is given twice", "leave one"),
        (function(LEG) + "legs(h=2)", 3, 6, "legs has no parameter 'h'", r"legs\(w=_\)"),
        (function(LEG) + "legs(**w)", 3, 6, r"no parameter '\*\*'", "w"),
        (function(LEG) + "lgs(w=2)", 3, 1, "unknown statement 'lgs'", "did you mean legs"),
        (function(LEG) + "for i in legs(w=2):\n    pass", 3, 10, "unknown loop 'legs'", "translate"),
        (function(LEG, "legs(w=w)"), 3, 5, "legs calls itself", "loop"),
        ("legs(w=1)\n" + function(LEG), 1, 1, "defined further down", "above"),
        (function(LEG) + function(LEG), 3, 1, "'legs' has a meaning already", "another name"),
        (function(LEG, head="def leg(w):"), 1, 1, "'leg' has a meaning already", "another name"),
        (function(LEG, head="def rotate(w):"), 1, 1, "'rotate' has a meaning already", "another name"),
        (function(LEG, head="def rail(w):"), 1, 1, "'rail' has a meaning already", "another name"),
        (function(LEG, "def other(w):", "    " + LEG), 3, 5, "a function is defined inside another block", "top"),
        (function(LEG, head="def legs(*w):"), 1, 1, "parameters are name or name=number", "remove"),
        (function(LEG, head="def legs(w: float):"), 1, 1, "parameters are name or name=number", "remove"),
        (function(LEG, head="@legs\ndef legs(w):"), 2, 1, "parameters are name or name=number", "remove"),
        (function(LEG, head="def legs(w=h):"), 1, 12, "unknown name 'h'", "declare it above: h"),
        (function(LEG) + "legs(w=h)", 3, 8, "unknown name 'h'", "declare it above: h"),
        ("w = 1" + " + 1" * 100 + "\n" + LEG, 1, 5, "more than 64 levels", "a name of its own"),
    ],
)
def test_mistakes_point_at_their_place(text: str, line: int, column: int, words: str, hint: str) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        parse(text)
    assert (caught.value.line, caught.value.column) == (line, column)
    with pytest.raises(ProgramError, match=f"hint:.*{hint}"):
        parse(text)


def tower(levels: int, calls: int) -> str:
    text = function(LEG, head="def f0(w):")
    for level in range(1, levels):
        text += function(*[f"f{level - 1}(w=w)"] * calls, head=f"def f{level}(w):")
    return text + f"f{levels - 1}(w=1)\n"


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
        Assignment((("long", 4.0),)),
        Function("upright", (("at", None),), (Draw("leg", (Name("at"), 0.0, 0.0, long, 1.0, 1.0)),)),
        Call("upright", (("at", -long / 2),)),
        Comment(),
    )
    program = evaluated(Source(lines))
    assert program.body == (Draw("leg", (-2.0, 0.0, 0.0, 4.0, 1.0, 1.0)),)
    assert parse(format_program(program)) == program
    with pytest.raises(ShapeProgError, match="upright needs at"):
        evaluated(Source((*lines[:-2], Call("upright", ()))))
    with pytest.raises(ShapeProgError, match="has 1 numbers instead of 6"):
        evaluated(Source((lines[3], Draw("leg", (long,)))))
    with pytest.raises(ShapeProgError, match="undefined function 'posts'"):
        evaluated(Source((Call("posts", ()),)))
    with pytest.raises(ShapeProgError, match="cannot be printed"):
        format_program(evaluated(Source((Comment("a\nleg()"), *lines))))


def test_everything_that_works_on_shapes_takes_programs_with_names() -> None:
    program = parse(CHAIR)
    plain = Program(program.body)
    assert sp.unroll(program).centre.tolist() == sp.unroll(plain).centre.tolist()
    assert (program.size, program.statements, program.blocks) == (plain.size, plain.statements, plain.blocks)
    assert program.snap() == plain.snap()


@pytest.mark.parametrize("suffix", [".shape", ".json"])
def test_files_keep_programs_as_they_are_written_and_their_frame(tmp_path: Path, suffix: str) -> None:
    text = "# one leg\nthick = 2\nleg(at=(-8, -thick, 0), size=(12, thick, thick))\n"
    program, frame = parse(text), sp.Frame(0.25, (1.0, 2.0, 3.0))
    sp.save(program, tmp_path / f"chair{suffix}", frame)
    assert sp.load_with_frame(tmp_path / f"chair{suffix}") == (program, frame)
    sp.save(*sp.load_with_frame(tmp_path / f"chair{suffix}")[:1], tmp_path / "again.shape", frame)
    assert (tmp_path / "again.shape").read_text().count("frame:") == 1
    assert sp.load(tmp_path / "again.shape") == program
