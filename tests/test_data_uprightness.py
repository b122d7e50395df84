"""Which way up: planted furniture, turned so that another axis of its file is up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from shapeprog.data import load, loading
from shapeprog.data.orientation import AUTO, axes_of
from shapeprog.data.uprightness import Upright, find_up, measures
from shapeprog.formats.parts import solid
from shapeprog.language.parser import parse
from shapeprog.space import grid_axes

CHAIR = """\
box(at=(-1, -5, -5), size=(1.5, 10, 10))
for i in mirror(side):
    for j in mirror(depth):
        box(at=(-12, 3.5, 3.5), size=(11, 1.5, 1.5))
box(at=(0.5, 3.5, -5), size=(11.5, 1.5, 10))
"""

TABLE = """\
box(at=(6, -8, -12), size=(1.5, 16, 24))
for i in mirror(side):
    for j in mirror(depth):
        box(at=(-9, 6, 10), size=(15, 1.5, 1.5))
"""

DIRECTIONS = ["+x", "-x", "+y", "-y", "+z", "-z"]


def written(folder: Path, text: str, up: str) -> Path:
    """A mesh file in which a program stands along one axis."""
    vertices, faces = solid(parse(text))
    turned = vertices @ grid_axes(up, "+y" if up[1] == "x" else "+x").T
    trimesh.Trimesh(turned, faces, process=False).export(folder / "shape.ply")
    return folder / "shape.ply"


@pytest.mark.parametrize("text", [CHAIR, TABLE])
@pytest.mark.parametrize("up", DIRECTIONS)
def test_furniture_stands_up_whatever_way_its_file_has_it(tmp_path, text, up):
    path = written(tmp_path, text, up)
    found, told = load(path, up="auto"), load(path, up=up)
    np.testing.assert_array_equal(found.voxels, told.voxels)
    assert found.frame == told.frame
    assert f"Estimated up axis of the file: {up} " in found.note
    assert told.note == ""


def test_up_is_never_along_the_front(tmp_path):
    path = written(tmp_path, TABLE, "+z")
    shape = load(path, up="auto", front="-z")
    assert "z" not in shape.note.split(" of the file")[0].rsplit(" ", 1)[1]


def test_points_stand_up_too(tmp_path):
    vertices, faces = solid(parse(CHAIR))
    points = trimesh.Trimesh(vertices, faces).sample(4000, seed=0)
    np.savetxt(tmp_path / "scan.xyz", points[:, [1, 2, 0]] * [1, -1, -1])  # up is -z of a format that has +z up
    assert "of the file: -z" in load(tmp_path / "scan.xyz", up="auto").note


def test_what_is_the_same_from_all_sides_is_left_to_convention():
    cube = np.zeros((32, 32, 32), bool)
    cube[4:28, 4:28, 4:28] = True
    np.testing.assert_allclose(np.ptp(measures(cube), 0), 0, atol=1e-12)
    assert find_up(cube, usual="-y").up == "-y"
    assert find_up(cube).probability == pytest.approx(1 / 6)


@pytest.mark.parametrize(("probability", "doubted"), [(0.69, True), (0.71, False)])
def test_an_up_axis_that_is_not_certain_is_to_be_checked(tmp_path, monkeypatch, probability: float, doubted: bool):
    monkeypatch.setattr(loading, "find_up", lambda *_, **__: Upright("+z", probability))
    note = load(written(tmp_path, CHAIR, "+z"), up="auto").note
    assert f"(probability {probability:.0%})" in note
    assert ("check it in a picture, or give --up" in note) == doubted


def test_auto_counts_as_not_given_where_axes_are_checked():
    np.testing.assert_array_equal(axes_of(Path("a.obj"), AUTO, None), axes_of(Path("a.obj"), None, None))
