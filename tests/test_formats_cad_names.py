"""CAD scripts of programs with names: numbers, expressions and functions stay what they are, and draw the same."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cad_twin import evaluate, expected, same

import shapeprog as sp
from shapeprog.formats import export
from shapeprog.formats.build123d import script_text
from shapeprog.formats.openscad import scad_text
from shapeprog.formats.parts import parts, solid
from shapeprog.formats.plan import plan
from shapeprog.formats.written_plan import script_plan
from shapeprog.language.text import format_program, parse
from shapeprog.language.unit import Unit
from shapeprog.space import Frame, grid_axes

CHAIR = """
# A chair.
width, depth, height = 10.25, 12, 23.5
seat_height, thick = 9.5, 2  # top of the seat above the floor; section of the legs
floor = -height / 2
n = 3

def legs(long, inset, thick=2):  # four of them
    far = depth / 2 - thick
    for i in mirror(side):
        leg(at=(floor, far, width / 2 - inset), size=(long, thick, thick))
        leg(bar(start=(floor + long, -far, width / 2), end=(floor, -far, width / 2 - inset), section=(thick, 1)))
    for i in mirror(depth, at=far / 20):
        rod(start=(floor, far, -(inset - 1)), end=(floor + 2, far, 1), radius=thick / 2)

def never(width):
    box(at=(0, 0, width), size=(1, 1, 1))

def spin(radius):
    line(start=(floor, 0, 0), end=(floor - 1, radius, 0), radius=0.5)

top_square(at=(floor + seat_height - 2.5, 0, 0), thickness=2.5, half=width / 2)
legs(long=seat_height - 2.5, inset=thick, thick=thick)
for i in translate(2, by=(0, 0, -2 * width)):
    legs(long=3, inset=depth / 4)
spin(radius=3)
for i in translate(n, by=(0, 0, -(width - 2) / (n - 1))):
    back(at=(floor + seat_height, depth / 2 - 1, width / 2 - 2), size=(height - seat_height, 1, 2), tilt=thick * 1.5)
for j in rotate(n + 2, step=1):
    foot(cushion(at=(floor - 1, 6, 0), size=(1, thick, thick), edge=thick / 4))
    line(start=(floor, 1, 0), end=(floor - 1, 5, n), radius=0.5)
