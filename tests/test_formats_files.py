"""Every format: it agrees with unrolling where the input lies, is whole or not there, and errors say what to do."""

from __future__ import annotations

import errno
import inspect
import json
import os
import pkgutil
import re
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cad_twin import volume_of
from hypothesis import given
from hypothesis import strategies as st

import shapeprog as sp
from shapeprog.cli import main
from shapeprog.data import load
from shapeprog.data.loading import ARRAY_SUFFIXES
from shapeprog.data.synthetic.shapes import shapes_of
from shapeprog.errors import InputError, OutputError, ProgramError, ShapeProgError
from shapeprog.formats import FORMATS, Format, export, format_of, listed, suffixes
from shapeprog.formats.colours import colour
from shapeprog.formats.files import program_files
from shapeprog.formats.frames import frame_comment, frame_of_grid, in_grid_of, placement, scale_of
from shapeprog.formats.json_form import program_from_json, program_to_json
from shapeprog.formats.parts import crease_normals, parts, solid
from shapeprog.formats.shape import program_in, program_text
from shapeprog.geometry.primitives.cylinder import CYLINDER
from shapeprog.language.ast import Scale
from shapeprog.language.evaluate import evaluated
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program
from shapeprog.language.program import Program
from shapeprog.space import Frame, grid_axes

TEXT = """
top_rectangle(at=(10, 0, 0), thickness=2, half=(12, 9))
for i in translate(2, by=(0, 0, 14)):
    for j in translate(2, by=(0, 20, 0)):
        leg(at=(-12, -11, -8), size=(22, 2, 2))
line(start=(-6, -10, -8), end=(-6, 9, -8), radius=0.75)
"""
PROGRAM = parse(TEXT)
FRAME = Frame.around([1, 2, 3], [3, 4, 4.5], grid_axes("+y", "-z"))
MESHES = [".glb", ".obj", ".ply", ".stl"]


def lies(suffix: str, frame: Frame | None = None) -> Frame:
    """Where the table is in a file."""
    return placement(format_of(f"a{suffix}"), replace(PROGRAM, frame=frame)).frame


def close(one: Frame | None, two: Frame | None) -> None:
    """Both are the same map but for the rounding of text."""
    assert (one is None) == (two is None)
    if one is not None and two is not None:
        np.testing.assert_allclose(one.matrix(), two.matrix(), rtol=1e-7, atol=1e-6 * two.scale)


@pytest.mark.parametrize("suffix", MESHES)
@pytest.mark.parametrize("frame", [FRAME, None])
def test_meshes_agree_with_the_parts(tmp_path: Path, suffix: str, frame: Frame | None):
    path = export(PROGRAM, tmp_path / f"table{suffix}", frame)
    read = trimesh.load(path, force="mesh")
    each = parts(PROGRAM, lies(suffix, frame))
    stacked = np.concatenate([part.vertices for part in each])
    np.testing.assert_allclose(read.bounds, [stacked.min(0), stacked.max(0)], atol=1e-5)
    union = trimesh.Trimesh(*solid(PROGRAM, lies(suffix, frame)))
    wanted = union.volume if suffix == ".stl" else sum(map(volume_of, each))
    np.testing.assert_allclose(read.volume, wanted, rtol=1e-5)


def test_stl_is_one_watertight_solid_without_inner_walls(tmp_path: Path):
    read = trimesh.load(export(PROGRAM, tmp_path / "table.stl", FRAME))
    assert read.is_watertight
    assert read.body_count == 1
    overlap = sum(map(volume_of, parts(PROGRAM, lies(".stl", FRAME)))) - read.volume
    assert overlap > 0


def test_stl_has_no_triangle_whose_corners_coincide(tmp_path: Path):
    path = export(PROGRAM, tmp_path / "far.stl", Frame(centre=(1e7, 0, 0), scale=0.4), on_input=True)
    corners = trimesh.load(path, process=False).triangles
    assert len(corners) > 20
    assert (corners != np.roll(corners, 1, 1)).any(2).all()


def test_glb_names_and_colours_every_part(tmp_path: Path):
    scene = trimesh.load(export(PROGRAM, tmp_path / "table.glb", FRAME))
    names = ["top_rectangle_1", "leg_1", "leg_2", "leg_3", "leg_4", "line_1"]
    assert sorted(scene.graph.nodes_geometry) == sorted(names)
    for name, part in zip(names, parts(PROGRAM), strict=True):
        material = scene.geometry[name].visual.material
        assert material.name == part.word
        assert tuple(material.baseColorFactor[:3]) == colour(part.word)


