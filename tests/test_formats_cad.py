"""Scripts for CAD keep the program and draw what the program draws; files for makers stand upright in millimetres."""

from __future__ import annotations

import ast
import importlib.util
import math
import re
import shutil
import xml.etree.ElementTree as xml
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cad_twin import of_build123d, of_meshes, of_openscad, same

import shapeprog as sp
from shapeprog.cli import main
from shapeprog.errors import InputError
from shapeprog.formats import export, format_of
from shapeprog.formats.build123d import script_text
from shapeprog.formats.cuts import cut_list
from shapeprog.formats.frames import placement
from shapeprog.formats.openscad import scad_text
from shapeprog.formats.parts import parts
from shapeprog.language.parser import parse
from shapeprog.space import Frame, grid_axes

FORMS = """
# Every form of the language.
# unit: cm
width, depth, height = 50, 30, 2 * 20
gap, radius, n = 0.5, 1, 3  # between doors
inset = radius * 2

def tray(rim, floor_thickness=radius / 2):  # with a loose floor
    inner = width - 2 * rim
    shelf(height=floor_thickness)
    box(x=1, width=inner / 2, y=-1, depth=depth - 2 * rim, z=0, height=floor_thickness, lean=rim)

box(left=inset)
# Leaning parts.
back(rear=3, depth=1, bottom=20, lean=2.5, tilt=8)
seat(cushion(left=5, width=15, height=5, edge=1.5, tilt=5))
cushion(right=5, width=15, height=n, edge=25)
top_circle(cylinder(right=2.5, depth=10, height=2))
base_circle(cylinder(x=-10, rear=5, radius=inset, height=2, tilt=15))
cylinder(left=10, right=30, y=1.5, height=1.5)
post(rod(left=2, front=2, radius=radius, bottom=3))
leg(taper(left=6, front=2, radius=(0.5, radius), height=15))
leg(taper(start=at(left=1.5, front=1.5), end=at(x=0, y=0, z=0), radius=(0, 2)))
rail(bent_rod(start=at(left=5, rear=2, bottom=15), through=at(x=0, bottom=30), end=at(right=5), radius=radius))
rail(bent_rod(start=at(left=5), through=at(x=0), end=at(right=5), radius=radius))
brace(bar(start=at(left=5, bottom=5), end=at(right=5, bottom=15), depth=1.5, height=3, turn=20))
brace(bar(start=at(rear=1, bottom=25), end=at(front=1, bottom=10), width=1.5, height=3, turn=-20))
brace(bar(start=at(left=2, front=2, top=1), end=at(x=2, bottom=2), width=1.5, depth=3, turn=30))
drawer(tray(rim=2, left=5, width=20, bottom=10, height=10, tilt=3))
with inside(right=0, width=25, top=0, height=15, tilt=12):
    panel(left=width / 10, front=depth / 10, top=height / 10)
    tray(rim=width / 10, left=width / 5)
    for _ in mirror(x=2, rear=5):
        foot(left=0, width=1.5, front=2, depth=1.5, height=height / 10)
for _ in mirror(z=0):
    slat(height=1)
for _ in rotate(n + 2, left=10, y=1):
    foot(bar(start=at(left=10, front=15, bottom=1), end=at(front=5), width=1.5, height=1))
for _ in rotate(3, step=30):
    handle(width=2, front=0, depth=1, height=2)
for _ in translate(n, x=5, y=-0.5, z=1.25):
    block(left=0, width=2.5, front=0, depth=2.5, height=2.5)
for _ in row(n, last=at(top=1.5, x=5)):
    for _ in row(3, last=at(right=1)):
        slat(rod(start=at(left=2, bottom=5), end=at(top=15), radius=0.5))
for _ in row(2, last=at(right=0, rear=1)):
    for _ in mirror(y=0):
        foot(taper(left=inset, front=3, radius=(0.5, 1), height=4))
for _ in row(3, last=at(x=15)):
    foot(cylinder(left=3, front=20, rear=4, height=2))
for _ in row(0, last=at(top=0)):
    apron(height=2)
for _ in divide(2.5, x, gap=gap, bottom=25, top=5, tilt=4):
    for _ in divide(n, z):
        door(front=0, depth=gap)
"""

