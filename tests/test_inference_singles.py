"""Single candidates: which statement draws a piece, also one of a user's own, with and without a hint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from declared import LANGUAGE, STATEMENTS, name_of, without_the_paper

from shapeprog.data.placement import shape_from_mesh
from shapeprog.data.shape import Shape
from shapeprog.formats.parts import parts
from shapeprog.inference.assembly import assemble
from shapeprog.inference.candidates.drawings import starts
from shapeprog.inference.candidates.singles import single_candidates
from shapeprog.inference.choice.coverage import Coverage
from shapeprog.inference.pieces.pieces import find_pieces
from shapeprog.inference.surface.evidence import evidence_of
from shapeprog.language import Statement, using
from shapeprog.language.hints import Box
from shapeprog.language.parser import parse


@pytest.mark.parametrize("declared", STATEMENTS, ids=name_of)
def test_starts_are_within_the_declared_ranges_and_as_many_as_are_asked_for(declared: Statement) -> None:
    box = Box(np.array([1.0, -2, 3]), np.eye(3), np.array([4.0, 2, 1]))
    found = np.array([drawn.values for drawn in starts(declared, box)])
    assert found.shape[1] == declared.size
    assert len(found) > 0
    for slot, quantity in enumerate(declared.quantities):
        assert (found[:, slot] >= quantity.low).all()
        assert (found[:, slot] <= quantity.high).all()
        if quantity.discrete:
            assert (found[:, slot] == found[:, slot].round()).all()


TABLE = """\
box(at=(6.25, -9, -12), size=(1.5, 18, 24))
for i in mirror(side):
    for j in mirror(depth):
        cone_leg(at=(-7.75, 6.5, 9.5), height=14, bottom=0.6, top=1.2)
"""


def shape_of(text: str) -> Shape:
    """A program as a mesh in which parts are apart."""
    drawn = parts(parse(text))
    counts = np.cumsum([0, *(len(part.vertices) for part in drawn)])
    vertices = np.concatenate([part.vertices for part in drawn])
    faces = np.concatenate([part.faces + first for part, first in zip(drawn, counts, strict=False)])
    return shape_from_mesh(vertices, faces, name="planted", axes=np.eye(3))


@pytest.mark.parametrize("hinted", [True, False], ids=["hinted", "without a hint"])
def test_a_statement_of_a_users_own_stands_for_the_legs_of_a_table(hinted: bool) -> None:
    with using(without_the_paper()) as own:
        example = LANGUAGE["cone_leg"]
        own.register(replace(example, hint=example.hint if hinted else None))
        legs = [
            node for node in single_candidates(find_pieces(evidence_of(shape_of(TABLE)))) if node.name == "cone_leg"
        ]
        right = [leg.values for leg in legs if np.allclose(leg.values[3:], (14, 0.6, 1.2), atol=0.3)]
        for depth, side in ((6.5, 9.5), (6.5, -9.5), (-6.5, 9.5), (-6.5, -9.5)):
            assert any(np.allclose(values[:3], (-7.75, depth, side), atol=0.2) for values in right)


def test_every_leg_of_a_planted_table_is_a_statement_of_a_users_own_without_a_hint() -> None:
    with using(without_the_paper()) as own:
        own.register(replace(LANGUAGE["cone_leg"], hint=None))
        shape = shape_of(TABLE)
        found = assemble(Coverage(evidence_of(shape))).program
        (legs,) = (chain for chain in found.chains if chain[-1].name == "cone_leg")
        assert [loop.name for loop in legs[:-1]] == ["mirror", "mirror"]
        assert found.blocks == 2
        assert legs[-1].values[3:] == pytest.approx((14, 0.6, 1.2), abs=0.1)
