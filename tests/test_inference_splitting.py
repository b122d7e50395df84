"""Blocks split where the surface has gaps, and sheets made as thick as their likes: planted shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shapeprog.data.placement import shape_from_mesh, shape_from_points
from shapeprog.geometry.mesh import union_mesh
from shapeprog.inference.choice import choose
from shapeprog.inference.coverage import Prices, covers
from shapeprog.inference.evidence import Evidence, evidence_of
from shapeprog.inference.splitting import split
from shapeprog.inference.thickness import THICKEST, thickened
from shapeprog.language import Draw, Program
from shapeprog.language.program import Node
from shapeprog.language.text import parse
from shapeprog.language.unroll import unroll
from shapeprog.space import FloatArray

ONE = "box(at=(-12, 0, -12), size=(24, 1, 24.6))\n"
SLATS = "for i in translate(5, by=(0, 0, 5)):\n    box(at=(-12, 0, -12), size=(24, 1, 4.6))\n"
HALVES = "box(at=(-12, 0, -12), size=(24, 1, 9))\nbox(at=(-12, 0, -1), size=(24, 1, 13.6))\n"
DRAWERS = "for i in translate(3, by=(8.1, 0, 0)):\n    for j in translate(2, by=(0, 0, 12.4)):\n        {box}\n"
DRAWERS = DRAWERS.format(box="box(at=(-12, 0, -12), size=(7.6, 1, 11.9))")


def seen(vertices: FloatArray, faces: np.ndarray) -> Evidence:
    shape = shape_from_mesh(vertices, faces)
    where_it_is = replace(shape, vertices=vertices.astype(np.float32), faces=faces.astype(np.int32))
    return evidence_of(where_it_is)


def evidence(text: str) -> Evidence:
    return seen(*union_mesh(unroll(parse(text))))


def chosen(start: str, target: str) -> Program:
    program, known = parse(start), evidence(target)
    near: list[Node] = [*program.body, *split(program, known)]
    found = choose(covers([Program((node,)) for node in near], known, Prices()), 10)
    return Program(tuple(near[place] for place in found.best.chosen))


@pytest.mark.parametrize(
    ("target", "blocks"), [(SLATS, 1), (HALVES, 2), (DRAWERS, 1)], ids=["slats", "halves", "drawers"]
)
def test_a_board_becomes_the_parts_that_it_was_drawn_in_the_place_of(target, blocks):
    found = chosen(ONE, target)
    centres, wanted = (unroll(each).centre for each in (found, parse(target)))
    assert found.blocks == blocks
    assert centres.shape == wanted.shape
    assert (centres[:, None] - wanted).abs().amax(-1).amin(1).max() < 0.2


def test_parts_stay_in_the_loops_of_their_block():
    loop = "for i in mirror(depth):\n    "
    parts = "".join(f"    {line}\n" for line in HALVES.replace("-12, 0,", "-12, 4,").splitlines())
    found = split(parse(loop + ONE.replace("-12, 0,", "-12, 4,")), evidence("for i in mirror(depth):\n" + parts))
    assert len(found) == 2
    assert all(Program((node,)).chains[0][0].name == "mirror" for node in found)


def test_what_has_no_gap_is_not_split():
    for text in (ONE, "rod(start=(-12, 0, 0), end=(12, 0, 0), radius=1)\n"):
        assert split(parse(text), evidence(text)) == []
    assert split(Program(), evidence(ONE)) == []


BOARD = "box(at=(-12, -4, -8), size=(24, {thick}, 16))\n"


def with_sheet(thick: float, height: float = 0.0) -> Evidence:
    """An upright board, and a sheet that lies across it."""
    vertices, faces = union_mesh(unroll(parse(BOARD.format(thick=thick))))
    sheet = np.array([[height, y, z] for y in (-3.0, 9.0) for z in (-8.0, 8.0)])
    both = np.concatenate([faces, np.array([[0, 1, 2], [1, 3, 2]]) + len(vertices)])
    return seen(np.concatenate([vertices, sheet]), both)


def thick(found: Program) -> float:
    drawn = found.body[1]
    assert isinstance(drawn, Draw)
    return drawn.values[3]


@pytest.mark.parametrize("like", [0.12, 1.0])
def test_a_sheet_is_as_thick_as_its_like_and_both_its_faces_stay_near_it(like):
    program = parse(BOARD.format(thick=like) + "box(at=(-0.05, -3, -8), size=(0.1, 12, 16))\n")
    found = thickened(program, with_sheet(like))
    assert found.body[0] == program.body[0]
    assert thick(found) == pytest.approx(min(like, THICKEST), abs=1e-3)
    assert unroll(found).centre[1, 0] == pytest.approx(0, abs=1e-3)
    assert thickened(program, with_sheet(like), [program.body[1]]) == program


def test_a_sheet_on_the_floor_does_not_sink_into_it():
    found = thickened(
        parse(BOARD.format(thick=1) + "box(at=(-12.05, -3, -8), size=(0.1, 12, 16))\n"), with_sheet(1.0, -12.0)
    )
    assert found.body[1].values[0] == pytest.approx(-12, abs=1e-3)


def test_what_has_two_faces_keeps_its_thickness_and_of_scans_nobody_knows():
    thin = parse(BOARD.format(thick=1) + "box(at=(0, -3, -8), size=(0.14, 12, 16))\n")
    vertices, faces = union_mesh(unroll(thin))
    assert thickened(thin, seen(vertices, faces)) == thin
    random = np.random.default_rng(0)
    cloud = np.concatenate([random.uniform([-12, -4, -8], [12, -4, 8], (3000, 3)), random.normal(0, 0.2, (2000, 3))])
    assert thickened(thin, evidence_of(shape_from_points(cloud + random.normal(0, 0.3, cloud.shape)))) == thin
    assert thickened(Program(), with_sheet(1.0)) == Program()
