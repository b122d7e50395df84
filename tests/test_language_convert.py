"""Programs in cells with their parts placed from the sides of the whole, and back."""

from __future__ import annotations

import pytest
import torch

import shapeprog as sp
from shapeprog.data.random import random_program
from shapeprog.data.synthetic.furniture import furniture
from shapeprog.language.convert import in_cells, named_cells, placed, placed_again
from shapeprog.language.dimensions import in_unit
from shapeprog.language.free import numbers
from shapeprog.language.printer import format_program, source_of
from shapeprog.language.program import Program
from shapeprog.language.unit import Unit

BLOCK = "block(box(at=(-6, -5, -12), size=(12, 10, 24)))\n"

KNOWN = [  # what is drawn beside BLOCK, and how it is placed
    ("seat(box(at=(-1, -5, -12), size=(1, 10, 24)))", "seat(bottom=5, height=1)"),
    ("leg(at=(-6, 4, 11), size=(12, 1, 1))", "leg(left=0, width=1, rear=0, depth=1)"),
    ("panel(box(at=(-6, -0.5, -11), size=(11, 1, 22)))", "panel(width=22, depth=1, top=1)"),
    ("back(at=(0, 2, -12), size=(6, 1, 24), tilt=-1)", "back(rear=2, depth=1, top=0, height=6, lean=-1)"),
    (
        "door(board(at=(-5, 0, 0), size=(3, 1, 2), tilt=5))",
        "door(left=10, width=2, rear=4, depth=1, bottom=1, height=3, tilt=5)",
    ),
    ("top_circle(at=(5, 0, 0), thickness=1, radius=4)", "top_circle(cylinder(top=0, height=1, radius=4))"),
    ("cushion(at=(-6, -5, -12), size=(2, 10, 24), edge=2.5)", "cushion(height=2, edge=2.5)"),
    ("layer(at=(-1, 0, 0), thickness=1, half=(2, 3))", "layer(width=6, depth=4, bottom=5, height=1)"),
    (
        "rail(rod(start=(-4, 0, -12), end=(-4, 0, 12), radius=1))",
        "rail(rod(start=at(right=0, bottom=2), end=at(left=0), radius=1))",
    ),
    ("leg(rod(start=(-6, 0, 0), end=(0, 0, 0), radius=1))", "leg(rod(height=6, radius=1))"),
    (
        "leg(taper(start=(-4, 1, 2), end=(0, 1, 3), radius=(1, 2)))",
        "leg(taper(start=at(left=10, rear=4, bottom=2), end=at(left=9, z=0), radius=(1, 2)))",
    ),
    (
        "rail(bar(start=(0, 0, -9.5), end=(1, 2, 9.5), section=(1, 2), turn=10))",
        "rail(bar(start=at(right=2.5, z=0), end=at(left=2.5, rear=3, top=5), depth=2, height=1, turn=-10))",
    ),
    (
        "post(bar(start=(-4, 2, 3), end=(0, 4, 3), section=(1, 2)))",
        "post(bar(start=at(left=9, rear=3, bottom=2), end=at(rear=1, z=0), width=2, depth=1))",
    ),
    (
        "line(start=(-1, -0.5, 0.5), end=(2, 3, 0.5), radius=1)",
        "line(rod(start=at(left=11, bottom=5.5), end=at(rear=1.5, top=3.5), radius=1))",
    ),
    (
        ("for i in mirror(side):\n    for j in mirror(depth):\n        leg(at=(-6, 4, 11), size=(5, 1, 1))"),
        ("for _ in mirror(x=0, y=0):\n    leg(left=0, width=1, front=0, depth=1, height=5)"),
    ),
    (
        ("for i in translate(2, by=(0, 0, 23)):\n    leg(at=(-6, -5, -12), size=(5, 1, 1))"),
        ("for _ in mirror(x=0):\n    leg(left=0, width=1, front=0, depth=1, height=5)"),
    ),
    (
        ("for i in translate(3, by=(5.5, 0, 0)):\n    shelf(box(at=(-6, -5, -12), size=(1, 10, 24)))"),
        ("for _ in translate(3, z=5.5):\n    shelf(height=1)"),
    ),
    (
        ("for i in translate(3, by=(3, 0, -1)):\n    shelf(box(at=(-6, 0, 0), size=(1, 2, 3)))"),
        ("for _ in translate(3, x=1, z=3):\n    shelf(left=9, width=3, rear=3, depth=2, height=1)"),
    ),
    (
        ("for i in rotate(5, step=1):\n    foot(box(at=(-6, 1, -1), size=(1, 3, 2)))"),
        ("for _ in rotate(5):\n    foot(width=2, rear=1, depth=3, height=1)"),
    ),
    (
        ("for i in rotate(4, step=1):\n    base_cross(at=(-6, 1, 0), thickness=1, length=4, turn=0)"),
        ("for _ in rotate(4, rear=4, step=90):\n    base_cross(right=8, width=4, rear=3, depth=2, height=1)"),
    ),
    (
        ("for i in rotate(4, step=1):\n    line(start=(-4, 1, 0), end=(0, 3, 0), radius=1)"),
        (
            "for _ in rotate(4, left=11.5, rear=3.5):\n"
            "    line(rod(start=at(left=11.5, rear=3.5, bottom=2.5), end=at(rear=1.5, top=5.5), radius=1))"
        ),
    ),
]

