"""Statements without a hint: made to draw other boxes, kept where they write fewer numbers, fitted in the end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from declared import LANGUAGE, without_the_paper
from test_inference_assembly import apart

from shapeprog.inference.assembly import assemble
from shapeprog.inference.candidates.candidates import alike, as_unhinted, drawings, is_unhinted, plain, solid_boxes
from shapeprog.inference.candidates.stretching import OFF, stretched
from shapeprog.language.hints import Box
from shapeprog.language.program import Draw, Loop
from shapeprog.language.statement import language, using

CONE = Draw("cone_leg", (-12.0, 3.0, 4.0, 20.0, 1.0, 0.5))
BOX = Box(np.array([-1.0, 2.0, 5.0]), np.eye(3), np.array([11.0, 1.5, 1.5]))
SQUARE = [Draw(name, values) for name, values in (
    ("box", (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
    ("cushion", (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.5)),
    ("bar", (0.0, 0.0, 0.0, 5.0, 1.0, 2.0, 1.0, 2.0, 10.0)),
    ("taper", (0.0, 0.0, 0.0, 5.0, 1.0, 2.0, 1.0, 0.5)),
    ("rod", (0.0, 0.0, 0.0, 5.0, 1.0, 2.0, 1.0)),
    ("cylinder", (0.0, 1.0, 2.0, 5.0, 1.0)),
)]  # fmt: skip


@pytest.fixture
def without_hint():
    """All statements of the package, and the cone leg of the examples without its hint."""
    with using(without_the_paper()) as own:
        own.register(replace(LANGUAGE["cone_leg"], hint=None))
        yield


@pytest.mark.parametrize("drawn", SQUARE, ids=[drawn.name for drawn in SQUARE])
def test_any_statement_follows_the_box_that_it_is_to_draw(drawn):
    ((box,),) = solid_boxes([drawn])
    wanted = Box(box.centre + np.array([0.5, -0.25, 1.0]), box.rotation, 1.2 * box.half)  # as round as it was
    other = stretched(drawn, wanted)
    assert other is not None
    ((found,),) = solid_boxes([other])
    np.testing.assert_allclose(found.centre, wanted.centre, atol=OFF)
    np.testing.assert_allclose(found.half, wanted.half, atol=OFF)
    np.testing.assert_allclose(found.rotation, wanted.rotation, atol=0.05)


def test_what_moves_no_face_stays(without_hint):
    longer = stretched(CONE, Box(np.array([-1.0, 3.0, 4.0]), np.eye(3), np.array([11.0, 1.0, 1.0])))
    assert longer is not None
    assert longer.values == pytest.approx((-12, 3, 4, 22, 1, 0.5), abs=1e-4)


def test_what_a_statement_cannot_draw_is_no_statement(without_hint):
    flat = BOX._replace(half=np.array([11.0, 1.5, 0.5]))  # a cone is as deep as it is wide
    assert stretched(CONE, flat) is None
    assert alike(CONE, flat) == drawings(flat)
    assert [draw.name for draw in alike(CONE, BOX)] == ["cone_leg"]


def test_a_statement_of_fewer_numbers_is_not_written_with_more(without_hint):
    assert [declared.name for declared in language() if is_unhinted(declared)] == ["cone_leg"]
    assert plain(CONE) == CONE
    looped = Loop("mirror", (2.0, 2.0, 0.0), (CONE,))
    assert plain(looped) == looped


def test_what_was_chosen_is_drawn_by_a_statement_without_a_hint_too(without_hint):
    taper = Draw("taper", (-12.0, 3.0, 4.0, 8.0, 3.0, 4.0, 1.0, 0.5))
    around = Loop("mirror", (2.0, 2.0, 0.0), (taper,))
    ((place, again),) = as_unhinted([CONE, around])
    assert place == 1
    assert isinstance(again, Loop)
    assert again.body[0].name == "cone_leg"
    assert again.body[0].values == pytest.approx((-12, 3, 4, 20, 1, 0.5), abs=0.1)


def test_every_leg_of_a_planted_table_is_a_cone_leg(without_hint):
    top = "box(at=(10, -8, -10), size=(2, 16, 20))\n"
    legs = "for i in mirror(side):\n    for j in mirror(depth):\n        "
    found = assemble(apart(f"{top}{legs}cone_leg(at=(-12, 6, 8), height=22, bottom=.6, top=1.2)\n")).program
    (legs_found,) = (chain for chain in found.chains if chain[-1].name == "cone_leg")
    assert [loop.name for loop in legs_found[:-1]] == ["mirror", "mirror"]
    assert found.blocks == 2
    assert legs_found[-1].values[3:] == pytest.approx((22, 0.6, 1.2), abs=0.1)
