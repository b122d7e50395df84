"""Mistakes in program text point at their place and propose a cure; the words are pinned."""

from __future__ import annotations

import json

import pytest

from shapeprog.errors import InputError, ProgramError, ShapeProgError
from shapeprog.formats.json_form import program_from_json
from shapeprog.formats.parts import parts
from shapeprog.language import Draw, Language, Loop, Program, decode, encode, unroll, using
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program

LEG = "leg(at=(1, 2, 3), size=(1, 2, 3))"
SIZE = "width, depth, height = 4, 4, 4"

PINNED = [
    (
        "legg(at=(1, 2, 3), size=(1, 2, 3))",
        "t.shape, line 1, column 1: unknown statement 'legg'\n"
        "  legg(at=(1, 2, 3), size=(1, 2, 3))\n"
        "  ^\n"
        "  hint: did you mean leg? A statement of your own needs --with, in Python sp.load_statements.",
    ),
    (
        f"{LEG}\nleg(at=(1, 2, 3), sise=(1, 2, 3))",
        "t.shape, line 2, column 19: leg has no parameter 'sise'\n"
        "  leg(at=(1, 2, 3), sise=(1, 2, 3))\n"
        "                    ^\n"
        "  hint: did you mean size?",
    ),
    (
        "leg(at=(1, 2, 3))",
        "t.shape, line 1, column 1: leg needs size\n"
        "  leg(at=(1, 2, 3))\n"
        "  ^\n"
        "  hint: write leg(at=(_, _, _), size=(_, _, _))",
    ),
    (
        "leg(at=(1, 2), size=(1, 2, 3))",
        "t.shape, line 1, column 8: at of leg takes 3 numbers, not 2\n"
        "  leg(at=(1, 2), size=(1, 2, 3))\n"
        "         ^\n"
        "  hint: write at=(_, _, _)",
    ),
    (
        f"for i in translate(2.5, by=(0, 0, 1)):\n    {LEG}",
        "t.shape, line 1, column 20: count of translate is 2.5, but must be whole\n"
        "  for i in translate(2.5, by=(0, 0, 1)):\n"
        "                     ^\n"
        "  hint: it takes whole numbers from 0 to 64",
    ),
    (
        f"for i in translate(1e9, by=(0, 0, 1)):\n    {LEG}",
        "t.shape, line 1, column 20: count of translate is 1000000000, beyond 16777216, "
        "the end of exact whole numbers\n"
        "  for i in translate(1e9, by=(0, 0, 1)):\n"
        "                     ^\n"
        "  hint: it takes whole numbers from 0 to 64",
    ),
    (
        f"for i in range(4):\n    {LEG}",
        "t.shape, line 1, column 10: unknown loop 'range'\n"
        "  for i in range(4):\n"
        "           ^\n"
        "  hint: known: translate, rotate, mirror, rotate_about, tilt_about",
    ),
    (
        "translate(2, by=(0, 0, 1))",
        "t.shape, line 1, column 1: translate is a loop, not a drawing statement\n"
        "  translate(2, by=(0, 0, 1))\n"
        "  ^\n"
        "  hint: write for i in translate(_, by=(_, _, _)):",
    ),
    (
        "leg(at=(1, 2, 3), size=(1, 2, width))",
        "t.shape, line 1, column 31: size of leg holds width, which is not a number\n"
        "  leg(at=(1, 2, 3), size=(1, 2, width))\n"
        "                                ^\n"
        "  hint: write numbers such as 4 or -2.5: names and expressions are for parts placed by keywords",
    ),
    (
        "leg(at=(1, 2, 1e39), size=(1, 2, 3))",
        "t.shape, line 1, column 15: at of leg holds 1e39, which is too large\n"
        "  leg(at=(1, 2, 1e39), size=(1, 2, 3))\n"
        "                ^\n"
        "  hint: numbers end at 3.4028235e+38",
    ),
    (
        "height += 4",
        "t.shape, line 1, column 1: this is no statement of a program\n"
        "  height += 4\n"
        "  ^\n"
        "  hint: use a part, a loop, with inside(...), a function or name = number",
    ),
    (
        "leg(1, size=(1, 2, 3))",
        "t.shape, line 1, column 5: leg takes nothing without a name\n"
        "  leg(1, size=(1, 2, 3))\n"
        "      ^\n"
        "  hint: write leg(at=(_, _, _), size=(_, _, _))",
    ),
    (
        "for i in translate(2, by=(0, 0, 1)):\n\tleg()",
        "t.shape, line 2, column 1: this line is indented with a tab\n   leg()\n  ^\n  hint: indent with four spaces",
    ),
    (
        "'\N{LATIN SMALL LETTER E WITH ACUTE}'; legg()",
        "t.shape, line 1, column 1: this is no statement of a program\n"
        "  '\N{LATIN SMALL LETTER E WITH ACUTE}'; legg()\n"
        "  ^\n"
        "  hint: use a part, a loop, with inside(...), a function or name = number",
    ),
]


