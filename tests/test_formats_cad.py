"""CAD scripts: the expressions they share are evaluated here by a small twin and compared with unrolling."""

from __future__ import annotations

import importlib.util
import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from shapeprog.formats import export
from shapeprog.formats.build123d import script_text
from shapeprog.formats.openscad import scad_text
from shapeprog.formats.parts import parts, solid
from shapeprog.formats.plan import Repetition, plan
from shapeprog.geometry.primitive import Primitive, primitives
from shapeprog.geometry.primitives.cuboid import CUBOID
from shapeprog.language import Draw, Language, Loop, Program, language, loop, statement, unroll, using
from shapeprog.language.parameters import Count, Extent, Length, Position, Radius, Shift
from shapeprog.language.shapes import disc
from shapeprog.language.shapes import solid as draw_solid
from shapeprog.language.statement import Motion
from shapeprog.language.text import parse
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


def matrix(linear=None, shift=(0, 0, 0)):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = np.eye(3) if linear is None else linear, shift
    return out


def move(i, by):
    return matrix(shift=i * np.array(by))


def turn(degrees, about):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    spin = matrix([[1, 0, 0], [0, c, -s], [0, s, c]])
    axis = np.array([0, *about[1:]])
    return matrix(shift=axis) @ spin @ matrix(shift=-axis)


def evaluate(made, changed=None):
    """Centres and bounding boxes of the solids of a plan, by its expressions alone; numbers may be changed first."""
    names = {v.name: eval(v.text) for heading in made.headings for v in heading.variables}
    names |= {name: table.tolist() for name, table in made.tables.items()} | (changed or {})
    found = []

    def run(steps, place, scope):
        for step in steps:
            if isinstance(step, Repetition):
                for copy in range(eval(step.count, {}, scope)):
                    inner = scope | {step.letter: copy}
                    here = place
                    if step.shift:
                        here = here @ move(*(eval(word, {}, inner) for word in step.shift))
                    if step.turn:
                        here = here @ turn(*(eval(word, {}, inner) for word in step.turn))
                    if step.signs:
                        here = here @ np.diag([*eval(step.signs, {}, inner), 1])
                    run(step.body, here, inner)
                continue
            arguments = [np.array(eval(word, {}, scope), float) for word in step.arguments]
            if step.kind in ("cylinder", "frustum"):
                start, end, *radii = arguments
                along = (end - start) / max(np.linalg.norm(end - start), 1e-12)
                spread = np.outer(radii, np.sqrt(np.maximum(0, 1 - (place[:3, :3] @ along) ** 2)))
                ends = np.stack([start, end]) @ place[:3, :3].T + place[:3, 3]
                found.append((ends.mean(0), (ends - spread).min(0), (ends + spread).max(0)))
                continue
            if step.kind == "cuboid":
                size, lean = arguments[1], float(arguments[2]) if len(arguments) > 2 else 0.0
                corners = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)]) * size
                corners[:, 1] += np.repeat([0, lean], 4)
                low = arguments[0] if step.axes is None else -size / 2 - [0, lean / 2, 0]
                local = corners + low
            else:
                local = made.shells[step.shell][0] * arguments[1]
                local = local if step.axes is not None else local + arguments[0]
            if step.axes is not None:
                local = local @ step.axes.T + arguments[0]
            world = local @ place[:3, :3].T + place[:3, 3]
            found.append(((world.min(0) + world.max(0)) / 2, world.min(0), world.max(0)))

    run(made.body, np.eye(4), names)
    return sorted((np.round(np.concatenate(each), 5) + 0.0).tolist() for each in found)