"""

CHANGES = {"width": 14.5, "depth": 9, "height": 30, "seat_height": 12, "thick": 1.5, "n": 4}


UNITS = ["", "# unit: cm, 0.5 per cell\n", "# unit: m, 2 per cell\n"]


@pytest.mark.parametrize("head", UNITS)
def test_scripts_draw_what_unrolling_draws(head):
    program = parse(head + CHAIR)
    made = script_plan(program, ())
    assert made.numbers
    same(evaluate(made), expected(program))


def test_scripts_say_lengths_in_the_unit_of_the_program():
    cells = parse(
        "seat = 9\nbox(at=(0, 0, 0), size=(seat, 4, seat - 2))\nboard(at=(0, 0, 0), size=(1, 2, 3), tilt=seat)"
    )
    program = parse("# unit: cm, 4 per cell\n" + format_program(cells).replace("9", "36").replace("4,", "16,"))
    frame = Frame(0.04, (1, 2, 3))
    for text in (scad_text(program, frame), script_text(program, frame)):
        assert "Lengths are in cm." in text
        assert "seat = 36" in text
        assert "seat - 2" in text
        assert "tilted_box" in text
    assert "world = [[0.01, 0, 0, 1]" in scad_text(program, frame)
    assert "scale = 0.01\n" in script_text(program, frame)
    plain = scad_text(sp.in_unit(sp.inline(cells), Unit("mm", 40)), frame)
    assert "box_1_size = [360, 160, 280]; // [0:5:1280]" in plain
    assert "board_1_tilt = 9; // [-45:0.5:45]" in plain


@pytest.mark.parametrize("head", UNITS)
@pytest.mark.parametrize("name", CHANGES)
def test_names_stay_live(name, head):
    program = parse(head + CHAIR)
    changed = {name: CHANGES[name]}
    same(evaluate(script_plan(program, ()), changed), expected(sp.set(program, changed)))


def test_names_expressions_functions_and_notes_are_kept():
    scad, script = scad_text(parse(CHAIR), Frame()), script_text(parse(CHAIR), Frame())
    for line in (
        "width = 10.25; // [0:0.1:21]",
        "n = 3; // [2:1:6]",
        "floor_ = -height / 2;",
        "module legs(long, inset, thick = 2) {",
        "  far = depth / 2 - thick;",
        "  legs(long = seat_height - 2.5, inset = thick, thick = thick);",
        "  for (i = [0 : 1 : round(n) - 1]) move(i, [0, 0, -(width - 2) / (n - 1)]) {",
    ):
        assert line in scad.splitlines()
    for line in (
        "seat_height = 9.5  # top of the seat above the floor; section of the legs",
        "floor = -height / 2",
        "def legs(long, inset, thick=2, place=Place()):",
        "    # four of them",
        "    legs(long=3, inset=depth / 4, place=at_i)",
        "for i in range(round(n + 2)):",
    ):
        assert line in script.splitlines()
    assert "leg_1_at" not in scad + script
    for text in (scad, script):
        assert "arc_through" not in text  # no more is defined than what is called
        assert text.count("top of the seat above the floor") == 1


def test_words_of_a_script_are_no_names_of_numbers():
    program = parse(
        "cube, scale, i, h\u00f6he, len = 1, 2, 3, 4, 5\ntop_square(at=(cube, scale, i), thickness=h\u00f6he, half=len)"
    )
    scad, script = scad_text(program, Frame()), script_text(program, Frame())
    assert "cube_ = 1;" in scad
    assert "scale_ = 2" in scad
    assert "cube = 1\nscale_ = 2\ni = 3\nh_he = 4\nlen_ = 5\n" in script
    same(evaluate(script_plan(program, {"len"})), expected(program))


@pytest.mark.parametrize(
    "text",
    [
        "t = 2\nbase_cross(at=(1, 2, 3), thickness=1, length=4, turn=t)",
        "def f(t):\n    base_cross(at=(1, 2, 3), thickness=1, length=4, turn=t)\nf(t=1)\nf(t=2)",
        "def f(x):\n    line(start=(1, 2, x), end=(1, 5, 3), radius=1)\nfor i in rotate(3, step=1):\n    f(x=2)",
        "n = 1\nfor i in rotate(2, step=n):\n    box(at=(1, 2, 3), size=(1, 1, 1))",
    ],
)
def test_what_a_script_cannot_say_with_names_is_written_out(text):
    program = parse(text)
    made = script_plan(program, ())
    assert made == plan(sp.inline(program))
    same(evaluate(made), expected(program))


FRAME = Frame.around([1, 2, 3], [30, 40, 45], grid_axes("+y", "-z"))


@pytest.mark.skipif(shutil.which("openscad") is None, reason="needs OpenSCAD")
@pytest.mark.parametrize("changes", [{}, CHANGES])
def test_openscad_makes_the_same_solid(tmp_path: Path, changes: dict[str, float]):
    program = parse(CHAIR)
    export(program, tmp_path / "chair.scad", FRAME)
    given = [word for name, value in changes.items() for word in ("-D", f"{name}={value}")]
    words = ["openscad", "-q", *given, "-o", "chair.stl", "chair.scad"]
    subprocess.run(words, cwd=tmp_path, check=True, capture_output=True)
    made, wanted = trimesh.load(tmp_path / "chair.stl"), trimesh.Trimesh(*solid(sp.set(program, changes), FRAME))
    np.testing.assert_allclose(made.volume, wanted.volume, rtol=1e-3)
    np.testing.assert_allclose(made.bounds, wanted.bounds, atol=1e-2)


@pytest.mark.skipif(importlib.util.find_spec("build123d") is None, reason="needs build123d")
def test_build123d_makes_the_same_parts():
    program = parse(CHAIR)
    scope = {"__name__": "model"}
    exec(script_text(program, FRAME), scope)
    made = {part.label: part for part in scope["parts"]}
    wanted = {part.name: part for part in parts(program, FRAME)}
    assert made.keys() == wanted.keys()
    found = [(*box.min, *box.max, part.volume) for part in made.values() for box in [part.bounding_box()]]
    meshes = [trimesh.Trimesh(part.vertices, part.faces) for part in wanted.values()]
    for mesh in meshes:  # scripts number the parts of one loop copy by copy
        like = [*mesh.bounds.ravel(), mesh.volume]
        assert min(np.abs(np.subtract(each, like) / ([2e-2] * 6 + [1e-4 * mesh.volume])).max() for each in found) < 1
