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
# The tops of the legs, which are hidden, have no plane.
FITTED = """\
box(at=(8.8, -7.9, -11.8), size=(2.3, 15.8, 23.9))
for i in mirror(side):
    for j in mirror(depth):
        box(at=(-10.8, 4.9, 9.2), size=(19.8, 2.3, 1.9))
"""
CASE, DOOR = "box(at=(-12, {}, -6), size=(24, {}, 12))\n", "box(at=({}, -5.4, -6), size=({}, 0.4, 12))\n"


def numbers(program: Program) -> list[float]:
    """All numbers of the statements in cells."""
    return [value for node in program.walk() for value in node.values]


def sheets() -> Evidence:
    """Two equal level sheets, 12 cells apart."""
    rectangle = (-6, -12), (6, -12), (6, 12), (-6, 12)
    corners = np.array([(height, *corner) for height in (-6, 6) for corner in rectangle], np.float64)
    faces = np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    return evidence_of(shape_from_mesh(corners, faces, axes=np.eye(3)))


def test_faces_of_a_fitted_union_move_onto_its_planes():
    moved = on_planes(parse(FITTED), evidence_of_program(parse(TABLE)))
    assert np.allclose(numbers(moved), numbers(parse(TABLE)), atol=1e-3)


def test_of_two_planes_as_near_a_face_takes_the_one_that_covers_more_of_it():
    # The front of a case is at -5, with a door at -5.4 on two thirds of it; all other faces stay.
    evidence = evidence_of_program(parse(CASE.format(-5, 10) + DOOR.format(-8, 16)))
    moved = on_planes(parse(CASE.format(-5.2, 10.2)), evidence)
    assert np.allclose(numbers(moved), numbers(parse(CASE.format(-5.4, 10.4))), atol=1e-3)


def test_a_thin_front_stays_before_its_case_though_nothing_is_seen_of_the_face_between():
    program = parse(CASE.format(-5, 10) + DOOR.format(-12, 24))
    assert np.allclose(numbers(on_planes(program, evidence_of_program(program))), numbers(program), atol=1e-3)


def test_copies_that_share_a_thickness_get_that_of_most():
    shelf = "box(at=({}, -6, -12), size=({}, 12, 24))\n"
    given = shelf.format(-6, 0.6) + shelf.format(0, 0.6) + shelf.format(6, 0.9)
    row = "for i in translate(3, by=(6, 0, 0)):\n    box(at=(-6, -6, -12), size=(0.7, 12, 24))\n"
    moved = on_planes(parse(row), evidence_of_program(parse(given)))
    assert numbers(moved)[-3] == pytest.approx(0.6, abs=0.02)


def test_one_face_of_a_board_is_on_a_sheet_and_the_other_stays():
    evidence = sheets()
    assert evidence.mesh is not None
    at = float(evidence.mesh.vertices[:, 0].max())
    moved = on_planes(parse(f"box(at=({at - 0.25}, -6, -12), size=(0.3, 12, 24))"), evidence)
    assert numbers(moved)[0] == pytest.approx(at - 0.25, abs=1e-3)
    assert numbers(moved)[0] + numbers(moved)[3] == pytest.approx(at, abs=1e-3)


@pytest.mark.parametrize("near", [CASE.format(-6, 11), CASE.format(-5.2, 10.2)])
def test_a_plane_that_is_far_or_covers_little_of_a_face_does_not_move_it(near: str):
    # There is no front at -5 but for a board on a fifth of it.
    evidence = evidence_of_program(parse(CASE.format(-3, 8) + "box(at=(-2.4, -5, -6), size=(4.8, 4, 12))\n"))
    assert np.allclose(numbers(on_planes(parse(near), evidence)), numbers(parse(near)), atol=1e-3)


@pytest.mark.parametrize(
    "text", ["board(at=(9, -8, -12), size=(2, 16, 24), tilt=10)", "cylinder(at=(-10, 0, 0), height=20, radius=2)"]
)
def test_parts_that_lean_or_are_round_have_no_straight_faces(text: str):
    tunable, mesh = Tunable(parse(text)), evidence_of_program(parse(TABLE)).mesh
    assert mesh is not None
    assert not len(faces_of(tunable.scene(tunable.values), mesh).target)


def test_the_derivatives_of_residuals_are_those_of_differences():
    text = "for i in rotate(4, step=90):\n    box(at=(-11, 5, 9), size=(20, 2, 2))\n" + FITTED
    tunable, mesh = Tunable(parse(text)), evidence_of_program(parse(TABLE)).mesh
    assert mesh is not None
    poses = tunable.poses(tunable.values)
    faces, step = faces_of(poses.scene, mesh), 1e-3
    residuals, slopes = faces.residuals(poses)
    for f in np.flatnonzero(~tunable.are("angle").numpy()):
        values = tunable.values.clone()
        values[f] += step
        moved, _ = faces.residuals(tunable.poses(values))
        assert np.allclose((moved - residuals) / step, slopes[:, f], atol=1e-5)
