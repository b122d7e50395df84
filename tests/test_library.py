"""Libraries of functions: what is learned from programs, and programs written with them."""

from __future__ import annotations

import re
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest
import torch
from commands import Run

from shapeprog import inference
from shapeprog.data.synthetic.furniture import furniture
from shapeprog.errors import InputError, OutputError
from shapeprog.formats.files import load
from shapeprog.language.ast import Call, Source
from shapeprog.language.convert import placed
from shapeprog.language.dimensions import in_unit
from shapeprog.language.expression import value_at
from shapeprog.language.named import inline, names
from shapeprog.language.named import set as set_numbers
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program, source_of
from shapeprog.language.program import Draw, Loop, Program
from shapeprog.language.unit import Unit
from shapeprog.language.unroll import unroll
from shapeprog.library import Library, joined, learn, library_of, load_library, save_library, with_library
from shapeprog.library.blocks import Kind, blocks_of
from shapeprog.library.groups import PARAMETERS
from shapeprog.library.length import statements
from shapeprog.library.matching import TOLERANCE
from shapeprog.library.words import plural

BOARD = "width, depth, height = 1, 1, 1\n"
"""The size that a library declares, as any placed text does."""

SHELVES = """\
# such as shelves(height=16, depth=8, width=12, count=4, thick=1)
def shelves(thick, count=2):
    for _ in row(count, last=at(top=0)):
        shelf(height=thick)
"""

POSTS = """\
def posts(thick):
    for _ in mirror(x=0, y=0):
        box(left=0, width=thick, front=0, depth=thick)
"""

TABLE = """\
width, depth, height = 20, 12, 9
thick = 1.5
for _ in mirror(x=0, y=0):
    leg(left=0, width=thick, front=0, depth=thick, top=thick)
top(top=0, height=thick)
"""


def away(one: Program, two: Program) -> float:
    """The largest difference between the distances of points to two programs."""
    points = (torch.rand(2000, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) - 0.5) * 26
    return float((unroll(one).distance(points) - unroll(two).distance(points)).abs().max())


def calls(program: Program) -> list[Call]:
    return [line for line in source_of(program).walk() if isinstance(line, Call)]


def plain_arguments(program: Program, call: Call) -> dict[str, float]:
    numbers = source_of(program).evaluated_numbers()
    return {name: value_at(value, numbers) for name, value in call.arguments}


def library(*texts: str) -> Library:
    return library_of(parse("\n".join([BOARD, *texts])))


@pytest.mark.parametrize("number", range(0, 48, 4))
def test_a_program_written_with_a_library_draws_the_same_in_fewer_statements(number: int) -> None:
    program = furniture(number, seed=5)
    written = with_library(program, load_library())
    assert away(program, written) <= 3**0.5 * TOLERANCE
    assert sorted(chain[-1].word for chain in program.chains) == sorted(chain[-1].word for chain in written.chains)
    assert (statements(written) < statements(program)) == bool(calls(written))
    assert source_of(parse(format_program(written))).lines == source_of(written).lines
    assert with_library(written, load_library()) == written


def test_what_is_drawn_alike_is_alike_however_it_is_written() -> None:
    size = "size=(8, 1, 1)"
    texts = [
        f"for i in mirror(side):\n    for j in mirror(depth):\n        leg(at=(0, 3, 9), {size})",
        f"for i in translate(2, by=(0, -7, 0)):\n    for j in mirror(side):\n        leg(box(at=(0, 3, -10), {size}))",
        f"for i in mirror(depth):\n    for j in translate(2, by=(0, 0, 19)):\n        leg(at=(0, -4, -10), {size})",
    ]
    found = [next(blocks_of(parse(text.replace("leg(box", "leg(box")).chains[0])) for text in texts]
    assert {each.kind for each in found} == {found[0].kind}
    assert all(each.values == pytest.approx(found[0].values) for each in found)


def test_arguments_are_expressions_of_the_names_of_the_program() -> None:
    program = parse(TABLE)
    written = with_library(program, library(POSTS))
    (call,) = calls(written)
    assert call.role == "leg"
    assert {name: str(value) for name, value in call.arguments} == {"top": "thick", "thick": "thick"}
    assert [each.name for each in names(written)] == [each.name for each in names(program)]
    for name in ("width", "depth", "height", "thick"):
        assert away(set_numbers(program, {name: 7.0}), set_numbers(written, {name: 7.0})) < 1e-6