CHANGES = {"width": 60, "depth": 26, "height": 45, "gap": 0.75, "radius": 1.25, "n": 4, "inset": 3}

STOOL = """
# unit: m
width, depth, height = 0.36, 0.36, 0.45
seat(top=0, height=0.03)
for _ in mirror(x=0, y=0):
    leg(left=0.02, width=0.04, front=0.02, depth=0.04, top=0.03)
"""

FRAME = Frame.around([1, 2, 3], [30, 40, 45], grid_axes("+y", "-z"))

needs_openscad = pytest.mark.skipif(shutil.which("openscad") is None, reason="needs OpenSCAD")
needs_build123d = pytest.mark.skipif(importlib.util.find_spec("build123d") is None, reason="needs build123d")


def changed(name):
    """The program with another value of a name, and that value."""
    if not name:
        return parse(FORMS), {}
    value = {name: CHANGES[name]}
    if name == "inset":  # an expression
        return parse(FORMS.replace("radius * 2", str(CHANGES[name]))), value
    return sp.set(parse(FORMS), value), value


def upright(program, name="a.scad", **asked):
    return placement(format_of(name), program, **asked).frame


@needs_openscad
@pytest.mark.parametrize("name", ["", *CHANGES])
def test_openscad_draws_the_parts_and_its_customizer_changes_what_set_changes(name, tmp_path: Path):
    program, (other, changes) = parse(FORMS), changed(name)
    frame = upright(program)
    same(of_openscad(scad_text(program, frame), tmp_path, changes), of_meshes(other, frame))


@needs_openscad
def test_openscad_draws_where_a_frame_says(tmp_path: Path):
    program = parse(FORMS)
    same(of_openscad(scad_text(program, FRAME), tmp_path), of_meshes(program, FRAME))


@needs_build123d
@pytest.mark.parametrize("name", ["", *CHANGES])
def test_build123d_draws_the_parts_and_its_numbers_change_what_set_changes(name):
    program, (other, _) = parse(FORMS), changed(name)
    frame = upright(program)
    lines = script_text(program, frame).splitlines()
    if name:
        (place,) = (row for row, line in enumerate(lines) if line.startswith(f"{name} = "))
        lines[place] = f"{name} = {CHANGES[name]}"
    same(of_build123d("\n".join(lines)), of_meshes(other, frame))


@needs_build123d
def test_build123d_draws_where_a_frame_says_and_writes_named_solids(tmp_path: Path):
    import build123d

    program = parse(FORMS)
    same(of_build123d(script_text(program, FRAME)), of_meshes(program, FRAME))
    read = build123d.import_step(export(parse(STOOL), tmp_path / "a.step"))
    assert [part.label for part in read.children] == ["seat_1", "leg_1", "leg_2", "leg_3", "leg_4"]
    np.testing.assert_allclose(tuple(read.bounding_box().size), (360, 360, 450), rtol=1e-5)


def test_scripts_keep_loops_names_functions_roles_and_comments():
    scad, script = scad_text(parse(FORMS), FRAME).splitlines(), script_text(parse(FORMS), FRAME).splitlines()
    for line in (
        "// Every form of the language.",
        "// between doors",
        "n = 3; // [1:1:3]",
        "inset = radius * 2;",
        "module tray(rim, floor_thickness = radius / 2) { // with a loose floor",
        "  inner = $width - 2 * rim;",
        "  // Leaning parts.",
        '  part("leg") upright("taper", left = 6, front = 2, radius = [0.5, radius], height = 15);',
        '  part("drawer") inside(left = 5, width = 20, bottom = 10, height = 10, tilt = 3) tray(rim = 2);',
        "    let ($given_rim = $width / 10) inside(left = $width / 5) tray(rim = $given_rim);",
        '  divide(2.5, "x", gap = gap, bottom = 25, top = 5, tilt = 4) {',
        "  rotated(n + 2, left = 10, y = 1) {",
    ):
        assert line in scad
    for line in (
        "# Every form of the language.",
        "width = 50",
        "gap = 0.5  # between doors",
        "@function",
        "def tray(rim, floor_thickness=radius / 2):  # with a loose floor",
        "    inner = here.width - 2 * rim",
        'leg = role("leg")',
        "leg(taper(left=6, front=2, radius=(0.5, radius), height=15))",
        "    tray(rim=here.width / 10, left=here.width / 5)",
        "for _ in divide(2.5, x, gap=gap, bottom=25, top=5, tilt=4):",
    ):
        assert line in script
    assert scad.count("// between doors") == script.count("gap = 0.5  # between doors") == 1
    assert "module bent_rod" not in scad_text(parse(STOOL), FRAME)  # no more is defined than what is called