@pytest.mark.parametrize(("text", "message"), PINNED, ids=[message.split(": ")[1] for _, message in PINNED])
def test_messages(text: str, message: str) -> None:
    with pytest.raises(ProgramError) as caught:
        parse(text, "t.shape")
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        (f"{LEG}\n\nleg(at=(1, 2, 3), size=(1, 2, 3)", 3, 4, "never closed"),
        (f"{LEG}\n{LEG[:-1]}, at=(1, 2, 3))", 2, 35, "given twice"),
        (f"for i in translate(2, count=2, by=(0, 0, 0)):\n  {LEG}", 1, 23, "given twice"),
        (f"for i in translate(2, (0, 0, 0)):\n  {LEG}", 1, 23, "only its count"),
        (f"for i in translate(2, by=(0, 0, 0)):\n  {LEG}\nelse:\n  {LEG}", 4, 3, "no else"),
        (f"for i, j in translate(2, by=(0, 0, 0)):\n  {LEG}", 1, 5, "one variable"),
        ("for i in translate(2, by=(0, 0, 0)):\n", 1, 37, "expected an indented block"),
        (f"for i in {LEG}:\n    pass", 1, 10, "not a loop"),
        ("leg", 1, 1, "no statement"),
        ("leg.__class__()", 1, 1, "not declared"),
        ("__import__('os').system('x')", 1, 1, "the size is not declared"),
        ("leg(**{}, at=0)", 1, 5, "no parameter"),
        ("leg(*a, at=0)", 1, 5, "without a name"),
        ("leg(at=[1, 2, 3], size=(1, 2, 3))", 1, 8, "not a number"),
        ("leg(at=(1, 2, True), size=(1, 2, 3))", 1, 15, "not a number"),
        ("leg(at=(1, 2, 3j), size=(1, 2, 3))", 1, 15, "not a number"),
        ("leg(at=(1, 2, ~3), size=(1, 2, 3))", 1, 15, "not a number"),
        ("leg(at=(1, 2, 1 ** 1), size=(1, 2, 3))", 1, 15, "not a number"),
        ("leg(at=(1, 2, nan), size=(1, 2, 3))", 1, 15, "holds nan, which is not a number"),
        ("leg(at=(1, 2, 1e999), size=(1, 2, 3))", 1, 15, "too large"),
        (f"leg(at=(1, 2, 1{'0' * 400}), size=(1, 2, 3))", 1, 15, "too large"),
        (f"leg(at=(1, 2, 1{'0' * 5000}), size=(1, 2, 3))", 1, 1, "invalid syntax"),
        ("top_square(at=(1, 2, 3), thickness=(1,), half=2)", 1, 36, "1 number, not a group"),
        ("leg(at='\N{SNOWMAN}', foo=(1, 2, 3))", 1, 8, "'\N{SNOWMAN}', which is not a number"),
        ("leg(at=(1,2,3), \N{LATIN SMALL LETTER E WITH ACUTE}=1, b=2)", 1, 17, "no parameter"),
        ("leg(\0)", 1, 5, "null byte"),
        ("\n\ud800", 2, 1, "half a character"),
        (f"leg({'-' * 100000}1)", 1, 1, "too deeply"),
        ("1" + "+1" * 100000, 1, 1, "too deeply|no statement"),  # Python 3.10 reads it
        ("leg(" * 300 + ")" * 300, 1, 804, "too many nested"),
        ("import os", 1, 1, "no statement"),
        ("pass", 1, 1, "not declare its size"),
        ("# unit: cm\n", 1, 1, "not declare its size"),
        (f"{SIZE}\n    box()", 2, 5, "unexpected indent"),
        (f"{SIZE}\nfor _ in mirror(x=0):\nbox()", 3, 1, "expected an indented block"),
        (f"{SIZE}\nfor _ in mirror(x=0):\n    box()\n  box(left=0)", 4, 3, "unindent.*\n.*\n {4}\\^"),
        (f"{SIZE}\nbox(width=leg_width)", 2, 11, "did you mean width\\? or declare it above: leg_width = "),
        (f"{SIZE}\nbox(width=q)\nq = 3", 2, 11, "hint: declare it above: q = "),
        ("width, depth, height = 4", 1, 1, "3 names for 1 number\n"),
        ("width, = 4, 5", 1, 1, "1 name for 2 numbers\n"),
    ],
)
def test_places(text: str, line: int, column: int, words: str) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        parse(text)
    assert (caught.value.line, caught.value.column) == (line, column)
    assert len(caught.value.source) <= 200
    str(caught.value).encode()


