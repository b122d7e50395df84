import pytest
import torch
from geometry_helpers import make_scene, random_scene, require, with_leaves
from hypothesis import given, settings
from hypothesis import strategies as st

from shapeprog.geometry.batch import Batch
from shapeprog.geometry.distance import each_distance, nearest_primitive, projected, signed_distance


def cloud(seed, count=200, lead=(), dtype=torch.float64, reach=12):
    g = torch.Generator().manual_seed(seed)
    return (torch.rand(*lead, count, 3, generator=g, dtype=dtype) * 2 - 1) * reach


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_the_union_is_the_nearest_of_all_primitives_with_the_same_gradient(seed):
    scene, leaves = with_leaves(random_scene(seed, lead=(2,), slots=6, dtype=torch.float64))
    points = cloud(seed, lead=(2,)).requires_grad_()
    fast, slow = signed_distance(scene, points), each_distance(scene, points).min(-1)[0]
    torch.testing.assert_close(fast, slow)
    slope = torch.randn(fast.shape, dtype=torch.float64)
    for got, expected in zip(
        torch.autograd.grad(fast, [*leaves, points], slope), torch.autograd.grad(slow, [*leaves, points], slope),
        strict=True,
    ):  # fmt: skip
        torch.testing.assert_close(got, expected, rtol=1e-7, atol=1e-9)


def test_the_nearest_primitive_is_that_of_all_pairs():
    scene = random_scene(5, lead=(2,), slots=6)
    points = cloud(0, lead=(2,), dtype=torch.float32)
    expected = each_distance(scene, points).min(-1)
    torch.testing.assert_close(signed_distance(scene, points), expected.values, rtol=1e-5, atol=1e-5)
    slot, value = nearest_primitive(scene, points)
    torch.testing.assert_close(value, expected.values, rtol=1e-5, atol=1e-5)
    assert (slot == expected.indices).double().mean() > 0.99


def test_known_distances_of_a_box_a_cylinder_and_a_sheared_board():
    scene = make_scene(["cuboid", "cylinder", "cuboid"], [[1.0, 2, 3], [2, 1, 0], [2, 1, 5, 4]], [[0.0, 0, 0]] * 3)
    points = torch.tensor([[0.0, 0, 0], [4, 2, 0], [2, 3, 0], [4, 0, 7], [5, 3, 4]])
    found = each_distance(scene, points)
    assert found[0].tolist() == pytest.approx([-1, -1, -(0.5**0.5)])
    assert found[1].tolist() == pytest.approx([3, 5**0.5, 2])
    assert found[2, :2].tolist() == pytest.approx([2**0.5, 2])
    assert float(found[3, 2]) == pytest.approx((2**2 + 1 + 2**2) ** 0.5)


def test_exact_distance_against_a_dense_sampling_of_the_surface():
    scene = random_scene(8, slots=5, dtype=torch.float64)
    points = cloud(1, 60)
    each = each_distance(scene, points)
    for slot in range(4):
        alone = require(scene, mask=torch.arange(5) == slot)
        dense = alone.sample(20000, torch.Generator().manual_seed(0))
        nearest = torch.cdist(points, dense).min(-1)[0]
        torch.testing.assert_close(each[:, slot].abs(), nearest, atol=0.15, rtol=0)
        assert (each[:, slot].abs() <= nearest + 1e-6).all()


@pytest.mark.parametrize("name", ["cuboid", "cylinder"])
def test_gradcheck_at_random_points(name):
    scene = make_scene([name], [[2.0, 1.5, 1, 1.2 if name == "cuboid" else 0]], [[0.3, 0.2, 0.1]], dtype=torch.float64,
                       rotation=torch.linalg.qr(cloud(3, 3))[0][None])  # fmt: skip
    scene, leaves = with_leaves(scene)
    points = cloud(2, 12, reach=4).requires_grad_()

    def value(size, centre, rotation, points):
        return signed_distance(require(scene, size=size, centre=centre, rotation=rotation), points)

    assert torch.autograd.gradcheck(value, (*leaves, points))


