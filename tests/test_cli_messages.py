"""What the commands say of inputs that are read in one of several ways, of changes, and of files that exist."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from commands import PROGRAM, Run, table

from shapeprog import inference
from shapeprog.cli import terminal
from shapeprog.cli.terminal import assumed, at
from shapeprog.errors import ShapeProgError
from shapeprog.language.named import names as named
from shapeprog.language.parser import parse
from shapeprog.language.readable import in_readable_unit
from shapeprog.language.unit import Unit
from shapeprog.space import Frame


def cloud(path: Path) -> np.ndarray:
    """Points on the table, in the axes of the mesh that is written to a file."""
    from shapeprog.data import load as load_shape

    shape = load_shape(table(path), up="+y", front="+z")
    assert shape.points is not None
    return shape.frame.to_world(shape.points)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(("name", "usual"), [("a.npy", "+y"), ("a.npz", "+y"), ("a.xyz", "+z"), ("a.ply", "+y")])
def test_an_assumed_up_axis_is_told_with_the_others(run: Run, tmp_path: Path, name: str, usual: str):
    points = cloud(tmp_path / name) if name.endswith("ply") else cloud(tmp_path / "table.obj")
    save = {"a.npy": np.save, "a.npz": lambda path, array: np.savez(path, points=array), "a.xyz": np.savetxt}
    save.get(name, lambda *_: None)(tmp_path / name, points)
    said = run("infer", name, "--no-picture").out
    others = ", ".join(axis for axis in ("+x", "-x", "+y", "-y", "+z", "-z") if axis != usual)
    assert f"does not store the up axis: {usual} is assumed. Another axis: --up with one of {others}; --up auto" in said
    assert "does not store" not in run("infer", name, "--no-picture", "--up", "+z").out


@pytest.mark.usefixtures("quick")
def test_what_is_assumed_is_told_once_in_a_batch_and_with_each_shape_in_json(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    other = inference.Result(parse(TABLE), None, {}, "Stopped at once.", (), seconds=0.1)
    metric = in_readable_unit(other.program, Unit("cm", 3.0))
    monkeypatch.setattr(inference, "infer", lambda *_, **__: replace(other, program=metric))
    names = [table(tmp_path / name).name for name in ("a.stl", "b.ply", "c.stl", "d.ply")]
    said = run("infer", *names, "--no-picture", "--unit", "cm").out
    assert said.count("does not store the up axis: +z is assumed") == 1
    assert said.count("does not store the up axis: +y is assumed") == 1
    assert said.count("assumed to be m, so that the longest side is 2 m. Another unit: --file-unit mm") == 1
    lines = run("infer", *names, "--no-picture", "--unit", "cm", "--json").out.splitlines()
    for line in lines:
        up, unit = json.loads(line)["notes"]
        assert "does not store the up axis" in up
        assert "assumed to be m" in unit
    words = ["--no-picture", "--unit", "cm", "--json", "--file-unit", "mm", "--up", "+y"]
    assert json.loads(run("infer", "a.stl", *words).out)["notes"] == []


@pytest.mark.parametrize(("unit", "others"), [("mm", ["cm", "in"]), ("cm", ["mm", "in"]), ("m", ["mm", "cm", "in"])])
def test_an_assumed_unit_is_told_with_all_others_that_are_likely(unit: str, others: list[str]):
    hint = assumed(Frame(), unit).partition("Another unit: ")[2]
    assert hint == " or ".join(f"--file-unit {name}" for name in others)


@pytest.mark.usefixtures("quick")
def test_voxels_in_arrays_have_no_other_up_axis(run: Run, tmp_path: Path):
    np.save(tmp_path / "a.npy", np.ones((32, 32, 32), bool))
    assert "up axis" not in run("infer", "a.npy", "--no-picture").out


@pytest.mark.usefixtures("quick")
def test_inputs_of_one_name_are_told_apart_by_their_paths_and_errors_begin_with_them(run: Run, tmp_path: Path):
    folder = tmp_path / "mixed"
    (folder / "sub").mkdir(parents=True)
    for name in ("chair.glb", "chair.ply", "sub/chair.stl"):
        table(folder / name)
    (folder / "nan.obj").write_text("v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n")
    (folder / "trunc.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 1")
    cells = np.zeros((2, 32, 32, 32), np.uint8)
    cells[0, 4:28] = 1
    cells[1] = 7
    np.save(folder / "x.npy", cells)
    ended = run("infer", "mixed", "--out", "res", "--no-picture")
    headings = [line for line in ended.out.splitlines() if line.startswith("mixed/")]
    assert headings == ["mixed/chair.glb", "mixed/chair.ply", "mixed/sub/chair.stl", "mixed/x.npy#0"]
    messages = [line for line in ended.err.splitlines() if line.startswith("error: ")]
    assert messages[0] == "error: mixed/nan.obj: 1 of 3 positions are not finite numbers"
    assert messages[1].startswith("error: mixed/trunc.obj is cut short")
    assert messages[2].startswith("error: mixed/x.npy#1 holds voxels with the value 7")


@pytest.mark.usefixtures("quick")
def test_a_few_points_and_a_line_are_refused_and_what_is_flat_is_told(run: Run, tmp_path: Path):
    points = np.random.default_rng(0).random((500, 3))
    np.save(tmp_path / "line.npy", points[:, :1] * [1, 2, 3])
    np.save(tmp_path / "few.npy", points[:99])
    (tmp_path / "three.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    ended = run("infer", "line.npy", "few.npy", "three.obj")
    assert ended.code == 2
    assert "line.npy is a line: it has extent in one direction only" in ended.err
    assert "few.npy has no faces and 99 points; a point cloud needs at least 100" in ended.err
    assert "three.obj has no faces and 3 points" in ended.err


@pytest.mark.parametrize("leaning", [0.0, 0.7])
def test_what_lies_in_one_plane_has_a_note(tmp_path: Path, leaning: float):
    from shapeprog.data import load as load_shape

    points = np.random.default_rng(0).random((500, 3))
    plane = points * [1, 1, 0] + points[:, :1] * [0, 0, leaning]
    np.save(tmp_path / "plane.npy", plane)
    np.save(tmp_path / "solid.npy", points)
    corners = "".join(f"v {x} {y} {leaning * x}\n" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
    (tmp_path / "square.obj").write_text(f"{corners}f 1 2 3 4\nv 5 5 5\n")
    for name in ("plane.npy", "square.obj"):
        assert load_shape(tmp_path / name).note == "The input is flat: all of it lies in one plane."
        assert load_shape(tmp_path / name, up="auto").note.endswith(". The input is flat: all of it lies in one plane.")
    assert not load_shape(tmp_path / "solid.npy").note


@pytest.mark.usefixtures("quick")
def test_infer_replaces_its_own_results_but_no_edited_text_unless_it_may(run: Run, tmp_path: Path):
    for name in ("one", "two"):
        table(tmp_path / f"{name}.obj")
    words = ["infer", "one.obj", "two.obj", "--out", "res", "--no-picture"]
    assert [run(*words).code for _ in range(2)] == [0, 0]
    text, written = tmp_path / "res" / "one.shape", (tmp_path / "res" / "one.shape").read_text()
    edited = written.replace("thickness=2", "thickness=3")
    text.write_text(edited)
    ended = run(*words)
    assert (ended.code, text.read_text()) == (1, edited)
    assert "one.obj: res/one.shape is not replaced: it differs from the text in one.json" in ended.err
    assert "two.json" in ended.out
    assert "--overwrite" in ended.err
    (tmp_path / "res" / "one.json").unlink()
    for also in ([], ["--overwrite"]):  # not known to be a result
        assert run(*words, *also).code == 0
        assert text.read_text() == edited
    assert (tmp_path / "res" / "one_2.shape").read_text() == written
    text, ours = tmp_path / "res" / "two.shape", (tmp_path / "res" / "two.shape").read_text()
    text.write_text(edited)
    assert run(*words, "--overwrite").code == 0
    assert text.read_text() == ours
    assert len(list((tmp_path / "res").iterdir())) == 8
    text.unlink()
    assert run(*words).code == 0


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("suffix", [".json", ".shape", ".glb"])
def test_results_that_were_written_in_part_are_replaced_by_the_next_run(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
):
    table(tmp_path / "one.obj")
    words = ["infer", "one.obj", "--out", "res", "--no-picture"]
    assert run(*words).code == 0
    before = (tmp_path / "res" / "one.json").read_text()
    replace = os.replace

    def fail(old: Path, new: Path) -> None:
        if new.suffix == suffix:
            raise OSError(errno.ENOSPC, "full", str(new))
        replace(old, new)

    with monkeypatch.context() as patch:
        other = inference.Result(parse(TABLE), None, {}, "Stopped at once.", (), seconds=0.1)
        patch.setattr(inference, "infer", lambda *_, **__: other)
        patch.setattr(os, "replace", fail)
        ended = run(*words)
        assert (ended.code, "the disk is full" in ended.err) == (2, True)
    assert ((tmp_path / "res" / "one.json").read_text() == before) == (suffix == ".json")
    assert run(*words).code == 0
    assert sorted(path.name for path in (tmp_path / "res").iterdir()) == ["one.glb", "one.json", "one.shape"]
    assert (tmp_path / "res" / "one.json").read_text() == before


def test_an_edit_during_inference_and_a_result_of_another_run_are_kept(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for name in ("one", "two"):
        table(tmp_path / f"{name}.obj")
    (tmp_path / "res").mkdir()
    text = tmp_path / "res" / "one.shape"
    calls = []

    def infer(shape, **_):
        calls.append(shape.name)
        if len(calls) == 3:
            text.write_text("# edited\n")
        if len(calls) == 4:
            (tmp_path / "res" / "two.json").write_text("{}")
        return inference.Result(PROGRAM, PROGRAM.snap(), {}, "Stopped at once.", (), seconds=0.1)

    monkeypatch.setattr(inference, "infer", infer)
    words = ["infer", "one.obj", "two.obj", "--out", "res", "--no-picture"]
    assert run(*words).code == 0
    ended = run(*words)
    assert (ended.code, text.read_text()) == (1, "# edited\n")
    assert "one.obj: res/one.shape is not replaced" in ended.err
    assert (tmp_path / "res" / "two.json").read_text() == "{}"
    assert (tmp_path / "res" / "two_2.json").exists()
    assert "one.shape is not replaced" in run(*words).err
    assert calls == ["one", "two", "one", "two", "two"]  # what cannot be written is not inferred again


@pytest.mark.parametrize(
    ("path", "message", "told"),
    [
        ("in/chair.obj", "chair.obj is empty", "in/chair.obj is empty"),
        ("in/chair.obj", "chair: 3 positions", "in/chair.obj: 3 positions"),
        ("in/chair.obj", "chair is a line", "in/chair.obj is a line"),
        ("in/x.npy#1", "x#1 holds voxels", "in/x.npy#1 holds voxels"),
        ("in/x.npz#1", "x.npz: a has no occupied cell", "in/x.npz#1: a has no occupied cell"),
        ("chair.obj", "chair.shape is not replaced", "chair.obj: chair.shape is not replaced"),
        ("in/a.obj", "a point cloud needs normals", "in/a.obj: a point cloud needs normals"),
        ("in/a", "a point cloud needs normals", "in/a: a point cloud needs normals"),
    ],
)
def test_messages_lose_the_name_of_their_own_input_only(path: str, message: str, told: str):
    assert at(Path(path), ShapeProgError(message, "a cure")).message == told


@pytest.mark.usefixtures("quick")
def test_shapes_of_packs_are_told_by_name(run: Run, tmp_path: Path):
    voxels = np.packbits(np.ones((2, 32**3), bool), axis=1)
    np.savez(tmp_path / "chairs.npz", ids=np.array(["chair", "s"]), voxels=voxels)
    ended = run("infer", "chairs.npz", "--no-picture")
    assert [line for line in ended.out.splitlines() if line.startswith("chairs.npz")] == [
        "chairs.npz#0: chair",
        "chairs.npz#1: s",
    ]


TABLE = """\
diameter = 42.6
width, depth, height = diameter, diameter, 70
inset = 4
n = 4
top(cylinder(top=0, height=2))
for _ in rotate(n):
    leg(cylinder(y=inset - 21, top=2, radius=2))
