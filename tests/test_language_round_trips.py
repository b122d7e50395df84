"""Laws: whatever is written reads back exactly, in every form, for every declared statement."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch
from declared import LANGUAGE, LOOPS, STATEMENTS, name_of, numbers, programs
from hypothesis import given
from hypothesis import strategies as st

import shapeprog as sp
from shapeprog.data.random import outside_published, random_program
from shapeprog.formats import load, save
from shapeprog.formats.json_form import program_from_json, program_to_json
from shapeprog.language import Draw, Loop, Program, Statement, decode, encode, using
from shapeprog.language.parameters import shortest, to_float32
from shapeprog.language.parser import parse
from shapeprog.language.placement import BETWEEN, BOX, GROUPS, IN_BOX
from shapeprog.language.printer import format_program
from shapeprog.view.manual import manual, page


@pytest.fixture(autouse=True)
def everything_declared() -> Iterator[None]:
    with using(LANGUAGE):
        yield


@pytest.mark.parametrize("declared", [*STATEMENTS, *LOOPS], ids=name_of)
@given(data=st.data())
def test_each_statement_survives_every_form(declared: Statement, data: st.DataObject) -> None:
    values = data.draw(numbers(declared))
    node = Loop(declared.name, values, (Draw("leg", (1.0,) * 6),)) if declared.is_loop else Draw(declared.name, values)
    survives(Program((node,)))


@given(programs())
def test_programs_survive_every_form(program: Program) -> None:
    survives(program)


def survives(program: Program) -> None:
    """Exactly, the sign of zero included: hence the comparison of representations."""
    assert repr(parse(format_program(program)).body) == repr(program.body)
    assert repr(program_from_json(program_to_json(program)).body) == repr(program.body)
    flat = program.flat()
    assert repr([decoded.body for decoded in decode(encode(program))]) == repr([flat.body])


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_shortest_decimals_are_exact(value: float) -> None:
    text = shortest(value)
    assert to_float32(float(text)) == value
    assert math.copysign(1, float(text)) == math.copysign(1, value)
    assert len(text) <= len(repr(value)) + 4


def test_a_program_that_was_set_reads_back_with_its_text_in_a_grid_of_its_own(tmp_path: Path) -> None:
    parsed = parse("width, depth, height = 60, 40, 80\nleg(left=0, width=4, height=height - 5)\n")
    assert parse(format_program(parsed)) == parsed
    frame, changed = sp.Frame(2.0, (1.0, 2.0, 3.0)), sp.set(parsed, height=120)
    save(changed, tmp_path / "a.shape", frame)
    again = sp.load(tmp_path / "a.shape")
    assert again != changed
    assert format_program(again) == format_program(changed)
    before, after = (place.to_world(sp.unroll(each).centre) for each, place in ((changed, frame), (again, again.frame)))
    torch.testing.assert_close(before, after, atol=1e-5, rtol=0)


def test_numbers_are_printed_as_people_write_them() -> None:
    written = [16.0, -0.0, 0.1, 1e-40, -2.5, 16777216.0, 1e20, 3.4028234663852886e38]
    assert [shortest(to_float32(value)) for value in written] == [
        "16", "-0.0", "0.1", "1e-40", "-2.5", "16777216", "1e+20", "3.4028235e+38",
    ]  # fmt: skip


def test_canonical_text_is_pinned() -> None:
    text = (
        "top_rectangle(at=(4, 0, 0), thickness=2, half=(9, 11))\n"
        "for i in translate(2, by=(0, 0, 18)):\n"
        "    for j in translate(2, by=(0, 14.5, 0)):\n"
        "        leg(at=(-12, -8, -10), size=(16, 2, 2))\n"
        "    for j in rotate(4, step=1):\n"
        "        base_cross(at=(-0.0, 0, 0), thickness=1, length=6, turn=-1)\n"
    )
    loose = text.replace(", ", " ,").replace("translate(2", "translate(count=+2").replace("j in", "whatever in")
    assert format_program(parse(f"# a table\n\n{loose}  # the end")) == text
    assert format_program(Program()) == ""
    assert parse("for i in translate(2, by=(0, 0, 1)):\n    pass\n").body[0] == Loop("translate", (2, 0, 0, 1), ())


@pytest.mark.parametrize("declared", [*STATEMENTS, *LOOPS], ids=name_of)
def test_the_manual_shows_text_that_parses(declared: Statement) -> None:
    shown = page(declared)
    assert declared.doc.replace("``", "") in shown
    assert all(parameter.name in shown for parameter in declared.parameters)
    filled = " ".join(declared.signature.replace("(_", "(1").replace("=_", "=1").replace(" _", " 1").split())
    assert parse(filled + ("\n    pass" if declared.is_loop else "")).statements == 1
    assert manual(declared.name).endswith(shown)
    assert declared.name in manual()


def test_the_manual_has_every_word_of_placed_text_and_comes_first_with_it() -> None:
    for name, needs in (*IN_BOX.items(), *BETWEEN.items()):
        shown = manual(name)
        assert shown.startswith(f"{name}(")
        assert all(re.search(rf"^  {word}\b|^  left .*\b{word}\b", shown, re.MULTILINE) for word in needs.required)
        assert all(re.search(rf"\b{word}\b", shown) for word in needs.optional)
        if name in IN_BOX and name != "taper":  # whose radius is two numbers
            assert parse(f"width, depth, height = 40, 40, 40\n{shown.splitlines()[0].replace('_', '1')}").size == 1
    for name, group in GROUPS.items():
        assert manual(name).startswith(group.example)
        assert all(re.search(rf"\b{word}\b", manual(name)) for word in group.keywords)
        assert group.example in manual()
        inner = "\n    leg(height=2)\n"
        assert parse(f"width, depth, height = 40, 40, 40\n{group.example.replace('...', '5')}{inner}").blocks == 1
    for word in (*BOX, "gap", "tilt", "radius"):
        assert word in manual(word)
    assert manual().index("Solids") < manual().index("Roles") < manual().index("Statements in cells")


def test_random_programs_stay_in_range_and_repeat_with_their_seed() -> None:
    def sample(**options: bool) -> Program:
        return random_program(torch.Generator().manual_seed(5), blocks=60, **options)

    program = sample()
    assert program == sample()
    assert program.blocks == 60
    assert not all(value == round(value) for node in program.walk() for value in node.values)
    for node in [*program.walk(), *sample(whole=True).walk()]:
        for value, quantity in zip(node.values, LANGUAGE[node.name].quantities, strict=True):
            assert quantity.low <= value <= quantity.high
            assert to_float32(value) == value
            assert not quantity.discrete or value == round(value)
    assert outside_published(sample(published=True)) == []
    assert outside_published(sample()) != []
    assert sample(whole=True).snap() == sample(whole=True)


def test_files(tmp_path: object) -> None:
    path = tmp_path / "x.shape"  # type: ignore[operator]
    program = random_program(torch.Generator().manual_seed(1))
    save(program, path)
    assert load(path) == program
    assert sp.load(path) == program
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert load(path) == program
    for content, words in [
        (b"leg(\xff)", "byte 4 is not UTF-8"),
        (b"legg(at=1)", "x.shape, line 1, column 1: unknown statement"),
    ]:
        path.write_bytes(content)
        with pytest.raises(sp.ShapeProgError, match=words):
            load(path)
    for place in (tmp_path, path / "y", tmp_path / "none.shape"):  # type: ignore[operator]
        with pytest.raises(sp.InputError):
            load(place)
        with pytest.raises(sp.OutputError):
            save(program, place / "z" / "x.shape")
    with pytest.raises(sp.ShapeProgError, match="too large"):
        save(Program((Draw("leg", (math.nan,) * 6),)), path)


def test_a_seed_stands_for_a_new_generator() -> None:
    assert random_program(3) == random_program(torch.Generator().manual_seed(3)) != random_program(4)
