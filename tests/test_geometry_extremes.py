"""No number that fits into float32 makes a kernel read or write beside its arrays, and large ones are not too large."""

import re
from contextlib import suppress

import numpy as np
import pytest
import torch
import trimesh
from geometry_helpers import NAMES, make_scene, random_scene, require, with_leaves
from hypothesis import example, given, settings
from hypothesis import strategies as st

from shapeprog import export, parse
from shapeprog.errors import ShapeProgError
from shapeprog.formats.format import suffixes
from shapeprog.geometry.cells import rasterise
from shapeprog.geometry.distance import each_distance, nearest_primitive, signed_distance
from shapeprog.geometry.mesh import part_meshes
from shapeprog.geometry.nearest import nearest, squared_distance
from shapeprog.geometry.surface import sample_surface
from shapeprog.space import Frame
from shapeprog.view.page import picture
from shapeprog.view.viewer import viewer

ANY = st.floats(width=32)
ODD = [1e19, -1e19, 3e38, -3e38, 1e-38, 0.0, float("nan"), float("inf"), -float("inf")]


def seeded(numbers):
    """A scene and points of which some numbers are replaced by those given."""
    scene = random_scene(0, lead=(2,), slots=6)
    generator = torch.Generator().manual_seed(len(numbers))
    points = torch.rand(2, 40, 3, generator=generator) * 20 - 10
    size, centre, rotation = scene.size.clone(), scene.centre.clone(), scene.rotation.clone()
    for number in numbers:
        for tensor in (size, centre, rotation, points):
            if torch.rand((), generator=generator) < 0.5:
                place = int(torch.randint(tensor.numel(), (), generator=generator))
                tensor.view(-1)[place] = number
    return require(scene, size=size, centre=centre, rotation=rotation), points


@settings(max_examples=40)
@given(st.lists(ANY | st.sampled_from(ODD), min_size=1, max_size=12))
@example([1e19] * 12)
@example([float("nan")] * 12)
@example(ODD)
def test_every_kernel_takes_every_number(numbers):
    scene, points = seeded(numbers)
    scene, leaves = with_leaves(scene)
    points.requires_grad_()
    distance = signed_distance(scene, points)
    assert distance.shape == (2, 40)
    torch.autograd.grad(distance.nan_to_num(0, 0, 0).sum(), [*leaves, points])
    slots = nearest_primitive(scene, points)[0]
    assert ((slots >= 0) & (slots < 6)).all()
    assert rasterise(scene).shape == (2, 32, 32)
    assert rasterise(scene, 40).shape == (2, 80, 40)
    try:
        sample = sample_surface(scene, 20)
        torch.autograd.grad(sample.points.sum() + sample.weights.sum(), leaves)
    except ShapeProgError:  # such as a surface without end
        pass
    cloud = scene.centre
    index = nearest(points, cloud)
    assert ((index >= 0) & (index < 6)).all()
    torch.autograd.grad(squared_distance(points, cloud).nan_to_num(0, 0, 0).sum(), [points])


@pytest.mark.parametrize("far", [1e17, 1e19, 1e25, 1e30])
def test_distances_far_away_are_those_of_all_pairs(far):
    scene = random_scene(2, lead=(2,), slots=6, dtype=torch.float64)
    points = torch.randn(2, 50, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * far
    points[:, ::2] /= far / 5
    expected = each_distance(scene, points).min(-1).values
    torch.testing.assert_close(nearest_primitive(scene, points)[1], expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_solids_far_apart_find_the_nearer_one(name):
    size = [1e20, 1e20, 0 if name == "arc" else 1e20]
    scene = make_scene([name] * 2, [size] * 2, [[0.0, 0, 0], [4e20, 0, 0]], dtype=torch.float64)
    points = torch.tensor([[-3e20, 0, 0], [6e20, 0, 0], [1.5e20, 0, 0]], dtype=torch.float64)
    slots, distances = nearest_primitive(scene, points)
    assert slots.tolist() == [0, 1, 0]
    torch.testing.assert_close(distances / 1e20, torch.tensor([2.0, 1, 0.5], dtype=torch.float64))


@pytest.mark.parametrize("far", [2e18, 1e30, float("inf"), float("nan")])
def test_points_that_leave_single_precision_are_refused(far):
    scene = make_scene(["cuboid"] * 2, [[1.0, 1, 1]] * 2, [[0.0, 0, 0], [0, far, 0]])
    with pytest.raises(ShapeProgError, match="farther than 1e\\+18 cells"):
        sample_surface(scene, 50)
    near = require(scene, centre=scene.centre.nan_to_num(0, 0, 0).clamp(max=9e17))
    assert sample_surface(near, 50).points.square().sum(-1).isfinite().all()


def test_a_surface_without_end_is_named_as_such():
    with pytest.raises(ShapeProgError, match="infinite or undefined area"):
        sample_surface(make_scene(["cuboid"], [[3e38] * 3], [[0.0, 0, 0]]), 50)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("size", [3e38, float("inf")])
def test_solids_without_end_have_no_mesh(name, size):
    scene = make_scene([name], [[size, size, 0 if name == "arc" else size]], [[0.0, 0, 0]])
    with pytest.raises(ShapeProgError, match="reach farther than"):
        part_meshes(scene)


PLACES = {
    "position": "leg(at=({0}, 0, {0}), size=(2, 2, 2))\nleg(at=(0, 0, 0), size=(1, 1, 1))\n",
    "size": "leg(at=(0, 0, 0), size=({0}, 2, {0}))\nback(at=(0, 0, 0), size=(2, 2, 2), tilt={0})\n",
    "radius": "line(start=(0, {0}, 0), end=({0}, 0, 0), radius={0})\nbase_circle(at=(0, 0, 0), thickness=1, radius=9)",
    "shift": "for i in translate(3, by=(0, {0}, 0)):\n    leg(at=(0, 0, 0), size=(2, 2, 2))\n",
}
NO_NUMBER = re.compile(rb"\b(nan|inf|infinity)\b", re.IGNORECASE)


@pytest.mark.parametrize("number", ["1e19", "-3e38", "3e38", "1e-38", "4e13"])
@pytest.mark.parametrize("place", PLACES)
def test_every_exit_of_a_program_ends_in_finite_numbers_or_in_words(tmp_path, place, number):
    program = parse(PLACES[place].format(number))
    for suffix in suffixes():
        if suffix in (".step", ".stp"):  # a script that another library runs
            continue
        path = tmp_path / f"a{suffix}"
        try:
            export(program, path)
        except ShapeProgError:
            continue
        if suffix in (".glb", ".stl", ".ply"):
            assert np.isfinite(trimesh.load(path, force="mesh", process=False).vertices).all()
        elif suffix != ".npy":
            assert not NO_NUMBER.search(path.read_bytes())
    for draw in (
        lambda: picture(None, program, tmp_path / "a.png", view=48),
        lambda: viewer(program, tmp_path / "a.html"),
    ):
        with suppress(ShapeProgError):
            draw()


def test_a_frame_that_leaves_single_precision_is_refused(tmp_path):
    program, frame = parse("leg(at=(0, 0, 0), size=(2, 2, 2))\n"), Frame(scale=1e38)
    for suffix in (".glb", ".obj", ".ply", ".stl"):
        with pytest.raises(ShapeProgError, match="single precision"):
            export(program, tmp_path / f"a{suffix}", Frame(scale=1e39))
    export(program, tmp_path / "a.ply", frame)
