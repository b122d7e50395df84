"""Roles: what a person would call the parts of furniture made by hand, however it is written."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import shapeprog as sp
from shapeprog.geometry.primitives import primitives
from shapeprog.inference.roles import roles
from shapeprog.inference.roles.roles import in_order, note_on_front, separated, with_roles
from shapeprog.language.hints import Box, straight_bar, upright_box
from shapeprog.language.program import Draw, Program
from shapeprog.language.statement import language
from shapeprog.space import Frame, grid_axes

CHAIR = """
for i in mirror(side):
    box(at=(-12, -6, 4), size=(10, 1.2, 1.2))  # leg
    bar(start=(-12, 6, 4.6), end=(12, 8, 4.6), section=(1.2, 1.2))  # leg
    bar(start=(-8, -5, 4.6), end=(-8, 6, 4.6), section=(0.8, 0.8))  # stretcher
    box(at=(2, -6, 5), size=(0.8, 12.5, 1.4))  # arm
    box(at=(-2, -5, 5), size=(4, 1, 1))  # arm_post
box(at=(-8.5, -1, -4.2), size=(1, 3, 8.4))  # stretcher
box(at=(-2, -6.5, -6), size=(1.5, 13, 12))  # seat
box(at=(8, 7, -4), size=(2, 0.8, 8))  # rail
box(at=(-3.5, -5.8, -4), size=(1.5, 0.6, 8))  # apron
for i in translate(5, by=(0, 0, 1.5)):
    box(at=(-0.5, 6.6, -3.2), size=(8.5, 0.5, 0.5))  # slat
"""

STOOL_BACK = """
cylinder(at=(-0.5, -1, 0), height=1.5, radius=6)  # seat
cylinder(at=(-10, -1, 0), height=9.5, radius=0.8)  # pedestal
for i in rotate(5, step=2):
    box(at=(-12, -1, -0.5), size=(1.5, 6, 1))  # base
for i in mirror(side):
    rod(start=(0, 4, 3), end=(8, 5, 3), radius=0.4)  # post
board(at=(6, 4.5, -5), size=(6, 0.8, 10), tilt=8)  # back
"""

UPHOLSTERED = """
box(at=(-12, -6, -6), size=(11.5, 11, 12))  # base
for i in mirror(side):
    box(at=(-12, -6, 6), size=(17, 11, 2.5))  # arm
bar(start=(-12, 4.5, 0), end=(12, 5, 0), section=(3, 12))  # back
"""

TABLE = """
box(at=(7, -8, -12), size=(1, 16, 24))  # top
for i in mirror(depth):
    for j in mirror(side):
        taper(start=(-9, 7, 11), end=(7, 7, 11), radius=(0.4, 0.9))  # leg
    box(at=(5.5, 6, -10.5), size=(1.5, 0.5, 21))  # apron
bar(start=(-5, 0, -11), end=(-5, 0, 11), section=(0.6, 0.6))  # stretcher
box(at=(-2, -7, -11), size=(0.5, 14, 22))  # shelf
bar(start=(-6, 7, -8), end=(5, 7, 2), section=(0.5, 0.5))  # brace
"""

BOOKCASE = """
for i in mirror(side):
    box(at=(-12, -4, 7), size=(24, 8, 0.6))  # side
box(at=(11.4, -4, -7), size=(0.6, 8, 14))  # top
box(at=(-12, -4, -7), size=(0.6, 8, 14))  # base
for i in translate(3, by=(6, 0, 0)):
    box(at=(-6, -3.8, -7), size=(0.5, 7.5, 14))  # shelf
box(at=(-12, 3.7, -7), size=(24, 0.3, 14))  # panel
"""

CABINET = """
for i in mirror(side):
    box(at=(-10, -5, 11), size=(20, 10, 0.8))  # side
    box(at=(-9, -5.3, 0.1), size=(12, 0.4, 11))  # door
    box(at=(-3, -5.9, 1), size=(2, 0.6, 0.3))  # handle
    for j in mirror(depth):
        box(at=(-12, 3, 9), size=(2, 1.5, 1.5))  # foot
box(at=(10, -5.5, -12), size=(0.8, 11, 24))  # top
box(at=(-10, -5, -11), size=(0.8, 10, 22))  # base
box(at=(-9, 4.8, -11), size=(19, 0.3, 22))  # panel
for i in translate(2, by=(0, 0, 11.2)):
    box(at=(4, -5.3, -11.1), size=(5, 0.4, 10.8))  # drawer
"""

WARDROBE = """
for i in mirror(side):
    box(at=(-12, -5, 7), size=(24, 10, 0.6))  # side
