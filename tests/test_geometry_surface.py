import math

import numpy as np
import pytest
import torch
import twins
from geometry_helpers import make_scene, random_scene, require, with_leaves

from shapeprog.errors import ShapeProgError
from shapeprog.geometry import surface as room
from shapeprog.geometry.arrays import table_of
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.parser import parse
from shapeprog.language.unroll import unroll


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_points_lie_on_their_own_surface_and_in_no_other_part(dtype):
    scene = random_scene(1, lead=(2,), slots=7, dtype=dtype)
    sample = sample_surface(scene, 400, seeded())
    distance = each_distance(scene, sample.points)
    own = distance.gather(-1, sample.slot[..., None])[..., 0]
    assert own.abs().max() < 1e-4
    assert distance.min() > -2 * room.SKIN
    outside = each_distance(scene, sample.points + 1e-2 * sample.normals).gather(-1, sample.slot[..., None])[..., 0]
    torch.testing.assert_close(outside, torch.full_like(outside, 1e-2), atol=1e-3, rtol=0)
    torch.testing.assert_close(sample.normals.norm(dim=-1), torch.ones_like(own))


def test_the_kernel_draws_what_the_declarations_draw():
    scene = random_scene(2, lead=(3,), slots=6, dtype=torch.float64)
    shares = room.area_shares(room.face_areas(scene), scene)
    fast, slow = room.visible(table_of(scene), shares, 300, 7), twins.visible(scene, shares, 300, 7)
    assert (fast.chosen == slow.chosen).all()
    assert (fast.found == slow.found).all()
    np.testing.assert_allclose(fast.places, slow.places, rtol=1e-7, atol=1e-7)


def test_gradient_of_placing_is_that_of_the_declarations():
    scene, leaves = with_leaves(random_scene(3, lead=(2,), slots=5, dtype=torch.float64))
    table, areas = table_of(scene), room.face_areas(scene)
    choice = room.visible(table, room.area_shares(areas.detach(), scene), 200, 5)
    slope = torch.randn(2, 200, 3, dtype=torch.float64, generator=seeded())
    weigh = torch.randn(2, 200, dtype=torch.float64, generator=seeded())
    fast = room._Placed.apply(*leaves, areas, table, choice)
    slow = twins.place(scene, areas, choice)
    torch.testing.assert_close(fast, slow)
    fast, slow = (torch.autograd.grad(each, leaves, (slope, weigh), retain_graph=True) for each in (fast, slow))
    for got, expected in zip(fast, slow, strict=True):
        torch.testing.assert_close(got, expected)
    assert sample_surface(scene, 20, seeded()).points.requires_grad


def test_a_block_is_hidden_inside_others_and_shown_where_it_stands_out_of_them():
    scene = unroll(parse("""
box(at=(0, 0, 0), size=(4, 4, 4))
box(at=(0, 0, 4), size=(4, 4, 4))
box(at=(1, 1, 1), size=(2, 2, 6))
box(at=(2.1, 1, 1), size=(2, 2, 2))
cylinder(at=(0, 2, 2), height=4.01, radius=1)
"""))  # fmt: skip
    assert room.hidden_groups(scene, scene.block) == {2, 4}
    nothing = unroll(parse(""))
    assert room.hidden_groups(nothing, nothing.block) == set()


def test_two_overlapping_cubes_show_their_exact_areas():
    # cubes of side 4 whose corners overlap in a cube of side 2: each hides 3 faces of 4 of the other
    scene = make_scene(["cuboid"] * 2, [[2.0, 2, 2], [2, 2, 2]], [[0.0, 0, 0], [2, 2, 2]])
    sample = sample_surface(scene, 20000, seeded())
    share = (sample.slot == 0).double().mean()
    assert abs(share - 0.5) < 4 * math.sqrt(0.25 / 20000)
    high_faces = ((sample.slot == 0) & (sample.normals.sum(-1) > 0)).double().mean()
    expected = 3 * 12 / (2 * 84)
    assert abs(high_faces - expected) < 4 * math.sqrt(expected / 20000)


