"""Programs in cells with their parts placed from the sides of the whole, and back."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

import shapeprog as sp
from shapeprog.data.random import random_program
from shapeprog.data.synthetic.furniture import furniture
from shapeprog.language.ast import values
from shapeprog.language.convert import in_cells, placed
from shapeprog.language.expression import Binary, Negative, Value
from shapeprog.language.free import numbers
from shapeprog.language.printer import format_program, source_of
from shapeprog.language.program import Program

WHOLE = "width, depth, height = 24, 10, 12\nthick, inset, floor = 1, 2.5, -height / 2\n"

KNOWN = [  # what is drawn below WHOLE, and how it is placed
    ("seat(box(at=(floor + 5, -depth / 2, -width / 2), size=(thick, depth, width)))", "seat(bottom=5, height=thick)"),
    (
        "leg(at=(floor, depth / 2 - thick, width / 2 - thick), size=(height, thick, thick))",
        "leg(left=0, width=thick, rear=0, depth=thick)",
    ),
    (
        "panel(box(at=(floor, -thick / 2, thick - width / 2), size=(height - thick, thick, width - 2 * thick)))",
        "panel(left=thick, right=thick, depth=thick, top=thick)",
    ),
    (
        "back(at=(0, 2, -width / 2), size=(height / 2, thick, width), tilt=-1)",
        "back(front=depth / 2 + 2, depth=thick, bottom=height / 2, lean=-1)",
    ),
    ("door(board(at=(floor, 0, 0), size=(3, 1, 2), tilt=5))", "door(x=-1, width=2, y=0.5, depth=1, height=3, tilt=5)"),
    (
        "top_circle(at=(height / 2 - thick, 0, 0), thickness=thick, radius=4)",
        "top_circle(cylinder(top=0, height=thick, radius=4))",
    ),
    (
        "cushion(at=(floor, -depth / 2, -width / 2), size=(2, depth, width), edge=inset)",
        "cushion(height=2, edge=inset)",
    ),
    ("layer(at=(floor + 5, 0, 0), thickness=thick, half=(2, 3))", "layer(width=6, depth=4, bottom=5, height=thick)"),
    (
        "rail(rod(start=(floor + 2, 0, -width / 2), end=(floor + 2, 0, width / 2), radius=thick))",
        "rail(rod(start=at(right=0, bottom=2), end=at(left=0), radius=thick))",
    ),
    ("leg(rod(start=(floor, 0, 0), end=(0, 0, 0), radius=thick))", "leg(rod(start=at(), end=at(z=0), radius=thick))"),
    (
        "leg(taper(start=(floor, 1, 2), end=(0, 1, 3), radius=(1, 2)))",
        "leg(taper(start=at(x=-2, y=1), end=at(x=-3, z=0), radius=(1, 2)))",
    ),
    (
        "rail(bar(start=(0, 0, -9), end=(1, 2, 9), section=(thick, 2), turn=10))",
        "rail(bar(start=at(x=9, z=0), end=at(x=-9, y=2, z=1), depth=2, height=thick, turn=-10))",
    ),
    (
        "post(bar(start=(floor, 2, 3), end=(0, 4, 3), section=(1, 2)))",
        "post(bar(start=at(x=-3, y=2), end=at(y=4, z=0), width=2, depth=1))",
    ),
    (
        "line(start=(-1, -0.5, 0.5), end=(2, 3, 0.5), radius=1)",
        "line(rod(start=at(x=-1, z=-0.5), end=at(y=3.5, z=2.5), radius=1))",
    ),
    (
        "for i in mirror(side):\n"
        "    for j in mirror(depth):\n"
        "        leg(at=(floor, depth / 2 - thick, width / 2 - thick), size=(5, thick, thick))",
        "for _ in mirror(x=0, y=0):\n    leg(left=0, width=thick, front=0, depth=thick, height=5)",
    ),
    (
        "for i in translate(2, by=(0, 0, width - thick)):\n"
        "    leg(at=(floor, -depth / 2, -width / 2), size=(5, thick, thick))",
        "for _ in mirror(x=0):\n    leg(left=0, width=thick, front=0, depth=thick, height=5)",
    ),
    (
        "for i in translate(3, by=(height / 2 - thick / 2, 0, 0)):\n"
        "    shelf(box(at=(floor, -depth / 2, -width / 2), size=(thick, depth, width)))",
        "for _ in row(3, last=at(top=0)):\n    shelf(height=thick)",
    ),
    (
        "for i in translate(3, by=(3, 0, -1)):\n    shelf(box(at=(floor, 0, 0), size=(1, 2, 3)))",
        "for _ in translate(3, x=1, z=3):\n    shelf(x=-1.5, width=3, y=1, depth=2, height=1)",
    ),
    (
        "for i in rotate(5, step=1):\n    foot(box(at=(floor, 1, -1), size=(1, 3, 2)))",
        "for _ in rotate(5):\n    foot(width=2, y=2.5, depth=3, height=1)",
    ),
    (
        "for i in rotate(4, step=1):\n    base_cross(at=(floor, 1, 0), thickness=1, length=4, turn=0)",
        "for _ in rotate(4, y=1, step=90):\n    base_cross(x=2, width=4, y=1, depth=2, height=1)",
    ),
    (
        "for i in rotate(4, step=1):\n    line(start=(floor, 1, 0), end=(0, 3, 0), radius=1)",
        "for _ in rotate(4, x=-0.5, y=1.5):\n"
        "    line(rod(start=at(x=-0.5, y=1.5, bottom=0.5), end=at(y=3.5, z=0.5), radius=1))",
    ),
]

OLD = """\
# A chair
width, depth, height = 10, 12, 24  # bottom: above the floor
floor, leg_height, thick, left = -height / 2, 12, 2, 1
def legs(height, thick=1):
    for i in mirror(side):
        leg(at=(floor, depth / 2 - thick, width / 2 - thick), size=(height, thick, thick))
