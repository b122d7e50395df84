"""CAD scripts: the expressions they share are evaluated by a small twin and compared with unrolling."""

from __future__ import annotations

import importlib.util
import math
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from cad_twin import evaluate, expected, same

from shapeprog.formats import export
from shapeprog.formats.build123d import script_text
from shapeprog.formats.openscad import scad_text
from shapeprog.formats.parts import parts, solid
from shapeprog.formats.plan import plan
from shapeprog.formats.symbolic import repeat
from shapeprog.geometry.primitive import Primitive, primitives
from shapeprog.geometry.primitives.cuboid import CUBOID
from shapeprog.language import Draw, Language, Loop, Program, language, loop, statement, using
from shapeprog.language.converting import in_unit
from shapeprog.language.parameters import Count, Extent, Length, Position, Radius, Shift
from shapeprog.language.shapes import disc
from shapeprog.language.shapes import solid as draw_solid
from shapeprog.language.statement import Motion
from shapeprog.language.text import parse
from shapeprog.language.unit import Unit
from shapeprog.space import Frame, grid_axes

CHAIR = """
top_rectangle(at=(0, 0, 0), thickness=2, half=(8, 9))
for i in translate(2, by=(0, 0, 16)):
    for j in translate(2, by=(0, 14, 0)):
        leg(at=(-12, -8, -9), size=(12, 2, 2))
back(at=(2, 6, -9), size=(10, 2, 18), tilt=3.25)
for i in translate(2, by=(0, 0, 16)):
    chair_beam(at=(2, -6, -9), size=(4.5, 2, 2))
    chair_beam(at=(6.5, -6, -9), size=(2, 13, 2))
line(start=(-8, -7, -8), end=(-8, 6.5, 8), radius=0.75)
"""

SPIN = """
top_circle(at=(2, 1, 0), thickness=2, radius=10)
for i in rotate(5, step=1):
    line(start=(-9, 1, 0), end=(-12, 9, 3), radius=1)
    leg(at=(-3, 5, -1), size=(3, 2, 2))
for i in rotate(4, step=1):
    base_cross(at=(-11, 1, 0), thickness=1.5, length=9, turn=0)
for i in translate(2, by=(4, 0, 0)):
    for j in rotate(3, step=2):
        for k in translate(2, by=(0, 3, 1)):
            line(start=(-2, 1.5, 0), end=(-1, 5, 2), radius=0.5)
            base_cross(at=(-4, 1, 2), thickness=1.5, length=5, turn=3)
"""

LOUNGE = """
seat(cushion(at=(0, -8, -9), size=(3, 16, 18), edge=1))
cushion(at=(3, -8, -9), size=(2, 4, 18), edge=0)
pillow(cushion(at=(3, 0, -3), size=(5, 3, 6), edge=9))
back(board(at=(2, 6, -9), size=(10, 2, 18), tilt=15))
for i in mirror(axis=side):
    for j in translate(2, by=(0, 12, 0)):
        leg(bar(start=(0, -6, -8), end=(-11, -8, -10), section=(1.5, 1), turn=20))
        post(taper(start=(0, -3, -5), end=(-11, -4, -6), radius=(1, 0)))
    arm(bent_rod(start=(1, -8, -10), through=(7, 0, -11), end=(3, 8, -10), radius=0.75))
    bar(start=(-4, -8, -10), end=(-4.5, 8, -9), section=(2, 0.5), turn=-35)
    board(at=(-6, 2, 5), size=(4, 1, 3), tilt=-30)
for i in mirror(axis=depth, at=1):
    handle(bent_rod(start=(2, -9, 1), through=(2.5, -13, 0), end=(2, -9, -1), radius=0.25))
for i in rotate(3, step=1):
    bent_rod(start=(-10, 2, 1), through=(-9.99, 5, 1), end=(-10, 8, 1), radius=0.5)
    bar(start=(-11, 4, 3), end=(-9, 4, -5), section=(1, 2))
"""


def changed_program(program, generator):
    """The program with every continuous number and every count changed, and the variables of its plan to match."""
    variables = {}
    made = iter(plan(program).headings)

    def change(node):
        heading, declared = next(made), language()[node.name]
        values = list(node.values)
        shown = [p for p in declared.parameters if p.quantity.kind != "axis" and p.quantity.written_out]
        for parameter, variable in zip(shown, heading.variables, strict=True):
            for slot in range(parameter.slots.start, parameter.slots.stop):
                if parameter.quantity.kind == "count":
                    values[slot] += 1
                elif not parameter.quantity.discrete:
                    values[slot] = float(np.float32(values[slot] + generator.integers(1, 5) / 4))
            group = values[parameter.slots]
            variables[variable.name] = group if len(group) > 1 else group[0]
            if parameter.quantity.discrete:
                variables[variable.name] = round(group[0])
        if isinstance(node, Loop):
            return Loop(node.name, tuple(values), tuple(change(inner) for inner in node.body))
        return Draw(node.name, tuple(values))

    return Program(tuple(change(node) for node in program.body)), variables