def test_names_that_nothing_uses_any_more_are_left_out() -> None:
    arms = library("def arms():\n    for _ in mirror(x=0):\n        arm(left=0, width=1)")
    text = "width, depth, height = 24, 9, 8\n{}\nfor _ in mirror(x=0):\n    arm(left=0, width=b - 2, height=a)\n"
    program = parse(text.format("a, b = 2, 3"))
    assert [each.name for each in names(with_library(program, arms))] == ["width", "depth", "height", "a"]
    both = with_library(parse(text.format("a, b = 2, 3\nseat(height=b)")), arms)
    assert [each.name for each in names(both)] == ["width", "depth", "height", "a", "b"]


@pytest.mark.parametrize("count", [2, 3, 7])
def test_one_function_serves_any_count_and_says_defaults_only_where_they_differ(count: int) -> None:
    step = 15 / (count - 1)
    text = f"for i in translate({count}, by=({step}, 0, 0)):\n    shelf(box(at=(-8, -4, -6), size=(1, 8, 12)))\n"
    (call,) = calls(with_library(parse(text), library(SHELVES)))
    said = {name: value for name, value in call.arguments if name in ("count", "thick")}
    assert said == ({"thick": 1} if count == 2 else {"thick": 1, "count": count})


@pytest.mark.parametrize("order", ["high, thick", "thick, high"])
def test_a_function_without_an_example_is_found_whatever_the_order_of_its_parameters(order: str) -> None:
    frame = (
        f"def frame({order}):\n    for _ in mirror(x=0):\n        post(left=0, width=thick)\n    rail(height=high)\n"
    )
    text = "for i in translate(2, by=(0, 0, 17)):\n    post(box(at=(0, 0, -9), size=(9, 8, 1)))\n"
    text += "rail(box(at=(0, 0, -9), size=(3, 8, 18)))\n"
    (call,) = calls(with_library(parse(text), library(frame)))
    assert {name: value for name, value in call.arguments if name in ("high", "thick")} == {"high": 3, "thick": 1}


def test_a_loop_of_what_a_function_draws_stays_around_its_call() -> None:
    text = "for i in mirror(depth, at=9):\n    for j in mirror(side):\n        for k in mirror(depth):\n"
    text += "            leg(at=(0, 3, 9), size=(8, 1, 1))\n"
    written = with_library(parse(text), library(POSTS))
    assert format_program(written).endswith(
        "for _ in mirror(rear=13):\n    leg(posts(front=18, rear=18, top=0, height=8, thick=1))\n"
    )


def test_equal_loops_around_what_a_function_draws_become_one_loop_around_its_call() -> None:
    desk = library("def desk(thick):\n    top(top=0, height=thick)\n    side(left=0, width=thick)\n")
    text = "width, depth, height = 24, 6, 10\nstep, wide, thick = 8, 6, 1\n"
    text += "for _ in translate(3, x=step):\n    top(left=1, width=wide, top=0, height=thick)\n"
    text += "for _ in translate(3, x={}):\n    side(left=1, width=thick)\n"
    program = parse(text.format("step"))
    written = with_library(program, desk)
    assert format_program(written).endswith(
        "for _ in translate(3, x=step):\n    desk(left=1, width=wide, thick=thick)\n"
    )
    assert away(program, written) < 1e-6
    other = parse(text.format("8.2"))
    assert with_library(other, desk) == other


def test_parts_of_another_role_and_those_that_are_off_are_left_alone() -> None:
    text = "for i in translate(3, by=(7.5, 0, 0)):\n    shelf(box(at=(-8, -4, -6), size=(1, 8, 12)))\n"
    assert calls(with_library(parse(text), library(SHELVES)))
    for other in (text.replace("shelf", "drawer"), text.replace("box", "cushion")):
        program = parse(other.replace("12))", "12), edge=0.1)") if "cushion" in other else other)
        assert with_library(program, library(SHELVES)) == program


def test_several_libraries_are_one_in_which_the_first_of_a_name_counts() -> None:
    program = parse(TABLE + "for _ in row(3, last=at(top=2)):\n    shelf(width=9, bottom=1, height=0.5)\n")
    both = joined([library(POSTS), Library(Source()), library(SHELVES)])
    assert {call.name for call in calls(with_library(program, both))} == {"posts", "shelves"}
    others = library("def posts():\n    box(height=1)\ndef four():\n    posts()\ndef five():\n    box(width=1)\n")
    assert [function.name for function in joined([both, others]).functions] == ["posts", "shelves", "five"]
    assert joined([both, others]).source.functions["posts"] == both.source.functions["posts"]
    users = library(f"{POSTS}def four():\n    posts(thick=1)\n")
    assert [function.name for function in joined([library(POSTS), users]).functions] == ["posts", "four"]