def nested(depth: int) -> str:
    heads = ("    " * level + "for i in translate(1, by=(0, 0, 0)):\n" for level in range(depth))
    return "".join(heads) + "    " * depth + LEG


def test_loops_nest_to_a_stated_depth() -> None:
    program = parse(nested(64))
    assert parse(format_program(program)) == program
    for depth in (65, 99, 101, 300):
        with pytest.raises(ProgramError):
            parse(nested(depth))
    deeper = Program((Loop("translate", (1, 0, 0, 0), program.body),))
    with pytest.raises(ShapeProgError, match="more than 64 deep"):
        format_program(deeper)


def test_programs_made_wrongly_are_refused_in_words() -> None:
    with pytest.raises(ShapeProgError, match="unknown statement 'stool'"):
        format_program(Program((Draw("stool", ()),)))
    with pytest.raises(ShapeProgError, match="has 2 numbers instead of 6"):
        format_program(Program((Draw("leg", (1.0, 2.0)),)))
    for use in (encode, unroll, parts):
        with pytest.raises(ShapeProgError, match="unknown statement 'stool'"):
            use(Program((Draw("stool", ()),)))
        with pytest.raises(ShapeProgError, match="has 2 numbers instead of 6"):
            use(Program((Draw("leg", (1.0, 2.0)),)))
    with using(Language()), pytest.raises(ProgramError, match="unknown statement 'leg'"):
        parse(LEG)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ([], "holds no program"),
        ({"format": "other"}, "holds no program"),
        ({"version": 5}, "version 5 of the program format is not read"),
        (
            {"version": 3, "program": []},
            "version 3 of the program format is not read, only version 4\n.*infer the shape again",
        ),
        ({}, "text: None is not a string"),
        ({"text": ["leg()"]}, "is not a string"),
    ],
)
def test_wrong_json_is_refused_in_words(content: object, words: str) -> None:
    if isinstance(content, dict):
        content = {"format": "shapeprog", "version": 4, **content}
    with pytest.raises(InputError, match=words):
        program_from_json(json.dumps(content))


def test_mistakes_in_the_text_of_json_have_their_place_in_it() -> None:
    text = "width, depth, height = 4, 4, 4\nleg(left=0, widht=2)\n"
    with pytest.raises(
        ProgramError, match=r"a\.json: text, line 2, column 13: .*\n.*\n.*\n.*did you mean width"
    ) as caught:
        program_from_json(json.dumps({"format": "shapeprog", "version": 4, "text": text}), "a.json")
    assert (caught.value.line, caught.value.column) == (2, 13)


def test_broken_json_is_refused_in_words() -> None:
    with pytest.raises(ProgramError, match="not JSON") as caught:
        program_from_json('{"format":\n  oops}', "p.json")
    assert (caught.value.line, caught.value.column) == (2, 3)
    for text in ("[" * 100000, '{"a": NaN}', '{"a": 1, "a": 2}', '{"a": 1' + "0" * 5000 + "}"):
        with pytest.raises(ShapeProgError):
            program_from_json(text)