@pytest.mark.parametrize("text", [CHAIR, SPIN, LOUNGE])
@pytest.mark.parametrize("unit", [None, Unit("cm", 3.75), Unit("m", 0.0375)])
def test_expressions_draw_what_unrolling_draws(text, unit):
    program = in_unit(parse(text), unit)
    made = plan(program)
    same(evaluate(made), expected(program))
    shown = [v for heading in made.headings for v in heading.variables if v.quantity.kind == "length"]
    written = [eval(each.text) for each in shown]
    cells = [eval(v.text) for h in plan(parse(text)).headings for v in h.variables if v.quantity.kind == "length"]
    np.testing.assert_allclose(np.hstack(written), np.hstack(cells) * made.cell, rtol=1e-5)


@pytest.mark.parametrize("text", [CHAIR, SPIN, LOUNGE])
def test_numbers_at_the_top_stay_live(text):
    program = parse(text)
    other, variables = changed_program(program, np.random.default_rng(0))
    same(evaluate(plan(program), variables), expected(other))


@pytest.mark.parametrize("declared", [each for each in language() if not each.is_loop], ids=lambda each: each.name)
@pytest.mark.parametrize("around", ["", "translate", "rotate"])
def test_every_statement_keeps_its_parameters(declared, around):
    generator = np.random.default_rng(declared.id)
    low = {"length": 1, "turn": 0}
    values = tuple(float(generator.integers(low.get(q.kind, -8), 6)) for q in declared.quantities)
    node = Draw(declared.name, values)
    if around:
        motion = language()[around]
        node = Loop(around, tuple(float(v) for v in (3, 2, -1, 4)[: motion.size]), (node,))
    program = Program((node,))
    other, variables = changed_program(program, generator)
    same(evaluate(plan(program)), expected(program))
    same(evaluate(plan(program), variables), expected(other))
    fixed = [v.name for h in plan(program).headings for v in h.variables if v.fixed]
    discrete = {
        p.name
        for each in (declared, *([language()[around]] if around else []))
        for p in each.parameters
        if p.quantity.discrete
    }
    assert all(name.rpartition("_")[2] in discrete for name in fixed)


@pytest.fixture
def own():
    """A language with statements of a user's own: another primitive, a turned box, a curve, a loop without a rule."""
    with using(Language()):
        ball = primitives.register(_ball())

        @statement("puff")
        def puff(at: Position, half: Extent):
            """A soft cushion."""
            return draw_solid(ball, at, *half.unbind(-1))

        @statement("tipped")
        def tipped(at: Position, size: Extent):
            """A box tipped about the side axis, its top leaning."""
            c, s = math.cos(0.5), math.sin(0.5)
            axes = torch.tensor([[c, -s, 0], [s, c, 0], [0, 0, 1]]).to(at).expand(*at.shape[:-1], 3, 3)
            return draw_solid(CUBOID, at, *(size / 2).unbind(-1), size[..., 0] / 4, rotation=axes)

        @statement("posts")
        def posts(at: Position, radius: Radius, angle: Length):
            """Two posts on a circle."""
            zero = torch.zeros_like(angle)
            place = torch.stack([zero, radius * angle.cos(), radius * angle.sin()], -1)
            return [disc(at, radius, radius / 4), disc(at + place, radius, radius / 4)]

        @loop("spiral")
        def spiral(copy, quarter, count: Count, rise: Shift):
            """Copies that rise ever faster while turning, the slower the more there are."""
            zero = torch.zeros_like(copy)
            return Motion(turn=copy / 9, shift=torch.stack([copy**2 * rise / (2 * count), zero, zero], -1))

        yield parse(
            "puff(at=(3, 0, 0), half=(2, 5, 6))\n"
            "for i in spiral(4, rise=2):\n"
            "    tipped(at=(-4, 6, -3), size=(4, 3, 2))\n    puff(at=(-4, 0, 5), half=(2, 1, 1))\n"
            "posts(at=(-12, 0, 0), radius=4, angle=1.25)\n"
        )


def _ball():
    def mesh(size):
        sphere = trimesh.creation.icosphere(1)
        return np.asarray(sphere.vertices) * size[:3], np.asarray(sphere.faces)

    unused = {"distance": lambda points, size: points[..., 0], "areas": lambda size: size[..., :1]}
    unused |= {
        "sample": lambda size, face, u: u,
        "place": lambda size, unit: unit,
        "normal": lambda size, unit, f: unit,
    }
    unused |= {"volume": lambda size: size[..., 0]}
    return Primitive("test_ball", ("a", "b", "c"), 3, bound=lambda size: size[..., :3], mesh=mesh, **unused)


def test_statements_of_a_users_own_are_exported_too(own):
    made = plan(own)
    same(evaluate(made), expected(own))
    fixed = {v.name for heading in made.headings for v in heading.variables if v.fixed}
    assert fixed == {"spiral_1_rise", "posts_1_angle"}
    assert "polyhedron" in scad_text(own, Frame())
    compile(script_text(own, Frame()), "script", "exec")