"""


@pytest.mark.parametrize("words", [["export", "o.stl"], ["render", "o.png"], ["show", "o.html"]])
def test_changes_with_which_parts_come_apart_or_vanish_are_told_with_the_range(
    run: Run, tmp_path: Path, words: list[str]
):
    (tmp_path / "t.shape").write_text(TABLE)

    def told(*changes: str) -> str:
        ended = run(words[0], "t.shape", words[1], "--set", *changes)
        assert ended.code == 0
        return ended.err

    low, high = named(parse(TABLE))[0].range or (0, 0)
    expected = f"diameter may be {low:.4g} to {high:.4g}"
    assert "warning: t.shape, with diameter=28: parts come apart: leg (4 times); " in told("diameter=28")
    assert expected in told("diameter=28")
    assert "inset may be" not in told("diameter=28")
    assert not told("diameter=300")  # beyond what is tried for the range, but in one piece
    assert not told("diameter=28", "inset=9")
    assert not told("n=1")
    assert "parts come apart: leg; " in told("n=1", "inset=-40")


EDGES = """\
width, depth, height = 20, 10, 20
step = 4
top(top=0, height=2)
for _ in translate(3, x=step):
    leg(left=0, width=2, front=0, depth=2)
block(left=step * 2 + 2, front=2, depth=2, width=2, height=4)
"""


def test_parts_that_come_off_are_named_if_the_program_was_one_solid_before(run: Run, tmp_path: Path):
    """The block is flush with the last leg, or meets it along an edge only."""
    (tmp_path / "whole.shape").write_text(EDGES.replace("step * 2 + 2", "8"))
    (tmp_path / "loose.shape").write_text(EDGES)
    ended = run("render", "whole.shape", "o.png", "--set", "step=3")
    assert "with step=3: parts come apart: block" in ended.err
    assert "may be" not in ended.err, "the range is that within which parts touch"
    assert "come apart" not in run("render", "whole.shape", "o.png", "--set", "step=4").err
    assert "come apart" not in run("render", "loose.shape", "o.png", "--set", "step=3").err


MANY = "width, depth, height = 9, 9, 9\n" + "".join(f"size_{n} = {n}\nbox(width=size_{n})\n" for n in range(1, 10))


@pytest.mark.parametrize(
    ("text", "change", "message", "hint"),
    [
        (
            "TABLE",
            "diamter=3",
            "no name 'diamter'",
            "did you mean diameter? its names are diameter, width, depth, height",
        ),
        ("TABLE", "q=3", "no name 'q'", "its names are diameter, width, depth, height, inset, n"),
        ("MANY", "siz=3", "no name 'siz'", "size_5, size_6, size_7 and 2 more in its text"),
        ("TABLE", "height=1", "with --set height=1: ", "height may be 2"),
        ("TABLE", "height*=-1", "with --set height=-70: ", "height may be 2"),
        ("TABLE", "inset=10cm", "'10cm' is not a number", "in the unit of the program"),
        ("# unit: cm\nTABLE", "inset=10cm", "'10cm' is not a number", "in the unit of the program, cm"),
        ("TABLE", "inset 10", "write --set inset=10", ""),
        ("TABLE", "inset -1.5", "write --set inset=-1.5", ""),
    ],
)
def test_a_wrong_change_is_told_with_its_name_and_what_is_allowed(
    run: Run, tmp_path: Path, text: str, change: str, message: str, hint: str
):
    (tmp_path / "t.shape").write_text(text.replace("TABLE", TABLE).replace("MANY", MANY))
    ended = run("export", "t.shape", "o.stl", "--set", *change.split())
    assert ended.code == 2
    assert message in ended.err
    assert hint in ended.err


def test_computed_numbers_have_as_many_digits_as_are_meaningful(run: Run, tmp_path: Path):
    (tmp_path / "t.shape").write_text(TABLE)
    for change, digits in (("diameter*=1.1", "46.86"), ("diameter+=.3", "42.9"), ("diameter/=3", "14.2")):
        assert run("export", "t.shape", "o.shape", "--overwrite", "--set", change, "inset=0.123456789").code == 0
        text = (tmp_path / "o.shape").read_text()
        assert f"diameter = {digits}\n" in text
        assert "inset = 0.12345679\n" in text


def test_no_file_is_written_if_one_of_them_has_no_format(run: Run, tmp_path: Path):
    (tmp_path / "t.shape").write_text(TABLE)
    for word in ("inset=3", "inset=4.5", "diameter*=1.1"):
        ended = run("export", "t.shape", "o.stl", word)
        assert (ended.code, list(tmp_path.glob("o.*"))) == (2, [])
        assert f"--set {word}" in ended.err
    ended = run("export", "t.shape", "o.stl", "o.gbl")
    assert (ended.code, list(tmp_path.glob("o.*"))) == (2, [])
    assert "did you mean .glb" in ended.err


@pytest.mark.parametrize("words", [["render", "o.png"], ["show", "o.html"]])
def test_a_program_that_draws_nothing_is_told(run: Run, tmp_path: Path, words: list[str]):
    (tmp_path / "t.shape").write_text("width, depth, height = 8, 8, 24\n")
    ended = run(words[0], "t.shape", words[1])
    assert "warning: t.shape, nothing is drawn" in ended.err


@pytest.mark.parametrize("words", [["infer", "gone.obj", "gone.npz#1"], ["evaluate", "gone.shape", "gone.obj"]])
def test_absent_inputs_are_told_before_heavy_modules_are_imported(tmp_path: Path, words: list[str]):
    script = "import sys\nfrom shapeprog.cli import main\ntry:\n    main(sys.argv[1:])\nfinally:\n"
    script += "    print({'numpy', 'torch', 'numba'} & sys.modules.keys())"
    ended = subprocess.run([sys.executable, "-c", script, *words], cwd=tmp_path, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (2, "set()\n"), ended.stderr
    assert f"there is no file {'or folder ' if words[0] == 'evaluate' else ''}{words[1]}\nhint: check" in ended.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["t.shape", "t.json"])
def test_a_program_that_is_to_be_inferred_is_told_to_be_one(run: Run, tmp_path: Path, name: str):
    (tmp_path / name).write_text(TABLE)
    ended = run("infer", name)
    assert (ended.code, f"{name}: no shapes are read" in ended.err) == (2, True)
    assert "a program already: 'shapeprog render' draws it, 'shapeprog export' writes" in ended.err


@pytest.mark.parametrize("words", [["render", "o.png"], ["show", "o.html"], ["export", "o.stl"]])
@pytest.mark.parametrize("text", ["", "\n# a chair\n"])
def test_an_empty_program_is_an_error_that_tells_how_programs_begin(
    run: Run, tmp_path: Path, words: list[str], text: str
):
    (tmp_path / "t.shape").write_text(text)
    ended = run(words[0], "t.shape", words[1])
    assert (ended.code, "is empty\nhint: begin with width, depth, height = ..." in ended.err) == (2, True)
    assert not (tmp_path / words[1]).exists()


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (OSError(errno.EACCES, "Permission denied", "in.obj"), "in.obj: Permission denied"),
        (OSError(errno.ENOSPC, "No space left on device"), "cannot write the standard output: the disk is full"),
        (OSError(errno.EMFILE, "Too many open files"), "the system: Too many open files"),
    ],
)
def test_an_error_of_the_system_is_called_one_of_writing_only_if_it_is(
    error: OSError, message: str, monkeypatch: pytest.MonkeyPatch
):
    @terminal.guarded
    def command() -> None:
        raise error

    told: list[ShapeProgError] = []
    monkeypatch.setattr(terminal, "complain", told.append)
    with pytest.raises(typer.Exit):
        command()
    assert told[0].message == message