box(at=(-6, -4.6, -7), size=(0.5, 9, 14))  # shelf
box(at=(-12, 4.7, -7), size=(24, 0.3, 14))  # panel
box(at=(10, -5, -7), size=(2, 0.5, 14))  # rail
box(at=(-12, -5, -7), size=(5.5, 0.4, 14))  # drawer
"""

BED = """
box(at=(-3, -11, -8), size=(3, 21, 16))  # mattress
box(at=(-4.2, -11, -8), size=(1.2, 21, 16))  # base
box(at=(-6, 10.5, -9), size=(12, 1, 18))  # headboard
box(at=(-6, -12, -9), size=(6, 1, 18))  # footboard
for i in mirror(side):
    box(at=(-4.5, -11, 8.2), size=(3, 21.5, 0.6))  # side
    box(at=(0, 5.5, 0.8), size=(1.2, 4, 6))  # pillow
    for j in mirror(depth):
        box(at=(-7.5, 10, 7.5), size=(3, 1, 1))  # leg
"""

SOFA = """
box(at=(-5, -5, -10), size=(3, 10, 20))  # seat
for i in mirror(side):
    cushion(at=(-2, -5, 0.1), size=(2, 8, 9.8), edge=0.5)  # cushion
    box(at=(-5, -5, 10), size=(7, 11, 2))  # arm
    for j in mirror(depth):
        cylinder(at=(-6.5, 4, 11), height=1.5, radius=0.5)  # foot
box(at=(-5, 4, -10), size=(12, 2, 20))  # back
"""

SLATTED = """
for i in translate(5, by=(0, 2, 0)):
    box(at=(-1, -5, -12), size=(0.5, 1.4, 24))  # seat
for i in mirror(side):
    box(at=(-8, 3.6, 10), size=(15, 1, 1))  # leg
    box(at=(-8, -4.6, 10), size=(7, 1, 1))  # leg
    box(at=(-1.8, -3.6, 10.2), size=(0.8, 7.2, 0.6))  # apron
box(at=(-1.2, -5.3, -11), size=(0.8, 0.3, 22))  # apron
for i in translate(3, by=(2, 0.2, 0)):
    box(at=(1.5, 4.2, -11), size=(1.2, 0.4, 22))  # slat
"""

TALL = """
for i in mirror(side):
    box(at=(-12, -3, 6), size=(24, 6, 0.6))  # side
box(at=(11.4, -3, -6), size=(0.6, 6, 12))  # top
box(at=(-11, -3, -6), size=(0.6, 6, 12))  # base
for i in translate(2, by=(6, 0, 0)):
    box(at=(-3, -2.8, -6), size=(0.5, 5.5, 12))  # shelf
box(at=(-11, -3.4, -6.6), size=(22, 0.4, 13.2))  # door
box(at=(-11, 2.7, -6), size=(22, 0.3, 12))  # panel
for i in mirror(side):
    box(at=(-11, 2.4, 4.6), size=(22, 0.3, 1.4))  # post
"""

SIDEBOARD = """
box(at=(-6, -6, -12), size=(12, 12, 24))  # body
for i in mirror(side):
    for j in mirror(depth):
        box(at=(-9, 4.5, 10), size=(3, 1.1, 0.9))  # leg
"""

SPLAYED = """
box(at=(-4, -4, -12), size=(8, 8, 24))  # body
for i in mirror(side):
    for j in mirror(depth):
        bar(start=(-6.5, 3.5, 11.5), end=(-4, 3.5, 6.5), section=(0.6, 0.6))  # leg
box(at=(1, -4.6, -10), size=(0.2, 0.6, 20))  # rail
"""

DESK = """
box(at=(11, -12, -12), size=(1, 24, 24))  # top
for i in mirror(side):
    for j in mirror(depth):
        box(at=(-12, 9.7, 10), size=(23, 1.3, 1.3))  # leg
    box(at=(-8, -9, 10.3), size=(18, 18, 0.7))  # side
box(at=(-12, 10, -10), size=(23, 0.7, 20))  # panel
"""

PLATE = """
box(at=(-12, -8, -8), size=(1, 16, 16))  # base
box(at=(-11, -1, -1), size=(9, 2, 2))  # pedestal
cushion(at=(-2, -5, -5), size=(2.5, 9, 10), edge=0.3)  # seat
board(at=(0, 4, -5), size=(12, 1, 10), tilt=1)  # back
"""

CHEST = """
for i in mirror(side):
    box(at=(-12, -5, 7), size=(24, 10, 0.6))  # side
