"""Losses of adaptation and gradient estimators: hand-computed values, declarations, errors, exact expectations."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest
import torch
from torch import Tensor

from shapeprog.errors import DeclarationError, ShapeProgError
from shapeprog.language.parser import parse
from shapeprog.language.unroll import unroll
from shapeprog.liang2022 import losses
from shapeprog.liang2022.losses import LOSSES, NEURAL, Comparison, Values, compute, loss, parse_losses

pytestmark = pytest.mark.paper

CUBE = "leg(at=(-8, -8, -8), size=(16, 16, 16))\n"
HALF_CUBE = "leg(at=(-8, -8, -8), size=(16, 16, 8))\n"


def comparison(text: str, points: list[list[float]], target: str = HALF_CUBE) -> Comparison:
    scene, cells = unroll([parse(text)]), unroll([parse(target)]).voxels()
    return Comparison(scene, torch.tensor([points]).float(), cells, 4000, torch.Generator().manual_seed(0))


def values(compared: Comparison) -> dict[str, float]:
    return {name: float(value) for name, value in compute(compared, dict.fromkeys(LOSSES, 1.0)).items()}


def test_losses_of_a_cube_have_their_hand_computed_values():
    result = values(comparison(CUBE, [[0, 0, 0], [0, 0, 10], [0, 11, 12]]))
    assert result["coverage"] == pytest.approx((0 + 2 + 5) / 3)
    both = values(comparison(CUBE, [[0, 0, 0]]))  # a mean of 8^2 + 2 * 8^2 / 3 over all faces; and back to the nearest
    assert both["chamfer"] == pytest.approx(64 * 5 / 3 + 64, abs=2)


def test_losses_of_cells_are_small_for_the_target_and_weights_multiply():
    same, other = (values(comparison(text, [[0, 0, 0]])) for text in (HALF_CUBE, CUBE))
    assert same["soft_iou"] < 0.15 < 0.42 < other["soft_iou"] < 0.58
    compared = comparison(CUBE, [[0, 0, 0]])  # samples are drawn once
    one, two = compute(compared, {"chamfer": 1.0}), compute(compared, {"chamfer": 2.5, NEURAL: 1.0})
    assert list(two) == ["chamfer"] and torch.equal(two["chamfer"], 2.5 * one["chamfer"])  # noqa: PT018


def test_a_users_function_is_a_loss_and_faulty_ones_are_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("shapeprog.liang2022.losses.LOSSES", dict(LOSSES))

    @loss("reach")
    def reach(compared: Comparison) -> Values:
        return compared.scene.centre.norm(dim=-1).sum(-1)

    flat = loss("flat")(lambda compared: compared.points.sum())
    weights = parse_losses("chamfer, reach=0.5")
    assert weights == {"chamfer": 1, "reach": 0.5}
    moved = comparison("leg(at=(2, 3, 0), size=(2, 2, 0))\n", [[0, 0, 0]])
    assert float(compute(moved, weights)["reach"]) == 0.5 * 5
    with pytest.raises(ShapeProgError, match=r"'flat' returns values of shape \(\)"):
        compute(moved, {"flat": 1.0})
    for name in ("chamfer", "reach", NEURAL, "a=b"):
        with pytest.raises(DeclarationError, match=r"declared twice|cannot be the name"):
            loss(name)(flat)


def test_a_loss_that_is_declared_again_by_the_same_cell_replaces_itself(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("shapeprog.liang2022.losses.LOSSES", dict(LOSSES))
    cell = """@loss("mine")\ndef mine(comparison):\n    return comparison.scene.centre.norm(dim=-1).sum(-1)"""
    notebook = {"loss": loss, "__name__": "__main__"}
    for _ in range(2):
        exec(cell, notebook)
    assert losses.LOSSES["mine"] is notebook["mine"]
    with pytest.raises(DeclarationError, match="'mine' is declared twice"):
        exec(cell, {"loss": loss, "__name__": "another"})


@pytest.mark.parametrize(("error", "told"), [(AssertionError(), "AssertionError"), (KeyError("a"), "KeyError: 'a'")])
def test_whatever_a_users_loss_raises_is_told(error: Exception, told: str, monkeypatch: pytest.MonkeyPatch):
    def faulty(compared: Comparison) -> Values:
        raise error

    monkeypatch.setitem(LOSSES, "faulty", faulty)
    with pytest.raises(ShapeProgError) as caught:
        compute(comparison(CUBE, [[0, 0, 0]]), {"faulty": 1.0})
    assert caught.value.message == f"the loss 'faulty' raised {told}"


def test_the_example_of_the_manual_costs_nothing_inside(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("shapeprog.liang2022.losses.LOSSES", dict(LOSSES))
    manual = Path(losses.__file__).with_name("README.md").read_text(encoding="utf-8")
    exec(manual.partition("```python\n")[2].partition("```")[0], {})
    inside, outside = (comparison(CUBE, [[0, 0, 0], [7, 0, 0], [0, 0, end]]) for end in (8, 10))
    assert inside.scene.distance(inside.points).tolist() == [[-8, -1, 0]]
    assert float(compute(inside, {"huber": 1.0})["huber"]) == 0
    assert float(compute(outside, {"huber": 1.0})["huber"]) == pytest.approx((0 + 0 + 1.5) / 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("chamfre=1", "unknown loss 'chamfre'\n  hint: did you mean 'chamfer'?"),
        ("", "unknown loss ''\n  hint: choose from chamfer, coverage"),
        ("chamfer=1,chamfer=2", "the loss 'chamfer' is given twice"),
        ("coverage=-1", "the weight of 'coverage' is '-1'"),
    ],
)
def test_the_parser_names_the_fault_and_the_nearest_loss(text: str, message: str):
    with pytest.raises(ShapeProgError) as caught:
        parse_losses(text)
    assert str(caught.value).startswith(message)


def test_a_loss_without_a_gradient_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("shapeprog.liang2022.losses.LOSSES", dict(LOSSES))
    loss("count")(lambda compared: compared.scene.mask.sum(-1).float())
    compared = comparison(CUBE, [[0, 0, 0]])
    compared.scene.centre.requires_grad_(True)
    with pytest.raises(ShapeProgError, match="the loss 'count' has no gradient"):
        compute(compared, {"count": 1.0})


COSTS = torch.tensor([3.0, -1.0, 0.5, 2.0], dtype=torch.float64)


def expected(samples: int, estimate: object) -> tuple[Tensor, Tensor]:
    """The expected estimate over all draws of so many categories, and the gradient of the expected cost."""
    logits = torch.tensor([0.3, -0.2, 1.0, 0.1], dtype=torch.float64, requires_grad=True)
    log_probs, total = logits.log_softmax(0), torch.zeros(4, dtype=torch.float64)
    for draw in itertools.product(range(4), repeat=samples):
        chosen = log_probs[list(draw)]
        (gradient,) = torch.autograd.grad(estimate(chosen, COSTS[list(draw)]), logits, retain_graph=True)  # type: ignore[operator]
        total += chosen.detach().sum().exp() * gradient
    return total, torch.autograd.grad((log_probs.exp() * COSTS).sum(), logits)[0]


@pytest.mark.parametrize("samples", [2, 3])
def test_leave_one_out_is_unbiased(samples: int):
    def estimate(log_probs: Tensor, costs: Tensor) -> Tensor:
        advantage = losses.leave_one_out(costs[:, None])[..., None]
        return losses.reinforce_loss(log_probs[:, None, None], advantage)

    torch.testing.assert_close(*expected(samples, estimate), atol=1e-12, rtol=0)
    assert losses.leave_one_out(torch.tensor([[1.0], [4.0]])).tolist() == [[-3], [3]]


@pytest.mark.parametrize("variance", [0.5, 9.0])
def test_nvil_is_unbiased_up_to_its_scale(variance: float):
    baseline = losses.NvilBaseline(3).double().eval()
    torch.nn.init.normal_(baseline.layers[2].weight)
    baseline.mean.fill_(0.7), baseline.variance.fill_(variance)

    def estimate(log_probs: Tensor, costs: Tensor) -> Tensor:
        advantage, _ = baseline(torch.ones(1, 3), torch.tensor([[False, True]]), costs)
        return losses.reinforce_loss(log_probs[:, None], advantage[:, 1:])

    result, exact = expected(1, estimate)
    torch.testing.assert_close(result * math.sqrt(max(variance, 1)), exact, atol=1e-12, rtol=0)


def test_the_baseline_learns_the_costs():
    baseline, feature, live = losses.NvilBaseline(4), torch.randn(64, 4), torch.ones(32, 2, dtype=torch.bool)
    feature[1::2] = feature[::2]
    costs, weights = 7 + feature[::2, 0], list(baseline.parameters())
    for _ in range(300):
        advantage, miss = baseline(feature, live, costs)
        for weight, slope in zip(weights, torch.autograd.grad(miss, weights), strict=True):
            weight.data -= 0.05 * slope
    assert float(baseline.mean) == pytest.approx(float(costs.mean()), abs=0.01)
    assert float(advantage.square().mean()) < 0.1 * float(costs.var())
