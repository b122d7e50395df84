"""The commands: what they write, what they say, and how they end."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from commands import FRAME, PROGRAM, Run, table

import shapeprog as sp
from shapeprog import inference, view
from shapeprog.cli import main, terminal, writing
from shapeprog.data import Shape, loading
from shapeprog.data import load as load_shape
from shapeprog.formats import export
from shapeprog.formats.json_form import program_to_json
from shapeprog.space import Frame, grid_axes


@pytest.mark.usefixtures("quick")
def test_infer_writes_four_files_that_lie_on_the_input(run: Run, tmp_path: Path):
    ended = run("infer", table(tmp_path / "table.stl"), "--out", "res", "--up", "+y", "--front", "+z")
    assert ended.code == 0, ended.err
    assert sorted(path.name for path in (tmp_path / "res").iterdir()) == [
        "table.glb", "table.json", "table.png", "table.shape"
    ]  # fmt: skip
    assert "leg(at=(-12, -9, -12), size=(22, 2, 2))" in ended.out
    assert "IoU 1.000" in ended.out
    assert "Stopped at once." in ended.out
    source = trimesh.load(tmp_path / "table.stl", force="mesh").bounds
    np.testing.assert_allclose(trimesh.load(tmp_path / "res" / "table.glb").bounds, source, atol=1e-4)
    kept = json.loads((tmp_path / "res" / "table.json").read_text())
    assert kept["scores"]["iou"] == 1
    assert "odd" not in kept["scores"], "JSON knows no NaN"
    for name in ("table.shape", "table.json"):
        assert run("export", f"res/{name}", f"{name}.obj").code == 0
        np.testing.assert_allclose(trimesh.load(tmp_path / f"{name}.obj", force="mesh").bounds, source, atol=1e-4)


@pytest.mark.usefixtures("quick")
def test_a_broken_file_is_told_at_the_end_and_stops_nothing(run: Run, tmp_path: Path):
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "a_broken.obj").write_text("no mesh at all")
    table(folder / "b_good.obj")
    ended = run("infer", "in", "in/b_good.obj", "missing.obj", "--out", "res", "--no-picture")
    assert ended.code == 1
    assert sorted(path.name for path in (tmp_path / "res").glob("*.json")) == ["b_good.json", "b_good_2.json"]
    assert not list((tmp_path / "res").glob("*.png"))
    assert ended.err.index("a_broken.obj") < ended.err.index("missing.obj") < ended.err.index("2 of 4 inputs failed")


@pytest.mark.usefixtures("quick")
def test_the_input_itself_is_never_overwritten(run: Run, tmp_path: Path):
    before = table(tmp_path / "table.glb").read_bytes()
    assert run("infer", "table.glb", "--out", ".", "--no-picture").code == 0
    assert (tmp_path / "table.glb").read_bytes() == before
    assert (tmp_path / "table_2.glb").exists()


@pytest.mark.usefixtures("quick")
def test_results_of_another_input_or_of_somebody_else_are_spared(run: Run, tmp_path: Path):
    for folder in ("a", "b", "res"):
        (tmp_path / folder).mkdir()
    (tmp_path / "res" / "table.png").write_text("mine")
    for folder in ("a", "b", "a"):
        table(tmp_path / folder / "table.obj")
        assert run("infer", f"{folder}/table.obj", "--out", "res", "--no-picture").code == 0
    assert sorted(path.name for path in (tmp_path / "res").glob("*.json")) == ["table_2.json", "table_3.json"]
    assert (tmp_path / "res" / "table.png").read_text() == "mine"


@pytest.mark.usefixtures("quick")
def test_a_disk_that_takes_nothing_ends_the_run(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from shapeprog.cli import results
    from shapeprog.errors import OutputError

    def full(*_: object) -> list[str]:
        raise OutputError("the disk is full", "free some space")

    monkeypatch.setattr(results, "write", full)
    table(tmp_path / "one.obj")
    ended = run("infer", "one.obj", table(tmp_path / "two.obj"))
    assert ended.code == 2
    assert ended.err.count("the disk is full") == 1
    assert "finished results are kept: 0 programs" in ended.err


@pytest.mark.usefixtures("quick")
def test_shapes_of_a_pack_are_found_again(run: Run, tmp_path: Path):
    cells = np.zeros((2, 32, 32, 32), bool)
    cells[:, 4:28, 10:20, 10:20] = True
    np.save(tmp_path / "many.npy", cells)
    ended = run("infer", "many.npy", "--out", "res", "--no-picture")
    assert "Read as voxels." in ended.out
    sources = [json.loads(path.read_text())["source"] for path in sorted((tmp_path / "res").glob("*.json"))]
    assert sources == [f"{tmp_path / 'many.npy'}#{number}" for number in range(2)]


@pytest.mark.usefixtures("quick")
def test_json_is_one_object_a_line_and_quiet_says_nothing(run: Run, tmp_path: Path):
    (tmp_path / "broken.ply").write_text("ply?")
    table(tmp_path / "good.obj")
    ended = run("infer", "good.obj", "broken.ply", "--json", "--no-picture")
    lines = [json.loads(line) for line in ended.out.splitlines()]
    assert lines[0]["name"] == "good"
    assert lines[0]["text"].splitlines()[1].startswith("top_rectangle(")
    assert "broken" in lines[1]["error"]
    quiet = run("infer", "good.obj", "--quiet", "--no-picture")
    assert (quiet.code, quiet.out, quiet.err) == (0, "", "")


def test_an_interruption_says_what_was_kept(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def infer(shape, **_):
        raise KeyboardInterrupt

    monkeypatch.setattr(inference, "infer", infer)
    ended = run("infer", table(tmp_path / "table.obj"), "--out", "res")
    assert ended.code == 130
    assert "finished results are kept: 0 programs in res" in ended.err


def test_a_fault_of_ours_in_measuring_one_shape_stops_nothing(run: Run, tmp_path: Path, monkeypatch):
    from shapeprog.evaluation import scoring

    (tmp_path / "in").mkdir()
    for name in ("a", "b"):
        table(tmp_path / "in" / f"{name}.obj")
    measure = scoring.measure

    def fails_once(prediction, target, *others, **options):
        if target.name == "a":
            raise ZeroDivisionError("division by zero")
        return measure(prediction, target, *others, **options)

    monkeypatch.setattr(scoring, "measure", fails_once)
    ended = run("evaluate", "in", "in", "--json")
    assert ended.code == 1
    assert "prediction a could not be measured: internal error" in ended.err
    assert [row["name"] for row in json.loads(ended.out)["rows"]] == ["b"]


def test_a_fault_of_ours_in_one_shape_stops_nothing(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def infer(shape, **_):
        raise RuntimeError("a bug")

    monkeypatch.setattr(inference, "infer", infer)
    ended = run("infer", table(tmp_path / "table.obj"))
    assert ended.code == 2
    assert "internal error" in ended.err
    assert "RuntimeError" not in ended.err, "what Python says is for --debug"
    assert "--debug" in ended.err
    with pytest.raises(RuntimeError, match="a bug"):
        main(["infer", str(tmp_path / "table.obj"), "--debug"])
    terminal.debugging = False


@pytest.fixture
def program(tmp_path: Path) -> Path:
    return export(PROGRAM, tmp_path / "table.json", FRAME)


def test_export_writes_every_file_it_is_given(run: Run, tmp_path: Path, program: Path):
    ended = run("export", program, "a.glb", "b.scad", "c.py", "d.stl")
    assert ended.code == 0, ended.err
    assert all((tmp_path / name).exists() for name in ("a.glb", "b.scad", "c.py", "d.stl"))


NAMED = (
    "width, depth, height = 8, 8, 24\nn = 2\nspan = width - 2\n"
    "for _ in translate(n, x=span):\n    leg(left=0, width=2)\n"
)


@pytest.mark.parametrize(
    ("changes", "n", "span"),
    [
        (["--set", "width=11"], 2, 9),
        (["--set", "width*=2", "n+=1"], 3, 14),
        (["--set", "width/=2", "--set", "width -= 0.5", "n=1"], 1, 1.5),
    ],
)
def test_export_sets_the_numbers_that_have_names(run: Run, tmp_path: Path, changes: list[str], n: int, span: float):
    (tmp_path / "legs.shape").write_text(NAMED)
    ended = run("export", "legs.shape", "other.shape", *changes, "-q")
    assert (ended.code, ended.out) == (0, ""), ended.err
    assert sp.load(tmp_path / "other.shape").body[0].values == (n, 0, 0, -span * (24 / max(24, span + 2)))
    assert "span = width - 2" in (tmp_path / "other.shape").read_text()
    assert run("export", "legs.shape", *changes, "--quiet", "again.shape").code == 0


PLACED = """\
# a table
width, depth, height = 80, 60, 74
thick = 2
plinth = 3
overhang = thick * 2