box(at=(11.4, -5, -7), size=(0.6, 10, 14))  # top
box(at=(-12, -4.6, -7), size=(1.6, 0.4, 14))  # base
for i in translate(7, by=(3.1, 0, 0)):
    box(at=(-10.2, -5, -7), size=(2.8, 0.4, 14))  # drawer
    box(at=(-9, -5.5, -2), size=(0.3, 0.5, 4))  # handle
box(at=(-10.4, 4.7, -7), size=(21.8, 0.3, 14))  # panel
"""

DOORS = """
box(at=(-12, -4, -6), size=(2, 9, 12))  # base
box(at=(-10, -4.4, -6), size=(22, 9.4, 12))  # body
for i in translate(4, by=(0, 0, 3)):
    box(at=(-10, -5, -5.9), size=(22, 0.6, 2.8))  # door
"""

BETWEEN_ARMS = """
box(at=(-6, -6, -9), size=(2.5, 11, 18))  # base
cushion(at=(-3.5, -6, -9), size=(2.5, 10, 18), edge=0.5)  # seat
for i in mirror(side):
    box(at=(-6, -6, 9), size=(12, 12, 3))  # arm
box(at=(-6, 4, -9), size=(12, 2, 18))  # back
"""

CORNER = """
box(at=(-6, -2, -12), size=(4, 14, 9))  # seat
for i in translate(2, by=(0, 0, 7)):
    box(at=(-6, 2, -3), size=(4, 8, 7))  # seat
box(at=(-6, 10, -12), size=(12, 2, 24))  # back
"""

SLATTED_BED = """
for i in translate(10, by=(0, 2.2, 0)):
    box(at=(-4, -11, -8), size=(0.5, 1, 16))  # slat
for i in mirror(side):
    box(at=(-5, -11, 8), size=(2, 22, 0.6))  # side
box(at=(-6, 11, -9), size=(10, 0.8, 18))  # headboard
box(at=(-6, -11.8, -9), size=(4, 0.8, 18))  # footboard
"""

TWO_MATTRESSES = """
for i in mirror(side):
    box(at=(-3, -11, 0.1), size=(2, 22, 10.9))  # mattress
    for j in mirror(depth):
        box(at=(-5, 9, 9), size=(2, 1, 1))  # foot
box(at=(-5, 11, -11), size=(10, 1, 22))  # headboard
"""

COAT_RACK = """
cylinder(at=(-12, 0, 0), height=0.4, radius=2.6)  # base
cylinder(at=(-11.6, 0, 0), height=23.6, radius=0.3)  # pedestal
for i in rotate(6, step=1):
    rod(start=(10, 0, 0.2), end=(11.1, 0, 2.1), radius=0.13)  # brace
