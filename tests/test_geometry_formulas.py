"""Code generated from formulas: the same values and derivatives as torch."""

from __future__ import annotations

import pytest
import torch

from shapeprog.geometry import formulas as f

FORMULAS = {
    "arithmetic": lambda x, y: (x + 2 * y - 3 / (x + 4)) * (1 - y) / (y + 5) + (-x) ** 2,
    "extremes": lambda x, y: f.minimum(x, y) * 2 + f.maximum(x * y, y) + f.positive(x) + f.at_least(y, 0.3),
    "limits": lambda x, y: f.clamp(x, -0.5, 0.5) * y + abs(y) * abs(x),
    "branches": lambda x, y: f.where((x > 0) & (y <= 0.5) | (x < -0.7), x * y, f.where(y >= 0, y / 2, -x)),
    "trigonometry": lambda x, y: f.sin(x) * f.cos(y) + f.atan2(y, x + 2),
    "roots": lambda x, y: f.root(x**2 + y**2) + f.meet(x, y - 0.2),
    "constants": lambda x, y: f.constant(x) * y + x,
}
POINTS = [*torch.rand(40, 2, generator=torch.Generator().manual_seed(1)).mul(3).sub(1.5).tolist(), [0, 0], [0.5, 0.5]]


@pytest.mark.parametrize("name", FORMULAS)
def test_generated_code_has_the_values_and_derivatives_of_torch(name):
    formula, inputs = FORMULAS[name], [f.Node("x"), f.Node("y")]
    graph = formula(*inputs)
    compute = f.generated("compute", "x, y", "return {}, {}, {}", [graph, *f.gradient([graph], [1.0], inputs)])
    for point in POINTS:
        leaves = [torch.tensor(float(number), dtype=torch.float64, requires_grad=True) for number in point]
        value = formula(*leaves)
        expected = [value, *torch.autograd.grad(value, leaves, allow_unused=True)]
        assert compute(*map(float, point)) == pytest.approx([0.0 if each is None else each.item() for each in expected])
