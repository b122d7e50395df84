"""The tensor code for cells against the kernels."""

from __future__ import annotations

import pytest
import torch
from geometry_helpers import primitives_restored, random_scene

from shapeprog.geometry.occupancy import packed_blocks, packed_rows, voxels
from shapeprog.geometry.raster import filled, filled_blocks, spread
from shapeprog.geometry.scene import Scene
from shapeprog.language import encode, unroll
from shapeprog.language.sampling import random_program


def programs(whole: bool, count: int = 60) -> Scene:
    random = torch.Generator().manual_seed(1)
    return unroll(encode([random_program(random, blocks=1 + n % 5, whole=whole, copies=5) for n in range(count)]))


def words(scene: Scene) -> torch.Tensor:
    return torch.from_numpy(packed_rows(scene).view("i4"))


@pytest.mark.parametrize("whole", [True, False])
def test_random_programs_fill_the_same_cells(whole: bool) -> None:
    scene = programs(whole)
    assert (filled(scene) == words(scene)).all()
    assert (spread(filled(scene)) == voxels(scene)).all()
    assert (filled_blocks(scene, 5) == torch.from_numpy(packed_blocks(scene, 5).view("i4"))).all()


@pytest.mark.parametrize("lead", [(), (7,), (3, 4)])
def test_any_pose_and_kind_fill_the_same_cells(lead: tuple[int, ...]) -> None:
    with primitives_restored():
        scene = random_scene(3, lead, slots=7, user=True)
        assert (filled(scene) == words(scene)).all()
        assert filled(scene).shape == (*lead, 32, 32)


def test_quarter_turns_of_leaning_boards_and_of_cylinders() -> None:
    random = torch.Generator().manual_seed(2)
    scene = random_scene(5, (200,), slots=4)
    axes = torch.stack([torch.randperm(3, generator=random) for _ in range(800)])
    signs = torch.randint(0, 2, (800, 3, 1), generator=random) * 2.0 - 1
    turns = (torch.eye(3)[axes] * signs).reshape(200, 4, 3, 3)
    scene = Scene(**vars(scene) | {"rotation": turns})
    assert (filled(scene) == words(scene)).all()


def test_broken_and_absurd_solids() -> None:
    scene = random_scene(1, (6,), slots=3)
    size, centre = scene.size.clone(), scene.centre.clone()
    size[0, 0], size[1, 0], size[2, 0], centre[3, 0] = torch.nan, -1, 0, torch.inf
    size[4, 0], centre[5, 0] = 1e30, -1e30
    scene = Scene(**vars(scene) | {"size": size, "centre": centre})
    assert (filled(scene) == words(scene)).all()
    assert filled(scene[:0]).shape == (0, 32, 32)