def expected(program):
    """The same from the parts of the unrolled program; a cylinder's box is that of the true cylinder."""
    scene = unroll(program)
    found = []
    for slot in torch.nonzero(scene.mask)[:, 0].tolist():
        size, centre, rotation = (t[slot].double().numpy() for t in (scene.size, scene.centre, scene.rotation))
        kind = primitives[int(scene.kind[slot])]
        if kind.name == "cylinder":
            spread = np.abs(rotation[:, 0]) * size[0] + size[1] * np.sqrt(np.maximum(0, 1 - rotation[:, 0] ** 2))
            found.append((centre, centre - spread, centre + spread))
            continue
        if kind.name == "frustum":
            spread = np.outer(size[1:3], np.sqrt(np.maximum(0, 1 - rotation[:, 0] ** 2)))
            ends = centre + np.outer([-size[0], size[0]], rotation[:, 0])
            found.append((centre, (ends - spread).min(0), (ends + spread).max(0)))
            continue
        world = kind.mesh(size)[0] @ rotation.T + centre
        found.append(((world.min(0) + world.max(0)) / 2, world.min(0), world.max(0)))
    return sorted((np.round(np.concatenate(each), 5) + 0.0).tolist() for each in found)


def same(one, two):
    assert len(one) == len(two)
    np.testing.assert_allclose(one, two, atol=2e-4)


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


@pytest.mark.parametrize("text", [CHAIR, SPIN])
def test_expressions_draw_what_unrolling_draws(text):
    program = parse(text)
    same(evaluate(plan(program)), expected(program))


@pytest.mark.parametrize("text", [CHAIR, SPIN])
def test_numbers_at_the_top_stay_live(text):
    program = parse(text)
    other, variables = changed_program(program, np.random.default_rng(0))
    same(evaluate(plan(program), variables), expected(other))


@pytest.mark.parametrize("declared", [each for each in language() if not each.is_loop], ids=lambda each: each.name)
@pytest.mark.parametrize("around", ["", "translate", "rotate"])
def test_every_statement_keeps_its_parameters(declared, around, request):
    if declared.name in ("bar", "board", "bent_rod", "cushion"):
        request.applymarker(pytest.mark.xfail(reason="some of their numbers are fixed in scripts", strict=True))
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
    assert all(name.endswith(("_turn", "_step")) for name in fixed)


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
            """Copies that rise ever faster while turning."""
            zero = torch.zeros_like(copy)
            return Motion(turn=copy / 9, shift=torch.stack([copy**2 * rise / 8, zero, zero], -1))

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


def test_loops_are_loops_and_numbers_have_names():
    text = scad_text(parse(CHAIR), Frame())
    assert "leg_1_size = [12, 2, 2]; // [0:0.5:32]" in text
    assert "for (j = [0 : 1 : translate_2_count - 1]) move(j, translate_2_by) {" in text
    assert "cuboid(leg_1_at, leg_1_size); // leg_1" in text
    assert "cuboid(back_1_at, back_1_size, back_1_tilt)" in text
    script = script_text(parse(CHAIR), Frame(), 'a "chair"')
    assert "for j in range(translate_2_count):" in script
    compile(script, "script", "exec")


def test_a_turning_loop_is_written_once_for_each_axis():
    body = ["line(start=(0, 0, 0), end=(3, 3, 3), radius=1)", "leg(at=(0, 4, 0), size=(1, 1, 1))"]
    body += ["layer(at=(0, 6, 0), thickness=1, half=(1, 1))"]
    made = plan(parse("\n    ".join(["for i in rotate(3, step=1):", *body])))
    assert [step.turn[1] for step in made.body].count("[0, 0, 0]") == 2
    assert len(made.body) == 3


FRAME = Frame.around([1, 2, 3], [30, 40, 45], grid_axes("+y", "-z"))


@pytest.mark.skipif(shutil.which("openscad") is None, reason="needs OpenSCAD")
def test_openscad_makes_the_same_solid(tmp_path: Path):
    program = parse(CHAIR)
    export(program, tmp_path / "chair.scad", FRAME)
    subprocess.run(["openscad", "-q", "-o", "chair.stl", "chair.scad"], cwd=tmp_path, check=True, capture_output=True)
    made, wanted = trimesh.load(tmp_path / "chair.stl"), trimesh.Trimesh(*solid(program, FRAME))
    np.testing.assert_allclose(made.volume, wanted.volume, rtol=1e-4)
    np.testing.assert_allclose(made.bounds, wanted.bounds, atol=1e-3)


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
