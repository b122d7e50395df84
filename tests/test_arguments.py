"""Wrong arguments of public functions are errors of the package, which name the argument and the remedy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import shapeprog as sp
from shapeprog.arguments import check_number
from shapeprog.geometry import losses
from shapeprog.inference import Result
from shapeprog.language.parser import parse

pytestmark = pytest.mark.wrong_types

TEXT = """# unit: cm
width, depth, height = 60, 60, 90
seat_bottom = 47
leg(left=0, width=4, front=0, depth=4, bottom=0, height=seat_bottom)
seat(bottom=seat_bottom, height=4)
"""
PROGRAM = parse(TEXT)
CELLS = parse("box(at=(0, 0, 0), size=(2, 2, 2))")
CHAIR = sp.Parametric(PROGRAM)
CODE = sp.encode([PROGRAM])
SCENE, SCENES = sp.unroll(PROGRAM), sp.unroll([PROGRAM] * 2)
POINTS = torch.zeros(5, 3)
BENCH = Path(__file__).parents[1] / "examples" / "bench_kenney.obj"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sp.coverage(SCENE, POINTS[:, :2]), r"target has the shape \(5, 2\)\n  hint: give the shape .* P x 3"),
        (lambda: sp.coverage(SCENE, POINTS[0]), r"target has the shape \(3,\)"),
        (lambda: sp.coverage(SCENE, POINTS[:0]), r"target has the shape \(0, 3\)\n.* 1 or more"),
        (lambda: sp.coverage(SCENE, POINTS.numpy()), r"target is no tensor but ndarray\n  hint: give torch.as_tensor"),
        (lambda: sp.coverage(SCENE, POINTS.long()), r"target holds torch.int64\n.* target\.float\(\)"),
        (lambda: sp.coverage(SCENE, POINTS.bfloat16()), r"target holds torch.bfloat16"),
        (lambda: sp.coverage(SCENE, POINTS.expand(2, 5, 3)), r"\(2, 5, 3\) do not go with .* \(\)\n.* unroll a list"),
        (lambda: sp.coverage(SCENES, POINTS.expand(3, 5, 3)), r"do not go with .* \(2,\)\n.* \(2, P, 3\) or \(P, 3\)"),
        (lambda: SCENE.distance(POINTS[:, :2]), r"points has the shape \(5, 2\)"),
        (lambda: sp.chamfer(POINTS.numpy(), POINTS), "points is no tensor but ndarray"),
        (lambda: sp.chamfer(POINTS, POINTS[0]), r"target has the shape \(3,\)"),
        (lambda: sp.chamfer(POINTS.long(), POINTS), "points holds torch.int64"),
        (lambda: sp.chamfer(POINTS, POINTS.expand(2, 5, 3)), r"shape \(5, 3\) and a target of \(2, 5, 3\)"),
        (lambda: sp.chamfer(POINTS, POINTS, weights=torch.ones(4)), r"weights has the shape \(4,\)\n.* the shape 5$"),
        (lambda: sp.chamfer(POINTS, POINTS, target_weights=torch.ones(2, 5)), r"weights has the shape \(2, 5\)"),
        (lambda: sp.chamfer(POINTS, POINTS * torch.nan), r"target has 5 points .* not finite\n  hint: remove"),
        (lambda: losses.excess(POINTS, POINTS * torch.inf), "target has 5 points"),
        (lambda: sp.coverage(SCENE, POINTS.index_fill(0, torch.tensor(1), torch.nan)), "target has 1 points"),
        (lambda: SCENE.distance(POINTS * torch.nan), "points has 5 points"),
        (lambda: sp.coverage(PROGRAM, POINTS), r"a Program is given .*\n  hint: give sp.unroll\(program\)"),
        (lambda: sp.sample(PROGRAM, 5), "a Program is given where a scene is needed"),
        (lambda: sp.sample(CODE, 5), "a Code is given"),
        (lambda: sp.sample(SCENE, -1), "n is -1\n  hint: give a whole number of 0 or more"),
        (lambda: SCENE.sample(2.5), "n is 2.5"),
        (lambda: sp.sample(SCENE, 5, 0), r"generator is 0\n  hint: give torch.Generator\(\)"),
        (lambda: sp.names(None), "None is no program"),
        (lambda: sp.set(TEXT, width=3), "is no program"),
        (lambda: sp.export(None, "a.glb"), "None is no program"),
        (lambda: sp.statement(lambda at: at), 'is no name\n  hint: write the name in brackets, as in @statement'),
        (lambda: sp.shape_from_mesh("chair.obj", []), "vertices is 'chair.obj'\n  hint: .*sp.load_shape reads files"),
        (lambda: sp.unroll("leg()"), r"'leg\(\)' is no program\n.*sp.parse reads text"),
        (lambda: sp.unroll(None), "None is no program"),
        (lambda: sp.unroll([CODE]), "is no program"),
        (lambda: sp.unroll(PROGRAM, shortest="x"), "shortest is 'x'\n  hint: give a number of 0 or more"),
        (lambda: sp.unroll(PROGRAM, shortest=np.ones(2)), "shortest is array"),
        (lambda: sp.unroll(PROGRAM, shortest=-0.1), "shortest is -0.1"),
        (lambda: sp.set(PROGRAM, seat_bottom="47"), "seat_bottom = '47' is no number"),
        (lambda: sp.set(PROGRAM, seat_bottom=None), "seat_bottom = None is no number"),
        (lambda: sp.set(PROGRAM, seat_bottom=np.array([1.0, 2.0])), r"seat_bottom = array\(\[1., 2.\]\) is no number"),
        (lambda: sp.set(PROGRAM, seat_bottom=True), "seat_bottom = True is no number"),
        (lambda: sp.set(PROGRAM, seat_bottom=10**400), "seat_bottom = 10{400} is no number, not finite, or too large"),
        (lambda: CHAIR.at(torch.ones(3)), r"values has the shape \(3,\)\n.* x 4$"),
        (lambda: CHAIR.at(torch.tensor(1.0)), r"values has the shape \(\)"),
        (lambda: CHAIR.at(torch.ones(4).long()), r"values holds torch.int64"),
        (lambda: CHAIR.at(torch.ones(4).half()), r"values holds torch.float16"),
        (lambda: CHAIR.at(np.ones(4)), "values is no tensor but ndarray"),
        (lambda: sp.unroll(CODE.having(CODE.parameters.half())), "parameters hold torch.float16"),
        (lambda: sp.unroll(CODE.having(CODE.parameters.bfloat16())), r"parameters hold torch.bfloat16\n.* float32"),
        (lambda: replace(CODE, parameters=CODE.parameters[:, :1]), r"parameters have the shape .*, ids \(1, 2, 3\)"),
        (lambda: sp.evaluate(TEXT, BENCH), "is no program\n  hint: sp.parse reads text, sp.load a file"),
        (lambda: sp.evaluate(BENCH, BENCH), "bench_kenney.obj holds no program: its name ends in '.obj'"),
        (lambda: sp.evaluate("no.json", BENCH), "there is no file"),
        (lambda: sp.evaluate("a" * 999, BENCH), "holds no program|cannot be read"),
        (lambda: sp.evaluate(PROGRAM, BENCH, "x"), "frame is 'x'\n  hint: give the frame of a shape or of a program"),
        (lambda: sp.save(PROGRAM, "a.json", 3), "frame is 3\n"),
        (lambda: sp.program_to_json(PROGRAM, "x"), "frame is 'x'\n"),
        (lambda: sp.evaluate(PROGRAM, BENCH, points=1), "points is 1\n"),
        (lambda: sp.infer(BENCH, detail=0), "detail is 0\n  hint: give a number above 0$"),
        (lambda: sp.infer(BENCH, detail=float("nan")), "detail is nan"),
        (lambda: sp.infer(BENCH, blocks=0), "blocks is 0\n  hint: give a whole number of 1 or more$"),
        (lambda: sp.infer(BENCH, blocks=2.5), "blocks is 2.5"),
        (lambda: sp.infer(BENCH, budget="1"), "budget is '1'\n  hint: give a number of 0 or more$"),
        (lambda: sp.infer(BENCH, budget=float("nan")), "budget is nan"),
        (lambda: sp.infer(BENCH, progress=3), "progress is 3\n  hint: give a function"),
        (lambda: sp.load_shape(BENCH, up=1), "'1' is not an axis; use x, y or z .*\n  hint: up and front, "),
        (lambda: sp.load_shape(BENCH, front="auto"), "'auto' is not an axis"),
        (lambda: sp.load_shape(BENCH, front=np.array([0, 0, 1])), "is not an axis; use x, y or z"),
        (lambda: sp.Frame.of(0, np.zeros(3), np.eye(3)), "scale is 0.*\n  hint: give a number above 0"),
        (lambda: sp.Frame("2"), "scale is '2'"),
        (lambda: sp.infer(BENCH, settings=3), r"settings is 3\n  hint: give shapeprog.inference.Settings"),
        (lambda: sp.infer(BENCH, libraries=sp.load_library()), r"libraries is no list\n.* \[sp.load_library\(\)\]"),
        (lambda: sp.infer(BENCH, libraries=["a"]), "a str is given where a library is needed\n  hint: sp.load_library"),
        (lambda: sp.infer(BENCH, libraries=[PROGRAM]), "a Program is given where a library is needed"),
        (lambda: sp.learn([PROGRAM], most=1.5), "most is 1.5\n  hint: give a whole number of 0 or more"),
        (lambda: sp.learn([PROGRAM], most=-1), "most is -1"),
        (lambda: sp.learn([TEXT]), "is no program"),
        (lambda: sp.learn(3), "3 is no program"),
        (lambda: sp.with_library(PROGRAM, "a"), "a str is given where a library is needed"),
        (lambda: sp.with_library(TEXT, sp.load_library()), "is no program"),
        (lambda: sp.save_library(PROGRAM, "a.shape"), "a Program is given where a library is needed"),
        (lambda: sp.refine(TEXT, BENCH), "is no program"),
        (lambda: sp.random_program("a"), "generator is 'a'\n  hint: give a whole number of 0 or more"),
        (lambda: sp.random_program(1.5), "generator is 1.5"),
        (lambda: sp.random_program(0, blocks=-1), "blocks is -1"),
        (lambda: sp.random_program(0, depth=0), "depth is 0\n  hint: give a whole number of 1 or more"),
        (lambda: sp.infer(BENCH, unit="foot"), "unknown unit 'foot'\n  hint: use mm, cm, m or in$"),
        (lambda: sp.infer(BENCH, unit=3), "unknown unit 3\n  hint: use mm"),
        (lambda: sp.in_unit(PROGRAM, "mm"), r"'mm' is the name of a unit\n  hint: give sp.Unit\('mm', n\)"),
        (lambda: sp.export(CELLS, "a.stl", unit="foot"), "unknown unit 'foot'"),
        (lambda: sp.export(CELLS, "a.shape", unit="foot"), "unknown unit 'foot'"),
        (lambda: sp.infer(BENCH, statements="foo"), "unknown statements 'foo'\n  hint: choose all or paper"),
    ],
)  # fmt: skip
def test_a_wrong_argument_is_named_with_its_remedy(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(sp.ShapeProgError, match=message):
        call()


def test_a_result_stands_for_its_program(tmp_path: Path) -> None:
    given = replace(PROGRAM, frame=sp.Frame(2.0))
    result: Any = Result(given, None, {}, "", (), 0.0)
    functions: list[Callable[[Any], Any]] = [
        sp.format_program, sp.inline, sp.program_to_json,
        lambda given: sp.export(given, tmp_path / "a.obj").read_text(),
        lambda given: sp.in_unit(given, sp.Unit("mm", 30)), lambda given: sp.set(given, seat_bottom=40),
        lambda given: sp.with_library(given, sp.load_library()), lambda given: [name.value for name in sp.names(given)],
        lambda given: sp.unroll(given).centre.tolist(), lambda given: sp.Parametric(given).values.tolist(),
    ]  # fmt: skip
    for function in functions:
        assert function(result) == function(given)
    sp.save(result, tmp_path / "a.json")
    assert (tmp_path / "a.json").read_text() == sp.program_to_json(given)


def test_right_arguments_pass() -> None:
    assert sp.coverage(SCENES, POINTS).shape == sp.coverage(SCENES, POINTS.expand(2, 5, 3)).shape == (2,)
    assert sp.coverage(SCENES, POINTS.expand(1, 5, 3)).shape == (2,)
    assert sp.chamfer(POINTS, POINTS, weights=torch.ones(5)) == 0
    assert sp.unroll(program for program in [PROGRAM]).mask.sum() == 2  # type: ignore[arg-type]
    assert sp.set(PROGRAM, seat_bottom=torch.tensor(40.0)) == sp.set(PROGRAM, seat_bottom=np.int64(40))  # type: ignore[arg-type]
    check_number("a share", np.float32(1), 0, 1)
    check_number("a count", np.int64(3), 1, whole=True)


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize(
    "value",
    [10**400, np.array([1, 2]), torch.ones(2), True, np.True_, "1", b"1", None, 1j, torch.ones(1, device="meta")],
)
def test_what_is_no_number_is_refused(value: Any, whole: bool) -> None:
    with pytest.raises(sp.ShapeProgError, match=r"n is .*\n  hint: give a .*number of 0 or more"):
        check_number("n", value, 0, whole=whole)


def test_a_fraction_is_no_whole_number() -> None:
    check_number("n", torch.tensor(1.5), 0)
    check_number("n", torch.tensor(2), 0, whole=True)
    for value in (torch.tensor(1.5), np.float64(2)):
        with pytest.raises(sp.ShapeProgError, match="give a whole number"):
            check_number("n", value, 0, whole=True)


def test_lack_of_memory_is_no_wrong_shape(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: Any) -> None:
        raise RuntimeError("not enough memory")

    monkeypatch.setattr(type(SCENES), "flatten", full)
    with pytest.raises(RuntimeError, match="not enough memory"):
        SCENES.distance(POINTS)


@pytest.mark.parametrize("factor", [-1.0, torch.nan, torch.inf])
def test_values_that_no_program_can_have_are_refused_but_where_a_gradient_is_recorded(factor: float) -> None:
    with pytest.raises(sp.ShapeProgError, match=r"a (length|position) of box in block 1 is (-|nan|inf)"):
        CHAIR.at(CHAIR.values * factor)
    with pytest.raises(sp.ShapeProgError, match="in entry 1\n"):
        CHAIR.at(torch.stack([CHAIR.values, CHAIR.values * factor]))
    recorded = (CHAIR.values * factor).requires_grad_()
    assert CHAIR.at(recorded).parameters.requires_grad
    with torch.no_grad(), pytest.raises(sp.ShapeProgError):
        CHAIR.at(recorded)


def test_a_negative_length_that_is_recorded_draws_nothing_or_the_shortest() -> None:
    values = CHAIR.values.clone()
    values[CHAIR.names.index("seat_bottom")] = -1.0
    assert sp.unroll(CHAIR.at(values.requires_grad_())).mask.sum() == 1
    scene = sp.unroll(CHAIR.at(values), shortest=0.2)
    assert scene.mask.all()
    assert float(scene.size[:, :3].detach().min()) == pytest.approx(0.1)


def test_zero_is_a_length() -> None:
    text = TEXT.replace("seat_bottom = 47", "tip, seat_bottom = 0, 47").replace(
        "leg(", "taper(bottom=0, height=5, radius=(4, tip))\nleg("
    )
    cone = sp.Parametric(parse(text))
    assert sp.unroll(cone.at(cone.values)).mask.sum() == 3


def test_frames_of_arrays_and_of_tuples_are_equal() -> None:
    frame = sp.Frame(2.0, np.zeros(3), np.eye(3))  # type: ignore[arg-type]
    assert frame == sp.Frame(2.0)
    assert hash(frame) == hash(sp.Frame(2.0))
