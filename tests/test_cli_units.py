"""Commands that are asked for lengths in a unit of the object."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from commands import FRAME, PROGRAM, Run, table

from shapeprog import inference
from shapeprog.data.shape import unit_of_result
from shapeprog.formats import export, load
from shapeprog.language.convert import placed
from shapeprog.language.dimensions import in_unit
from shapeprog.language.free import numbers
from shapeprog.language.named import names
from shapeprog.language.parser import parse
from shapeprog.language.printer import source_of
from shapeprog.language.readable import in_readable_unit
from shapeprog.language.unit import Unit
from shapeprog.language.unroll import unroll

NAMED = """\
width, depth, height = 8, 8, 24
n = 2
span = width - 2
top(bottom=16, height=1.5)
for _ in translate(n, x=span):
    leg(left=0, width=2, front=0, depth=2, height=16)
"""
PLACED = placed(PROGRAM)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Inference that always finds the same table, at once."""

    def infer(shape, *, unit, **_):
        program = replace(in_readable_unit(PLACED, unit_of_result(shape, PLACED, unit)), frame=shape.frame)
        return inference.Result(program, PROGRAM.snap(), {}, "Stopped at once.", (), seconds=0.1)

    monkeypatch.setattr(inference, "infer", infer)


def wide(program: Path) -> np.ndarray:
    """The sides of what a program draws in the world, from its exported mesh."""
    return np.ptp(trimesh.load(program, force="mesh").bounds, axis=0)


@pytest.mark.parametrize(("options", "per_cell"), [((), 100 / 12), (("--file-unit", "mm"), 0.1 / 12)])
def test_infer_writes_programs_in_the_unit_of_the_object(
    run: Run, tmp_path: Path, options: tuple[str, ...], per_cell: float
) -> None:
    ended = run("infer", table(tmp_path / "table.obj"), "--unit", "cm", *options, "--out", "res", "--no-picture")
    assert ended.code == 0, ended.err
    assert "# unit: cm\n" in ended.out
    assert ("assumed to be m, so that the longest side is 2 m" in ended.out) == (not options)
    assert "IoU 1.000" in ended.out
    program = load(tmp_path / "res" / "table.shape")
    assert program.unit is not None
    assert (program.unit.name, program.unit.per_cell) == ("cm", pytest.approx(per_cell))
    assert program == load(tmp_path / "res" / "table.json")
    assert source_of(program).lines == source_of(in_readable_unit(PLACED, Unit("cm", per_cell))).lines
    assert json.loads((tmp_path / "res" / "table.json").read_text())["scores"]["statements"] == 4
    assert numbers(program) == numbers(PLACED)
    source = trimesh.load(tmp_path / "table.obj", force="mesh").bounds
    assert run("export", "res/table.shape", "again.glb").code == 0
    for made in ("res/table.glb", "again.glb"):
        np.testing.assert_allclose(trimesh.load(tmp_path / made).bounds, source, atol=0.002)
    rows = [run("evaluate", f"res/table.{end}", "table.obj", "--json").out for end in ("shape", "json")]
    distances = [json.loads(row)["rows"][0]["cd"] for row in rows]
    assert distances[0] == pytest.approx(distances[1])
    assert distances[0] < 0.001


def test_what_is_assumed_of_the_unit_is_told_once_and_where_it_is_unlikely(run: Run, tmp_path: Path) -> None:
    for name in ("one", "two"):
        table(tmp_path / f"{name}.obj")
    trimesh.load(tmp_path / "one.obj", force="mesh").apply_scale(450).export(tmp_path / "vast.obj")
    ended = run("infer", "one.obj", "two.obj", "vast.obj", "--unit", "cm", "--no-picture")
    assert re.findall(r"longest side is (\S+) m", ended.out) == ["2", "0.9"]


def test_meshes_are_exported_in_the_unit_that_is_asked_for(run: Run, tmp_path: Path) -> None:
    export(PROGRAM, tmp_path / "table.shape", FRAME)
    assert run("export", "table.shape", "m.obj", "default.stl").code == 0
    assert run("export", "table.shape", "mm.stl", "mm.obj", "--unit", "mm").code == 0
    assert run("export", "table.shape", "cells.ply", "--unit", "cells").code == 0
    in_metres = wide(tmp_path / "m.obj")
    for name, factor in (("mm.obj", 1000), ("cells.ply", 1 / FRAME.scale), ("mm.stl", 1000), ("default.stl", 1000)):
        found = wide(tmp_path / name)[[0, 2, 1] if name.endswith(".stl") else [0, 1, 2]]  # makers have z up
        np.testing.assert_allclose(found, factor * in_metres, atol=4e-2 * factor * FRAME.scale)
    ended = run("export", "table.shape", "a.npy", "--unit", "mm")
    assert (ended.code, "--unit has no effect on .npy" in ended.err) == (2, True), ended.err


