import pytest
import torch
from geometry_helpers import any_order as any_order
from geometry_helpers import ellipsoid_kind, make_scene, random_scene, require, with_leaves

from shapeprog.geometry.cells import voxels
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.losses import coverage, excess, occupancy_cross_entropy, parts, soft_iou, volume
from shapeprog.geometry.occupancy import cell_centres, soft_logits, soft_occupancy
from shapeprog.language import Draw, Loop, Program, unroll


@pytest.mark.parametrize("user", [False, True])
def test_soft_occupancy_and_its_gradient_are_those_of_all_pairs(user):
    scene, leaves = with_leaves(random_scene(1, lead=(2,), slots=6, user=user))
    fast = soft_occupancy(scene, 3.0, 12)
    points = cell_centres(12).reshape(-1, 3).expand(2, -1, 3)
    slow = torch.sigmoid(-3.0 * each_distance(scene, points).min(-1)[0]).reshape(fast.shape)
    torch.testing.assert_close(fast, slow, atol=1e-5, rtol=1e-5)
    slope = torch.randn(fast.shape, generator=torch.Generator().manual_seed(0)) / 100
    for got, expected in zip(
        torch.autograd.grad(fast, leaves, slope), torch.autograd.grad(slow, leaves, slope), strict=True
    ):
        torch.testing.assert_close(got, expected, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("resolution", [16, 32])
def test_soft_occupancy_tends_to_the_cells_whose_centre_is_inside(resolution):
    scene = random_scene(2, slots=6, dtype=torch.float64)
    centres = cell_centres(resolution, scene.centre).reshape(-1, 3)
    inside = each_distance(scene, centres).min(-1)[0].reshape((resolution,) * 3) < 0
    errors = [float((soft_occupancy(scene, s, resolution) - inside.double()).abs().mean()) for s in (2, 20, 2000)]
    assert errors[0] > errors[1] > errors[2]
    assert (soft_occupancy(scene, 1e9, resolution).round() == inside).all()


def test_the_limit_is_the_hard_cells_for_whole_numbered_boxes():
    scene = make_scene(["cuboid"] * 2, [[2.0, 3, 4], [1, 1, 1.5]], [[0.0, 1, 2], [5, 5, 0.5]])
    assert (soft_occupancy(scene, 1e6).round().to(torch.uint8) == voxels(scene)).all()


def test_coverage_counts_what_sticks_out_and_excess_what_is_too_much():
    scene = make_scene(["cuboid"], [[2.0, 2, 2]], [[0.0, 0, 0]])
    target = torch.tensor([[0.0, 0, 0], [4, 0, 0], [2, 5, 6]])
    torch.testing.assert_close(coverage(scene, target), torch.tensor(7.0 / 3))
    torch.testing.assert_close(coverage(scene, target, surface=True), torch.tensor(9.0 / 3))
    found = excess(torch.tensor([[0.0, 0, 3], [4, 0, 0]]), target)
    torch.testing.assert_close(found, torch.tensor(1.5), atol=1e-5, rtol=0)
    full = make_scene(["cuboid"], [[16.0, 16, 16]], [[0.0, 0, 0]])
    assert coverage(full, target) == 0, "one box that fills the grid covers everything"


def test_coverage_and_its_gradient_are_those_of_all_pairs():
    scene, leaves = with_leaves(random_scene(3, lead=(3,), slots=12))
    target = torch.rand(3, 400, 3, generator=torch.Generator().manual_seed(1)) * 24 - 12
    fast = coverage(scene, target)
    slow = each_distance(scene, target).min(-1)[0].clamp(min=0).mean(-1)
    torch.testing.assert_close(fast, slow)
    for got, expected in zip(
        torch.autograd.grad(fast.sum(), leaves), torch.autograd.grad(slow.sum(), leaves), strict=True
    ):
        torch.testing.assert_close(got, expected, atol=1e-5, rtol=1e-5)


def test_prices():
    kinds, sizes = ["cuboid", "cylinder", ellipsoid_kind()], [[1.0, 2, 3], [2, 1, 0], [1, 1, 1]]
    scene, leaves = with_leaves(make_scene(kinds, sizes, [[0.0, 0, 0]] * 3))
    torch.testing.assert_close(volume(scene), torch.tensor(48 + 4 * torch.pi + 4 / 3 * torch.pi))
    assert torch.autograd.grad(volume(scene), leaves[0])[0][0].tolist() == [48, 24, 16, 0]
    assert float(parts(scene)) == 3
    masked = require(scene, mask=torch.tensor([True, False, True]))
    assert float(parts(masked)) == 2
    assert float(parts(masked, torch.tensor([0.5, 1, 0.25]))) == 0.75
    assert volume(make_scene([], [], [])) == 0


def test_occupancy_losses_have_their_known_values():
    target = torch.zeros(4, 4, 4)
    target[0] = 1
    assert float(soft_iou(target, target)) == 1
    assert float(soft_iou(1 - target, target)) == 0
    assert float(soft_iou(target * 0, target * 0)) == 1
    assert float(soft_iou(target * 0 + 1, target)) == 0.25
    torch.testing.assert_close(occupancy_cross_entropy(target * 0, target), torch.tensor(2.0).log())
    assert float(occupancy_cross_entropy((target - 0.5) * 1e9, target)) == 0
    empty = soft_logits(make_scene([], [], []), 4.0, 4)
    assert occupancy_cross_entropy(empty, target).isfinite()


def test_losses_lead_a_box_to_its_target():
    goal = make_scene(["cuboid"], [[3.0, 5, 4]], [[1.0, -2, 0]])
    scene, leaves = with_leaves(make_scene(["cuboid"], [[4.0, 4, 4]], [[0.0, 0, 0]]))
    target, cells = goal.sample(500, torch.Generator().manual_seed(0)), voxels(goal)
    optimiser = torch.optim.Adam(leaves[:2], lr=0.1)
    for _ in range(60):
        optimiser.zero_grad()
        loss = coverage(scene, target, surface=True) + 0.1 * occupancy_cross_entropy(soft_logits(scene, 2.0), cells)
        loss.backward()
        optimiser.step()
    torch.testing.assert_close(leaves[0][0, :3].detach(), goal.size[0, :3], atol=0.3, rtol=0)
    torch.testing.assert_close(leaves[1].detach(), goal.centre, atol=0.3, rtol=0)


def test_a_loop_equals_its_copies_on_every_path():
    leg = (-10.0, -8.0, -10.0, 12.0, 2.0, 3.0)
    looped = Program((Loop("translate", (3.0, 0.0, 1.0, 6.0), (Draw("leg", leg),)),))
    copies = [Draw("leg", (leg[0], leg[1] + i, leg[2] + 6 * i, *leg[3:])) for i in range(3)]
    one, two = unroll(looped), unroll(Program(tuple(copies)))
    points = torch.rand(50, 3, generator=torch.Generator().manual_seed(0)) * 24 - 12
    torch.testing.assert_close(one.distance(points), two.distance(points))
    assert (one.voxels() == two.voxels()).all()
    g = [torch.Generator().manual_seed(1) for _ in range(2)]
    torch.testing.assert_close(one.sample(50, g[0]), two.sample(50, g[1]))
    torch.testing.assert_close(volume(one), volume(two))


def test_a_user_primitive_fills_the_cells_it_contains():
    scene = make_scene([ellipsoid_kind(), "cuboid"], [[5.0, 5, 5], [1, 1, 1]], [[1.0, 2, 0], [-12, -12, -12]])
    batch = type(scene)(**{name: t.expand(2, *t.shape) for name, t in vars(scene).items()})
    for resolution in (20, 32):
        inside = each_distance(scene, cell_centres(resolution).reshape(-1, 3))[:, 0] <= 0
        cells = voxels(batch, resolution)
        assert (cells[0] == cells[1]).all()
        ball = cells[0].bool() & (cell_centres(resolution)[..., 0] > -8)
        assert (ball.flatten() == inside).all()
    assert cells[0].sum() == inside.sum() + 8
