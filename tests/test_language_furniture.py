"""Statements of our own: solids in any direction, mirrors, and roles around solids."""

from __future__ import annotations

import math

import pytest
import torch

import shapeprog as sp
from shapeprog.errors import DeclarationError, ProgramError, ShapeProgError
from shapeprog.formats.json_form import program_to_json
from shapeprog.language import Draw, Language, Loop, Program, decode, encode, language, using
from shapeprog.language.hints import Box
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program

SIGNS = torch.cartesian_prod(*[torch.tensor([-1.0, 1.0])] * 3)


def corners(text: str) -> torch.Tensor:
    """The corners (8, 3) of the one cuboid that a program draws."""
    scene = sp.unroll(parse(text))
    return scene.centre[0] + (SIGNS * scene.size[0, :3]) @ scene.rotation[0].T


@pytest.mark.parametrize("axis", ["up", "depth", "side"])
@pytest.mark.parametrize(
    "solid",
    [
        "taper(start=(-5, 1, 2), end=(3, 2, 5), radius=(0.5, 1.5))",
        "bar(start=(-5, 1, 2), end=(3, 2, 5), section=(1, 2), turn=20)",
        "board(at=(1, 2, 3), size=(6, 1, 4), tilt=15)",
        "bent_rod(start=(0, 1, 2), through=(3, 2, 4), end=(1, 5, 6), radius=0.5)",
        "back(at=(1, 2, 3), size=(6, 1, 4), tilt=2)",
        "cushion(at=(1, 2, 3), size=(6, 3, 4), edge=1)",
    ],
)
def test_a_mirror_image_has_the_distances_of_the_mirrored_point(axis, solid):
    points = 12 * torch.rand(200, 3, generator=torch.Generator().manual_seed(0)) - 6
    both = sp.unroll(parse(f"for i in mirror({axis}, at=0.5):\n    {solid}\n"))
    one = sp.unroll(parse(solid))
    place = ["up", "depth", "side"].index(axis)
    there = points.clone()
    there[:, place] = 1 - there[:, place]
    expected = torch.minimum(one.distance(points), one.distance(there))
    torch.testing.assert_close(both.distance(points), expected, rtol=0, atol=2e-5)
    torch.testing.assert_close(torch.linalg.det(both.rotation), torch.ones(2))


def test_mirrors_and_turns_are_done_from_the_inside_out():
    text = "for i in {}:\n    for j in {}:\n        rod(start=(0, 3, 1), end=(4, 4, 2), radius=0.5)\n"
    turned = sp.unroll(parse(text.format("rotate(3, step=1)", "mirror(side)"))).centre
    angle = [2 * math.pi * copy / 3 for copy in range(3)]
    for copy, (cos, sin) in enumerate((math.cos(a), math.sin(a)) for a in angle):
        for side in (1.5, -1.5):
            expected = torch.tensor([2.0, 3.5 * cos - side * sin, 3.5 * sin + side * cos])
            assert (turned - expected).norm(dim=1).min() < 1e-5, copy
    mirrored = sp.unroll(parse(text.format("mirror(side, at=2)", "rotate(3, step=1)"))).centre
    single = sp.unroll(
        parse("for i in rotate(3, step=1):\n    rod(start=(0, 3, 1), end=(4, 4, 2), radius=0.5)\n")
    ).centre
    assert torch.cdist(single * torch.tensor([1, 1, -1.0]) + torch.tensor([0, 0, 4.0]), mirrored).amin(1).max() < 1e-5


def test_bars_have_their_sides_along_the_axes_they_run_along_least():
    leg = corners("bar(start=(-12, 0, 0), end=(4, 0, 0), section=(2, 3))")
    assert leg.amax(0).tolist() == [4, 1, 1.5]
    rail = corners("bar(start=(0, 0, -5), end=(0, 0, 5), section=(2, 3))")
    assert rail.amax(0).tolist() == [1, 1.5, 5]
    turned = corners("bar(start=(0, 0, -5), end=(0, 0, 5), section=(2, 2), turn=45)")
    assert turned[:, 0].max().item() == pytest.approx(math.sqrt(2), abs=1e-5)


def test_a_board_leans_about_its_bottom_front_edge():
    board = corners("board(at=(1, 2, 3), size=(6, 1, 4), tilt=30)")
    edge = board[(board - torch.tensor([1.0, 2.0, 3.0])).norm(dim=1).argmin()]
    torch.testing.assert_close(edge, torch.tensor([1.0, 2.0, 3.0]), rtol=0, atol=1e-5)
    top = torch.tensor([1 + 6 * math.cos(math.pi / 6), 2 + 6 * math.sin(math.pi / 6), 3.0])
    assert (board - top).norm(dim=1).min() < 1e-5


