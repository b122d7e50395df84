"""Libraries of functions: what is learned from programs, and programs written with them."""

from __future__ import annotations

from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest
import torch
from commands import Run

from shapeprog import inference
from shapeprog.data.synthetic.furniture import furniture
from shapeprog.errors import InputError, OutputError
from shapeprog.language.ast import Call, Source
from shapeprog.language.convert import placed
from shapeprog.language.dimensions import in_unit
from shapeprog.language.named import inline, names
from shapeprog.language.named import set as set_numbers
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program, format_source, source_of
from shapeprog.language.program import Draw, Loop, Program
from shapeprog.language.unit import Unit
from shapeprog.language.unroll import unroll
from shapeprog.library import Library, learn, library_of, load_library, save_library, with_library
from shapeprog.library.blocks import Kind, blocks_of
from shapeprog.library.groups import PARAMETERS
from shapeprog.library.length import statements
from shapeprog.library.matching import TOLERANCE
from shapeprog.library.rewriting import offers
from shapeprog.library.words import plural

SHELVES = """\
# such as shelves(count=4, bottom=-8, height=16, width=12, thick=1)
def shelves(count, bottom, height, width, thick, front=-4):
    for i in translate(count, by=((height - thick) / (count - 1), 0, 0)):
        shelf(box(at=(bottom, front, -width / 2), size=(thick, 8, width)))
"""

POSTS = """\
def posts(floor, height, width, depth, thick):
    for i in mirror(side):
        for j in mirror(depth):
            box(at=(floor, depth / 2 - thick, width / 2 - thick), size=(height, thick, thick))
"""

TABLE = """\
width, depth, height = 20, 12, 9
thick = 1.5
floor = -height / 2
for i in translate(2, by=(0, 0, thick - width)):
    for j in mirror(depth):
        leg(at=(floor, -depth / 2, width / 2 - thick), size=(height - thick, thick, thick))
top(box(at=(height / 2 - thick, -depth / 2, -width / 2), size=(thick, depth, width)))
"""


def away(one: Program, two: Program) -> float:
    """The largest difference between the distances of points to two programs."""
    points = (torch.rand(2000, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) - 0.5) * 26
    return float((unroll(one).distance(points) - unroll(two).distance(points)).abs().max())


def calls(program: Program) -> list[Call]:
    return [line for line in source_of(program).walk() if isinstance(line, Call)]


def library(*texts: str) -> Library:
    return library_of(parse("\n".join(texts)))


@pytest.mark.parametrize("number", range(0, 48, 4))
def test_a_program_written_with_a_library_draws_the_same_in_fewer_statements(number: int) -> None:
    program = furniture(number, seed=5)
    written = with_library(program, load_library())
    assert away(program, written) <= 3**0.5 * TOLERANCE
    assert sorted(chain[-1].word for chain in program.chains) == sorted(chain[-1].word for chain in written.chains)
    assert (statements(written) < statements(program)) == bool(calls(written))
    assert parse(format_program(written)) == written
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
    assert {name: str(value) for name, value in call.arguments} == {
        "floor": "floor", "height": "height - thick", "width": "width", "depth": "depth", "thick": "thick",
    }  # fmt: skip
    assert [each.name for each in names(written)] == [each.name for each in names(program)]
    for name in ("width", "depth", "height", "thick"):
        assert away(set_numbers(program, {name: 7.0}), set_numbers(written, {name: 7.0})) < 1e-6


def test_names_that_nothing_uses_any_more_are_left_out() -> None:
    text = "gap = 18\nfor i in translate(2, by=(0, 0, gap)):\n    shelf(box(at=(0, 0, 0), size=(1, 8, gap / 9)))\n"
    two = "def two(wide, thick):\n    for i in translate(2, by=(0, 0, wide)):\n"
    two += "        shelf(box(at=(0, 0, 0), size=(thick, 8, wide / 9)))\n"
    assert "gap" in format_program(with_library(parse(text), library(two)))
    plain = "a, b = 2, 3\nfor i in mirror(side):\n    arm(box(at=(0, 0, 5), size=(a, 1, b - 2)))\n"
    arms = "def arms(tall):\n    for i in mirror(side):\n        arm(box(at=(0, 0, 5), size=(tall, 1, 1)))\n"
    assert format_program(with_library(parse(plain), library(arms))).startswith("a = 2\n")