def test_export_writes_programs_in_another_unit(run: Run, tmp_path: Path) -> None:
    export(parse(NAMED), tmp_path / "legs.shape", FRAME)
    assert run("export", "legs.shape", "cm.shape", "--unit", "cm").code == 0
    frame = load(tmp_path / "cm.shape").frame
    assert "width, depth, height = 66.667, 66.667, 200\nn = 2\n" in (tmp_path / "cm.shape").read_text()
    assert run("export", "cm.shape", "mm.json", "--unit", "mm", "--set", "width=80").code == 0
    other = load(tmp_path / "mm.json")
    np.testing.assert_allclose(other.frame.matrix(), frame.matrix(), rtol=1e-7)
    assert [each.value for each in names(other)] == [800, pytest.approx(666.67), 2000, 2, pytest.approx(633.33)]
    assert run("export", "mm.json", "back.shape", "--unit", "cells").code == 0
    assert (tmp_path / "back.shape").read_text().splitlines()[1] == "width, depth, height = 9.6, 8.00004, 24"


def test_conversions_keep_dimensions_to_a_hundredth_of_a_millimetre(run: Run, tmp_path: Path) -> None:
    sizes = "width, depth, height = 60, 46, 72.5\nthickness = 1.8\ngap = 0.0012\ntop(top=gap, height=thickness)\n"
    (tmp_path / "desk.shape").write_text(f"# unit: cm\n{sizes}")
    for unit in ("in", "mm", "m"):
        assert run("export", "desk.shape", f"{unit}.shape", "--unit", unit).code == 0
    assert "= 23.622, 18.11, 28.543\nthickness = 0.709\ngap = 0.000472\n" in (tmp_path / "in.shape").read_text()
    assert "= 600, 460, 725\nthickness = 18\n" in (tmp_path / "mm.shape").read_text()
    assert "= 0.6, 0.46, 0.725\nthickness = 0.018\n" in (tmp_path / "m.shape").read_text()


def test_conversions_keep_the_parts_of_small_objects_together(run: Run, tmp_path: Path) -> None:
    sizes = "width, depth, height = 0.11111, 0.1, 0.2\ntop(top=0, height=0.1)\n"
    (tmp_path / "bead.shape").write_text(f"# unit: cm\n{sizes}leg(bottom=0, height=0.1001, width=0.03333)\n")
    for unit, width, leg in (("mm", "1.1111", "1.001"), ("in", "0.043744", "0.039409"), ("m", "0.0011111", "0.001001")):
        assert run("export", "bead.shape", f"{unit}.shape", "--unit", unit).code == 0
        text = (tmp_path / f"{unit}.shape").read_text()
        assert f"width, depth, height = {width}, " in text
        assert f"height={leg}" in text


def test_statements_in_cells_are_exported_in_cells(run: Run, tmp_path: Path) -> None:
    export(PROGRAM, tmp_path / "old.shape", FRAME)
    ended = run("export", "old.shape", "new.shape", "--unit", "cells")
    assert ended.code == 0, ended.err
    assert (tmp_path / "new.shape").read_text() == (tmp_path / "old.shape").read_text()
    ended = run("export", "old.shape", "cm.shape", "--unit", "cm")
    assert (ended.code, "statements in cells have no unit" in ended.err) == (2, True)


def test_without_a_frame_files_count_in_the_unit_of_the_program(run: Run, tmp_path: Path) -> None:
    (tmp_path / "cells.shape").write_text(NAMED)
    export(in_unit(parse(NAMED), Unit("cm", 4)), tmp_path / "cm.shape")
    for name in ("cells", "cm"):
        assert run("export", f"{name}.shape", *(f"{name}{suffix}" for suffix in (".stl", ".obj", ".glb"))).code == 0
    for suffix, factor in ((".stl", 40), (".obj", 4), (".glb", 0.04)):  # in millimetres, in the unit, in metres
        found = wide(tmp_path / f"cm{suffix}") / wide(tmp_path / f"cells{suffix}")
        np.testing.assert_allclose(found, factor, rtol=1e-4)


def test_tidy_keeps_the_unit_or_takes_another(run: Run, tmp_path: Path) -> None:
    there = in_unit(parse(NAMED), Unit("cm", 4))
    export(there, tmp_path / "table.shape", FRAME)
    for options, name in (((), "cm"), (("--unit", "mm"), "mm"), (("--unit", "cells"), "cells")):
        ended = run("tidy", "table.shape", "out.shape", *options, "--overwrite")
        assert ended.code == 0, ended.err
        found = load(tmp_path / "out.shape")
        assert ((found.unit.name if found.unit else "") or "cells") == name
        for one, two in ((found, there), (there, found)):
            points = unroll(one).sample(500, torch.Generator().manual_seed(0))
            assert unroll(two).distance(points).abs().max() < 0.2