"""

WHOLE = [
    CHAIR, STOOL_BACK, UPHOLSTERED, TABLE, BOOKCASE, CABINET, WARDROBE, BED, SOFA, SLATTED, TALL, SIDEBOARD, DESK,
    PLATE, CHEST, DOORS, SPLAYED, BETWEEN_ARMS, CORNER, SLATTED_BED,
    TWO_MATTRESSES, COAT_RACK
]  # fmt: skip
NAMES = ["chair", "swivel chair", "upholstered chair", "table", "bookcase", "cabinet", "wardrobe", "bed", "sofa"]
NAMES += ["slatted bench", "tall cabinet", "sideboard", "desk", "chair on a plate", "chest of drawers", "doors"]
NAMES += ["sideboard on splayed legs", "sofa between high arms", "corner sofa", "slatted bed"]
NAMES += ["two mattresses", "coat rack"]


def wanted(text: str) -> list[str]:
    return [line.split("#")[1].strip() for line in text.splitlines() if "#" in line]


def words(program: Program) -> list[str]:
    return [node.word for node in program.walk() if isinstance(node, Draw)]


def copies(program: Program, scale: float = 1, shift: float = 0, turns: int = 0) -> tuple[Program, list[int]]:
    """A box or bar about each copy that a program draws, turned by quarters about up, and the blocks they come from."""
    turn = np.linalg.matrix_power(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), turns)
    scene = sp.unroll(program)
    half = torch.stack([primitives[int(k)].bound(size) for k, size in zip(scene.kind, scene.size, strict=True)])
    drawn = []
    for centre, rotation, each in zip(scene.centre, scene.rotation, half, strict=True):
        middle, axes = turn @ centre.double().numpy(), turn @ rotation.double().numpy()
        box = Box(scale * middle + shift, axes, scale * each.double().numpy())
        values = next(upright_box(box), None)
        name = "bar" if values is None else "box"
        values = next(straight_bar(box)) if values is None else values
        drawn.append(Draw(name, tuple(float(np.float32(value)) for value in values)))
    return Program(tuple(drawn)), scene.block.tolist()


@pytest.mark.parametrize("text", WHOLE, ids=NAMES)
def test_parts_get_the_roles_a_person_would_give(text: str) -> None:
    assert words(with_roles(sp.parse(text))) == wanted(text)


@pytest.mark.parametrize("text", WHOLE, ids=NAMES)
@pytest.mark.parametrize(("scale", "shift"), [(1, 0), (0.6, 1.5)])
def test_copies_written_one_by_one_as_boxes_of_any_size_and_place_get_the_same_roles(
    text: str, scale: float, shift: float
) -> None:
    alone, block = copies(sp.parse(text), scale, shift)
    assert words(with_roles(alone)) == [wanted(text)[each] for each in block]


@pytest.mark.parametrize("text", [CHAIR, STOOL_BACK, SLATTED, PLATE], ids=["chair", "swivel", "bench", "plate"])
@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_chair_has_the_same_parts_whichever_way_it_faces(text: str, turns: int) -> None:
    alone, block = copies(sp.parse(text), turns=turns)
    assert words(with_roles(alone)) == [wanted(text)[each] for each in block]


@pytest.mark.parametrize(
    ("side", "note"),
    [
        ("rear", ""),
        ("left", "on the left: if so, add --front +x"),
        ("front", "in front: if so, add --front -z"),
        ("right", "on the right: if so, add --front -x"),
        ("bottom", ""),
    ],
)
def test_a_back_that_is_not_behind_is_noted(side: str, note: str) -> None:
    size = "height" if side == "bottom" else "width" if side in ("left", "right") else "depth"
    back = "" if side == "bottom" else "bottom=45, "
    text = "width, depth, height = 50, 50, 90\nseat(bottom=40, height=5)\nfor _ in mirror(x=0, y=0):\n    "
    text += f"leg(left=0, width=4, front=0, depth=4, height=40)\nblock({back}{side}=0, {size}=4)\n"
    frame = Frame.of(1.0, (0, 0, 0), grid_axes("+y", "+z"))
    assert note in (sentence := note_on_front(sp.parse(text), frame))
    assert bool(note) == bool(sentence)


def test_a_low_board_at_the_foot_of_a_bed_is_its_footboard_too() -> None:
    low = BED.replace("size=(6, 1, 18))  # footboard", "size=(4, 1, 18))  # footboard")
    assert low != BED
    assert words(with_roles(sp.parse(low))) == wanted(low)


def test_a_bench_with_two_arms_and_no_back_is_not_turned() -> None:
    text = """
box(at=(-1, -5, -12), size=(1, 10, 24))  # seat
for i in mirror(side):
    box(at=(4, -4.8, 11), size=(1, 9.6, 1))  # arm
    for j in mirror(depth):
        box(at=(-8, 3.8, 11), size=(12, 1, 1))  # leg
"""
    assert words(with_roles(sp.parse(text))) == wanted(text)


def test_copies_in_places_of_several_names_have_the_one_that_says_both() -> None:
    text = """
for i in translate(2, by=(19.4, 0, 0)):
    box(at=(-10, -5, -11.4), size=(0.6, 10, 22.8))  # shelf
for i in mirror(side):
    box(at=(-10, -5, 11.4), size=(20, 10, 0.6))  # side
for i in mirror(depth):
    box(at=(-10, 5, -12), size=(20, 0.4, 24))  # panel
"""
    assert words(with_roles(sp.parse(text))) == wanted(text)


CASE = """
for i in mirror(side):
    box(at=(-12, -6, 9), size=(24, 12, 1))
for i in translate(2, by=(23, 0, 0)):
    box(at=(-12, -6, -9), size=(1, 12, 18))
for i in translate(2, by=(6, 0, 0)):
    box(at=(-6, -6, -9), size=(1, 12, 18))