@pytest.mark.parametrize("count", [2, 3, 7])
def test_one_function_serves_any_count_and_says_defaults_only_where_they_differ(count: int) -> None:
    step = 15 / (count - 1)
    text = f"for i in translate({count}, by=({step}, 0, 0)):\n    shelf(box(at=(-8, -4, -6), size=(1, 8, 12)))\n"
    (call,) = calls(with_library(parse(text), library(SHELVES)))
    assert dict(call.arguments) == {"count": count, "bottom": -8, "height": 16, "width": 12, "thick": 1}
    (call,) = calls(with_library(parse(text.replace("-4", "-3")), library(SHELVES)))
    assert dict(call.arguments)["front"] == pytest.approx(-3)


def test_a_count_keeps_its_name_in_a_call() -> None:
    text = "boards, high = 4, 16\nfor i in translate(boards, by=((high - 1) / (boards - 1), 0, 0)):\n"
    text += "    shelf(box(at=(-high / 2, -4, -6), size=(1, 8, 12)))\n"
    written = with_library(parse(text), library(SHELVES))
    (call,) = calls(written)
    assert {name: str(value) for name, value in call.arguments if not isinstance(value, float)} == {
        "count": "boards", "bottom": "-high / 2", "height": "high",
    }  # fmt: skip
    for changes in ({"boards": 5.0}, {"high": 20.0}):
        assert away(set_numbers(parse(text), changes), set_numbers(written, changes)) < 1e-6


@pytest.mark.parametrize("order", ["wide, thick", "thick, wide"])
def test_a_function_without_an_example_is_found_whatever_the_order_of_its_parameters(order: str) -> None:
    arms = f"def arms({order}):\n    for i in mirror(side):\n"
    arms += "        arm(box(at=(0, 0, wide / 2 - 3 * thick), size=(3, 8, thick)))\n"
    text = "for i in translate(2, by=(0, 0, 17)):\n    arm(box(at=(0, 0, -9), size=(3, 8, 1)))\n"
    (call,) = calls(with_library(parse(text), library(arms)))
    assert dict(call.arguments) == {"wide": 22, "thick": 1}


def test_a_loop_of_what_a_function_draws_stays_around_its_call() -> None:
    text = "for i in mirror(depth, at=9):\n    for j in mirror(side):\n        for k in mirror(depth):\n"
    text += "            leg(at=(0, 3, 9), size=(8, 1, 1))\n"
    written = with_library(parse(text), library(POSTS))
    assert format_program(written).endswith(
        "for i in mirror(depth, at=9):\n    leg(posts(floor=0, height=8, width=20, depth=8, thick=1))\n"
    )


def test_equal_loops_around_what_a_function_draws_become_one_loop_around_its_call() -> None:
    desk = "def desk(high, wide, thick):\n    top(box(at=(high, 0, 0), size=(thick, 6, wide)))\n"
    desk += "    side(box(at=(0, 0, 0), size=(high, 6, thick)))\n"
    text = "step, wide, thick = 8, 6, 1\nfor i in translate(3, by=(0, 0, step)):\n    {}\n"
    top, side = "top(box(at=(9, 0, 0), size=(thick, 6, wide)))", "side(box(at=(0, 0, 0), size=(9, 6, thick)))"
    program = parse(text.format(top) + text.split("\n", 1)[1].format(side))
    written = with_library(program, library(desk))
    assert format_program(written).endswith(
        "for i in translate(3, by=(0, 0, step)):\n    desk(high=9, wide=wide, thick=thick)\n"
    )
    assert away(program, written) < 1e-6
    other = parse(text.format(top) + text.split("\n", 1)[1].replace("step", "8.2").format(side))
    assert with_library(other, library(desk)) == other


def test_what_equal_loops_say_as_shortly_is_no_call() -> None:
    sides = "def sides(front):\n    for i in mirror(side):\n        side(box(at=(-5, front, 6), size=(10, 8, 1)))\n"
    library = library_of(parse(sides))
    alone = parse("for i in mirror(side):\n    side(box(at=(-5, -4, 6), size=(10, 8, 1)))\n")
    assert len(calls(with_library(alone, library))) == 1
    leg = "for i in mirror(side):\n    leg(taper(start=(-9, 0, 6), end=(-5, 0, 6), radius=(1, 2)))\n"
    more = parse(format_program(alone) + leg)
    assert with_library(more, library) is more