def leg_pair(gap, unused=1):
    for _ in mirror(x=0):
        leg(left=gap, width=5)

top(top=0, height=thick)
leg_pair(gap=overhang, top=thick)
"""


def test_names_of_placed_text_are_set_and_what_it_does_not_use_is_a_warning(run: Run, tmp_path: Path):
    (tmp_path / "table.shape").write_text(PLACED)
    ended = run("export", "table.shape", "other.shape", "table.obj", "--set", "overhang*=2", "height=148")
    assert ended.code == 0, ended.err
    assert "warning: table.shape, line 4: unused name 'plinth'" in ended.err
    assert "warning: table.shape, line 7: unused name 'unused'" in ended.err
    text = PLACED.replace("thick * 2", "8").replace("60, 74", "60, 148")
    assert (tmp_path / "other.shape").read_text() == text
    assert "no name 'leg_pair'" in run("export", "table.shape", "a.stl", "--set", "leg_pair=3").err
    for words in (["render", "table.shape", "a.png"], ["show", "table.shape"], ["sheet", ".", "sheet.png"]):
        assert "unused name 'plinth'" in run(*words).err
    assert (tmp_path / "table.html").read_text().count("leg_pair") > 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("widht=3", "did you mean width?"),
        ("width", "invalid change"),
        ("width=x", "'x' is not a number"),
        ("width/=0", "divides by zero"),
        ("width=-3", "the width of the whole is -3"),
    ],
)
def test_changes_that_cannot_be_made_are_told(run: Run, tmp_path: Path, change: str, words: str):
    (tmp_path / "legs.shape").write_text(NAMED)
    for command in (["export", "legs.shape", "a.stl"], ["render", "legs.shape", "a.png"], ["show", "legs.shape"]):
        ended = run(*command, "--set", change)
        assert (ended.code, words in ended.err) == (2, True), ended.err


def test_export_replaces_no_other_program(run: Run, tmp_path: Path, program: Path):
    text = NAMED.replace("8, 8", "9, 8")
    (tmp_path / "a.shape").write_text(NAMED)
    (tmp_path / "b.shape").write_text(text)
    ended = run("export", "a.shape", "b.shape", "all.stl")  # as a shell makes of *.shape
    assert (ended.code, "b.shape exists" in ended.err) == (2, True), ended.err
    assert (tmp_path / "b.shape").read_text() == text
    assert not (tmp_path / "all.stl").exists()
    assert run("export", "a.shape", "b.shape", "--overwrite").code == 0
    assert run("export", "a.shape", "a.json").code == 0
    (tmp_path / "a.shape").write_text(text)
    (tmp_path / "c.SHAPE").write_text(text)
    made = "furniture_0.shape"
    assert run("sample", "--count", 1, "--folder", ".").code == 0
    for words, name in (
        (["export", "a.json"], "a.shape"), (["export", "a.json"], "c.SHAPE"), (["tidy", "a.json"], "a.shape"),
        (["library", "learn", "a.json", "--out"], "a.shape"), (["sample", "--count", 1, "--folder", "."], made),
    ):  # fmt: skip
        before = (tmp_path / name).read_text()
        ended = run(*words, *([name] if name != made else []))
        assert (ended.code, f"{name} exists" in ended.err) == (2, True), ended.err
        assert (tmp_path / name).read_text() == before
    assert run("sample", "--count", 1, "--folder", ".", "--overwrite").code == 0
    assert run("tidy", "c.SHAPE", "c.SHAPE").code == 0, "a program may be replaced by itself"


def test_a_share_of_a_span_for_one_copy_says_how_many_there_must_be(run: Run, tmp_path: Path):
    (tmp_path / "shelves.shape").write_text(
        "width, depth, height = 5, 5, 10\nn = 3\nfor _ in translate(n, z=9 / (n - 1)):\n    box(height=1)\n"
    )
    assert "let n be more than 1" in run("export", "shelves.shape", "a.stl", "--set", "n=1").err


def test_a_folder_in_the_place_of_a_program_names_one_in_it(run: Run, tmp_path: Path, program: Path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "a.json").write_bytes(program.read_bytes())
    assert "such as folder/a.json" in run("export", "folder", "a.stl").err


@pytest.mark.parametrize("name", ["cloud.npy", "cells.npy", "mesh.stl"])
def test_the_input_is_shown_as_it_was_inferred(tmp_path: Path, name: str):
    mesh = load_shape(table(tmp_path / "mesh.stl"))
    np.save(tmp_path / "cloud.npy", mesh.points)
    np.save(tmp_path / "cells.npy", mesh.voxels)
    turned = load_shape(tmp_path / name, up="+y", front="-x")
    for frame, size in ((turned.frame, 1), (replace(turned.frame, scale=2 * turned.frame.scale), 0.5)):
        seen = writing._as_inferred(tmp_path / name, frame)
        np.testing.assert_array_equal(seen.voxels, turned.voxels)
        for one, other in ((seen.points, turned.points), (seen.vertices, turned.vertices)):
            assert (one is None) == (other is None)
            assert one is None or np.allclose(one, size * other, atol=1e-4)
    for frame in (replace(turned.frame, scale=1e-3), replace(turned.frame, centre=(1e3, 0, 0))):
        seen = writing._as_inferred(tmp_path / name, frame)  # the same object in another unit, or in another place
        assert turned.vertices is None or np.array_equal(seen.vertices, turned.vertices)


@pytest.mark.usefixtures("quick")
def test_results_in_a_folder_of_inputs_are_no_inputs(run: Run, tmp_path: Path):
    table(tmp_path / "table.glb")
    for _ in range(2):
        assert run("infer", ".", "--out", "res", "--no-picture").code == 0
    assert sorted(path.name for path in (tmp_path / "res").glob("*.json")) == ["table.json"]
    for suffix in (".json", ".shape"):  # results beside the input that they are of
        (tmp_path / f"table{suffix}").write_bytes((tmp_path / "res" / f"table{suffix}").read_bytes())
    assert run("infer", ".", "--out", "res", "--no-picture").code == 0
    assert "holds results of infer alone" in run("infer", "res", "--out", "more").err


def test_render_makes_pictures_and_export_cells_and_points(run: Run, tmp_path: Path, program: Path):
    table(tmp_path / "input.obj")
    assert run("render", program, "a.png", "--shape", "input.obj").code == 0
    assert run("export", program, "b.npy", "c.xyz").code == 0
    assert np.load(tmp_path / "b.npy").shape == (32, 32, 32)
    rows = np.loadtxt(tmp_path / "c.xyz")
    assert rows.shape == (5000, 6)
    assert (rows[:, :3] > [0.99, 1.99, 2.9]).all()
    assert (rows[:, :3] < [3.01, 4.01, 4.6]).all()
    assert "unknown picture suffix '.gif'" in run("render", program, "a.gif").err


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> dict[str, Path | None]:
    """The input that is shown beside each program, by the name of the program."""
    inputs: dict[str, Path | None] = {}

    def source(shape: Shape | None) -> Path | None:
        return None if shape is None else shape.source

    monkeypatch.setattr(
        view, "contact_sheet", lambda items, *_, **__: inputs.update({i.name: source(i.shape) for i in items})
    )
    monkeypatch.setattr(view, "picture", lambda shape, *_, title, **__: inputs.update({title: source(shape)}))
    return inputs


def with_inputs(folder: Path, *places: str) -> None:
    """Programs in a folder ``res`` of inputs somewhere else, which are copied below ``in`` at these places."""
    (folder / "res").mkdir()
    for number, place in enumerate(places):
        copy = folder / "in" / place
        copy.parent.mkdir(parents=True, exist_ok=True)
        table(copy)
        text = program_to_json(PROGRAM, FRAME, source=f"/elsewhere/{place}")
        (folder / "res" / f"{number}.json").write_text(text)


def test_the_input_of_several_with_its_name_is_that_with_most_of_its_path(
    run: Run, tmp_path: Path, shown: dict[str, Path | None]
):
    places = ["a/x.obj", "b/x.obj", "b/y.obj", "03001627/one/models/m.obj", "03001627/two/models/m.obj"]
    with_inputs(tmp_path, *places)
    ended = run("sheet", "res", "s.png", "--shape", "in")
    assert {name: str(path) for name, path in shown.items()} == {str(n): f"in/{p}" for n, p in enumerate(places)}
    assert "without their input" not in ended.err


def test_none_of_several_inputs_that_fit_alike_is_shown_and_their_number_is_told(
    run: Run, tmp_path: Path, shown: dict[str, Path | None]
):
    with_inputs(tmp_path, "a/x.obj", "a/y.obj", "a/z.obj")
    for other in ("b/x.obj", "c/x.obj"):
        (tmp_path / "in" / other).parent.mkdir()
        table(tmp_path / "in" / other)
    (tmp_path / "in" / "a" / "x.obj").unlink()
    (tmp_path / "in" / "a" / "y.obj").unlink()
    ended = run("sheet", "res", "s.png", "--shape", "in")
    assert (ended.code, {name: bool(path) for name, path in shown.items()}) == (0, {"0": False, "1": False, "2": True})
    assert "2 of 3 programs are shown without their input, such as 0: several files have its name" in ended.err
    assert "it was not found" in ended.err
    assert "several files have its name" in run("render", "res/0.json", "p.png", "--shape", "in").err
    assert "without their input" not in run("sheet", "res", "s.png").err, "no input was asked for"


def test_the_input_of_a_text_is_that_of_the_json_beside_it(run: Run, tmp_path: Path, shown: dict[str, Path | None]):
    with_inputs(tmp_path, "a/x.obj")
    export(PROGRAM, tmp_path / "res" / "0.shape", FRAME)
    assert run("render", "res/0.shape", "p.png", "--shape", "in").code == 0
    assert str(shown["0"]) == "in/a/x.obj"
    (tmp_path / "res" / "0.json").unlink()
    assert "no .json of its name" in run("render", "res/0.shape", "p.png", "--shape", "in").err


def test_show_and_sheet_write_a_page_and_a_picture(run: Run, tmp_path: Path, program: Path):
    assert run("show", program).code == 0
    page = (tmp_path / "table.html").read_text()
    assert "top_rectangle" in page
    assert '"frame":"# placed: up ' in page, "what is copied keeps its way to the input"
    assert "pages end in .html" in run("show", program, "a.png").err
    (tmp_path / "cut.json").write_text(program.read_text()[:100])
    assert "there is no folder table.json" in run("sheet", ".", "a.png", "--shape", program.name).err
    assert "The input is not shown" in run("show", program, "--shape", ".").err
    ended = run("sheet", ".", "sheet.png")
    assert ended.code == 1
    assert "1 programs" in ended.out
    assert "was the file cut off?" in ended.err
    assert (tmp_path / "sheet.png").exists()
    program.unlink()
    ended = run("sheet", ".", "sheet.png")
    assert (ended.code, "was the file cut off?" in ended.err) == (2, True)


def test_statements_prints_the_manual(run: Run):
    assert "base_cross" in run("statements").out
    assert "tilt" in run("statements", "back").out
    two = run("statements", "taper", "rod").out
    assert two.startswith("taper(")
    assert "\nrod(" in two
    assert "width, depth, height = " in run("statements").out
    assert run("statements", "divide").out.startswith("for _ in divide(")
    assert "at(left=3, top=0)" in run("statements", "at").out
    assert "  width, depth, height  two of these, across it" in run("statements", "bar").out
    ended = run("statements", "bak")
    assert (ended.code, "did you mean back?" in ended.err) == (2, True)


def test_statements_of_a_users_own_come_with_an_option(run: Run, tmp_path: Path):
    (tmp_path / "mine.py").write_text("oops")
    ended = run("statements", "--with", "mine.py")
    assert ended.code == 2
    assert "mine.py, line 1" in ended.err


def test_a_cloud_is_as_near_to_itself_as_can_be(run: Run, tmp_path: Path):
    cloud = load_shape(table(tmp_path / "table.stl")).points
    np.save(tmp_path / "cloud.npy", cloud[:1000])
    ended = run("evaluate", "cloud.npy", "cloud.npy", "--json")
    assert json.loads(ended.out)["rows"][0]["cd"] == 0
    rows = [run("evaluate", "cloud.npy", "table.stl", "--json", "--points", n).out for n in (100, 1000)]
    assert json.loads(rows[0])["rows"][0]["to_target"] != json.loads(rows[1])["rows"][0]["to_target"]


def test_prepare_writes_packs(run: Run, tmp_path: Path):
    (tmp_path / "in" / "table").mkdir(parents=True)
    table(tmp_path / "in" / "table" / "one.obj")
    (tmp_path / "in" / "table" / "two.obj").write_text("broken")
    table(tmp_path / "in" / "stray.obj")
    ended = run("prepare", "in", "packs")
    assert ended.code == 1
    assert "stray.obj: it lies in no folder of a category" in ended.err
    assert ended.out.endswith(".npz: 1 shape\n")
    assert "two.obj" in ended.err
    assert "Few shapes, so scores on them say little: table_" in ended.err
    for name in ("table/two.obj", "stray.obj"):
        (tmp_path / "in" / name).unlink()
    assert [run("prepare", "in", output).code for output in ("in", "in", "in/packs", "in")] == [0] * 4


def test_evaluate_measures_programs_and_meshes_alike(run: Run, tmp_path: Path, program: Path):
    (tmp_path / "targets").mkdir()
    (tmp_path / "meshes").mkdir()
    table(tmp_path / "targets" / "table.obj")
    table(tmp_path / "meshes" / "table.ply")
    (tmp_path / "programs").mkdir()
    program.rename(tmp_path / "programs" / "table.json")
    found = {}
    for kind in ("programs", "meshes"):
        ended = run("evaluate", kind, "targets", "--json")
        assert ended.code == 0, ended.err
        found[kind] = json.loads(ended.out)["rows"][0]
        assert found[kind]["iou"] > 0.99
        assert found[kind]["cd"] < 2 * found[kind]["cd_floor"]
        assert found[kind]["f1_cell"] > 0.95
    assert (found["programs"]["blocks"], found["meshes"]["blocks"]) == (2, 0)
    shown = run("evaluate", "programs", "targets")
    assert "CD of the target itself" in shown.out
    assert "F1@1% of the target itself" in shown.out
    assert "floor" not in shown.out + run("evaluate", "programs", "targets", "--all").out
    assert "two halves of its points" in run("evaluate", "--help").out
    assert "IoU@32" not in shown.out
    assert "IoU@32" in run("evaluate", "programs", "targets", "--all").out


def test_evaluate_in_python_gives_the_figures_of_the_command(run: Run, tmp_path: Path, program: Path):
    cloud = FRAME.to_world(sp.sample(sp.unroll(PROGRAM), 12_000).points)
    np.savetxt(tmp_path / "cloud.xyz", cloud)
    table(tmp_path / "table.obj")
    known_program = sp.load(program)
    for name in ("table.obj", "cloud.xyz"):
        row = json.loads(run("evaluate", "table.json", name, "--json", "--points", 1000, "--seed", 3).out)["rows"][0]
        known = sp.evaluate(known_program, name, points=1000, seed=3)
        loaded = sp.evaluate(known_program, load_shape(name), points=1000, seed=3)
        assert {name: value for name, value in asdict(known).items() if value == value} == row
        assert repr(loaded) == repr(known)
    with pytest.raises(sp.InputError, match="other axes than the target"):
        sp.evaluate(known_program, replace(load_shape("cloud.xyz"), source=None))
    result = inference.Result(PROGRAM, PROGRAM.snap(), {}, "", (), 0.0)
    assert sp.evaluate(result, "table.obj").cd == sp.evaluate(PROGRAM, load_shape("table.obj")).cd


@pytest.mark.parametrize("suffix", [".json", ".shape"])
def test_evaluate_compares_a_program_in_the_axes_that_it_stores_unless_others_are_given(
    run: Run, tmp_path: Path, suffix: str
):
    frame = Frame.around([1, 2, 3], [3, 4, 4.5], grid_axes("-x", "+y"))
    export(PROGRAM, tmp_path / "input.obj", frame, on_input=True)
    export(PROGRAM, tmp_path / f"p{suffix}", frame)

    def iou(*words: str) -> float:
        ended = run("evaluate", f"p{suffix}", "input.obj", "--json", *words)
        assert ended.code == 0, ended.err
        return json.loads(ended.out)["rows"][0]["iou"]

    assert iou() == iou("--up=-x", "--front=+y") > 0.99
    assert iou("--up", "+y") < 0.5


def test_evaluate_tells_how_many_physical_parts_have_a_primitive_of_their_own(run: Run, tmp_path: Path, program: Path):
    run("export", "table.json", "table.obj")
    boxes = trimesh.load(tmp_path / "table.obj", force="mesh").split()
    folder = tmp_path / "parts" / "kitchen" / "table"
    folder.mkdir(parents=True)
    for number, box in enumerate(boxes):
        box.export(folder / f"{number}.ply")
    (tmp_path / "table.obj").rename(tmp_path / "kitchen_table.obj")
    ended = run("evaluate", "table.json", "kitchen_table.obj", "--parts", "parts", "--json")
    assert ended.code == 0, ended.err
    row = json.loads(ended.out)["rows"][0]
    assert (row["part_recall"], row["part_precision"]) == (1, 1)
    ended = run("evaluate", "table.json", table(tmp_path / "other.obj"), "--parts", "parts")
    assert "No parts of 1 of 1 targets, such as other, are in parts" in ended.err
    (folder / "0.ply").write_text("ply")
    ended = run("evaluate", "table.json", "kitchen_table.obj", "--parts", "parts")
    assert (ended.code, "prediction table: 0.ply" in ended.err) == (1, True)


def test_evaluate_tells_what_has_no_partner(run: Run, tmp_path: Path, program: Path):
    for name in ("one", "two"):
        (tmp_path / "programs").mkdir(exist_ok=True)
        (tmp_path / "programs" / f"{name}.json").write_text(program.read_text())
    table(tmp_path / "one.obj")
    ended = run("evaluate", "programs", "one.obj")
    assert ended.code == 1
    assert "prediction two: there is no target" in ended.err
    table(tmp_path / "other.obj")
    ended = run("evaluate", "programs", "other.obj")
    assert (ended.code, "matched by name" in ended.err) == (2, True)


def test_evaluate_tells_which_targets_were_left_out(run: Run, tmp_path: Path, program: Path):
    (tmp_path / "targets").mkdir()
    for name in ("table", "chair"):
        table(tmp_path / "targets" / f"{name}.obj")
    ended = run("evaluate", "table.json", "targets")
    assert ended.code == 0
    assert "1 of 2 targets have no prediction and are not counted: chair" in ended.err
    assert json.loads(run("evaluate", "table.json", "targets", "--json").out)["missing"] == ["chair"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["export", "table.json", "a.gbl"], "did you mean .glb"),
        (["export", "table.json", "no/a.glb"], "make the folder first"),
        (["export", "gone.json", "a.glb"], "there is no file"),
        (["export", "mesh.obj", "a.glb"], "shapeprog infer"),
        (["export", "cut.json", "a.glb"], "was the file cut off?"),
        (["export", "typo.shape", "a.glb"], "did you mean leg?"),
        (["render", "table.json", "no/a.png"], "make the folder first"),
        (["sheet", "gone", "a.png"], "there is no folder"),
        (["evaluate", "gone", "mesh.obj"], "there is no file or folder gone"),
        (["infer", "mesh.obj", "--out", "table.json"], "there is a file of that name"),
        (["infer", "mesh.obj", "--with", "gone.py"], "no file"),
        (["infer", "mesh.obj", "mesh.obj", "--up", "q"], "'q' is not an axis"),
        (["prepare", ".", "packs", "--up", "y", "--front", "-y"], "must be perpendicular"),
        (["infer", "gone.obj"], "there is no file gone.obj"),
    ],
)
def test_mistakes_are_told_without_a_traceback(run: Run, tmp_path: Path, program: Path, words: list[str], told: str):
    table(tmp_path / "mesh.obj")
    (tmp_path / "cut.json").write_text(program.read_text()[:200])
    (tmp_path / "typo.shape").write_text("legg(at=(0, 0, 0), size=(1, 1, 1))")
    ended = run(*words)
    assert ended.code == 2
    assert told in ended.err
    assert "error: " in ended.err
    assert "Traceback" not in ended.err


def test_export_ends_as_a_failure_if_one_file_is_written_and_as_a_mistake_if_none_is(run: Run, program: Path):
    assert [run("export", program, name, "no/a.stl").code for name in ("a.stl", "no/b.stl")] == [1, 2]


@pytest.mark.parametrize("words", [["export"], ["tidy"]])
def test_a_missing_program_is_told_before_the_file_to_write_that_exists(run: Run, tmp_path: Path, words: list[str]):
    (tmp_path / "b.shape").write_text("box()")
    assert "there is no file missing.shape" in run(*words, "missing.shape", "b.shape").err


def test_units_of_statements_in_cells_and_readers_that_are_not_installed_are_told(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(loading, "mesh_formats", lambda: {"obj"})
    table(tmp_path / "a.obj")
    (tmp_path / "a.3mf").write_text("")
    for words, told in ((["a.obj", "--paper", "--unit", "cm"], "--paper"), (["a.3mf"], "pip install lxml networkx")):
        ended = run("infer", *words)
        assert (ended.code, told in ended.err) == (2, True), ended.err


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_seeds_out_of_range_are_told(run: Run, seed: int):
    ended = run("infer", "mesh.obj", "--seed", seed)
    assert (ended.code, "--seed" in ended.err) == (2, True)


def test_a_package_that_is_not_installed_is_named(run: Run, program: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    ended = run("export", program, "a.ply")
    assert (ended.code, "needs the package trimesh" in ended.err) == (2, True), ended.err


def commands() -> list[tuple[str, Any]]:
    """Every command but those of the paper, by the words that call it."""
    from typer.main import get_command

    from shapeprog.cli.app import app

    found = {name: each for name, each in get_command(app).commands.items() if name != "paper"}  # type: ignore[attr-defined]
    library = found.pop("library").commands
    return [*found.items(), *((f"library {name}", each) for name, each in library.items())]


@pytest.mark.parametrize(("words", "command"), commands())
def test_help_has_an_example_and_a_line_for_every_option(run: Run, words: str, command: Any):
    ended = run(*words.split(), "--help")
    assert f"Example: shapeprog {words} " in ended.out
    for option in command.params:
        assert 0 < len(option.help) <= 160, option.name  # outputs of export list all suffixes
        assert not re.search(r"\b(told|said|price|worth|stands?|whatever|beside what)\b", option.help), option.help


def test_the_command_alone_lists_the_commands_and_options_stand_under_headings(run: Run):
    alone = run()
    for words in ("Example: shapeprog infer chair.glb", "export      Export a program"):
        assert words in alone.out + alone.err
    headings = re.findall(r"^(\w+):$", run("infer", "--help").out, re.MULTILINE)
    assert headings == ["Arguments", "Input", "Program", "Search", "Options"]


def test_help_and_version_load_nothing_heavy():
    code = (
        "import sys, io, contextlib\nfrom shapeprog.cli import main\n"
        "for words in (['--help'], ['infer', '--help'], ['--version']):\n"
        "    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):\n        main(words)\n"
        "print(*{name.split('.')[0] for name in sys.modules})"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"torch", "numpy", "numba", "trimesh", "matplotlib", "scipy", "PIL"} & set(found)


def test_a_file_that_cannot_be_written_does_not_stop_the_others(run: Run, tmp_path: Path):
    (tmp_path / "table.shape").write_text(PLACED)
    ended = run("export", "table.shape", "none/a.stl", "b.stl", "none/c.obj", "d.csv")
    assert ended.code != 0
    assert ended.err.count("its folder does not exist") == 2
    assert (tmp_path / "b.stl").exists()
    assert (tmp_path / "d.csv").exists()
