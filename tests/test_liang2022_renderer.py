"""The reference renderer of the paper, and the fast core held to it in values and gradients."""

from __future__ import annotations

import math
import re

import pytest
import torch
from torch import Tensor

from shapeprog.errors import ShapeProgError
from shapeprog.geometry import losses
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.parser import parse
from shapeprog.language.tensors import Code, encode
from shapeprog.language.unroll import unroll
from shapeprog.liang2022 import renderer
from shapeprog.liang2022.renderer import Primitive

pytestmark = pytest.mark.paper

DRAWING, LINE, TRANSLATE, ROTATE = range(1, 19), 17, 19, 20
SEEDS = range(2)
DISCRETE = {10: 5, TRANSLATE: 0, ROTATE: 0}
"""Slot of the whole number of a statement, beside the step of a rotation."""


def program(seed: int) -> tuple[Tensor, Tensor]:
    """All 18 drawing statements, plain and in one or two translation loops, and the two that rotate."""
    random = torch.Generator().manual_seed(seed)
    chains = [[*[TRANSLATE] * int(torch.randint(3, (), generator=random)), number] for number in DRAWING]
    chains += [[ROTATE, 10], [ROTATE, LINE], [TRANSLATE, LINE], [TRANSLATE, 4], [TRANSLATE, TRANSLATE, 15]]
    ids = torch.tensor([chain + [0] * (3 - len(chain)) for chain in chains])
    values = torch.rand(*ids.shape, 7, generator=random, dtype=torch.float64)
    position, length = 16 * values - 8, 0.5 + 4 * values
    parameters = torch.cat([position[..., :3], length[..., 3:]], -1)
    parameters[ids == LINE, 3:6] = position[ids == LINE, 3:6]
    parameters[ids == 15, 6] = position[ids == 15, 6] / 3
    for number, slot in DISCRETE.items():
        parameters[ids == number, slot] = torch.randint(2, 6, ((ids == number).sum(),), generator=random).double()
    parameters[ids == ROTATE, 1] = 1
    return ids, parameters.requires_grad_()


def points(count: int, seed: int = 9) -> Tensor:
    return 24 * torch.rand(count, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64) - 12


def agree(fast: Tensor, slow: Tensor, parameters: Tensor, tolerance: float = 1e-9) -> None:
    """Values agree, and so does the gradient of a random combination of them by the parameters."""
    torch.testing.assert_close(fast, slow, atol=tolerance, rtol=tolerance)
    slope = torch.randn(fast.shape, generator=torch.Generator().manual_seed(7), dtype=fast.dtype)
    gradients = [torch.autograd.grad(item, parameters, slope, retain_graph=True)[0] for item in (fast, slow)]
    assert gradients[1].abs().sum() > 0
    torch.testing.assert_close(*gradients, atol=tolerance, rtol=tolerance)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_unrolled_primitive_of_the_core_is_that_of_the_reference(seed):
    ids, parameters = program(seed)
    primitives, scene = renderer.unroll(ids, parameters), unroll(Code(ids, parameters))
    assert len(primitives) == int(scene.mask.sum()) > 30
    where = points(200)
    slow = torch.stack([renderer.distance(item, where) for item in primitives], -1)
    agree(each_distance(scene, where).clamp(min=1e-12), slow, parameters)


@pytest.mark.parametrize("seed", SEEDS)
def test_coverage_of_the_core_is_that_of_the_reference(seed):
    ids, parameters = program(seed)
    where = points(500)
    slow = renderer.coverage(renderer.unroll(ids, parameters), where)
    agree(losses.coverage(unroll(Code(ids, parameters)), where), slow, parameters)


@pytest.mark.parametrize("seed", SEEDS)
def test_sampled_points_of_the_core_and_their_chamfer_are_those_of_the_reference(seed):
    ids, parameters = program(seed)
    primitives, target = renderer.unroll(ids, parameters), points(300)
    drawn = sample_surface(unroll(Code(ids, parameters)), 200, torch.Generator().manual_seed(seed))
    pieces, order, hidden = [], [], 0
    for index, primitive in enumerate(primitives):
        mine = (drawn.slot == index).nonzero()[:, 0]
        axes = (primitive.transform(torch.eye(3).double()) - primitive.centre).detach()
        unit = torch.linalg.solve(axes, (drawn.points[mine] - primitive.centre).detach(), left=False)
        hidden += int(renderer.hidden(primitives, index, unit).sum())
        pieces.append(primitive.transform(unit))
        order.append(mine)
    assert hidden <= 1, "within a thousandth of a cell below the surface of another"
    again = torch.cat(pieces)[torch.cat(order).argsort()]
    agree(drawn.points, again, parameters)
    agree(losses.chamfer(drawn.points, target), renderer.chamfer(again, target), parameters)