def test_a_default_may_be_larger_than_the_box_that_is_tried_first() -> None:
    handle = "handle(left={0}, right={0}, front=-1, depth=1, z=0, height=1)"
    whole, inside = "width, depth, height = 24, 24, 24", "with inside(front=0, depth=1, top=0, height=8)"
    text = f"{whole}\n{inside}:\n    drawer()\n    {handle.format(10)}\n"
    front = library(f"def pull(inset=10):\n    drawer()\n    {handle.format('inset')}\n")
    assert [call.name for call in calls(with_library(parse(text), front))] == ["pull"]


def test_words_that_a_program_has_already_are_not_taken_for_functions() -> None:
    program = parse(TABLE.replace("thick", "posts"))
    assert with_library(program, library(POSTS)) == program


OTHERS = ("top", "seat", "shelf", "drawer", "door")


def planted(number: int) -> Program:
    """Two braces and a rail between them, which are told by five numbers, and a part that only this program has."""
    random = torch.rand(8, generator=torch.Generator().manual_seed(number)).tolist()
    low, tall, wide, deep, thick = (round(1 + 6 * each, 2) for each in random[:5])
    bar = Draw("bar", (-low, -deep, wide, tall, deep, wide, thick, thick, 0.0), "brace")
    body = Draw("box", (-low, -deep, -wide, thick, thick, 2 * wide), "rail")
    other = Draw("box", (tall, *(round(-9 * each, 2) for each in random[5:7]), 2.0, 5.0, 5 * random[7]), OTHERS[number])
    braces = Loop("mirror", (2.0, 2.0, 0.0), (bar,))
    return Program((other, braces, body) if number % 2 else (body, other, braces))


def test_a_function_that_is_planted_in_five_programs_is_found_with_its_relations() -> None:
    programs = [planted(number) for number in range(5)]
    found = learn(programs)
    (function,) = found.source.functions.values()
    assert {line.kind for line in Source(function.body).walk()} == {"mirror", "bar", "box"}
    assert [name for name, _ in function.parameters] == ["thickness"], "all else follows from its box"
    for program in programs:
        written = with_library(program, found)
        assert len(calls(written)) == 1
        assert statements(written) == 2
        assert away(program, written) < 3**0.5 * TOLERANCE
    assert found.comments[function.name][0] == "used 5 times, by 5 programs, such as"
    assert found.examples[function.name].name == function.name


def test_the_same_programs_give_the_same_library_and_it_comes_back_from_its_file(tmp_path: Path) -> None:
    programs = [furniture(number) for number in range(6)]
    found = learn(programs)
    assert found.functions
    assert learn(program for program in programs) == found
    assert repr(found).startswith(f"<Library of {len(found.functions)}: {found.functions[0].name}")
    assert "\n" not in repr(found)
    assert load_library(save_library(found, tmp_path / "a.shape")) == found
    assert (tmp_path / "a.shape").read_text() == f"{found}\n"
    with pytest.raises(OutputError, match="no place for a library"):
        save_library(found, tmp_path / "a.json")


def test_programs_that_share_nothing_give_an_empty_library(tmp_path: Path) -> None:
    assert learn([]).functions == ()
    with pytest.raises(OutputError, match="holds no functions"):
        save_library(learn([]), tmp_path / "a.shape")
    alone = [parse("leg(at=(0, 0, 0), size=(8, 1, 1))"), parse("seat(box(at=(0, 0, 0), size=(1, 9, 9)))"), planted(1)]
    assert learn(alone).functions == ()
    assert with_library(alone[2], learn(alone)) == alone[2]


def test_the_library_that_ships_holds_at_most_twelve_functions_each_with_a_call_that_draws() -> None:
    shipped = load_library()
    assert 1 <= len(shipped.functions) <= 12
    assert max(len(function.parameters) for function in shipped.source.functions.values()) <= PARAMETERS
    for pattern in shipped.patterns:
        assert pattern.example is not None
        program = Program(pattern.drawn(pattern.arguments))
        assert unroll(program).mask.all()
        (call,) = calls(with_library(inline(program), shipped)) or [None]
        assert call is not None, pattern.function.name


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("leg(at=(0, 0, 0), size=(1, 1, 1))", "statements outside of functions"),
        (f"{BOARD}{SHELVES}shelves(thick=0.1)", "statements outside of functions"),
        (f"{BOARD}wide = 3\n{SHELVES}", "numbers of its own"),
        ("# nothing", "holds no functions"),
    ],
)
def test_a_file_that_is_no_library_is_told_apart(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "mine.shape").write_text(text)
    with pytest.raises(InputError, match=said):
        load_library(tmp_path / "mine.shape")