@pytest.mark.parametrize("piece", ["chair", "office_chair", "desk_with_drawers"])
def test_sliders_of_openscad_end_where_the_program_holds_together_and_take_its_numbers(piece: str):
    program = sp.load(Path(__file__).parents[1] / "examples" / "pieces" / f"{piece}.shape")
    program = sp.set(program, height=sp.names(program)[2].value + 0.3)
    sliders = re.findall(
        r"^(\w+) = (.*); // \[(.*):(.*):(.*)\]$", scad_text(program, FRAME).partition("/* [Q")[0], re.M
    )
    assert len(sliders) > 5
    for name, *texts in sliders:
        value, low, step, high = map(float, texts)
        (named,) = (number for number in sp.names(program) if number.name == name)
        assert named.range is not None
        assert named.range[0] - 1e-4 <= low <= value <= high <= named.range[1] + 1e-4
        assert (value - low) / step == pytest.approx(round((value - low) / step), abs=1e-6), "a slider moves in steps"
        for end in (low, high):
            assert sp.set(program, {name: end}).size


def test_words_of_a_script_are_no_names_of_numbers(tmp_path: Path):
    text = "width, depth, height = 4, 5, 6\ncube, scale, h\u00f6he, len, \u00f8 = 1, 2, 3, 4, 5\n"
    text += "def union(parts):\n    box(left=parts, height=len)\nbox(left=cube, bottom=scale)\nunion(parts=h\u00f6he)\n"
    program = parse(text)
    scad, script = scad_text(program, FRAME), script_text(program, FRAME)
    assert "\ncube_ = 1;" in scad
    assert "\nh_he = 3;" in scad
    assert "module union_(parts)" in scad
    assert "\ncube = 1\nscale_ = 2\nh_he = 3\nlen_ = 4\n__ = 5\n" in script
    ast.parse(script)
    if shutil.which("openscad"):
        same(of_openscad(scad, tmp_path), of_meshes(program, FRAME))


def test_a_role_around_a_call_names_cushions_and_boxes_alike():
    text = "width, depth, height = 40, 40, 40\ndef soft():\n    cushion(height=5, edge=1)\n    box(bottom=5)\n"
    for line, names in (("drawer(soft())", ["drawer_1", "drawer_2"]), ("soft()", ["cushion_1", "box_1"])):
        program = parse(f"{text}{line}\n")
        assert [part.name for part in parts(program)] == names
        assert ("drawer(soft())" in script_text(program, FRAME)) == ("drawer_1" in names)


def read_3mf(path: Path):
    """The unit, and the vertices of all objects by name, of a 3MF file."""
    with zipfile.ZipFile(path) as package:
        root = xml.fromstring(package.read("3D/3dmodel.model"))
    kind = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
    objects = {
        each.get("name"): np.array([[float(v.get(axis)) for axis in "xyz"] for v in each.iter(f"{kind}vertex")])
        for each in root.iter(f"{kind}object")
    }
    return root.get("unit"), objects


def bounds_of(path: Path):
    if path.suffix == ".3mf":
        every = np.concatenate([*read_3mf(path)[1].values()])
        return [every.min(0), every.max(0)]
    return trimesh.load(path, force="mesh").bounds