def test_a_program_without_a_unit_or_a_frame_has_that_of_its_file(run: Run, tmp_path: Path) -> None:
    sizes = "width, depth, height = 40, 20, 30\nbox(height=2, bottom=0)\ntop(top=0, height=2)\n"
    (tmp_path / "bare.shape").write_text(sizes)
    ended = run("export", "bare.shape", "a.stl", "a.csv", "--file-unit", "cm", "--on-input")
    assert "does not say how its input lies" in ended.err, "of the mesh; a cut list has no position"
    assert "length (cm)" in ended.out
    for words in (["export", "bare.shape", "b.stl"], ["tidy", "bare.shape", "mm.shape", "--unit", "mm"]):
        ended = run(*words, "--file-unit", "cm")
        assert ended.code == 0, ended.err
    np.testing.assert_allclose(wide(tmp_path / "b.stl"), [400, 200, 300], rtol=1e-6)
    assert "# unit: mm\nwidth, depth, height = 400, 200, 300\n" in (tmp_path / "mm.shape").read_text()


def test_python_exports_programs_in_the_unit_that_is_asked_for(tmp_path: Path) -> None:
    program = parse("# unit: cm\nwidth, depth, height = 25.4, 25.4, 50.8\ntop(top=0, height=2.54)\n")
    text = export(program, tmp_path / "a.shape", unit="in").read_text()
    assert text.startswith("# unit: in\nwidth, depth, height = 10, 10, 20\n")


def test_parts_that_round_to_nothing_are_told(run: Run, tmp_path: Path) -> None:
    (tmp_path / "a.shape").write_text(
        "# unit: mm\nwidth, depth, height = 4, 4, 4\nback(front=0, depth=0.01)\nleg(width=1)"
    )
    for words, thinnest in (([], "0.05 mm"), (["--unit", "in", "-q"], "0.0005 in")):
        ended = run("export", "a.shape", "a.csv", *words)
        assert f"parts thinner than {thinnest} are left out (wrong unit?): 1" in ended.err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["infer", "table.obj", "--unit", "furlong"], "--unit: unknown unit 'furlong'"),
        (["infer", "table.obj", "--unit", "cm", "--file-unit", "CM"], "did you mean cm?"),
        (["infer", "table.obj", "--file-unit", "mm", "--unit", "cells"], "add --unit cm"),
        (["tidy", "legs.shape", "--file-unit", "mm"], "add --unit cm"),
        (["tidy", "legs.shape", "--unit", "cm"], "write its unit at the top"),
        (["tidy", "cells.shape", "--unit", "cm"], "infer the object with --unit cm"),
        (["export", "legs.shape", "a.scad", "--unit", "cm"], "write its unit at the top"),
        (["export", "mixed.shape", "a.shape", "--unit", "cm"], "n stands for a length in one place"),
        (["export", "cm.shape", "a.csv", "--file-unit", "mm"], "the program states its unit, cm"),
        (["export", "cm.shape", "a.shape", "--unit", "m", "--file-unit", "mm"], "the program states its unit, cm"),
        (["export", "cm.shape", "a.glb", "--on-input", "--up", "z"], "give one of them"),
        (["export", "cm.shape", "a.csv", "--up", "y"], "--up has no effect on .csv"),
        (["export", "cm.shape", "a.npy", "--up", "y"], "--up has no effect on .npy"),
        (["export", "cm.shape", "a.json", "--up", "y"], "--up has no effect on .json"),
        (["export", "bad.shape", "a.stl"], "bad.shape, line 2, column 9: unknown unit 'c'"),
    ],
)
def test_units_that_cannot_be_are_told(run: Run, tmp_path: Path, words: list[str], told: str) -> None:
    table(tmp_path / "table.obj")
    (tmp_path / "legs.shape").write_text(NAMED)
    (tmp_path / "cells.shape").write_text("leg(at=(0, 0, 0), size=(1, 1, 1))")
    export(parse(NAMED.replace("x=span", "x=span, y=n")), tmp_path / "mixed.shape", FRAME)
    (tmp_path / "cm.shape").write_text(f"# placed: up y, front z, origin 0 0 0, 1 unit = 0.01\n# unit: cm\n{NAMED}")
    (tmp_path / "bad.shape").write_text(
        "# placed: up y, front z, origin 0 0 0, 1 unit = 1\n# unit: c\nwidth, depth, height = 1, 1, 1\n"
    )
    ended = run(*words)
    assert ended.code == 2
    assert told in " ".join(ended.err.split())
    assert "Traceback" not in ended.err