# the seat
seat(box(at=(floor + leg_height - left, -depth / 2, -width / 2), size=(left, depth, width)))  # wood
legs(leg_height, thick)
post(legs(height=height))
for i in mirror(side):
    stretcher(box(at=(floor + 3, thick - depth / 2, width / 2 - thick), size=(left, depth - 2 * thick, thick)))
    arm(bar(start=(0, -depth / 2, width / 2), end=(2, depth / 2, width / 2), section=(thick, left), turn=8))
"""


def operators(program: Program) -> int:
    """How many + - * / a program has."""

    def of(value: Value) -> int:
        match value:
            case Binary(_, left, right):
                return 1 + of(left) + of(right)
            case Negative(inner):
                return of(inner)
        return 0

    return sum(of(value) for line in source_of(program).walk() for value in values(line))


def same_surface(one: Program, other: Program, within: float = 1e-4) -> bool:
    """Whether points on the surface of each of two programs lie as near to that of the other, in cells."""
    scenes = sp.unroll(one), sp.unroll(other)
    for scene, image in (scenes, scenes[::-1]):
        points = sp.sample(scene, 400, torch.Generator().manual_seed(0)).points
        if image.distance(points).abs().max() > scene.distance(points).abs().max() + within:
            return False
    return True


def placeable(program: Program) -> bool:
    """Whether no loop of a program leans what is in it."""
    return all(node.name != "tilt_about" for node in program.walk())


PROGRAMS = [
    *(furniture(seed) for seed in range(12)),
    *filter(placeable, (random_program(torch.Generator().manual_seed(seed), blocks=4, copies=3) for seed in range(30))),
    *(sp.parse(WHOLE + "seat(box(at=(floor + inset, 0, 0), size=(thick, 1, 1)))\n" + cells) for cells, _ in KNOWN),
    sp.parse(OLD),
]


@pytest.mark.parametrize(("cells", "text"), KNOWN)
def test_each_statement_and_loop_has_a_known_placed_form(cells: str, text: str) -> None:
    use = "block(box(at=(floor + inset, 0, 0), size=(thick, 1, 1)))\n"
    lines = format_program(placed(sp.parse(WHOLE + use + cells))).splitlines()
    assert "\n".join(lines[3:]) == text


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_converted_program_has_the_same_surface_and_no_more_operators(program: Program) -> None:
    result = converted(program)
    assert same_surface(result, program)
    assert operators(result) <= operators(program)


@pytest.mark.parametrize("program", PROGRAMS)
def test_its_text_is_read_back_as_the_same_program(program: Program) -> None:
    result = converted(program)
    text = format_program(result)
    assert result.source is not None
    read = sp.parse(text)
    assert read.source is not None
    assert read.source.lines == result.source.lines
    assert format_program(read) == text
    assert not read.source.warnings
    assert placed(read) == read


@pytest.mark.parametrize("program", PROGRAMS)
def test_it_is_written_in_cells_again(program: Program) -> None:
    result = converted(program)
    cells = in_cells(result)
    assert same_surface(cells, result)
    assert cells.source is None or not cells.source.placed


def converted(program: Program) -> Program:
    """The placed program; one with a part that cannot be placed is skipped."""
    try:
        return placed(program)
    except sp.ShapeProgError as error:
        pytest.skip(error.message)


def test_an_old_chair_keeps_its_names_functions_comments_and_free_numbers() -> None:
    program = placed(sp.parse(OLD))
    text = format_program(program)
    assert (
        text
        == """\
