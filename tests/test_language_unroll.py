"""Laws of unrolling for every declared statement: loops are their copies, gradients arrive, batches agree."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
import torch
from declared import LANGUAGE, STATEMENTS, middle, name_of

import shapeprog as sp
from shapeprog.data.random import random_program
from shapeprog.errors import ShapeProgError
from shapeprog.geometry.scene import Scene
from shapeprog.language import Code, Draw, Loop, Program, Statement, encode, unroll, using
from shapeprog.language.parser import parse


@pytest.fixture(autouse=True)
def everything_declared() -> Iterator[None]:
    with using(LANGUAGE):
        yield


def scene_of(*body: Draw | Loop) -> Scene:
    return unroll(encode(Program(body), dtype=torch.float64))


def draw(declared: Statement) -> Draw:
    return Draw(declared.name, middle(declared))


def turned(angle: float) -> torch.Tensor:
    cos, sin = math.cos(angle), math.sin(angle)
    return torch.tensor([[1, 0, 0], [0, cos, -sin], [0, sin, cos]], dtype=torch.float64)


def pivot_of(declared: Statement) -> torch.Tensor:
    values = torch.tensor([*middle(declared), *[0] * (7 - declared.size)], dtype=torch.float64)
    point = torch.zeros(3, dtype=torch.float64) if declared.pivot is None else declared.pivot(**declared.split(values))
    return torch.cat([torch.zeros(1, dtype=torch.float64), point[1:]])


def same(a: torch.Tensor, b: torch.Tensor) -> None:
    torch.testing.assert_close(a, b, rtol=0, atol=1e-6)


@pytest.mark.parametrize("declared", STATEMENTS, ids=name_of)
def test_a_translation_is_its_copies(declared: Statement) -> None:
    one = scene_of(draw(declared))
    by = torch.tensor([1.25, -2.5, 0.75], dtype=torch.float64)
    many = scene_of(Loop("translate", (3, *by.tolist()), (draw(declared),)))
    parts = int(one.mask.sum())
    assert parts >= 1
    for index in range(3):
        here = slice(index * parts, (index + 1) * parts)
        same(many.centre[here], one.centre + index * by)
        same(many.size[here], one.size)
        same(many.rotation[here], one.rotation)
    assert many.mask.all()
    assert many.copy.tolist() == [index for index in range(3) for _ in range(parts)]
    assert set(many.statement.tolist()) == {declared.id}
    assert set(many.block.tolist()) == {0}


@pytest.mark.parametrize("declared", STATEMENTS, ids=name_of)
@pytest.mark.parametrize("count", [1, 4, 5])
def test_a_rotation_is_its_copies(declared: Statement, count: int) -> None:
    one = scene_of(draw(declared))
    many = scene_of(Loop("rotate", (count, 1), (draw(declared),)))
    parts, pivot = int(one.mask.sum()), pivot_of(declared)
    assert len(many.mask) == count * parts
    for index in range(count):
        here = slice(index * parts, (index + 1) * parts)
        matrix = turned(2 * math.pi * index / (4 if declared.quarter else count))
        same(many.centre[here], (one.centre - pivot) @ matrix.T + pivot)
        same(many.rotation[here], matrix @ one.rotation)
        same(many.size[here], one.size)


def test_a_translated_line_moves_both_ends() -> None:
    looped = parse("for i in translate(2, by=(1, 2, 3)):\n    line(start=(0, 1, 2), end=(5, 4, 4), radius=1)")
    plain = parse("line(start=(0, 1, 2), end=(5, 4, 4), radius=1)\nline(start=(1, 3, 5), end=(6, 6, 7), radius=1)")
    a, b = unroll(looped), unroll(plain)
    for name in ("size", "centre", "rotation"):
        same(getattr(a, name), getattr(b, name))


def test_a_turned_cross_advances_by_quarters() -> None:
    looped = parse("for i in rotate(4, step=1):\n    base_cross(at=(1, 2, 3), thickness=1, length=5, turn=0)")
    plain = parse("".join(f"base_cross(at=(1, 2, 3), thickness=1, length=5, turn={q})\n" for q in range(4)))
    a, b = unroll(looped), unroll(plain)
    same(a.centre, b.centre)
    # a quarter turn of the pose is the same box as an exchange of the two half extents
    corners = [(each.rotation.abs() @ each.size[..., :3, None])[..., 0] for each in (a, b)]
    same(corners[0], corners[1])


@pytest.mark.parametrize("declared", STATEMENTS, ids=name_of)
@pytest.mark.parametrize("loop", [None, "translate", "rotate"])
def test_gradients_reach_every_continuous_parameter(declared: Statement, loop: str | None) -> None:
    chain = {"translate": [Loop("translate", (3, 1.25, -2.5, 0.75), ())], "rotate": [Loop("rotate", (5, 1), ())]}
    steps = [*chain.get(loop or "", []), draw(declared)]
    body: Draw | Loop = steps[-1]
    for outer in reversed(steps[:-1]):
        assert isinstance(outer, Loop)
        body = Loop(outer.name, outer.values, (body,))
    code = encode(Program((body,)), dtype=torch.float64)
    parameters = code.parameters.clone().requires_grad_()
    scene = unroll(Code(code.ids, parameters))
    generator = torch.Generator().manual_seed(3)
    total = torch.zeros((), dtype=torch.float64)
    for tensor in (scene.size, scene.centre, scene.rotation):
        total = total + (tensor * torch.rand(tensor.shape, generator=generator, dtype=torch.float64)).sum()
    (gradient,) = torch.autograd.grad(total, parameters)
    assert torch.isfinite(gradient).all()
    for step, node in enumerate(steps):
        for slot, quantity in enumerate(LANGUAGE[node.name].quantities):
            reached = abs(float(gradient[0, step, slot])) > 1e-9
            assert reached != quantity.discrete, (node.name, slot)


@pytest.mark.parametrize("name", ["leg", "back", "line", "base_cross", "pouf", "arch"])
def test_gradients_agree_with_differences(name: str) -> None:
    program = Program((Loop("rotate", (3, 1), (Loop("translate", (2, 0.5, 1.5, -1), (draw(LANGUAGE[name]),)),)),))
    code = encode(program, dtype=torch.float64)
    discrete = torch.tensor(
        [[float(q.discrete) for q in [*LANGUAGE[n].quantities, *LANGUAGE["line"].quantities][:7]]
         for n in ("rotate", "translate", name)]
    ).bool()  # fmt: skip

    def flat(parameters: torch.Tensor) -> torch.Tensor:
        scene = unroll(Code(code.ids, torch.where(discrete, code.parameters, parameters)))
        return torch.cat([scene.size.flatten(), scene.centre.flatten(), scene.rotation.flatten()])

    assert torch.autograd.gradcheck(flat, code.parameters.clone().requires_grad_(), atol=1e-6)


@pytest.mark.parametrize("step", [30, 45, 60, 72, 90])
def test_the_gradient_of_a_step_is_right_at_quarter_turns_too(step: float) -> None:
    foot = "foot(left=1, width=3, front=2, depth=4, height=s / 20)"
    chair = sp.Parametric(
        parse(f"width, depth, height = 12, 12, 12\ns = {step}\nfor _ in rotate(4, step=s):\n    {foot}")
    )
    points = torch.rand(500, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) * 12 - 6

    def value(values: torch.Tensor) -> torch.Tensor:
        return sp.coverage(unroll(chair.at(values)), points)

    values = chair.values.clone().requires_grad_()
    (slope,) = torch.autograd.grad(value(values), values)
    moved = 1e-3 * torch.tensor([float(name == "s") for name in chair.names])  # nearer to a quarter, turns are rounded
    difference = (value(chair.values + moved) - value(chair.values - moved)) / 2e-3
    assert float(slope[chair.names.index("s")]) == pytest.approx(float(difference), rel=1e-2)


def test_batches_of_any_shape_agree_with_single_programs() -> None:
    generator = torch.Generator().manual_seed(11)
    programs = [random_program(generator, blocks=count) for count in (3, 0, 5, 1, 4, 2)]
    code = encode(programs)
    scene = unroll(
        Code(code.ids.reshape(2, 3, *code.ids.shape[1:]), code.parameters.reshape(2, 3, *code.parameters.shape[1:]))
    )
    assert scene.batch_shape == (2, 3)
    for program, found in zip(programs, scene.flatten(), strict=True):
        alone = unroll(program)
        count = int(alone.mask.sum())
        assert int(found.mask.sum()) == count
        for name in ("kind", "size", "centre", "rotation", "statement", "block", "copy"):
            torch.testing.assert_close(getattr(found, name)[found.mask], getattr(alone, name)[alone.mask])


def test_loops_around_several_statements_are_loops_around_each() -> None:
    generator = torch.Generator().manual_seed(4)
    inner = random_program(generator, blocks=4).body
    nested = Program((Loop("translate", (2, 1, 2, 3), inner),))
    assert nested.size == nested.flat().size
    a, b = unroll(nested), unroll(nested.flat())
    same(a.centre, b.centre)


def test_loops_nest_deeply() -> None:
    node: Draw | Loop = Draw("leg", (-12, -8, -10, 1, 1, 1))
    for level in range(7):
        node = Loop("translate", (2, *[float(axis == level % 3) * 2**level for axis in range(3)]), (node,))
    scene = unroll(Program((node,)))
    assert scene.mask.shape == (128,)
    assert len({tuple(centre) for centre in scene.centre.tolist()}) == 128
    assert scene.copy.tolist() == list(range(128))
    many: Draw | Loop = Draw("leg", (0, 0, 0, 1, 1, 1))
    for _ in range(30):
        many = Loop("translate", (1, 1, 0, 0), (many,))
    assert unroll(Program((many,))).mask.shape == (1,)


@pytest.mark.parametrize("count", [0, -1, -7])
@pytest.mark.parametrize("loop", ["translate", "rotate"])
def test_loops_without_copies_erase(loop: str, count: int) -> None:
    leg = Draw("leg", (0.0,) * 3 + (1.0,) * 3)
    rest = (0.0,) * (LANGUAGE[loop].size - 1)
    inner = Loop("translate", (2, 0, 0, 1), (leg,))
    scene = unroll(Program((Loop(loop, (count, *rest), (leg, inner)), leg)))
    assert int(scene.mask.sum()) == 1
    assert Program((Loop(loop, (count, *rest), (leg,)),)).size == 0


def test_negative_lengths_draw_nothing() -> None:
    scene = unroll(parse("leg(at=(0, 0, 0), size=(-1, 1, 1))\nleg(at=(0, 0, 0), size=(0, 1, 1))"))
    assert scene.mask.tolist() == [False, True]


def test_counts_that_multiply_to_too_much_are_refused() -> None:
    node: Draw | Loop = Draw("leg", (0.0,) * 6)
    for _ in range(6):
        node = Loop("translate", (60, 0, 0, 1), (node,))
    with pytest.raises(ShapeProgError, match="copies"):
        unroll(Program((node,)))


@pytest.mark.parametrize("ids", [[19, 0, 0], [19, 19, 19], [0, 1, 0], [1, 19, 1], [99, 0, 0], [-1, 1, 0], [1, 1, 0]])
def test_blocks_that_are_no_blocks_draw_nothing(ids: list[int]) -> None:
    code = Code(torch.tensor([ids, [1, 0, 0]]), torch.ones(2, 3, 7))
    assert unroll(code).block.tolist() == [1]