def test_commands_learn_show_and_draw_libraries(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "programs"
    folder.mkdir()
    for number in range(5):
        (folder / f"{number}.shape").write_text(format_program(planted(number)))
    ended = run("library", "learn", "programs", "--out", "mine.shape", "--sheet", "mine.png")
    assert ended.code == 0, ended.err
    assert "wrote mine.shape: 1 functions from 5 programs" in ended.out
    assert (tmp_path / "mine.png").stat().st_size > 5000
    shown = run("library", "show", "mine.shape")
    assert "# shapeprog library learn programs --out mine.shape" in shown.out
    assert shown.out == (tmp_path / "mine.shape").read_text()
    assert "def left_to_right(" in run("library", "show").out
    ended = run("library", "learn", "programs/0.shape")
    assert ended.code == 2
    assert "no function shortens this program" in ended.err


def test_a_program_in_a_unit_is_written_with_a_library_and_stays_in_it() -> None:
    plain, unit = parse(TABLE), Unit("cm", 3.75)
    program = in_unit(plain, unit)
    written = with_library(program, library(POSTS))
    assert written.unit == unit
    assert written == in_unit(with_library(plain, library(POSTS)), unit)
    assert away(written, program) < TOLERANCE
    assert [each.value for each in names(written)] == [each.value for each in names(program)]
    assert with_library(program, library(SHELVES)) is program
    mixed = parse("# unit: cm\n" + TABLE + "box(tilt=thick)\n")
    assert with_library(mixed, library(POSTS)) is mixed


def test_numbers_in_a_unit_stay_round() -> None:
    chair = load(Path(__file__).parents[1] / "examples/pieces/chair.shape")
    written = with_library(chair, load_library())
    kept = {each.name: each.value for each in names(written)}
    assert {"slats": 4} | kept == {each.name: each.value for each in names(chair)}
    assert not re.search(r"\d\.\d{4}", format_program(written))


def test_a_library_is_in_no_unit() -> None:
    with pytest.raises(InputError, match="lengths are in cm of one object"):
        library_of(parse("# unit: cm\n" + BOARD + POSTS))


def test_tidy_and_infer_write_programs_with_a_library(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "posts.shape").write_text(BOARD + POSTS)
    (tmp_path / "table.shape").write_text(TABLE)
    ended = run("tidy", "table.shape", "--with", "posts.shape", "--library")
    assert ended.code == 0, ended.err
    assert "leg(posts(" in ended.out, "one's own come first"
    given = []

    def infer(shape, *, libraries, **other):
        given.extend(each.functions[0].name for each in libraries)
        return inference.Result(parse(TABLE), None, {}, "Stopped.", (), seconds=0.1)

    monkeypatch.setattr(inference, "infer", infer)
    run("export", "table.shape", "table.obj")
    ended = run("infer", "table.obj", "--no-picture", "--with", "posts.shape", "--library")
    assert ended.code == 0, ended.err
    assert given == ["posts", "left_to_right"]


GRID = """\
def boxes(levels=1, level_spacing=0, rows=1, row_spacing=0, columns=1, column_spacing=0):
    for _ in translate(levels, z=level_spacing):
        for _ in translate(rows, y=row_spacing):
            for _ in translate(columns, x=column_spacing):
                box()
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "for i in mirror(side):\n    side(box(at=(-8, -4, 5), size=(16, 8, 1)))",
            {"columns": 2, "column_spacing": 11},
        ),
        ("for i in translate(4, by=(3, 0, 0)):\n    shelf(box(at=(-8, -4, -5), size=(1, 8, 10)))", {"levels": 4}),
        (
            "for i in mirror(depth):\n    for j in mirror(side):\n        leg(at=(-8, 4, 5), size=(6, 1, 1))",
            {"rows": 2, "row_spacing": 9, "columns": 2, "column_spacing": 11},
        ),
    ],
)
def test_a_grid_serves_pairs_rows_and_fours_and_says_only_what_is_repeated(text: str, said: dict[str, float]) -> None:
    program = parse(text)
    found = with_library(program, library(GRID))
    (call,) = calls(found)
    arguments = plain_arguments(found, call)
    assert said.items() <= arguments.items()
    assert {"levels", "rows", "columns"} & arguments.keys() == {"levels", "rows", "columns"} & said.keys()
    assert away(program, found) < TOLERANCE


def test_rails_that_run_straight_along_a_mirror_are_a_row_of_two_and_splayed_legs_are_not() -> None:
    text = dedent("""
    for i in mirror(side):
        {}(rod(start=(-8, -4, 5), end=({}), radius=0.5))
    """)
    straight, splayed = (blocks(parse(text.format(*each))) for each in (("rail", "-8, 4, 5"), ("leg", "0, -4, 4")))
    assert [kind.repeats for kind in straight] == [((2, "mirror"),), ((2, "row"),)]
    assert [kind.repeats for kind in splayed] == [((2, "mirror"),), ((2, "mirror"),)]


STEPS = """\
def boxes(levels=1, level_spacing=0, columns=1, column_spacing=0, steps=1, step_up=0, step_back=0, step_aside=0):
    for _ in translate(steps, x=step_aside, y=step_back, z=step_up):
        for _ in translate(levels, z=level_spacing):
            for _ in translate(columns, x=column_spacing):
                box()
"""


@pytest.mark.parametrize(
    ("loops", "corner", "said"),
    [
        (["translate(4, by=(3, 1, 0))"], "-8, -3.5, -5", {"steps": 4, "step_up": 3, "step_back": 1}),
        (["translate(4, by=(-3, -1, 0))"], "1, -0.5, -5", {"steps": 4, "step_up": 3, "step_back": 1}),
        (["translate(3, by=(2, -1, 0))", "mirror(side)"], "-8, -1, 6", {"steps": 3, "step_back": -1, "columns": 2}),
        (["mirror(side)", "translate(3, by=(2, -1, 0))"], "-8, -1, 6", {"steps": 3, "step_back": -1, "columns": 2}),
        (["mirror(side)", "mirror(side, at=5)"], "-8, -2, 5.5", {"steps": 2, "step_aside": -10, "columns": 2}),
        (["mirror(side)", "translate(3, by=(0, 0, -1.5))"], "-8, -2, 9", {"steps": 2, "columns": 3}),
        (["translate(2, by=(6, 0, 0))", "translate(3, by=(-1.5, 0, 0))"], "0, -2, 1", {"steps": 2, "levels": 3}),
    ],
)
def test_steps_of_a_grid_go_along_several_axes_or_along_one_of_its_own(
    loops: list[str], corner: str, said: dict[str, float]
) -> None:
    """Whichever copy a program begins with, and whichever of its loops is outside."""
    lines = [f"for i{number} in {loop}:" for number, loop in enumerate(loops)] + [f"box(at=({corner}), size=(1, 4, 2))"]
    program = parse("".join("    " * depth + line + "\n" for depth, line in enumerate(lines)))
    found = with_library(program, library(STEPS))
    (call,) = calls(found)
    assert said.items() <= plain_arguments(found, call).items()
    assert statements(found) == 1
    assert away(program, found) < TOLERANCE


def test_what_steps_the_other_way_behind_a_mirror_is_no_grid() -> None:
    text = (
        "for i in mirror(side):\n    for j in translate(3, by=(2, 0, 1)):\n        box(at=(-8, -2, 3), size=(1, 4, 2))"
    )
    (kind, *_) = blocks(parse(text))
    assert kind.loops == ("mirror", "translate")
    found = with_library(parse(text), library(STEPS))
    assert statements(found) == 2, "the mirror stays around a call"
    assert away(parse(text), found) < TOLERANCE


def blocks(program: Program) -> list[Kind]:
    """The kinds of the one block of a program, as it is written and where mirror images are rows."""
    (chain,) = program.chains
    return [next(blocks_of(chain, rows)).kind for rows in ((), (0, 1, 2))]


ALIKE = {
    "sides": "for i in mirror(side):\n    side(box(at=(-8, -4, {0}), size=(16, 8, 1)))",
    "shelves": "for i in translate({1}, by=(3.5, 0, 0)):\n    shelf(box(at=(-9, -4, -{0}), size=(1, 8, 12)))",
    "legs": "for i in mirror(depth):\n    for j in mirror(side):\n        leg(at=(-8, {0}, 6), size=(6, 1, 1))",
    "slanting_posts": "for i in mirror(side):\n    post(bar(start=(-8, {0}, 7), end=(4, 5, 6), section=(1, 2)))",
}
"""What many programs repeat, by the function that is learned from it."""


@pytest.mark.parametrize("name", ALIKE)
def test_repeated_parts_become_placed_functions_in_a_box_of_their_own(name: str) -> None:
    programs = [parse(ALIKE[name].format(3 + number / 2, 3 + number % 3)) for number in range(6)]
    found = learn(programs)
    (function,) = found.source.functions.values()
    assert function.name == name
    assert len(function.parameters) <= PARAMETERS
    for program in map(placed, programs):
        written = with_library(program, found)
        (call,) = calls(written)
        assert call.name == name
        assert statements(written) == 1
        assert away(program, written) < TOLERANCE


def test_more_copies_of_a_row_share_the_box_of_a_call() -> None:
    mine = library(
        "def boards(count, thickness):\n    for _ in row(count, last=at(top=0)):\n        shelf(height=thickness)",
    )
    text = (
        "width, depth, height = 80, 30, 200\n"
        "for _ in row({0}, last=at(top=10)):\n    shelf(left=2, right=2, bottom=10, height=2)\n"
    )
    for count in (2, 5):
        written = with_library(parse(text.format(count)), mine)
        (call,) = calls(written)
        assert dict(call.arguments)["count"] == count
        assert dict(call.arguments).keys() == {"left", "right", "bottom", "top", "count", "thickness"}
        assert away(parse(text.format(count)), written) < TOLERANCE


def test_a_placed_program_keeps_its_unit_and_its_numbers() -> None:
    mine = library(
        "def pull_out(grip):\n    drawer()\n    handle(width=width / 2, z=0, height=grip, front=-grip, depth=grip)",
    )
    program = parse(
        "# unit: cm\nwidth, depth, height = 60, 50, 80\nbody()\nfor _ in row(3, last=at(top=2)):\n"
        "    drawer(left=1, right=1, bottom=2, height=24, front=-2, depth=2)\n"
        "    handle(left=15.5, width=29, bottom=13, height=2, front=-4, depth=2)\n"
    )
    written = with_library(program, mine)
    (call,) = calls(written)
    assert dict(call.arguments)["grip"] == 2
    assert {each.name: each.value for each in names(written)} == {"width": 60, "depth": 50, "height": 80}
    assert written.unit == program.unit
    assert away(program, written) < TOLERANCE


def test_calls_that_make_placed_text_no_shorter_are_left_out() -> None:
    both = parse(
        "width, depth, height = 10, 10, 20\n"
        "for _ in mirror(x=0):\n    side(left=0, width=1)\n    bar(start=at(left=0), end=at(top=2), width=1, depth=1)\n"
    )
    pair = "def pair(thickness):\n    for _ in mirror(x=0):\n        box(left=0, width=thickness)"
    assert with_library(both, library(pair)) is both, "the loop stays for the bar"


def test_a_cushion_in_a_function_has_the_role_around_its_call() -> None:
    soft = library("def soft():\n    for _ in mirror(x=0):\n        cushion(left=0, width=2, edge=0.5)")
    program = parse(
        "width, depth, height = 24, 9, 8\nfor _ in mirror(x=0):\n    arm(cushion(left=0, width=2, edge=0.5))\n"
    )
    (call,) = calls(written := with_library(program, soft))
    assert call.role == "arm"
    assert [chain[-1].word for chain in written.chains] == ["arm"]


def test_two_boxes_that_share_little_are_no_function_of_their_own() -> None:
    random = np.random.default_rng(0)
    lines = "base(box(at=({0}, {1}, -{2}), size=({3}, {4}, {5})))\ntop(box(at=({6}, {7}, -{2}), size=({8}, {9}, {5})))"
    programs = [parse(lines.format(*(round(value, 2) for value in random.uniform(1, 4, 10)))) for _ in range(12)]
    assert learn(programs).functions == ()
    flush = "base(box(at=(-6, -{0}, -{1}), size=(1, 6, {2})))\ntop(box(at=(5, -{0}, -{1}), size=(1, 6, {2})))"
    programs = [parse(flush.format(*(round(value, 2) for value in random.uniform(1, 4, 3)))) for _ in range(12)]
    (function,) = learn(programs).functions
    assert function.name == "base_with_top"


def test_names_of_several_parts_are_plurals():
    words = ("shelf", "leg", "foot", "box", "bench", "body", "tray", "cross")
    assert [plural(word) for word in words] == [
        "shelves", "legs", "feet", "boxes", "benches", "bodies", "trays", "crosses",
    ]  # fmt: skip
