"""What the commands say of inputs that are read in one of several ways, of changes, and of files that exist."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from commands import Run, table

from shapeprog.language.named import names as named
from shapeprog.language.parser import parse


def cloud(path: Path) -> np.ndarray:
    """Points on the table, in the axes of the mesh that is written to a file."""
    from shapeprog.data import load as load_shape

    shape = load_shape(table(path), up="+y", front="+z")
    assert shape.points is not None
    return shape.frame.to_world(shape.points)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("name", "assumed", "other"),
    [("a.npy", "+y", "+z"), ("a.npz", "+y", "+z"), ("a.xyz", "+z", "+y"), ("a.ply", "+y", "+z")],
)
def test_an_assumed_up_axis_is_told_with_another_one(run: Run, tmp_path: Path, name: str, assumed: str, other: str):
    points = cloud(tmp_path / name) if name.endswith("ply") else cloud(tmp_path / "table.obj")
    save = {"a.npy": np.save, "a.npz": lambda path, array: np.savez(path, points=array), "a.xyz": np.savetxt}
    save.get(name, lambda *_: None)(tmp_path / name, points)
    said = run("infer", name, "--no-picture").out
    assert f"does not store the up axis: {assumed} is assumed. Another axis: --up {other}, or --up auto" in said
    assert "does not store" not in run("infer", name, "--no-picture", "--up", "+z").out


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
        assert load_shape(tmp_path / name, up="auto").note.endswith(
            "). The input is flat: all of it lies in one plane."
        )
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
    ended = run(*words)
    assert (ended.code, text.read_text()) == (1, edited)
    assert "it has no one.json beside it" in ended.err
    assert run(*words, "--overwrite").code == 0
    assert text.read_text() == written
    assert len(list((tmp_path / "res").iterdir())) == 6
    text.unlink()
    assert run(*words).code == 0


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
    assert "warning: t.shape, with diameter=28: parts come apart or vanish; " in told("diameter=28")
    assert expected in told("diameter=28")
    assert "inset may be" not in told("diameter=28")
    assert not told("diameter=300")  # beyond what is tried for the range, but in one piece
    assert not told("diameter=28", "inset=9")
    assert not told("n=1")
    assert "parts come apart or vanish" in told("n=1", "inset=-40")


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
