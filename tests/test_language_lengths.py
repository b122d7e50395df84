"""With ``shortest``, a part that shrinks to nothing keeps a gradient; without, parts are differentiated as written."""

from __future__ import annotations

import pytest
import torch

import shapeprog as sp
from shapeprog.data.synthetic.furniture import furniture
from shapeprog.language.unroll import draw_blocks
from shapeprog.liang2022.losses import SHORTEST

BOARD = "vertical_board(at=(-8, -8, -1), size=(16, 16, 1))"


def fitted(code: sp.Code, target: torch.Tensor, steps: int, shortest: float = SHORTEST) -> sp.Code:
    """The loop of the README with Adam."""
    parameters = code.parameters.clone().requires_grad_()
    optimiser = torch.optim.Adam([parameters], lr=0.05)
    generator = torch.Generator().manual_seed(0)
    for _ in range(steps):
        sample = sp.sample(sp.unroll(code.having(parameters), shortest=shortest), 200, generator)
        optimiser.zero_grad()
        sp.chamfer(sample.points, target, weights=sample.weights).sum().backward()
        optimiser.step()
    return code.having(parameters.detach())


@pytest.mark.parametrize("source", ["random", "furniture"])
def test_programs_fitted_to_other_shapes_keep_all_parts(source: str) -> None:
    generator = torch.Generator().manual_seed(0)
    random = source == "random"
    programs = [sp.random_program(generator, blocks=4, copies=2) if random else furniture(i) for i in range(24)]
    code = sp.encode(programs)
    before = sp.unroll(code)
    target = sp.sample(before, 200, torch.Generator().manual_seed(1)).points.roll(1, 0)
    after = sp.unroll(fitted(code, target, 100))
    assert torch.equal(before.mask, after.mask)


def test_a_board_of_one_cell_fitted_to_a_sheet_is_kept() -> None:
    code = sp.encode(sp.parse(BOARD))
    target = torch.rand(400, 3, generator=torch.Generator().manual_seed(0)) * 16 - 8
    target[:, 2] = -0.5
    with pytest.raises(sp.ShapeProgError, match="no surface"):
        fitted(code, target, 100, shortest=0.0)
    assert sp.unroll(fitted(code, target, 100)).mask.all()


def test_a_short_length_is_drawn_and_grows_under_any_gradient() -> None:
    code = sp.encode(sp.parse(BOARD.replace("16, 1)", "16, -3)")))
    parameters = code.parameters.clone().requires_grad_()
    for sign in (1, -1):
        scene = sp.unroll(code.having(parameters), shortest=SHORTEST)
        assert scene.size[0, :3].tolist() == pytest.approx([8, 8, SHORTEST / 2])
        (gradient,) = torch.autograd.grad(sign * scene.size.sum(), parameters)
        assert gradient[0, 0, 3:6].tolist() == [sign / 2, sign / 2, -1 / 2]


def test_what_is_drawn_without_gradient_is_as_it_was() -> None:
    generator = torch.Generator().manual_seed(5)
    code = sp.encode([sp.random_program(generator, whole=True) for _ in range(8)])
    shrunk = code.having(code.parameters - 4)
    hard, recorded = draw_blocks(shrunk), shrunk.having(shrunk.parameters.clone().requires_grad_())
    assert torch.equal(draw_blocks(recorded), hard)
    plain = sp.unroll(shrunk)
    assert not plain.mask.all()
    with torch.no_grad():
        assert torch.equal(sp.unroll(recorded, shortest=SHORTEST).mask, plain.mask)
    kept = sp.unroll(recorded, shortest=SHORTEST)
    for name in ("size", "centre", "rotation"):
        long = plain.mask & ((kept.size == 0) | (plain.size >= SHORTEST)).all(-1)
        torch.testing.assert_close(getattr(kept, name)[long], getattr(plain, name)[long], rtol=0, atol=0)


def test_by_default_thin_parts_are_drawn_and_differentiated_as_written() -> None:
    code = sp.encode(sp.parse(BOARD.replace("16, 1)", "16, 0.05)")), dtype=torch.float64)
    parameters = code.parameters.clone().requires_grad_()
    scene = sp.unroll(code.having(parameters))
    assert torch.equal(scene.size.detach(), sp.unroll(code).size)
    points = sp.sample(sp.unroll(code), 500, torch.Generator().manual_seed(0)).points + 0.3

    def loss(parameters: torch.Tensor) -> torch.Tensor:
        return sp.coverage(sp.unroll(code.having(parameters)), points, surface=True)

    assert torch.autograd.gradcheck(loss, parameters, eps=1e-6, atol=1e-5)