# A chair
width, depth, height = 10, 12, 24  # bottom: above the floor
leg_height, thick, part_left = 12, 2, 1
def legs(part_height, thick=1):
    for _ in mirror(x=0):
        leg(left=0, width=thick, rear=0, depth=thick, height=part_height)
# the seat
seat(bottom=leg_height - part_left, height=part_left)  # wood
legs(part_height=leg_height, thick=thick)
post(legs(part_height=height))
for _ in mirror(x=0):
    stretcher(left=0, width=thick, front=thick, rear=thick, bottom=3, height=part_left)
    arm(bar(start=at(left=0, front=0, z=0), end=at(rear=0, z=2), width=part_left, height=thick, turn=8))
"""
    )


def test_what_follows_from_names_follows_after_conversion_too() -> None:
    old, new = sp.parse(OLD), placed(sp.parse(OLD))
    for name, value in {"width": 14, "depth": 9, "leg_height": 10, "thick": 1}.items():
        assert same_surface(sp.set(new, {name: value}), sp.set(old, {name: value}))


def test_a_function_whose_bars_run_in_different_directions_has_two_forms() -> None:
    program = sp.parse(
        "def beam_between(up, back):\n"
        "    bar(start=(0, 0, 0), end=(up, back, 1), section=(1, 2))\n"
        "beam_between(up=6, back=2)\nbeam_between(up=1, back=7)\nbeam_between(up=9, back=2)\n"
    )
    result = placed(program)
    assert [*source_of(result).functions] == ["beam_between", "beam_between_2"]
    assert same_surface(result, program)


def test_a_program_without_sizes_gets_those_of_its_bounding_box_about_the_middle_of_the_grid() -> None:
    program = placed(sp.parse("leg(at=(-3, -4, 1), size=(5, 8, 2))"))
    assert format_program(program) == "width, depth, height = 6, 8, 6\nleg(left=0, width=2, top=1)\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("leg(at=(0, 0, 0), size=(0, 1, 1))", "without thickness"),
        ("rod(start=(0, 0, 0), end=(0, 0, 0), radius=1)", "starts where it ends"),
        ("for i in tilt_about(2, tilt=3, at=(0, 0)):\n    leg(at=(0, 0, 0), size=(1, 1, 1))", "no placed form"),
    ],
)
def test_what_has_no_placed_form_is_refused(text: str, message: str) -> None:
    with pytest.raises(sp.ShapeProgError, match=message):
        placed(sp.parse(text))


def test_a_part_with_a_negative_length_draws_nothing_and_is_left_out() -> None:
    program = placed(
        sp.parse("leg(at=(0, 0, 0), size=(1, 1, 1))\nfor i in mirror(side):\n    leg(at=(0, 0, 0), size=(1, -1, 1))")
    )
    assert len(source_of(program).lines) == 2


@pytest.mark.parametrize("suffix", [".shape", ".json"])
def test_a_file_of_an_old_program_is_placed_and_lies_where_it_did(tmp_path: Path, suffix: str) -> None:
    old, frame = sp.parse(OLD), sp.Frame(0.25, (1.0, 2.0, 3.0))
    sp.save(old, tmp_path / f"chair{suffix}", frame)
    new, new_frame = sp.load_with_frame(tmp_path / f"chair{suffix}")
    assert source_of(new).placed
    points = sp.sample(sp.unroll(old), 400, torch.Generator().manual_seed(0)).points
    image = torch.from_numpy(new_frame.to_grid(frame.to_world(points.double().numpy())))
    assert sp.unroll(new).distance(image).abs().max() < 1e-4


def test_free_numbers_are_as_many_as_before() -> None:
    assert numbers(placed(sp.parse(OLD))) == numbers(sp.parse(OLD))
