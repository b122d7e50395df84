from dataclasses import replace

import pytest
import torch
from geometry_helpers import make_scene, random_scene, with_leaves

import shapeprog as sp
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.losses import coverage, excess
from shapeprog.language import Draw, Loop, Program, unroll


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


def test_losses_lead_a_box_to_its_target():
    goal = make_scene(["cuboid"], [[3.0, 5, 4]], [[1.0, -2, 0]])
    scene, leaves = with_leaves(make_scene(["cuboid"], [[4.0, 4, 4]], [[0.0, 0, 0]]))
    target = goal.sample(500, torch.Generator().manual_seed(0))
    optimiser = torch.optim.Adam(leaves[:2], lr=0.1)
    for _ in range(60):
        optimiser.zero_grad()
        coverage(scene, target, surface=True).backward()
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


def test_second_derivatives_are_refused_instead_of_zero():
    scene = make_scene(["cuboid"], [[2.0, 2, 2]], [[0.0, 0, 0]])
    size = scene.size.clone().requires_grad_()
    scene = replace(scene, size=size)
    for loss in (coverage(scene, torch.full((5, 3), 4.0)), sp.sample(scene, 5).points.sum()):
        with pytest.raises(sp.ShapeProgError, match="no second derivatives"):
            torch.autograd.grad(loss, size, create_graph=True)