def test_a_comment_in_a_loop_is_no_statement() -> None:
    text = "for i in mirror(depth, at=9):\n    # legs\n    leg(at=(0, 3, 9), size=(8, 1, 1))\n"
    one = "def one(low):\n    for i in mirror(depth, at=9):\n        leg(at=(low, 3, 9), size=(8, 1, 1))\n"
    (offer,) = offers(parse(text), library(one))
    assert offer.fewer == 1


def test_parts_of_another_role_and_those_that_are_off_are_left_alone() -> None:
    text = "for i in translate(3, by=(7.5, 0, 0)):\n    shelf(box(at=(-8, -4, -6), size=(1, 8, 12)))\n"
    assert calls(with_library(parse(text), library(SHELVES)))
    for other in (text.replace("shelf", "drawer"), text.replace("-6", "-5.8"), text.replace("box", "cushion")):
        program = parse(other.replace("12))", "12), edge=0.1)") if "cushion" in other else other)
        assert with_library(program, library(SHELVES)) == program
    assert calls(with_library(parse(text.replace("-6", "-5.97")), library(SHELVES))), "within the tolerance"


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
    assert learn(programs) == found
    assert load_library(save_library(found, tmp_path / "a.shape")) == found
    with pytest.raises(OutputError, match="no place for a library"):
        save_library(found, tmp_path / "a.json")


def test_programs_that_share_nothing_give_an_empty_library() -> None:
    assert learn([]).functions == ()
    alone = [parse("leg(at=(0, 0, 0), size=(8, 1, 1))"), parse("seat(box(at=(0, 0, 0), size=(1, 9, 9)))"), planted(1)]
    assert learn(alone).functions == ()
    assert with_library(alone[2], learn(alone)) == alone[2]


def test_the_library_that_ships_holds_at_most_twelve_functions_each_with_a_call_that_draws() -> None:
    shipped = load_library()
    assert 1 <= len(shipped.functions) <= 12
    assert max(len(function.parameters) for function in shipped.source.functions.values()) <= PARAMETERS
    for pattern in shipped.patterns:
        assert pattern.example is not None
        program = parse(format_source(Source((*pattern.others, pattern.function, pattern.example))))
        assert unroll(program).mask.all()
        (call,) = calls(with_library(inline(program), shipped)) or [None]
        assert call is not None, pattern.function.name


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("leg(at=(0, 0, 0), size=(1, 1, 1))", "statements outside of functions"),
        (f"wide = 3\n{SHELVES}shelves(count=2, bottom=0, height=wide, width=2, thick=1)", "numbers of its own"),
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
    mixed = parse("# unit: cm, 4 per cell\n" + TABLE + "board(at=(0, 0, 0), size=(1, 1, 1), tilt=thick)\n")
    assert with_library(mixed, library(POSTS)) is mixed


def test_a_library_is_in_no_unit() -> None:
    with pytest.raises(InputError, match="lengths are in cm of one object"):
        library("# unit: cm, 4 per cell", POSTS)


def test_tidy_and_infer_write_programs_with_a_library(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "posts.shape").write_text(POSTS)
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
def boxes(bottom, height, depth, width, levels=1, level_spacing=0, rows=1, row_spacing=0, columns=1, column_spacing=0):
    for i in translate(levels, by=(level_spacing, 0, 0)):
        for j in translate(rows, by=(0, row_spacing, 0)):
            for k in translate(columns, by=(0, 0, column_spacing)):
                box(
                    at=(bottom, -(depth + (rows - 1) * row_spacing) / 2, -(width + (columns - 1) * column_spacing) / 2),
                    size=(height, depth, width),
                )
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
    program, library = parse(text), library_of(parse(GRID))
    found = with_library(program, library)
    (call,) = calls(found)
    arguments = dict(call.arguments)
    assert said.items() <= arguments.items()
    assert {"levels", "rows", "columns"} & arguments.keys() == {"levels", "rows", "columns"} & said.keys()
    assert away(program, found) < TOLERANCE
    loops = [node for node in inline(found).walk() if isinstance(node, Loop)]
    assert len(loops) == len({"levels", "rows", "columns"} & said.keys())  # rows of one are not written out
    assert all(loop.count > 1 for loop in loops)


