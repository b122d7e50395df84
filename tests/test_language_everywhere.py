"""A language of user statements alone is drawn, sampled, meshed and exported like the built-in one."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from declared import MODULES, STATEMENTS, middle, name_of

import shapeprog as sp
from shapeprog.formats import suffixes
from shapeprog.formats.plugins import load_statements
from shapeprog.geometry.cells import voxels
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.mesh import part_meshes, union_mesh
from shapeprog.geometry.surface import sample_surface
from shapeprog.language import Draw, Language, Program, Statement, standard, using

SEAT = """\
arch(at=(-12, -8, -8), size=(12, 16, 16), thickness=3)
pouf(at=(0, -6, -6), size=(4, 12, 12))
for i in translate(2, by=(0, 0, 10)):
    cone_leg(at=(4, 0, -5), height=8, bottom=1, top=3)
"""
OPTIONAL = {".step", ".stp"}


def test_user_statements_reach_every_room(tmp_path: Path) -> None:
    alone = Language()
    alone.register(standard["translate"])
    with using(alone):
        for module in MODULES:
            load_statements(module)
        program = sp.parse(SEAT)
        scene = sp.unroll(program)
        sample = sample_surface(scene, 500, torch.Generator().manual_seed(0))
        assert signed_distance(scene, sample.points).abs().max() < 1e-4
        inside = int(voxels(scene).sum())
        vertices, faces = union_mesh(scene)
        assert len(part_meshes(scene)) == 6
        assert len(faces) > 100
        assert abs(vertices).max() <= 12.01
        assert 1500 < inside < 3000
        for suffix in set(suffixes()) - OPTIONAL:
            path = tmp_path / f"seat{suffix}"
            sp.export(program, path)
            assert path.stat().st_size > 100


@pytest.mark.parametrize("declared", STATEMENTS, ids=name_of)
def test_voxels_are_about_as_many_as_the_volume_says(declared: Statement) -> None:
    """Statements of curved shapes too; whole boxes are compared cell for cell elsewhere."""
    language = Language()
    language.register(declared)
    with using(language):
        scene = sp.unroll(Program((Draw(declared.name, middle(declared)),)))
        cells = int(voxels(scene, 64).sum())
    volume = sum(mesh.volume for mesh in _solids(scene)) * 8
    assert cells == pytest.approx(volume, rel=0.25)


def _solids(scene: sp.Scene) -> list[object]:
    import trimesh

    return [trimesh.Trimesh(part.vertices, part.faces, process=False) for part in part_meshes(scene)]