def test_obj_names_parts_and_colours_them_beside(tmp_path: Path):
    text = export(PROGRAM, tmp_path / "table.obj").read_text()
    assert [line[2:] for line in text.splitlines() if line.startswith("o ")] == [part.name for part in parts(PROGRAM)]
    assert "newmtl leg\nKd 0.2667 0.4667 0.6667" in (tmp_path / "table.mtl").read_text()


def test_ply_colours_its_vertices(tmp_path: Path):
    read = trimesh.load(export(PROGRAM, tmp_path / "table.ply"), process=False)
    colours = {tuple(row) for row in read.visual.vertex_colors[:, :3].tolist()}
    assert colours == {colour("leg"), colour("top_rectangle"), colour("line")}


def test_a_program_without_a_frame_stands_upright_for_the_loader(tmp_path: Path):
    for suffix in MESHES:
        shape = load(export(PROGRAM, tmp_path / f"table{suffix}"))
        occupied = np.argwhere(shape.voxels)
        assert (occupied.max(0) - occupied.min(0) + 1).tolist() == pytest.approx([24, 24, 18], abs=1), suffix
        assert shape.voxels[26:28].mean() > 4 * shape.voxels[8:20].mean(), f"{suffix}: the top is not on top"


@pytest.mark.parametrize("suffix", [s for s in suffixes() if s not in (".step", ".stp")])
def test_a_full_disk_leaves_the_old_file_and_no_litter(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / f"table{suffix}"
    path.write_text("old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OutputError, match="the disk is full"):
        export(PROGRAM, path)
    assert path.read_text() == "old"
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_errors_say_what_to_do(tmp_path: Path):
    with pytest.raises(OutputError, match=r"did you mean \.glb"):
        export(PROGRAM, tmp_path / "table.gbl")
    with pytest.raises(OutputError, match="no suffix"):
        export(PROGRAM, tmp_path / "table")
    with pytest.raises(OutputError, match="make the folder first"):
        export(PROGRAM, tmp_path / "nowhere" / "table.glb")
    with pytest.raises(OutputError, match="draws nothing"):
        export(Program(), tmp_path / "table.glb")
    with pytest.raises(OutputError, match="no solid"):
        export(parse("leg(at=(0, 0, 0), size=(0, 2, 2))"), tmp_path / "table.stl")
    (tmp_path / "cut.json").write_text(program_to_json(PROGRAM)[:-30])
    with pytest.raises(ProgramError, match="cut off"):
        sp.load(tmp_path / "cut.json")


def test_every_program_file_reads_back_with_its_frame(tmp_path: Path):
    for suffix, program, frame in product(suffixes("program"), (parse(PLACED), PROGRAM), (FRAME, None)):
        path = tmp_path / f"table{suffix}"
        sp.save(program, path, frame)
        sp.save(sp.load(path), path)
        assert sp.load(path) == program
        close(sp.load(path).frame, frame)
        assert path.read_text().count("# placed:") == (frame is not None)
    assert (tmp_path / "table.shape").read_text() == format_program(PROGRAM)
    assert parse(program_text(replace(PROGRAM, frame=FRAME))) == PROGRAM
    assert json.loads(program_to_json(PROGRAM, FRAME, reason="done"))["reason"] == "done"
    text = tmp_path / "table.txt"
    text.write_text(TEXT)
    assert sp.load(text) == PROGRAM


def test_the_programs_of_a_folder_are_found_in_any_case_and_the_json_of_a_name_stands_for_it(tmp_path: Path):
    for name in ("b.shape", "b.JSON", "A.SHAPE", "c.json", "d.glb"):
        (tmp_path / name).touch()
    assert [path.name for path in program_files(tmp_path)] == ["A.SHAPE", "b.JSON", "c.json"]


def test_files_that_hold_no_program_are_refused_in_words(tmp_path: Path):
    (tmp_path / "other.json").write_text('{"chair": 4}')
    with pytest.raises(InputError, match="holds no program"):
        sp.load(tmp_path / "other.json")
    for name in ("chair.glb", "chair"):
        with pytest.raises(InputError, match=r"holds no program.*\n.*\.shape or \.json"):
            sp.load(tmp_path / name)
    with pytest.raises(InputError, match="there is no file"):
        sp.load(tmp_path / "missing.json")
    for name in ("chair.glb", "chair.txt", "chair"):
        with pytest.raises(OutputError, match="could not be read back"):
            sp.save(PROGRAM, tmp_path / name)
    assert [each.name for each in tmp_path.iterdir()] == ["other.json"]


def test_samples_take_their_options_and_other_formats_refuse_them(tmp_path: Path):
    assert np.load(export(PROGRAM, tmp_path / "cells.npy", resolution=16)).shape == (16, 16, 16)
    for name, number in (("a.npy", {"resolution": 5000}), ("a.npy", {"resolution": 1.5}), ("a.xyz", {"seed": 2**64})):
        with pytest.raises(ShapeProgError, match="give a whole number"):
            export(PROGRAM, tmp_path / name, **number)
    one, two = (export(PROGRAM, tmp_path / f"{seed}.xyz", FRAME, points=100, seed=seed) for seed in (1, 2))
    assert np.loadtxt(one).shape == (100, 6)
    assert (np.loadtxt(one) != np.loadtxt(two)).any()
    with pytest.raises(OutputError, match=r"\.glb takes no points"):
        export(PROGRAM, tmp_path / "table.glb", points=100)


@pytest.mark.parametrize("resolution", [32, 64])
def test_cells_are_those_that_thin_parts_touch(tmp_path: Path, resolution: int):
    program = parse("width, depth, height = 24, 24, 24\nshelf(bottom=5.2, height=0.2)\nback(front=0, depth=0.1)")
    cells = np.load(export(program, tmp_path / "a.npy", resolution=resolution))
    step = resolution // 32
    expected = np.zeros_like(cells)
    low, high = 4 * step, 28 * step
    expected[int(9.2 * step) : int(9.4 * step) + 1, low:high, low:high] = True
    expected[low:high, low, low:high] = True
    np.testing.assert_array_equal(cells, expected)
    if resolution == 32:
        np.testing.assert_array_equal(cells, shapes_of({"a": program})[0].voxels)


@pytest.mark.parametrize("suffix", [".xyz", ".obj"])
def test_points_far_from_the_origin_keep_their_digits(tmp_path: Path, suffix: str):
    path = export(PROGRAM, tmp_path / f"a{suffix}", Frame(centre=(5e6, 4e5, 100), scale=0.0123))
    values = path.read_text().replace("v ", "").split()
    assert max(len(value.replace(".", "")) for value in values if value.startswith("5000000.")) >= 10


def test_each_suffix_has_one_declaration_and_every_readable_shape_states_its_axes():
    every = [suffix for each in FORMATS for suffix in each.suffixes]
    assert len(every) == len(set(every))
    assert all(each.axes is None for each in FORMATS if each.kind == "program")
    assert all(grid_axes(*each.axes).shape == (3, 3) for each in FORMATS if each.axes is not None)
    stated = {suffix for each in FORMATS if each.axes for suffix in each.suffixes}
    assert {*ARRAY_SUFFIXES, ".binvox", ".glb", ".gltf", ".obj", ".off", ".ply", ".stl"} <= stated


@pytest.mark.parametrize("each", FORMATS, ids=lambda each: each.name)
def test_the_functions_that_a_declaration_names_are_there_and_take_its_options(each: Format):
    for place, first in ((each.reader, ["text", "name"]), (each.writer, ["program"])):
        if place:
            function = pkgutil.resolve_name(f"shapeprog.formats.{place}")
            assert list(inspect.signature(function).parameters)[: len(first)] == first
    if each.writer:
        assert set(each.options) <= {"frame", "unit", "stem", "resolution", "points", "seed", "more"}


def test_help_and_errors_list_the_declared_formats(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        main(["export", "--help"])
    assert " ".join(suffixes()) in " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert listed().splitlines()[0] in str(sp.export.__doc__)
    with pytest.raises(OutputError, match=re.escape(", ".join(suffixes()))):
        export(PROGRAM, tmp_path / "table.unheard")


def test_step_without_its_library_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(OutputError, match=r"pip install build123d"):
        export(PROGRAM, tmp_path / "table.step")


PLACED = """\
# unit: cm
width, depth, height = 44, 42, 90
leg_width = 4

def backrest(slats):
    for _ in row(slats, last=at(top=3)):
        slat(left=leg_width, depth=2, bottom=12, height=6)

for _ in mirror(x=0, y=0):
    leg(left=0, width=leg_width, front=0, depth=leg_width, top=45)
arm(cylinder(right=0, radius=2, bottom=50, height=4))
backrest(slats=3, rear=0, depth=leg_width, bottom=45, tilt=11)
"""
SIGNED = [f"{sign}{axis}" for sign in ("", "-") for axis in "xyz"]
ALIGNED = [(up, front) for up in SIGNED for front in SIGNED if up[-1] != front[-1]]


def turned(seed: int) -> list[list[float]]:
    """A rotation along no axis."""
    axes, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return (axes * [1, 1, np.linalg.det(axes)]).tolist()


@pytest.mark.parametrize("suffix", [".shape", ".json"])
@given(
    st.sampled_from([*ALIGNED, None]),
    st.floats(1e-4, 1e4),
    st.tuples(*[st.floats(-100, 100)] * 3),
    st.floats(0.5, 2),
    st.integers(0, 99),
)
def test_what_is_saved_and_loaded_lies_at_the_same_place_in_the_world(
    suffix: str, axes: tuple[str, str] | None, scale: float, middle: tuple[float, float, float], grid: float, seed: int
):
    source = parse(PLACED).source
    assert source is not None
    assert source.scale is not None
    # inference has a grid of its own, in which the longest side of the whole need not be 24 cells
    other = Scale(source.scale.cells_per_unit * grid, source.scale.floor + grid, grid / 3)
    rotation = turned(seed) if axes is None else grid_axes(*axes).tolist()
    frame = Frame(scale, tuple(scale * value for value in middle), tuple(map(tuple, rotation)))
    program = replace(evaluated(replace(source, scale=other)), frame=frame)
    text = program_text(program)
    assert text.startswith("# placed: up " if axes is None else f"# placed: up {axes[0]}, front {axes[1]}, origin ")
    read = program_in(text, "x") if suffix == ".shape" else program_from_json(program_to_json(program))
    for one, two in zip(parts(program), parts(read), strict=True):
        there, back = frame.to_world(one.vertices), read.frame.to_world(two.vertices)
        np.testing.assert_allclose(back, there, rtol=0, atol=24e-6 * scale)
    assert program_text(read).splitlines()[1:] == text.splitlines()[1:]
    for one, two in zip(parts(program), parts(in_grid_of(read, frame)), strict=True):
        np.testing.assert_allclose(two.vertices, one.vertices, rtol=0, atol=24e-6)
    beside = replace(frame, scale=2 * scale, centre=tuple(frame.to_world([1, 2, 3])))  # in size, height, depth and side
    for one, two in zip(parts(program), parts(in_grid_of(read, beside)), strict=True):
        np.testing.assert_allclose(beside.to_world(two.vertices), frame.to_world(one.vertices), atol=24e-6 * scale)


@pytest.mark.parametrize("unit", ["", "# unit: m\n"])
def test_the_size_of_a_unit_is_written_without_the_error_of_rounding(unit: str) -> None:
    program = parse(unit + "width, depth, height = 1, 0.5, 0.5\ntop(height=0.1)")
    written = frame_comment(replace(program, frame=Frame(scale=(1 - 3e-8) / 24)))
    assert written.endswith(f"1 unit = 1{' m' if unit else ''}\n")


def test_the_frame_of_a_placed_text_is_a_line_to_read():
    scale = scale_of(parse(PLACED))
    metres = frame_of_grid(Frame(0.01, (0, 0.5, 0), ((1, 0, 0), (0, 0, 1), (0, -1, 0))), scale)
    line = "# placed: up y, front z, origin 0 0.5 0, 1 unit = 0.01 m"
    assert program_text(replace(parse(PLACED), frame=metres)) == f"{line}\n{PLACED}"
    assert program_text(parse(PLACED)) == PLACED
    read = program_in(f"# a chair\r\n{line}\r\n" + PLACED.replace("\n", "\r\n"), "x")
    assert format_program(read) == PLACED.replace("\nwidth", "\n# a chair\n\nwidth", 1)
    np.testing.assert_allclose(read.frame.centre, metres.centre, atol=1e-12)
    assert program_in(PLACED + line, "x").frame is None, "below the first statement it is a comment"


@pytest.mark.parametrize(
    ("entries", "column", "words"),
    [
        ("up y, front -y, origin 0 0 0, 1 unit = 1", 11, "perpendicular"),
        ("up 0 1 0, front 0 1 0, origin 0 0 0, 1 unit = 1", 11, "perpendicular"),
        ("up 0 1e999 0, front 0 0 1, origin 0 0 0, 1 unit = 1", 11, "perpendicular"),
        ("up y", 11, "no frame of a text"),
        ("up w, front z, origin 0 0 0, 1 unit = 1", 11, "no frame of a text"),
        ("up y, front z, origin 0 a 0, 1 unit = 1 m", 11, "no frame of a text"),
        ("up y, front z, origin 0 1e999 0, 1 unit = 1", 11, "no frame of a text"),
        ("up y, front z, origin 0 0 0, 1 unit = 0", 11, "no frame of a text"),
    ],
)
def test_a_wrong_frame_of_a_placed_text_has_its_place(entries: str, column: int, words: str):
    with pytest.raises(ProgramError, match=words) as caught:
        program_in(f"# a chair\n# placed: {entries}\n{PLACED}", "x")
    assert (caught.value.line, caught.value.column) == (2, column)
    assert "write it as # placed: up y" in caught.value.hint


@pytest.mark.parametrize(
    "wrong",
    [
        *({"scale": scale} for scale in (0.0, -1.0, float("nan"), float("inf"))),
        {"centre": (float("inf"), 0, 0)},
        {"axes": ((2, 0, 0), (0, 1, 0), (0, 0, 1))},
        {"centre": (1, 2)},
        {"axes": ((-1, 0, 0), (0, 1, 0), (0, 0, 1))},
        {"axes": ((1, 0), (0, 1))},
    ],
)
def test_a_frame_that_would_not_be_read_back_is_none(wrong: dict[str, Any]):
    with pytest.raises(sp.ShapeProgError, match=r"scale is|is no frame"):
        Frame(**wrong)


def test_json_lists_the_solids_with_their_lines_and_bounds():
    content = json.loads(program_to_json(parse(PLACED), lies(".stl"), scores={"iou": 0.5}))
    lines = content["text"].splitlines()
    assert (content["unit"], content["scores"], "frame" in content) == ("cm", {"iou": 0.5}, True)
    found = [(lines[each["line"] - 1].strip(), each["role"], each["kind"]) for each in content["solids"]]
    leg = "leg(left=0, width=leg_width, front=0, depth=leg_width, top=45)"
    assert found[:4] == [(leg, "leg", "box")] * 4
    assert found[4] == ("arm(cylinder(right=0, radius=2, bottom=50, height=4))", "arm", "cylinder")
    assert {(role, kind) for _, role, kind in found[5:]} == {("slat", "box")}
    bounds = [(each["low"], each["high"]) for each in content["solids"]]
    assert ([-22, -21, 0], [-18, -17, 45]) in bounds[:4]
    assert ([18, 17, 0], [22, 21, 45]) in bounds[:4]
    assert bounds[4] == ([18, -2, 50], [22, 2, 54])
    in_cells = json.loads(program_to_json(PROGRAM))
    assert (in_cells["unit"], in_cells["solids"][0]["kind"]) == ("cells", "top_rectangle")
    assert in_cells["solids"][1] | {"role": "leg", "low": [6, -11, -12], "high": [8, -9, 10]} == in_cells["solids"][1]


def test_json_bounds_of_turned_round_solids_are_theirs():
    feet = "for _ in rotate(3):\n    foot(cylinder(width=6, front=11, height=4))\n"
    content = json.loads(program_to_json(parse(f"width, depth, height = 40, 40, 40\n{feet}")))
    for entry in content["solids"]:
        sides = np.subtract(entry["high"], entry["low"])
        np.testing.assert_allclose(sides, [6, 6, 4], rtol=3e-3)


def test_json_of_very_many_solids_has_no_list_of_them():
    program = parse("for i in translate(20000, by=(0.001, 0, 0)):\n    leg(at=(0, 0, 0), size=(1, 1, 1))\n")
    assert "solids" not in json.loads(program_to_json(program))


def test_creases_are_sharp_and_rounds_are_smooth():
    vertices, faces = CYLINDER.mesh(np.array([2.0, 3.0, 0, 0]))
    normals = crease_normals(vertices, faces)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-12)
    corners = vertices[faces]
    side = np.abs(normals[..., 0]) < 0.5
    radial = corners[side][:, 1:] / np.linalg.norm(corners[side][:, 1:], axis=1, keepdims=True)
    np.testing.assert_allclose(normals[side][:, 1:], radial, atol=0.03)
    np.testing.assert_allclose(np.abs(normals[~side][:, 0]), 1, atol=1e-12)
