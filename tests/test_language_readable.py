"""Programs in a unit with the decimals that a person expects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from commands import PROGRAM
from hypothesis import given, reject
from hypothesis import strategies as st

from shapeprog.data.loading import load_shape
from shapeprog.data.random import random_program
from shapeprog.data.shape import Shape, unit_of_result
from shapeprog.errors import ShapeProgError
from shapeprog.formats import export, load, save
from shapeprog.geometry.mesh import part_meshes
from shapeprog.inference import Settings, infer
from shapeprog.inference.choice.connecting import floating
from shapeprog.language.convert import placed
from shapeprog.language.named import names
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program
from shapeprog.language.readable import TOLERANCES, in_readable_unit
from shapeprog.language.unit import METRES, Unit
from shapeprog.language.unroll import unroll
from shapeprog.space import SPAN, Frame, grid_axes

CHAIR = "width, depth, height = 10.213, 12, 24.004\nseat(depth=10.1, height=height / 9)\n"


@pytest.mark.parametrize(
    ("unit", "names", "depth"),
    [
        (Unit("cm", 3.75), "38.3, 45, 90", "37.9"),
        (Unit("mm", 37.5), "383, 450, 900", "379"),
        (Unit("m", 0.0375), "0.383, 0.45, 0.9", "0.379"),
        (Unit("in", 1.476), "15.07, 17.7, 35.42", "14.9"),
        (Unit("cm", 10), "102, 120, 240", "101"),
    ],
)
def test_lengths_have_the_decimals_that_a_person_expects(unit: Unit, names: str, depth: str) -> None:
    text = format_program(in_readable_unit(parse(CHAIR), unit))
    assert f"width, depth, height = {names}\n" in text
    assert f"seat(depth={depth}, height=height / 9)" in text


@given(st.integers(0, 1 << 30), st.builds(Unit, st.sampled_from([*METRES]), st.floats(0.03125, 400, width=32)))
def test_no_number_moves_far_and_no_copy_of_a_loop(seed: int, unit: Unit) -> None:
    try:
        program = placed(random_program(torch.Generator().manual_seed(seed), blocks=3, copies=30))
    except ShapeProgError:  # a part without a placed form
        reject()
    moved = in_readable_unit(program, unit)
    assert moved.unit == unit
    centre = unroll(program).centre
    farthest = TOLERANCES[0] + 1e-3 + 5e-6 * float(centre.abs().max())  # numbers that stay unrounded have six digits
    assert (centre - unroll(moved).centre).abs().max() <= farthest


@pytest.mark.parametrize("seed", range(20))
def test_nearly_upright_bars_move_no_face_far(seed: int) -> None:
    # Their faces are not linear in these numbers: a box around an upright bar grows whichever way it leans.
    random = np.random.default_rng(seed)
    post, leg = (f"left={left:.4f}, front={front:.4f}" for left, front in random.uniform(3, 7, (2, 2)))
    lines = f"post(bar(start=at({post}), end=at({post}, top=0), width=1.0123, depth=.9877))\n"
    lines += f"leg(bar(start=at({leg}), end=at({leg}, top=1.2345), width=1, depth=.5))\n"
    program = parse(f"width, depth, height = 20, 16, 24\n{lines}base(height=1.0077)")
    moved = in_readable_unit(program, Unit("cm", 3.75))
    before, after = unroll(program), unroll(moved)
    for sign in (-1, 1):
        off = (before.centre + sign * before.reach) - (after.centre + sign * after.reach)
        assert float(off.abs().max()) <= TOLERANCES[0] + 1e-4
    assert "base(height=3.78)" in format_program(moved) or "base(height=3.8)" in format_program(moved)


def test_round_legs_that_lean_as_much_sideways_as_backwards_are_rounded() -> None:
    leg = "rod(start=at(left=margin, rear=margin), end=at(left=inset, rear=inset, bottom=2.719), radius=.277)"
    names = "width, depth, height = 23.996, 6.833, 7.85\nmargin, inset = .383, .966\n"
    program = parse(f"{names}for _ in mirror(x=0, y=0):\n    leg({leg})\ntop(bottom=2.719)")
    text = format_program(in_readable_unit(program, Unit("m", 0.041667)))
    assert "width, depth, height = 1, 0.285, 0.327\n" in text
    assert "margin, inset = 0.016, 0.04\n" in text


def test_a_part_that_is_thinner_than_the_tolerance_keeps_a_size_and_others_are_rounded() -> None:
    # 12.4826 and 62.486 cm of 75: both would be rounded so that nothing is left between them.
    program = parse("width, depth, height = 20, 16, 24\nside(left=3.3287, right=16.6629)\nbase(height=1.2301)")
    moved = in_readable_unit(program, Unit("cm", 3.75))
    assert unroll(moved).size[0, 2] > 0
    assert "base(height=4.6)" in format_program(moved)


@pytest.mark.parametrize("unit", [Unit("", 0.0375), Unit("cm", 3.75), Unit("in", 1.476)])
def test_sums_of_rounded_numbers_move_no_face_far(unit: Unit) -> None:
    program = parse(
        "width, depth, height = 10.13, 9.87, 24\n"
        "lift, drop, gap = 1.234, 0.567, 3.333\n"
        "with inside(bottom=lift + drop + gap, height=4 * drop + gap):\n"
        "    shelf(bottom=lift / 2 + drop, height=lift, left=lift + drop, right=gap)\n"
    )
    moved = in_readable_unit(program, unit)
    one, two = unroll(program), unroll(moved)
    assert ((one.centre - two.centre).abs() + (one.size - two.size).abs()[..., :3]).max() <= 2 * TOLERANCES[0]
    assert format_program(parse(format_program(moved))) == format_program(moved)


@pytest.mark.parametrize("name", ["", "mm", "in"])
def test_a_rounded_program_is_read_back_and_lies_where_it_lay(name: str, tmp_path: Path) -> None:
    program = parse(
        "width, depth, height = 10.13, 9.87, 23.99\nleg_height = 12.34\nleg(width=2.02, height=leg_height)\n"
    )
    frame = Frame.around([1, 2, 3], [1.9, 2.4, 3.7], grid_axes("+z", "-y"))
    rounded = in_readable_unit(program, Unit.of(frame, name) if name else Unit("", frame.scale))
    save(rounded, tmp_path / "leg.shape", frame)
    again = load(tmp_path / "leg.shape")
    assert format_program(again) == format_program(rounded)
    one, two = (f.to_world(part_meshes(unroll(p))[0].vertices) for p, f in ((program, frame), (again, again.frame)))
    assert abs(one - two).max() <= (TOLERANCES[0] + 1e-3) * frame.scale


@pytest.mark.parametrize(
    ("suffix", "longest", "unit"),
    [
        *((".obj", 0.9, ""), (".ply", 9, ""), (".obj", 90, "cm"), (".off", 450, "mm"), (".xyz", 2000, "mm")),
        *((".glb", 0.9, "m"), (".glb", 900, "mm"), (".stl", 0.9, ""), (".stl", 90, "mm"), (".stl", 900, "mm")),
    ],
)
def test_the_unit_of_a_file_is_that_of_its_format_if_furniture_may_be_so_large(
    suffix: str, longest: float, unit: str
) -> None:
    shape = Shape("chair", np.ones((32, 32, 32), np.bool_), frame=Frame(longest / SPAN), source=Path("a" + suffix))
    program, voxels = parse("width, depth, height = 9, 8, 24\nleg(width=2)\n"), replace(shape, kind="voxels")
    mesh = replace(shape, kind="mesh")
    assert mesh.file_unit == unit
    assert unit_of_result(mesh, program) == Unit(unit, longest / SPAN)
    assert unit_of_result(voxels, program) is unit_of_result(mesh, program, "cells") is None
    assert unit_of_result(replace(voxels, unit="in"), program) == Unit("in", longest / SPAN)
    metre = METRES[unit or "m"]
    assert unit_of_result(mesh, program, "cm") == Unit("cm", longest * metre * 100 / SPAN)


def test_an_stl_in_millimetres_becomes_a_program_in_millimetres_that_lies_on_it(tmp_path: Path) -> None:
    frame = Frame(50, (0, 0, 600), tuple(map(tuple, grid_axes("+z", "-y"))))
    export(PROGRAM, tmp_path / "table.stl", frame, on_input=True)
    shape = load_shape(tmp_path / "table.stl")
    program = infer(shape, settings=Settings(rounds=2)).program
    assert program.unit is not None
    assert program.unit.name == "mm"
    sizes = {named.name: named.value for named in names(program)}
    assert [sizes[word] for word in ("width", "depth", "height")] == pytest.approx([1200, 900, 1200], abs=1)
    assert all(value == round(value) for value in sizes.values())
    save(program, tmp_path / "table.shape")
    again = load(tmp_path / "table.shape")
    vertices = [again.frame.to_world(part.vertices) for part in part_meshes(unroll(again))]
    corners = shape.frame.to_world(shape.vertices)
    for end in (np.min, np.max):
        np.testing.assert_allclose(end(np.concatenate(vertices), 0), end(corners, 0), atol=2)
    with pytest.raises(ShapeProgError, match="furlong"):
        load_shape(tmp_path / "table.stl", unit="furlong")


def test_parts_that_touch_keep_as_many_decimals_as_hold_them_together() -> None:
    unit = Unit("cm", 4)
    for height, top, shown in ((2.5, 2.76, "bottom=11,"), (2.51, 2.77, "bottom=11.08,")):
        program = parse(
            f"width, depth, height = 4, 4, 24\nbox(bottom=0.26, height={height})\nbox(bottom={top}, height=1)\n"
        )
        found = in_readable_unit(program, unit)
        assert floating(program) == floating(found) == []
        assert shown in format_program(found)


def test_a_program_in_its_unit_is_left_as_it_is() -> None:
    program = in_readable_unit(parse(CHAIR), Unit("cm", 3.75))
    assert in_readable_unit(program, Unit("cm", 3.75)) is program
    again = in_readable_unit(in_readable_unit(program, None), Unit("cm", 3.75))
    assert format_program(again) == format_program(program)


def test_several_parts_in_one_loop_are_told_apart() -> None:
    program = parse(
        "width, depth, height = 4, 4, 24\n"
        "box(bottom=12, height=4)\n"
        "for _ in mirror(x=0):\n"
        "    leg(x=-0.76, width=1, rear=3, bottom=8, height=4)\n"
        "    arm(x=-0.76, width=1, bottom=20, height=1)\n"
    )
    assert floating(program) == [2]
    unit = Unit("cm", 4)
    assert floating(in_readable_unit(program, unit)) == [2]