STANDING = [[-180, -180, 0], [180, 180, 450]]


@pytest.mark.parametrize("suffix", [".stl", ".3mf"])
def test_a_stool_in_metres_and_one_inferred_from_millimetres_stand_450_mm_high(suffix, tmp_path: Path):
    stool = parse(STOOL)
    np.testing.assert_allclose(bounds_of(export(stool, tmp_path / f"m{suffix}")), STANDING, atol=0.01)
    bare = parse(STOOL.replace("# unit: m\n", ""))  # an STL in millimetres that lies on its back
    frame = Frame(450 / 24, (700, -50, 20), tuple(map(tuple, grid_axes("-y", "+z"))))
    made = export(bare, tmp_path / f"mm{suffix}", frame, file_unit="mm")
    np.testing.assert_allclose(bounds_of(made), STANDING, atol=0.01)
    lying = np.array([frame.to_world(np.array(STANDING) * 0)[0]])
    assert np.abs(bounds_of(export(bare, tmp_path / f"on{suffix}", frame, on_input=True)) - lying).max() < 250


def test_units_and_axes_of_files(tmp_path: Path):
    stool = parse(STOOL)
    for name, asked, high in (
        ("a.glb", {}, [0.36, 0.45, 0.36]),
        ("b.glb", {"unit": "cm", "up": "z"}, [36, 36, 45]),
        ("a.obj", {}, [0.36, 0.45, 0.36]),
        ("a.ply", {"unit": "in"}, [0.36 / 0.0254, 0.45 / 0.0254, 0.36 / 0.0254]),
        ("a.stl", {"unit": "cm", "up": "y"}, [36, 45, 36]),
        ("b.stl", {"unit": "cells"}, [19.2, 19.2, 24]),
        ("a.3mf", {"unit": "in"}, [0.36 / 0.0254, 0.36 / 0.0254, 0.45 / 0.0254]),
    ):
        low, far = bounds_of(export(stool, tmp_path / name, **asked))
        np.testing.assert_allclose(far - low, high, rtol=1e-4)
    assert read_3mf(tmp_path / "a.3mf")[0] == "inch"
    assert {*read_3mf(tmp_path / "a.3mf")[1]} == {"seat_1", "leg_1", "leg_2", "leg_3", "leg_4"}
    assert "scale(1000) whole" in scad_text(stool, upright(stool))
    bare = parse(STOOL.replace("# unit: m\n", ""))
    assert "\nwhole(" in scad_text(bare, upright(bare))  # one unit of the text is one of the file
    with pytest.raises(InputError, match="the size of the object is unknown"):
        export(bare, tmp_path / "a.stl", unit="mm")
    with pytest.raises(InputError, match="does not say how its input lies"):
        export(bare, tmp_path / "a.stl", on_input=True)


CABINET = """
# unit: cm
width, depth, height = 80, 40, 60
for _ in mirror(x=0):
    side(left=0, width=1.8)
    panel(left=2, right=2, rear=0, depth=0.8)
    knob = 0
shelf(left=1.8, right=1.8, z=0, height=1.8)
for _ in mirror(x=0, y=0):
    foot(cylinder(left=4, front=4, radius=2, top=60, bottom=-10))
    foot(taper(left=12, front=4, radius=(1, 2), height=8))
seat(cushion(top=-6, height=6, edge=2, tilt=3))
back(rear=0, depth=2, lean=5)
rail(bent_rod(start=at(left=0), through=at(x=0, bottom=40), end=at(right=0), radius=1))
""".replace("    knob = 0\n", "")


