"""Fitting: any drawing statement is brought onto points, without a hint and without its solid being known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from declared import LANGUAGE, STATEMENTS, name_of, without_the_paper

import shapeprog as sp
from shapeprog.data.placement import shape_from_mesh
from shapeprog.formats.parts import parts
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.candidates import candidates
from shapeprog.inference.candidates.candidates import single_candidates
from shapeprog.inference.candidates.fitting import Target, fit, improve, starts
from shapeprog.inference.pieces.pieces import Pieces, find_pieces
from shapeprog.language import Draw, Language, Program, Statement, standard, using
from shapeprog.language.hints import Box
from shapeprog.language.parameters import Extent
from shapeprog.language.parser import parse

SOLIDS = {
    "box": (-5.0, -3.0, -4.0, 8.0, 2.0, 6.0),
    "cylinder": (-6.0, 1.0, 2.0, 9.0, 2.0),
    "rod": (-6.0, 1.0, 2.0, 5.0, 3.0, -1.0, 0.8),
    "taper": (-7.0, 1.0, 2.0, 5.0, 2.0, 4.0, 0.5, 1.1),
    "cushion": (-5.0, -3.0, -4.0, 3.0, 7.0, 6.0, 0.9),
    "cone_leg": (-8.0, 3.0, 2.0, 13.0, 0.6, 1.4),
    "pouf": (-4.0, -3.0, -5.0, 5.0, 8.0, 9.0),
    "bolster": (2.0, 1.0, -1.0, 9.0, 1.5),
    "arch": (-6.0, -2.0, -7.0, 12.0, 3.0, 14.0, 1.5),
}


def surface(node: Draw, count: int = 64) -> tuple[np.ndarray, np.ndarray]:
    found = sample_surface(sp.unroll(Program((node,))), count, torch.Generator().manual_seed(0))
    return found.points.double().numpy(), found.normals.double().numpy()


def box_around(points: np.ndarray) -> Box:
    low, high = points.min(0), points.max(0)
    return Box((low + high) / 2, np.eye(3), (high - low) / 2)


def off(node: Draw, points: np.ndarray) -> float:
    return float(signed_distance(sp.unroll(Program((node,))), torch.from_numpy(points).float()).abs().mean())


@pytest.mark.parametrize("name", SOLIDS)
def test_every_statement_is_fitted_to_points_on_its_surface_without_a_hint(name: str) -> None:
    with using(LANGUAGE):
        points, normals = surface(Draw(name, SOLIDS[name]))
        (found,) = fit(LANGUAGE[name], [box_around(points)], Target.of(points[None], normals[None]))
        assert off(found, surface(Draw(name, SOLIDS[name]), 500)[0]) < 0.1


@pytest.mark.parametrize("declared", STATEMENTS, ids=name_of)
def test_starts_are_within_the_declared_ranges_and_as_many_as_are_asked_for(declared: Statement) -> None:
    box = Box(np.array([1.0, -2, 3]), np.eye(3), np.array([4.0, 2, 1]))
    found = starts(declared, box)
    assert found.shape[1] == declared.size
    assert len(found) > 0
    for slot, quantity in enumerate(declared.quantities):
        assert (found[:, slot] >= quantity.low).all()
        assert (found[:, slot] <= quantity.high).all()
        if quantity.discrete:
            assert (found[:, slot] == found[:, slot].round()).all()


def test_numbers_are_improved_from_where_they_are() -> None:
    points, normals = surface(Draw("taper", SOLIDS["taper"]))
    start = Draw("taper", (-6.8, 1.2, 2.2, 5.0, 2.2, 3.8, 0.8, 0.8))
    (found,) = improve([start], Target.of(points[None], normals[None]))
    assert off(found, points) < 0.02 < off(start, points)
    np.testing.assert_allclose(found.values[6:], SOLIDS["taper"][6:], atol=0.1)


TABLE = """\
box(at=(6.25, -9, -12), size=(1.5, 18, 24))
for i in mirror(side):
    for j in mirror(depth):
        cone_leg(at=(-7.75, 6.5, 9.5), height=14, bottom=0.6, top=1.2)
"""


def pieces_of(text: str) -> Pieces:
    """The pieces of a program as a mesh in which parts are apart."""
    drawn = parts(parse(text))
    counts = np.cumsum([0, *(len(part.vertices) for part in drawn)])
    vertices = np.concatenate([part.vertices for part in drawn])
    faces = np.concatenate([part.faces + first for part, first in zip(drawn, counts, strict=False)])
    return find_pieces(shape_from_mesh(vertices, faces, name="planted", axes=np.eye(3)))


@pytest.mark.parametrize("hinted", [True, False], ids=["hinted", "without a hint"])
def test_a_statement_of_a_users_own_stands_for_the_legs_of_a_table(hinted: bool) -> None:
    with using(without_the_paper()) as own:
        example = LANGUAGE["cone_leg"]
        own.register(replace(example, hint=example.hint if hinted else None))
        legs = [node for node in single_candidates(pieces_of(TABLE)) if node.name == "cone_leg"]
        right = [leg.values for leg in legs if np.allclose(leg.values[3:], (14, 0.6, 1.2), atol=0.3)]
        for depth, side in ((6.5, 9.5), (6.5, -9.5), (-6.5, 9.5), (-6.5, -9.5)):
            assert any(np.allclose(values[:3], (-7.75, depth, side), atol=0.2) for values in right)


def test_nothing_is_fitted_from_many_starts_where_every_statement_has_a_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(candidates, "fit", lambda *_: pytest.fail("there is nothing to fit"))
    assert single_candidates(pieces_of("box(at=(-2, -9, -12), size=(1.5, 18, 24))"))[0].name == "box"


def test_what_draws_nothing_from_any_start_is_no_candidate() -> None:
    with using(Language()) as own:

        @sp.language.statement("nothing")
        def nothing(size: Extent) -> object:
            """Nothing: an upright box of negative extents."""
            from shapeprog.language.shapes import box

            return box(-size, -1 - size)

        points, normals = surface_of_a_cube()
        (found,) = fit(own["nothing"], [box_around(points)], Target.of(points[None], normals[None]))
        assert np.isfinite(found.values).all()


def surface_of_a_cube() -> tuple[np.ndarray, np.ndarray]:
    with using(standard):
        return surface(Draw("box", (-2.0, -2.0, -2.0, 4.0, 4.0, 4.0)))