@pytest.mark.parametrize(("first", "sign"), [("-8", ""), ("4", "-")])
def test_more_copies_share_the_span_of_a_call_too(first: str, sign: str) -> None:
    text = dedent(f"""
    shelves, span = 4, 12
    for i in translate(shelves, by=({sign}span / (shelves - 1), 0, 0)):
        shelf(box(at=({first}, -4, -5), size=(1, 8, 10)))
    """)
    program = parse(text)
    found = with_library(program, library_of(parse(GRID)))
    assert statements(found) == 1
    for changed in ({"shelves": 7}, {"span": 9}, {"shelves": 2, "span": 14}):
        assert away(set_numbers(program, changed), set_numbers(found, changed)) < TOLERANCE


def test_rails_that_run_straight_along_a_mirror_are_a_row_of_two_and_splayed_legs_are_not() -> None:
    text = dedent("""
    for i in mirror(side):
        {}(rod(start=(-8, -4, 5), end=({}), radius=0.5))
    """)
    straight, splayed = (blocks(parse(text.format(*each))) for each in (("rail", "-8, 4, 5"), ("leg", "0, -4, 4")))
    assert [kind.repeats for kind in straight] == [((2, "mirror"),), ((2, "row"),)]
    assert [kind.repeats for kind in splayed] == [((2, "mirror"),), ((2, "mirror"),)]


STEPS = """\
def boxes(bottom, height, depth, width, levels=1, level_spacing=0, columns=1, column_spacing=0, middle_side=0,
          steps=1, step_up=0, step_back=0, step_aside=0):
    for h in translate(steps, by=(step_up, step_back, step_aside)):
        for i in translate(levels, by=(level_spacing, 0, 0)):
            for k in translate(columns, by=(0, 0, column_spacing)):
                box(
                    at=(
                        bottom,
                        -(depth + (steps - 1) * step_back) / 2,
                        middle_side - (width + (columns - 1) * column_spacing + (steps - 1) * step_aside) / 2,
                    ),
                    size=(height, depth, width),
                )
"""


@pytest.mark.parametrize(
    ("loops", "corner", "said"),
    [
        (["translate(4, by=(3, 1, 0))"], "-8, -3.5, -5", {"steps": 4, "step_up": 3, "step_back": 1}),
        (["translate(4, by=(-3, -1, 0))"], "1, -0.5, -5", {"steps": 4, "step_up": 3, "step_back": 1}),
        (["translate(3, by=(2, -1, 0))", "mirror(side)"], "-8, -1, 6", {"steps": 3, "step_back": -1, "columns": 2}),
        (["mirror(side)", "translate(3, by=(2, -1, 0))"], "-8, -1, 6", {"steps": 3, "step_back": -1, "columns": 2}),
        (["mirror(side)", "mirror(side, at=5)"], "-8, -2, 5.5", {"steps": 2, "step_aside": 10, "columns": 2}),
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
    found = with_library(program, library_of(parse(STEPS)))
    (call,) = calls(found)
    assert said.items() <= dict(call.arguments).items()
    assert statements(found) == 1
    assert away(program, found) < TOLERANCE


def test_what_steps_the_other_way_behind_a_mirror_is_no_grid() -> None:
    text = (
        "for i in mirror(side):\n    for j in translate(3, by=(2, 0, 1)):\n        box(at=(-8, -2, 3), size=(1, 4, 2))"
    )
    (kind, *_) = blocks(parse(text))
    assert kind.others == ("mirror", "translate")
    found = with_library(parse(text), library_of(parse(STEPS)))
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
    assert found.placed
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
        "width, depth, height = 1, 1, 1",
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
        "width, depth, height = 1, 1, 1",
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
    assert with_library(both, library("width, depth, height = 1, 1, 1", pair)) is both, "the loop stays for the bar"


def test_a_cushion_in_a_function_has_the_role_around_its_call() -> None:
    program = parse(
        dedent("""
        def soft(at):
            cushion(at=(0, at, 0), size=(2, 4, 4), edge=0.5)
            leg(at=(-4, at, 0), size=(4, 1, 1))

        door(soft(at=1))
        cushion(soft(at=6))
        """)
    )
    drawn = [node for node in inline(program).walk() if isinstance(node, Draw)]
    assert [(node.name, node.role) for node in drawn] == [
        ("cushion", "door"),
        ("leg", ""),
        ("cushion", ""),
        ("leg", ""),
    ]


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