CHAIR = """\
width, depth, height = 10, 12, 24
leg_height, thick = 12, 2
def legs(inset=0):
    for _ in mirror(x=0):
        leg(left=inset, width=thick, rear=0, depth=thick)
seat(bottom=leg_height - thick, height=thick)
legs(height=leg_height)
legs(height=height, inset=thick)
for _ in mirror(x=0):
    stretcher(left=0, width=thick, front=thick, rear=thick, bottom=3, height=1)
    arm(bar(start=at(left=0, front=0, z=0), end=at(rear=0, z=2), width=1, height=thick, turn=8))
"""


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
    *(sp.parse(BLOCK + cells) for cells, _ in KNOWN),
]


@pytest.mark.parametrize(("cells", "text"), KNOWN)
def test_each_statement_and_loop_has_a_known_placed_form(cells: str, text: str) -> None:
    whole, block, *lines = format_program(placed(sp.parse(BLOCK + cells))).splitlines()
    assert (whole, block) == ("width, depth, height = 24, 10, 12", "block()")
    assert "\n".join(lines) == text


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_converted_program_has_the_same_surface(program: Program) -> None:
    assert same_surface(converted(program), program)


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


def test_names_of_a_placed_program_stay_in_cells_and_when_it_is_placed_again() -> None:
    given = sp.parse(CHAIR)
    again = placed_again(named_cells(given))
    assert format_program(again).startswith(CHAIR[: CHAIR.index("def")])
    assert numbers(again) == numbers(given)
    for name, value in {"width": 14, "depth": 9, "leg_height": 10, "thick": 1}.items():
        expected = sp.set(given, {name: value})
        assert same_surface(sp.set(again, {name: value}), expected)


def test_a_program_without_sizes_gets_those_of_its_bounding_box_about_the_middle_of_the_grid() -> None:
    program = placed(sp.parse("leg(at=(-3, -4, 1), size=(5, 8, 2))"))
    assert format_program(program) == "width, depth, height = 6, 8, 6\nleg(left=0, width=2, top=1)\n"


@pytest.mark.parametrize(
    ("cells", "text"),
    [
        ("leg(at=(-3, -4, 1), size=(5, 8, 2))", "width, depth, height = 6, 8, 5\nleg(left=0, width=2)\n"),
        ("leg(at=(0, 1, -2), size=(5, 3, 4))", "width, depth, height = 4, 3, 5\nleg()\n"),
        ("leg(at=(-2.5, 1, -2), size=(5, 3, 4))", "width, depth, height = 4, 3, 5.5\nleg(bottom=0.5)\n"),
        (
            "for i in mirror(depth):\n    leg(at=(0, 1, -2), size=(5, 3, 4))",
            "width, depth, height = 4, 8, 5\nfor _ in mirror(y=0):\n    leg(front=0, depth=3)\n",
        ),
    ],
)
def test_the_whole_on_a_floor_ends_where_its_parts_end_unless_they_are_mirrored_about_the_middle(
    cells: str, text: str
) -> None:
    given = sp.parse(cells)
    result = placed(given, floor=-3)
    assert format_program(result) == text
    assert same_surface(result, given), "it stays where it is in the grid"
    in_metres = in_unit(result, Unit("m", 0.02))
    assert same_surface(in_metres, given)
    assert same_surface(sp.set(in_metres, height=0.2), sp.set(result, height=10)), "heights are measured from the floor"


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
