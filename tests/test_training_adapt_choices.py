"""Gradients for choices: estimators agree with the exact gradient where programs can be counted."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from shapeprog.geometry.cells import iou, pack
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks
from shapeprog.models.decoding import decode
from shapeprog.models.designs import build_generator
from shapeprog.models.generator import Generator, live_blocks
from shapeprog.training import choices

SMALL = {"widths": (4, 4, 4), "squeeze": 4, "feature": 8}


def small() -> Generator:
    torch.manual_seed(1)
    return build_generator("swift", SMALL).eval().requires_grad_(False)


def target() -> Tensor:
    cells = torch.zeros(1, 32, 32, 32, dtype=torch.uint8)
    cells[8:20, 10:22, 6:26] = 1
    return cells


def seen(generator: Generator, cells: Tensor) -> Tensor:
    return generator.perceive(cells.float(), torch.zeros(cells.shape), None)[0]


def cost_of(code: Code, cells: Tensor) -> Tensor:
    return 1 - iou(draw_blocks(code)[..., 0, :, :], pack(cells)).float()


def last_bias(generator: Generator) -> Tensor:
    """The biases of the ids, through which gradients are compared."""
    return generator.name[2].bias.requires_grad_()  # type: ignore[operator, union-attr, index]


def exact(generator: Generator, cells: Tensor) -> Tensor:
    """The gradient of the expected cost of one block, over all legal blocks."""
    bias = last_bias(generator)
    other = choices.alternatives(generator, seen(generator, cells))
    costs = cost_of(Code(other.ids[0][:, None], other.values[0][:, None]), cells)
    (gradient,) = torch.autograd.grad((other.chance[0].exp() * costs).sum(), bias)
    return gradient


def test_alternatives_are_all_legal_blocks_with_their_probabilities():
    generator, cells = small(), target()
    other = choices.alternatives(generator, seen(generator, cells))
    assert len({tuple(block) for block in other.ids[0].tolist()}) == other.ids.shape[1] == 57
    assert float(other.chance.exp().sum()) == pytest.approx(1, abs=1e-5)
    ids, many = other.ids[0][:, None], other.ids.shape[1]
    nothing = torch.zeros(many, 1, 32, 32, dtype=torch.int32)
    code = Code(ids, other.values[0][:, None])
    told = generator.predict(cells.expand(many, -1, -1, -1), nothing, code, torch.ones(many, 1).bool())
    torch.testing.assert_close(told.log_probability(ids)[:, 0], other.chance[0], atol=1e-4, rtol=0)
    used = generator.vocabulary.used[other.ids[0]]
    torch.testing.assert_close(other.values[0] * used, told.values, atol=1e-3, rtol=0)


def test_the_likeliest_alternatives_are_told_among_themselves():
    generator, cells = small(), target()
    feature = seen(generator, cells)
    everything, few = choices.alternatives(generator, feature), choices.alternatives(generator, feature, 5)
    assert torch.equal(few.ids[0], everything.ids[0, :5])
    torch.testing.assert_close(few.chance, everything.chance[:, :5].log_softmax(-1))


def test_the_expected_cost_has_the_exact_gradient():
    generator, cells = small(), target()
    bias = last_bias(generator)
    other = choices.alternatives(generator, seen(generator, cells))
    code = decode(generator, cells, blocks=1).code
    drawn, owner = choices.in_place(code, torch.ones(1, 1, dtype=torch.bool), other)
    found = iou(drawn, pack(cells)[owner][:, None])
    loss = choices.expected(other.chance, 1 - found.float(), 1)
    (gradient,) = torch.autograd.grad(loss, bias)
    torch.testing.assert_close(gradient, exact(generator, cells))


@pytest.mark.parametrize("kind", ["nvil", "rloo"])
def test_the_mean_of_a_sampled_estimate_is_the_exact_gradient(kind: str):
    """Within five standard errors of it in every component, for the choice of one block."""
    generator, cells = small(), target()
    feature = seen(generator, cells)
    other = choices.alternatives(generator, feature)
    table = torch.rand(other.ids.shape[1])
    logits = (0.1 * other.chance[0].detach()).requires_grad_()  # so that every block is drawn now and then
    chances = logits.log_softmax(-1)
    (wanted,) = torch.autograd.grad((chances.exp() * table).sum(), logits, retain_graph=True)
    groups, many = 400, 32
    random = torch.Generator().manual_seed(0)
    drawn = torch.multinomial(chances.detach().exp().expand(groups, -1), many, replacement=True, generator=random)
    baseline = choices.Baseline(feature.shape[1]).eval()
    baseline.mean.fill_(0.4)
    torch.nn.init.normal_(baseline.layers[2].weight, std=0.1)
    estimates = []
    for picked in drawn:
        costs, chance = table[picked], chances[picked][:, None]
        if kind == "rloo":
            surprise = choices.leave_one_out(costs.reshape(4, -1)).reshape(-1, 1)
        else:
            live = torch.ones(many, 1, dtype=torch.bool)
            surprise, _ = baseline(feature.expand(many, -1), live, costs)
        (each,) = torch.autograd.grad(choices.surrogate(chance, surprise), logits, retain_graph=True)
        estimates.append(each)
    found = torch.stack(estimates)
    error = found.std(0) / math.sqrt(groups)
    assert bool(((found.mean(0) - wanted).abs() <= 5 * error + 1e-6).all())
    assert float(wanted.norm()) > 3 * float(error.norm()), "the test can tell"


def test_alternatives_in_place_are_drawn_as_whole_programs():
    generator = small()
    cells = target().expand(3, -1, -1, -1).clone()
    cells[1, :12] = 0
    random = torch.Generator().manual_seed(3)
    code = decode(generator, cells, blocks=4, choose="sample", random=random).code
    live = live_blocks(code.ids)
    feature = generator.predict(cells, torch.zeros(3, 4, 32, 32, dtype=torch.int32), code).feature
    other = choices.alternatives(generator, feature, 6)
    drawn, owner = choices.in_place(code, live, other)
    for choice in range(6):
        trial, rows = choices.replaced(code, live, other, choice)
        assert torch.equal(rows, owner)
        blocks = draw_blocks(trial)
        union = blocks[:, 0] | blocks[:, 1] | blocks[:, 2] | blocks[:, 3]
        assert torch.equal(union, drawn[:, choice])


def test_a_baseline_learns_what_to_expect():
    torch.manual_seed(0)
    baseline = choices.Baseline(4).train()
    feature, live = torch.randn(64, 4), torch.ones(32, 2, dtype=torch.bool)
    feature[1::2] = feature[::2]  # both blocks of a program see the same
    costs = 7 + feature[::2, 0]
    weights = list(baseline.parameters())
    for _ in range(300):
        surprise, miss = baseline(feature, live, costs)
        for weight, slope in zip(weights, torch.autograd.grad(miss, weights), strict=True):
            weight.data -= 0.05 * slope
    assert float(baseline.mean) == pytest.approx(float(costs.mean()), abs=0.01)
    assert float(surprise.square().mean()) < 0.1 * float(costs.var())