def test_loops_that_follow_a_rule_are_looked_at_for_few_copies_however_many_they_have():
    seen = []

    def move(copy, quarter, **values):
        seen.append(len(copy))
        return language()["translate"].move(copy, quarter, **values)

    found, fixed = repeat(replace(language()["translate"], move=move), (2.0**24, 0, 0, 1), quarter=False)
    assert [axis.text(["count", "up", "depth", "side"]) for axis in found.shift] == ["up", "depth", "side"]
    assert fixed == frozenset()
    assert max(seen) < 100


def test_loops_are_loops_and_numbers_have_names():
    text = scad_text(parse(CHAIR), Frame())
    assert "leg_1_size = [12, 2, 2]; // [0:0.5:32]" in text
    assert "for (j = [0 : 1 : translate_2_count - 1]) move(j, translate_2_by) {" in text
    assert "cuboid(leg_1_at, leg_1_size); // leg_1" in text
    assert "cuboid(back_1_at, back_1_size, back_1_tilt)" in text
    script = script_text(parse(CHAIR), Frame(), 'a "chair"')
    assert "for j in range(translate_2_count):" in script
    compile(script, "script", "exec")


def test_a_pointed_leg_is_drawn_by_scripts_and_as_a_part():
    program = parse("leg(taper(start=(0, 0, 0), end=(-6, 0, 0), radius=(2, 0)))")
    (part,) = parts(program)
    assert trimesh.Trimesh(part.vertices, part.faces).volume == pytest.approx(np.pi * 2**2 * 6 / 3, rel=1e-5)
    same(evaluate(plan(program)), expected(program))
    for text in (scad_text(program, Frame()), script_text(program, Frame())):
        assert "cylinder_between(leg_1_start, leg_1_end, leg_1_radius[0], leg_1_radius[1])" in text


def test_a_turning_loop_is_written_once_for_each_axis():
    body = ["line(start=(0, 0, 0), end=(3, 3, 3), radius=1)", "leg(at=(0, 4, 0), size=(1, 1, 1))"]
    body += ["layer(at=(0, 6, 0), thickness=1, half=(1, 1))"]
    made = plan(parse("\n    ".join(["for i in rotate(3, step=1):", *body])))
    assert [step.turn[1] for step in made.body].count("[0, 0, 0]") == 2
    assert len(made.body) == 3


FRAME = Frame.around([1, 2, 3], [30, 40, 45], grid_axes("+y", "-z"))


@pytest.mark.skipif(shutil.which("openscad") is None, reason="needs OpenSCAD")
@pytest.mark.parametrize("text", [CHAIR, LOUNGE])
def test_openscad_makes_the_same_solid(text, tmp_path: Path):
    program = parse(text)
    export(program, tmp_path / "chair.scad", FRAME)
    subprocess.run(["openscad", "-q", "-o", "chair.stl", "chair.scad"], cwd=tmp_path, check=True, capture_output=True)
    made, wanted = trimesh.load(tmp_path / "chair.stl"), trimesh.Trimesh(*solid(program, FRAME))
    np.testing.assert_allclose(made.volume, wanted.volume, rtol=1e-3)
    np.testing.assert_allclose(made.bounds, wanted.bounds, atol=1e-2)


@pytest.mark.skipif(importlib.util.find_spec("build123d") is None, reason="needs build123d")
def test_build123d_makes_the_same_parts():
    program = parse(LOUNGE)
    scope = {"__name__": "model"}
    exec(script_text(program, FRAME), scope)
    made, wanted = {part.label: part for part in scope["parts"]}, {part.name: part for part in parts(program, FRAME)}
    assert made.keys() == wanted.keys()
    for name, mesh in wanted.items():
        part, box = made[name], made[name].bounding_box()
        np.testing.assert_allclose(part.volume, trimesh.Trimesh(mesh.vertices, mesh.faces).volume, rtol=1e-4)
        bounds = [mesh.vertices.min(0), mesh.vertices.max(0)]
        np.testing.assert_allclose([tuple(box.min), tuple(box.max)], bounds, atol=2e-2)


@pytest.mark.skipif(importlib.util.find_spec("build123d") is None, reason="needs build123d")
def test_build123d_makes_the_same_solid(tmp_path: Path):
    program = parse(CHAIR)
    scope = {"__name__": "model"}
    exec(script_text(program, FRAME), scope)
    wanted = trimesh.Trimesh(*solid(program, FRAME))
    np.testing.assert_allclose(scope["union"]().volume, wanted.volume, rtol=1e-4)
    assert [part.label for part in scope["parts"]] == [part.name for part in parts(program)]
    export(program, tmp_path / "chair.step", FRAME)
    assert b"leg_4" in (tmp_path / "chair.step").read_bytes()