def test_samples_of_the_core_and_of_the_reference_have_the_same_means_and_gradients_of_means():
    ids, parameters = program(0)
    random, scene = torch.Generator().manual_seed(0), unroll(Code(ids, parameters))
    fast = sample_surface(scene, 30000, random)
    slow, weights = renderer.sample(renderer.unroll(ids, parameters), 40000, random)
    assert scene.distance(slow).abs().max() < 20 * renderer.SKIN
    means = [
        (item * weight[:, None]).sum(0) / weight.sum()
        for item, weight in ((fast.points, fast.weights), (slow, weights))
    ]
    torch.testing.assert_close(*means, atol=0.25, rtol=0)
    one, two = (torch.autograd.grad(mean.sum(), parameters)[0] for mean in means)
    assert torch.nn.functional.cosine_similarity(one.flatten(), two.flatten(), 0) > 0.995


@pytest.mark.parametrize("ids", [[0, 0, 0], [0, 1, 0], [1, 0, 2], [1, 2, 0], [19, 19, 19], [20, 1, 0], [19, 21, 1]])
def test_blocks_outside_the_grammar_draw_nothing(ids):
    assert renderer.unroll(torch.tensor([ids]), torch.full((1, 3, 7), 2.0)) == []


def test_statements_that_are_not_of_the_paper_are_refused():
    code = encode(parse("width, depth, height = 4, 4, 4\nseat()\n"))
    with pytest.raises(ShapeProgError, match=r"is not one of the paper, whose last is 21\n.*statements='paper'"):
        renderer.unroll(code.ids, code.parameters)