"""


def test_a_row_of_two_parts_of_different_roles_is_separated_and_one_of_equal_shelves_is_not() -> None:
    program = Program(sp.parse(CASE).body)
    result = separated(program, 10)
    assert [draw.word for draw in with_roles(result).draws] == ["side", "base", "top", "shelf"]
    assert sp.unroll(result).centre.tolist() == sp.unroll(program).centre.tolist()
    assert separated(program, 3) == program, "no more blocks than allowed"


def test_a_door_and_a_back_that_mirror_each_other_are_separated_and_aprons_are_not() -> None:
    sides = "for i in mirror(side):\n    box(at=(-12, -6, 9), size=(24, 12, 1))\n"
    front = "for i in mirror(depth):\n    box(at=(-11, 5, -9), size=(23, 1, 18))\n"
    doors = "for i in mirror(depth):\n    for j in mirror(side):\n        box(at=(-11, 5, 0.2), size=(23, 1, 8.6))\n"
    for text in (front, doors):
        program = Program(sp.parse(sides + "box(at=(-12, -6, -9), size=(1, 12, 18))\n" + text).body)
        result = separated(program, 10)
        assert [draw.word for draw in with_roles(result).draws if draw.word != "base"] == ["side", "panel", "door"]
        before, after = (sorted(sp.unroll(each).centre.tolist()) for each in (program, result))
        assert after == before
    aprons = "for i in mirror(depth):\n    box(at=(6, 6, -10), size=(2, 1, 20))\n"
    program = Program(sp.parse("box(at=(8, -8, -12), size=(1, 16, 24))\n" + aprons).body)
    assert separated(program, 10) == program


def test_a_ring_between_legs_is_no_shelf() -> None:
    text = """
cylinder(at=(8, 0, 0), height=1, radius=6)  # top
for i in mirror(side):
    for j in mirror(depth):
        rod(start=(-12, 5, 5), end=(8, 3, 3), radius=0.5)  # leg
for i in rotate(4, step=1):
    bent_rod(start=(-5, -3.5, 3.5), through=(-5, 0, 5), end=(-5, 3.5, 3.5), radius=0.3)  # stretcher
"""
    assert words(with_roles(sp.parse(text))) == wanted(text)


def test_fronts_of_a_pedestal_are_drawers_and_have_handles() -> None:
    desk = """
box(at=(11, -6, -12), size=(1, 12, 24))  # top
for i in mirror(depth):
    box(at=(-12, 4, 10), size=(23, 1, 1))  # leg
box(at=(-12, -5, -11), size=(23, 10, 7))  # block
for i in translate(3, by=(7, 0, 0)):
    box(at=(-11, -5.4, -10.9), size=(6.5, 0.4, 6.8))  # drawer
for i in translate(3, by=(7, 0, 0)):
    box(at=(-8, -5.8, -8.5), size=(0.3, 0.4, 2))  # handle
"""
    assert words(with_roles(sp.parse(desk))) == wanted(desk)


def test_a_single_solid_is_a_body() -> None:
    assert words(with_roles(sp.parse("box(at=(-12, -3, -2), size=(24, 6, 4))"))) == ["body"]


def test_a_program_that_draws_nothing_stays_as_it_is() -> None:
    for text in (
        "",
        "box(at=(0, 0, 0), size=(-1, 2, 2))",
        "for i in translate(0, by=(0, 0, 1)):\n    rod(start=(0, 0, 0), end=(1, 0, 0), radius=1)",
    ):
        assert with_roles(sp.parse(text)) == sp.parse(text)


def test_solids_without_any_extent_are_named_without_a_warning() -> None:
    with_roles(sp.parse("box(at=(1, 1, 1), size=(0, 0, 0))\ncylinder(at=(1, 1, 1), height=0, radius=0)"))


def test_what_has_a_role_keeps_it() -> None:
    given = sp.parse("arm(box(at=(7, -8, -12), size=(1, 16, 24)))\nlocker(at=(0, -8, -12), size=(1, 16, 24))\n" + TABLE)
    named = with_roles(given)
    assert words(named)[:2] == ["arm", "locker"]
    assert with_roles(named) == named


def test_a_box_that_is_a_leg_is_written_as_the_statement() -> None:
    text = "for i in mirror(side):\n    box(at=(-12, -6, 4), size=(10, 1, 1))\nbox(at=(-2, -8, -8), size=(1, 16, 16))"
    assert (
        sp.format_program(with_roles(sp.parse(text))).splitlines()[1].strip() == "leg(at=(-12, -6, 4), size=(10, 1, 1))"
    )


def test_every_role_that_rules_give_is_declared() -> None:
    given = {role for role, _ in (*roles.SEATING, *roles.BED, *roles.CASE)} | {role for _, role in roles.MIXED}
    assert given <= set(language().roles)


def test_blocks_are_listed_from_the_main_surface_and_the_floor_up():
    program = with_roles(sp.parse(TABLE))
    ordered = in_order(Program(tuple(reversed(program.body))))
    assert sorted(map(repr, ordered.body)) == sorted(map(repr, program.body))
    assert [chain[-1].role or chain[-1].name for chain in ordered.chains] == [
        "top", "leg", "brace", "stretcher", "shelf", "apron"
    ]  # fmt: skip
    assert in_order(ordered) == ordered
