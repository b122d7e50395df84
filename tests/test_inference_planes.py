"""Straight faces on planes of a mesh: a union has no components for its parts, but its planes are exact."""

from __future__ import annotations

import numpy as np
import pytest

from shapeprog.data.placement import shape_from_mesh
from shapeprog.inference.fit.planes import faces_of, on_planes
from shapeprog.inference.fit.tunable import Tunable
from shapeprog.inference.surface.evidence import Evidence, evidence_of, evidence_of_program
from shapeprog.language.parser import parse
from shapeprog.language.program import Program

TABLE = """\
box(at=(9, -8, -12), size=(2, 16, 24))
for i in mirror(side):
    for j in mirror(depth):
        box(at=(-11, 5, 9), size=(20, 2, 2))
"""
FITTED = """\
box(at=(8.8, -7.9, -11.8), size=(2.3, 15.8, 23.9))
for i in mirror(side):
    for j in mirror(depth):
        box(at=(-10.8, 4.9, 9.2), size=(19.7, 2.3, 1.9))
"""


def numbers(program: Program) -> list[float]:
    """All numbers of the statements in cells."""
    return [value for node in program.walk() for value in node.values]


def sheet(up: float) -> Evidence:
    """A square sheet at a height, and a small one far below that keeps it in the middle of the grid."""
    square = (-6, -12), (6, -12), (6, 12), (-6, 12)
    corners = np.array([(height, *corner) for height in (up, -8) for corner in square], np.float64)
    faces = np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    return evidence_of(shape_from_mesh(corners, faces, axes=np.eye(3)))


def test_faces_of_a_fitted_union_move_onto_its_planes():
    moved = on_planes(parse(FITTED), evidence_of_program(parse(TABLE)))
    assert np.allclose(numbers(moved), numbers(parse(TABLE)), atol=1e-3)


def test_a_face_between_two_planes_takes_one_of_them_and_other_faces_stay():
    # The front of a case, at -5, has a door at -5.4 on two thirds of it; the fit is between both.
    case, door = "box(at=(-12, {}, -6), size=(24, {}, 12))\n", "box(at=(-8, -5.4, -6), size=(16, 2, 12))\n"
    evidence = evidence_of_program(parse(case.format(-5, 10) + door))
    moved = on_planes(parse(case.format(-5.25, 10.25)), evidence)
    assert np.allclose(numbers(moved), numbers(parse(case.format(-5.4, 10.4))), atol=1e-3)


def test_copies_that_share_a_number_agree_on_one_plane():
    # Shelves of .6, .6 and .9 cells: their shared thickness is that of two, not a mean.
    shelf = "box(at=({}, -6, -12), size=({}, 12, 24))\n"
    given = shelf.format(-6, 0.6) + shelf.format(0, 0.6) + shelf.format(6, 0.9)
    row = "for i in translate(3, by=(6, 0, 0)):\n    box(at=(-6, -6, -12), size=(0.7, 12, 24))\n"
    moved = on_planes(parse(row), evidence_of_program(parse(given)))
    assert numbers(moved)[-3] == pytest.approx(0.6, abs=0.02)


def test_a_sheet_is_in_the_middle_of_its_board_which_keeps_its_thickness():
    evidence = sheet(4.0)
    assert evidence.mesh is not None
    at = float(evidence.mesh.vertices[:, 0].max())
    moved = on_planes(parse(f"box(at=({at - 0.05}, -6, -12), size=(0.3, 12, 24))"), evidence)
    assert numbers(moved)[0] + 0.15 == pytest.approx(at, abs=1e-3)
    assert numbers(moved)[3] == pytest.approx(0.3, abs=1e-3)


def test_far_planes_and_small_ones_move_nothing_and_parts_that_lean_have_no_faces():
    evidence = evidence_of_program(parse(TABLE))
    far = parse("box(at=(2, -8, -12), size=(2, 16, 24))")
    assert np.allclose(numbers(on_planes(far, evidence))[:1], 2.0, atol=1e-3)
    assert evidence.mesh is not None
    for text in ("board(at=(9, -8, -12), size=(2, 16, 24), tilt=10)", "cylinder(at=(-10, 0, 0), height=20, radius=2)"):
        tunable = Tunable(parse(text))
        assert not len(faces_of(tunable.scene(tunable.values), evidence.mesh).at)