@pytest.mark.parametrize("far", [0.0, 1e-6, 0.01, 1.0, 4.0, 9.0])
def test_a_bent_rod_goes_through_its_three_points(far):
    scene = sp.unroll(parse(f"bent_rod(start=(0, -4, 1), through=({far}, 1, 1), end=(0, 4, 1), radius=0.5)"))
    inside = scene.distance(torch.tensor([[0.0, -4, 1], [far, 1, 1], [0, 4, 1]]))
    assert inside.abs()[[0, 2]].max() < 1e-4  # the middle of its end faces
    assert inside[1].item() == pytest.approx(-0.5, abs=1e-4)


def test_roles_are_kept_by_text_tensors_and_copies():
    text = "for i in mirror(side):\n    leg(taper(start=(-12, 3, 3), end=(0, 2, 2), radius=(0.5, 1)))\n"
    program = parse(text)
    assert format_program(program) == text
    assert decode(encode([program, Program()]))[0] == program
    assert encode(parse("leg(at=(0, 0, 0), size=(1, 1, 1))")).roles is None
    assert encode(program).parameters.shape[-1] == 8
    assert program.snap().body[0].body[0].role == "leg"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seat(at=(1, 2, 3))", "seat is a role: it takes one solid"),
        ("leg(leg(at=(0, 0, 0), size=(1, 1, 1)))", "redundant role: leg"),
        ("seet(box(at=(0, 0, 0), size=(1, 1, 1)))", "did you mean seat?"),
        ("seat(top(box(at=(0, 0, 0), size=(1, 1, 1))))", "unknown statement 'top'"),
        ("seat(box(at=(0, 0, 0), size=(1, 1, 1)), 3)", "takes one solid"),
        ("for i in mirror(sid):\n    pass", "did you mean side?"),
        ("for i in mirror(2):\n    pass", "which is not an axis"),
        ("for i in mirror(side, count=3):\n    pass", "mirror always has 2"),
    ],
)
def test_mistakes_with_roles_and_mirrors_are_told(text, said):
    with pytest.raises(ProgramError) as caught:
        parse(text)
    assert said in str(caught.value)


@pytest.mark.parametrize("word", ["leg", "cushion"])
def test_no_form_calls_a_part_what_it_is(word):
    leg = Program((Draw(word, (1.0,) * language()[word].size, word),))
    for write in (format_program, program_to_json):
        with pytest.raises(ShapeProgError, match="redundant role"):
            write(leg)


def test_a_role_is_refused_that_is_there_or_no_word():
    other = Language()
    with using(other):
        other.add_role("plinth", "What it stands on", "leg")
        for name, said in (("plinth", "declared twice"), ("a b", "not a Python identifier")):
            with pytest.raises(DeclarationError, match=said):
                other.add_role(name, "again")
        assert other.role(other.roles["plinth"].id) == other.roles["plinth"]


@pytest.mark.parametrize("declared", [each for each in language() if each.hint], ids=lambda each: each.name)
def test_hints_lie_in_their_box(declared):
    """A solid that starts from a box fills its length and does not leave it by more than a round section may."""
    turn = torch.linalg.qr(torch.randn(3, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(3)))[0]
    turn[:, 0] *= torch.linalg.det(turn)
    for rotation in (torch.eye(3, dtype=torch.float64), turn):
        for half in ([6.0, 1.0, 1.0], [6.0, 3.0, 0.5]):
            box = Box(
                torch.tensor([1.0, 2.0, -1.0]).double().numpy(), rotation.numpy(), torch.tensor(half).double().numpy()
            )
            assert declared.hint is not None
            for values in declared.hint(box):
                scene = sp.unroll(
                    encode(
                        Program((Draw(declared.name, tuple(map(float, values))),)),
                    )
                )
                local = (scene.sample(400).double() - torch.from_numpy(box.centre)) @ rotation
                assert (local.abs() <= torch.tensor(half) * 1.16 + 1e-3).all()
                assert local[:, 0].abs().max() > 0.8 * half[0]


def test_a_loop_with_one_legal_count_is_written_without_it():
    program = Program((Loop("mirror", (2.0, 1.0, 0.0), (Draw("box", (0.0, 0.0, 0.0, 1.0, 1.0, 1.0)),)),))
    assert format_program(program).startswith("for i in mirror(depth):")
