import pytest
import torch
import twins
from hypothesis import given, settings
from hypothesis import strategies as st

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.losses import chamfer
from shapeprog.geometry.nearest import nearest, squared_distance


def clouds(seed, count, other, dtype=torch.float32):
    """Two clouds of a form that grids find hard: flat, clustered, far apart, doubled, all in one place."""
    g = torch.Generator().manual_seed(seed)
    one = torch.rand(count, 3, generator=g, dtype=dtype) * 24 - 12
    two = torch.rand(other, 3, generator=g, dtype=dtype) * 24 - 12
    form = seed % 6
    if form == 1:
        one[:, 0], two[:, 0] = 3, 4
    elif form == 2:
        two = two * 0.01 + torch.randint(-9, 9, (other, 3), generator=g)
    elif form == 3:
        one = one + 1000
    elif form == 4:
        two = two[torch.randint(0, max(other // 4, 1), (other,), generator=g)]
    elif form == 5:
        two = two * 0 + 1
    return one, two


@settings(max_examples=24, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 300), st.integers(1, 300))
def test_neighbours_are_exact(seed, count, other):
    one, two = clouds(seed, count, other, torch.float64)
    distance = torch.cdist(one, two, compute_mode="donot_use_mm_for_euclid_dist")
    found = distance.gather(1, nearest(one, two)[:, None])[:, 0]
    torch.testing.assert_close(found, distance.min(1)[0], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_chamfer_and_its_gradient_are_those_of_all_pairs(seed, dtype):
    one, two = clouds(seed, 200, 170, dtype)
    if seed in (4, 5):
        two = two + torch.rand(two.shape, dtype=dtype) * 1e-3
    pair = [one.requires_grad_(), two.requires_grad_()]
    fast, slow = chamfer(*pair), twins.chamfer(*pair)
    torch.testing.assert_close(fast, slow)
    for got, expected in zip(torch.autograd.grad(fast, pair), torch.autograd.grad(slow, pair), strict=True):
        torch.testing.assert_close(got, expected, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("lead", [(), (3,), (2, 2)])
def test_leading_dimensions_and_directions(lead):
    g = torch.Generator().manual_seed(1)
    one, two = torch.randn(*lead, 50, 3, generator=g), torch.randn(*lead, 40, 3, generator=g)
    to_target, from_target = squared_distance(one, two).mean(-1), squared_distance(two, one).mean(-1)
    assert to_target.shape == lead
    torch.testing.assert_close(to_target + from_target, chamfer(one, two))
    flat = [twins.nearest_squared(a, b).mean() for a, b in zip(one.view(-1, 50, 3), two.view(-1, 40, 3), strict=True)]
    torch.testing.assert_close(to_target.reshape(-1), torch.stack(flat))


def test_weights_shift_the_mean_and_carry_gradient():
    one, two = clouds(0, 60, 50)
    weights = torch.ones(60, requires_grad=True)
    torch.testing.assert_close(chamfer(one, two, weights=weights), chamfer(one, two))
    (slope,) = torch.autograd.grad(chamfer(one, two, weights=weights), weights)
    squared = squared_distance(one, two)
    torch.testing.assert_close(slope, (squared - squared.mean()) / 60)


def test_gradcheck():
    one, two = clouds(0, 7, 6, torch.float64)
    assert torch.autograd.gradcheck(chamfer, (one.requires_grad_(), two.requires_grad_()))


def test_points_that_are_no_numbers_do_no_harm():
    one, two = clouds(0, 20, 20)
    one[3], two[4], two[5] = torch.nan, torch.nan, torch.inf
    found = nearest(one, two)
    assert ((found >= 0) & (found < 20)).all()


@pytest.mark.wrong_types
def test_mistakes_are_named():
    with pytest.raises(ShapeProgError, match="no points"):
        nearest(torch.zeros(4, 3), torch.zeros(0, 3))
    with pytest.raises(ShapeProgError, match="do not pair up"):
        nearest(torch.zeros(2, 4, 3), torch.zeros(3, 4, 3))
    assert nearest(torch.zeros(0, 3), torch.zeros(4, 3)).shape == (0,)