def test_a_cut_list_has_each_distinct_part_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    program = parse(CABINET)
    found = cut_list(program, upright(program, "a.csv"), "cm")
    rows = {(count, *cut) for cut, count in found.cuts}
    arc = 2 * 40 * math.atan2(40, 40) * 2
    assert rows == {
        (2, "side", "board", 60, 40, 1.8, 0),
        (1, "panel", "board", 76, 60, 0.8, 0),
        (1, "shelf", "board", 76.4, 40, 1.8, 0),
        (4, "foot", "round", 10, 0, 0, 4),
        (4, "foot", "tapered from 2 to 4", 8, 0, 0, 4),
        (1, "seat", "rounded edges 2", 80, 40, 6, 0),
        (1, "back", "board, leaning by 5", 80, 60.21, 2, 0),
        (1, "rail", "bent", round(arc, 2), 0, 0, 2),
    }
    assert found.coinciding == 1
    assert found.area == "1.72 m²"  # two sides, a panel, a shelf, the back
    program_file = tmp_path / "cabinet.shape"
    program_file.write_text(CABINET.lstrip())
    with pytest.raises(SystemExit, match="0"):
        main(["export", str(program_file), str(tmp_path / "cuts.csv"), "--unit", "mm"])
    assert "where another one lies are left out (a mirror through the part?): 1" in capsys.readouterr().err
    lines = (tmp_path / "cuts.csv").read_text().splitlines()
    assert lines[0] == "count,role,length (mm),width (mm),thickness (mm),diameter (mm),shape"
    assert "2,side,600,400,18,,board" in lines
    assert "4,foot,100,,,40,round" in lines


@pytest.mark.parametrize(
    ("plane", "part"),
    [
        ("y=0", "leg(x=0, width=4, y=0, depth=4, lean=36)"),
        ("z=0", "leg(taper(x=0, y=0, z=0, radius=(1, 2), height=8))"),
        ("z=0", "rail(bent_rod(start=at(left=0, z=0), through=at(x=0, bottom=40), end=at(right=0, z=0), radius=1))"),
    ],
)
def test_parts_that_differ_in_direction_alone_are_no_copies(plane: str, part: str):
    for mirror, count in ((plane, 2), ("x=0", 1)):
        program = parse(f"width, depth, height = 60, 40, 50\nfor _ in mirror({mirror}):\n    {part}\n")
        assert [number for _, number in cut_list(program, Frame()).cuts] == [count]


def test_areas_of_inches_are_in_square_feet_and_a_section_has_one_word(tmp_path: Path):
    lines = "".join(f"leg(height={length}, width=3.35, depth=3.35)\n" for length in (10.05, 10.06, 30))
    program = parse(f"# unit: in\nwidth, depth, height = 24, 24, 40\ntop(top=0, height=1)\n{lines}")
    found = cut_list(program, upright(program, "a.csv"), "in")
    assert found.area == "4 ft²"
    assert [cut.shape for cut, _ in found.cuts] == ["", "", "", "board"]


@pytest.mark.parametrize("suffix", [".stl", ".3mf"])
def test_files_for_printers_rest_on_their_lowest_point(suffix: str, tmp_path: Path):
    text = "# unit: cm\nwidth, depth, height = 50, 40, 45\nseat(top=0, height=3)\n"
    slanted = "leg(bar(start=at(left=2, y=0), end=at(left=8, y=0, top=3), width=4, depth=4))\n"
    program = parse(f"{text}{slanted}")
    low, high = bounds_of(export(program, tmp_path / f"a{suffix}"))
    assert low[2] == pytest.approx(0, abs=0.01)
    assert high[2] > 450 + 1, "lifted by what dips below the floor"
    assert [low[1], high[1]] == pytest.approx([-200, 200], abs=0.01)
    low, _ = bounds_of(export(program, tmp_path / f"b{suffix}", unit="cm", up="y"))
    assert low[1] == pytest.approx(0, abs=0.001)
    frame = Frame(1.0, (0.0, 0.0, 0.0), tuple(map(tuple, grid_axes("+z", "-y"))))
    low, _ = bounds_of(export(program, tmp_path / f"c{suffix}", frame, on_input=True))
    assert low[2] < -10.8 - 0.1, "on the input it stays where it is"
    assert "scale(10) whole(" in scad_text(program, upright(program))


def test_what_step_files_need_is_the_same_in_messages_and_documentation():
    for text in (format_of("a.step").doc, (Path(__file__).parents[1] / "docs" / "formats.md").read_text()):
        assert "pip install build123d" in text