def test_of_all_blocks_the_core_draws_those_of_the_reference_and_further_rotations():
    """Published are [k], [19, k], [19, 19, k], [20, 10] and [20, 17]; the core draws any loops around a statement."""
    ids = torch.cartesian_prod(*[torch.arange(22)] * 3)
    parameters = torch.full((*ids.shape, 7), 2.0, dtype=torch.float64)
    parameters[..., 1:3] = torch.rand(*ids.shape, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    heights = 100.0 * torch.arange(len(ids), dtype=torch.float64)[:, None]  # tell the blocks of the reference apart
    parameters[..., 0] = torch.where(ids < TRANSLATE, heights, 2.0)
    parameters[..., 3] = torch.where(ids == LINE, heights, 2.0)
    scene, centres = (
        unroll(Code(ids, parameters)),
        torch.stack([each.centre for each in renderer.unroll(ids, parameters)]),
    )

    letters = ["d"] * 22  # a statement, of which two rotate as published; loops; padding or an end
    letters[10] = letters[17] = "p"
    letters[0], letters[19], letters[20], letters[21] = "eTRe"
    words = ["".join(letters[number] for number in row) for row in ids.tolist()]
    copies = torch.tensor([2 ** sum(letter in "TR" for letter in word) for word in words])
    drawn = torch.tensor([re.fullmatch("[TR]*[pd]e*", word) is not None for word in words])
    published = torch.tensor([re.fullmatch("(T*[pd]|Rp)e*", word) is not None for word in words])
    of_core, of_reference = scene.block, (centres[:, 0] / 100).long()
    assert torch.equal(of_core.bincount(minlength=len(ids)), copies * drawn)
    assert torch.equal(of_reference.bincount(minlength=len(ids)), copies * published)
    torch.testing.assert_close(scene.centre[published[of_core]], centres)
    further = {word.strip("e").replace("p", "d") for word, more in zip(words, drawn & ~published, strict=True) if more}
    assert (int((drawn & ~published).sum()), further) == (86, {"Rd", "TRd", "RTd", "RRd"})


def test_loops_without_copies_and_negative_extents_draw_nothing():
    block = torch.tensor([[0, 1, 1, 1, 0, 0, 0], [0, 0, 0, 1, 1, 1, 0]]).float()
    assert renderer.unroll(torch.tensor([[TRANSLATE, 1]]), block[None]) == []
    assert renderer.unroll(torch.tensor([[1]]), -torch.ones(1, 1, 7)) == []


def cuboid(*size: float, kind: str = "cuboid") -> Primitive:
    return Primitive(kind, torch.tensor(size, dtype=torch.float64), torch.zeros(3).double(), torch.eye(3).double())


@pytest.mark.parametrize(
    ("primitive", "point", "expected"),
    [
        (cuboid(0.5, 0.5, 0.5), (0.1, 0.2, 0.3), 0),
        (cuboid(0.5, 0.5, 0.5), (1.5, 0, 0), 1),
        (cuboid(0.5, 0.5, 0.5), (3.5, 4.5, 12.5), 13),
        (cuboid(1, 2, kind="cylinder"), (0.5, 1, 1), 0),
        (cuboid(1, 2, kind="cylinder"), (3, 0, 0), 2),
        (cuboid(1, 2, kind="cylinder"), (0, 3, 4), 3),
        (cuboid(1, 2, kind="cylinder"), (5, 0, 5), 5),
        (cuboid(1, 1, 1, 2, kind="back"), (1, 1.9, 0), 0),
        (cuboid(1, 1, 1, 2, kind="back"), (2, 3, 1), math.sqrt(2)),
        (cuboid(1, 1, 1, 2, kind="back"), (-1, 1, 0), math.sqrt(0.5)),
    ],
)
def test_distances_have_their_known_values(primitive, point, expected):
    result = renderer.distance(primitive, torch.tensor([point], dtype=torch.float64))
    torch.testing.assert_close(result, torch.tensor([expected], dtype=torch.float64))


def test_the_distance_to_a_rotated_cuboid_and_to_a_union_have_their_hand_computed_values():
    """A long bar is turned from depth to side by 30 degrees, (0, 2, 0) to (0, 3^.5, 1), and moved up by one."""
    bar = renderer.turned(cuboid(0.5, 2, 0.25), torch.zeros(3).double(), math.pi / 6)
    bar = bar._replace(centre=torch.tensor([1.0, 0, 0]).double())
    end = torch.tensor([1, math.sqrt(3), 1]).double()
    along, across = torch.tensor([[0, math.sqrt(3) / 2, 1 / 2], [0, -1 / 2, math.sqrt(3) / 2]]).double()
    where = torch.stack(
        [end, end + 3 * along, end + across, end + 3 * along + 4.25 * across, end + 2 * torch.eye(3)[0]]
    )
    torch.testing.assert_close(renderer.distance(bar, where), torch.tensor([0, 3, 0.75, 5, 1.5]).double())
    cube = cuboid(1, 1, 1)._replace(centre=torch.tensor([1.0, 0, 20]).double())
    both = renderer.union_distance([bar, cube], torch.cat([where, torch.tensor([[1.0, 0, 18], [4, 5, 20]]).double()]))
    torch.testing.assert_close(both, torch.tensor([0, 3, 0.75, 5, 1.5, 1, math.hypot(2, 4)]).double())
    assert renderer.union_distance([], where).isinf().all()


def test_nothing_has_no_surface_to_sample():
    with pytest.raises(ShapeProgError, match="has no surface to sample"):
        renderer.sample([], 10)


def test_the_gradient_of_the_distance_to_a_cylinder_is_finite_on_its_axis():
    where = torch.tensor([[0.0, 0, 0], [3, 0, 0]], requires_grad=True)
    (slope,) = torch.autograd.grad(renderer.cylinder_distance(where, torch.tensor([1.0, 2.0])).sum(), where)
    assert slope.tolist() == [[0, 0, 0], [1, 0, 0]]


def test_sampled_points_lie_on_their_cylinder_in_proportion_to_area():
    result, _ = renderer.sample([cuboid(2, 3, kind="cylinder")], 4000, torch.Generator().manual_seed(0))
    across = result[:, 1:].norm(dim=-1)
    lateral = (across - 3).abs() < 1e-9
    assert (lateral | ((result[:, 0].abs() - 2).abs() < 1e-9)).all()
    assert float(lateral.double().mean()) == pytest.approx(4 / (4 + 3), abs=0.03)
    assert float((across[~lateral] ** 2).mean()) == pytest.approx(9 / 2, abs=0.2)


def test_weights_give_the_gradient_of_a_mean_over_the_surface():
    """The mean of the squared height on a cube: two faces at 1, four at 1/3 item; growing its height moves both."""
    size = torch.ones(3, dtype=torch.float64, requires_grad=True)
    result, weights = renderer.sample([cuboid(1, 1, 1)._replace(size=size)], 40000, torch.Generator().manual_seed(0))
    (slope,) = torch.autograd.grad((weights * result[:, 0] ** 2).sum() / weights.sum(), size)
    half = torch.ones(3, dtype=torch.float64, requires_grad=True)
    up, depth, side = half
    ends, sides = depth * side, up * (depth + side)
    (exact,) = torch.autograd.grad((ends * up**2 + sides * up**2 / 3) / (ends + sides), half)
    torch.testing.assert_close(slope, exact, atol=0.02, rtol=0)


def test_points_inside_another_primitive_and_between_touching_ones_are_dropped():
    boxes = [cuboid(1, 1, 1), cuboid(1, 1, 1)._replace(centre=torch.tensor([2.0, 0, 0]).double()), cuboid(3, 0.5, 0.5)]
    result, _ = renderer.sample(boxes, 2000, torch.Generator().manual_seed(0))
    seam = ((result[:, 0] - 1).abs() < 1e-6) & (result[:, 1:].abs() < 1 - 1e-3).all(-1)
    inside = ((result[:, 0] - 1).abs() < 2 - 1e-6) & (result[:, 1:].abs() < 1 - 1e-6).all(-1)
    assert not (seam | inside).any()
    assert 500 < len(result) < 2000


def test_chamfer_is_a_mean_over_points_of_both_clouds():
    one, two = torch.tensor([[0.0, 0, 0], [3, 0, 0]]), torch.tensor([[0.0, 0, 1]])
    assert float(renderer.chamfer(one, two)) == (1 + 10) / 2 + 1
    assert float(renderer.chamfer(one, two, torch.tensor([3.0, 1.0]))) == (3 + 10) / 4 + 1