@pytest.mark.parametrize("error", [ShapeProgError, InputError, ProgramError])
@pytest.mark.parametrize(
    "odd", ["\x1b[31m", "\t", "\r", "\0", "\x9b", "\N{RIGHT-TO-LEFT OVERRIDE}", "\u2028", "\ud800"]
)
def test_what_cannot_be_printed_is_told_as_its_escape(error: type[ShapeProgError], odd: str) -> None:
    told = error(f"no \N{GREEK SMALL LETTER PI} is called a{odd}b", hint=f"write {odd}")
    assert odd not in str(told)
    assert f"a{odd.encode('unicode_escape').decode()}b" in told.message
    assert "\N{GREEK SMALL LETTER PI}" in str(told)


@pytest.mark.parametrize("error", [ShapeProgError, InputError, ProgramError])
def test_the_middle_of_a_message_that_repeats_something_endless_is_left_out(error: type[ShapeProgError]) -> None:
    told = error(f"a.off announces {'9' * 4000} faces", hint=f"write {'a' * 10**6} again")
    assert told.message.startswith("a.off announces 999")
    assert told.message.endswith("999 faces")
    assert told.hint.endswith("a again")
    assert len(str(told)) < 2000


def test_lines_and_names_of_texts_command_no_terminal() -> None:
    told = ProgramError("x", source="a\x1bb", name="c\x1bd")
    assert str(told) == "c\\x1bd, line 1, column 1: x\n  a b\n  ^"


def test_numbers_without_names_behind_those_with_names_are_told_in_our_words() -> None:
    with pytest.raises(ProgramError, match="a number without a name follows one with a name"):
        parse("leg(at=(1, 2, 3), 5)")


def test_a_list_of_programs_has_no_text() -> None:
    programs = decode(encode(parse("leg(at=(1, 2, 3), size=(1, 1, 1))")))
    with pytest.raises(ShapeProgError, match="is no program") as caught:
        format_program(programs)  # type: ignore[arg-type]
    assert "sp.decode returns several" in caught.value.hint


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("leg(left=3 1/2, width=2)", "write 3.5 for 3 1/2"),
        ("leg(width=2, left=1, height=10 3 / 16)", "write 10.1875 for 10 3 / 16"),
        ("thickness = 0 3/4", "write 0.75 for 0 3/4"),
        ("leg(left=3 1/2, width=2)  # 7 1/4", "write 3.5 for 3 1/2"),
    ],
)
def test_mixed_fractions_are_told_as_decimals(line: str, hint: str) -> None:
    with pytest.raises(ProgramError) as error:
        parse(f"width, depth, height = 8, 8, 24\n{line}\n")
    assert (error.value.line, error.value.hint) == (2, hint)


@pytest.mark.parametrize("line", ["thickness = 12.5 1/2", "leg2 1/2", "leg(left=3 width=2)  # 3 1/2"])
def test_other_mistakes_are_not_taken_for_mixed_fractions(line: str) -> None:
    with pytest.raises(ProgramError) as error:
        parse(f"width, depth, height = 8, 8, 24\n{line}\n")
    assert " for " not in error.value.hint.replace("for _ in", "")


@pytest.mark.parametrize("comment", ["# unit: cm", "# Units = cm"])
@pytest.mark.parametrize("line", ["width, depth, height = 8, 8, 24", "leg(width=2)", ""])
def test_a_unit_that_is_not_at_the_top_has_a_warning(line: str, comment: str) -> None:
    head = "width, depth, height = 8, 8, 24\nleg(width=2)\n"
    text = head.replace(line, f"{line}  {comment}") if line else f"{head}{comment}\n"
    (warning,) = parse(text).source.warnings
    assert "this comment sets no unit; write # unit: cm above all other lines" in warning
    assert not parse(f"# unit: cm\n{text}").source.warnings
    assert not parse(f"{head}rail(width=1)  # unit: length of a unit\n").source.warnings