@pytest.mark.parametrize("size", [[2.0, 1, 1, 0], [0.0, 0, 0, 0], [0, 1, 1, 2], [2, 0, 0, 1], [1, 1, 1, 0]])
@pytest.mark.parametrize("kernel", [True, False])
def test_gradients_are_finite_on_edges_axes_and_for_zero_sizes(size, kernel):
    scene, leaves = with_leaves(make_scene(["cuboid", "cylinder"], [size, [*size[:3], 0]], [[0.0, 0, 0]] * 2))
    ticks = torch.tensor([-2.0, -1, 0, 1, 2])
    points = torch.cartesian_prod(ticks, ticks, ticks).requires_grad_()
    found = signed_distance(scene, points) if kernel else each_distance(scene, points)
    for slope in torch.autograd.grad(found.sum(), [*leaves, points]):
        assert slope.isfinite().all()


def test_distance_moves_with_the_shape():
    scene = random_scene(6, slots=5, dtype=torch.float64)
    points = cloud(4, 50)
    turn, shift = torch.linalg.qr(cloud(5, 3))[0], torch.tensor([3.0, -2, 1], dtype=torch.float64)
    moved = require(scene, centre=scene.centre @ turn.T + shift, rotation=turn @ scene.rotation)
    torch.testing.assert_close(signed_distance(moved, points @ turn.T + shift), signed_distance(scene, points))


@pytest.mark.parametrize("lead", [(), (3,), (2, 2)])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_leading_dimensions_and_types(lead, dtype):
    scene = random_scene(7, lead=lead, slots=4, dtype=dtype)
    points = cloud(6, 10, lead, dtype)
    assert signed_distance(scene, points).shape == (*lead, 10)
    assert signed_distance(scene, points).dtype == dtype
    assert each_distance(scene, points).shape == (*lead, 10, 4)
    assert each_distance(scene, points)[..., -1].isinf().all(), "padding is nowhere"
    shared = points.reshape(-1, 10, 3)[0]
    torch.testing.assert_close(scene.distance(shared), each_distance(scene, shared).min(-1)[0], atol=1e-5, rtol=1e-5)


def test_empty_scenes_are_infinitely_far_away():
    assert signed_distance(make_scene([], [], []), torch.zeros(4, 3)).isinf().all()
    nothing = require(random_scene(0, slots=3), mask=torch.zeros(3, dtype=torch.bool))
    assert signed_distance(nothing, torch.zeros(4, 3)).isinf().all()


def test_points_end_between_two_primitives_where_the_gap_is_narrow():
    scene = make_scene(["cuboid", "cuboid"], [[1, 1, 1], [1, 1, 1]], [[0, 0, 0], [0, 0, 5]], dtype=torch.float64)
    points = torch.tensor([[0.5, 0.2, -3.0], [4.0, 0, 3], [0, 0, 0.5]], dtype=torch.float64)
    pairs = pairs_of(scene, 3)
    expected = torch.tensor([[0.5, 0.2, 1], [1, 0, 1], [0, 0, 1]], dtype=torch.float64)
    torch.testing.assert_close(projected(pairs, points, 3), expected)


def test_points_inside_both_primitives_stay():
    scene = make_scene(["cuboid", "cylinder"], [[2, 2, 2], [2, 1]], [[0, 0, 0], [1, 0, 0]], dtype=torch.float64)
    points = torch.tensor([[1.0, 0.5, 0.3]], dtype=torch.float64)
    assert projected(pairs_of(scene, 1), points, 5).equal(points)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_projections_are_the_same_by_kernel_and_by_declaration(seed):
    scene, points = random_scene(seed, (40,), slots=3, dtype=torch.float64), cloud(seed, 40)
    pairs = Batch(*(part[:, :2] for part in (scene.kind, scene.size, scene.centre, scene.rotation, scene.mask)))
    moved = projected(pairs, points, 4)
    first, second = (Batch(*(part[:, slot : slot + 1] for part in vars(pairs).values())) for slot in range(2))
    for batch in 4 * (second, first):
        at = points[:, None].detach().requires_grad_()
        value = signed_distance(batch, at)
        (slope,) = torch.autograd.grad(value.sum(), at)
        points = (at - value.clamp(min=0)[..., None] * slope)[:, 0].detach()
    torch.testing.assert_close(moved, points, rtol=0, atol=1e-9)


def pairs_of(scene, count):
    """The two primitives of a scene, so many times."""
    parts = (scene.kind, scene.size, scene.centre, scene.rotation, scene.mask)
    return Batch(*(part.expand(count, *part.shape) for part in parts))