def test_flush_faces_count_once_and_touching_faces_never():
    # two boxes side by side with a common top plane and an overlap of half their width
    scene = make_scene(["cuboid"] * 2, [[1.0, 2, 2], [1, 2, 2]], [[0.0, 0, 0], [0, 2, 0]])
    sample = sample_surface(scene, 20000, seeded())
    depth = sample.points[:, 1]
    union = 2 * (2 * 6 + 6 * 4 + 2 * 4)
    top = ((sample.normals[:, 0] > 0.5) & (depth > 0) & (depth < 2)).double().mean()
    assert abs(top - 8 / union) < 4 * math.sqrt(8 / union / 20000)
    assert (sample.slot[(sample.normals[:, 0].abs() > 0.5) & (depth > 0) & (depth < 2)] == 0).all()
    stacked = make_scene(["cuboid"] * 2, [[1.0, 2, 2], [1, 2, 2]], [[-1.0, 0, 0], [1, 0, 0]])
    points = sample_surface(stacked, 4000, seeded())
    between = (points.points[:, 0].abs() < 1e-4) & (points.normals[:, 0].abs() > 0.5)
    assert not between.any()


def test_a_part_inside_another_and_a_copy_of_another_show_nothing():
    scene = make_scene(["cuboid", "cylinder", "cuboid"], [[4.0, 4, 4], [1, 1, 0], [4, 4, 4]], [[0.0, 0, 0]] * 3)
    assert (sample_surface(scene, 2000, seeded()).slot == 0).all()


def test_faces_of_a_cylinder_and_of_a_sheared_board_get_their_areas():
    scene = make_scene(["cylinder"], [[3.0, 2, 0]], [[0.0, 0, 0]])
    sample = sample_surface(scene, 20000, seeded())
    lateral = (sample.normals[:, 0].abs() < 0.5).double().mean()
    assert abs(lateral - 24 / 32) < 4 * math.sqrt(0.19 / 20000)
    board = make_scene(["cuboid"], [[4.0, 1, 2, 6]], [[0.0, 0, 0]])
    slanted = (sample_surface(board, 20000, seeded()).normals[:, 1].abs() > 0.1).double().mean()
    expected = 2 * 4 * 10 / (2 * 4 * 10 + 2 * 8 + 2 * 16)
    assert abs(slanted - expected) < 4 * math.sqrt(0.25 / 20000)


def test_weighted_means_have_the_gradient_of_the_mean_over_the_surface():
    # mean of x_0^2 over a box of half extents (a, b, c), against the analytic derivative by each of them
    half = torch.tensor([3.0, 2.0, 1.0], dtype=torch.float64, requires_grad=True)
    a, b, c = half
    cap, sides = b * c, a * (b + c)
    exact = (cap * a**2 + sides * a**2 / 3) / (cap + sides)
    (expected,) = torch.autograd.grad(exact, half)
    count, batch = 5000, 64
    scene = make_scene(["cuboid"], [[3.0, 2, 1]], [[0.0, 0, 0]], dtype=torch.float64, lead=(batch,))
    size = torch.cat([half, half.new_zeros(1)]).expand(batch, 1, 4)
    sample = sample_surface(require(scene, size=size), count, seeded())
    value = sample.points[..., 0] ** 2
    means = (value * sample.weights).sum(-1) / sample.weights.sum(-1)
    rows = torch.stack([torch.autograd.grad(mean, half, retain_graph=True)[0] for mean in means])
    error = rows.std(0) / math.sqrt(batch)
    assert abs(means.mean() - exact) < 4 * means.std() / math.sqrt(batch)
    assert ((rows.mean(0) - expected).abs() < 4 * error + 1e-12).all()
    unweighted = torch.autograd.grad(value.mean(), half)[0]
    assert ((unweighted - expected).abs() > 8 * error).any(), "without weights the gradient is wrong"


def test_seeds_batches_and_threads():
    scene = random_scene(4, lead=(2, 2), slots=4)
    one, two = sample_surface(scene, 100, seeded(3)), sample_surface(scene, 100, seeded(3))
    assert (one.points == two.points).all()
    assert (one.points != sample_surface(scene, 100, seeded(4)).points).any()
    assert one.points.shape == (2, 2, 100, 3)
    assert one.weights.unique().tolist() == [1.0]
    single = random_scene(4, lead=(), slots=4)
    assert sample_surface(single, 10).points.shape == (10, 3)
    assert sample_surface(single, 0).points.shape == (0, 3)


def test_scenes_without_a_surface_are_refused():
    scene = make_scene(["cuboid"], [[0.0, 0, 0]], [[0.0, 0, 0]])
    with pytest.raises(ShapeProgError, match="no surface"):
        sample_surface(scene, 10)
    both = make_scene(["cuboid"], [[1.0, 1, 1]], [[0.0, 0, 0]], lead=(2,))
    with pytest.raises(ShapeProgError, match="scene 1 of 2"):
        sample_surface(require(both, mask=torch.tensor([[True], [False]])), 10)
    with pytest.raises(ShapeProgError, match="no surface"):
        sample_surface(make_scene([], [], []), 10)
