"""The published generator: an independent functional reference, and what its default configuration cures."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from shapeprog.data.random import random_program
from shapeprog.geometry.cells import preceding, unpack
from shapeprog.language import Code, encode, unroll
from shapeprog.language.unroll import draw_blocks
from shapeprog.models.decoding import decode
from shapeprog.models.designs import build_generator
from shapeprog.models.generator import Generator, Said, live_blocks
from shapeprog.models.tian2019 import PUBLISHED, Tian2019
from shapeprog.models.vocabulary import Vocabulary

BLOCKS = 2
STRIDES = (1, 2, 1, 2, 1, 2, 1, 1)
Weights = dict[str, Tensor]


def network(**settings: object) -> Generator:
    made = build_generator("tian2019", settings)
    for name, value in made.named_parameters():
        if "BN" in name:
            torch.nn.init.uniform_(value, 0.5, 1.5)
    return made.eval()


def published() -> Tian2019:
    made = Tian2019(PUBLISHED, Vocabulary.current())
    made.load_state_dict(network(statistics="batch").state_dict())
    return made.eval()


@pytest.fixture
def shapes() -> tuple[Tensor, Tensor, Code]:
    """Targets, canvases and programs of one to three blocks."""
    random = torch.Generator().manual_seed(0)
    programs = [random_program(random, blocks=1 + n % 2, published=True, whole=True, copies=3) for n in range(3)]
    code = encode(programs, blocks=BLOCKS)
    drawn = draw_blocks(code)
    canvases = preceding(drawn)
    return unpack(canvases[:, -1] | drawn[:, -1]), canvases, code


# ---------------------------------------------------------------- the reference, straight from the description


def features(w: Weights, target: Tensor, canvas: Tensor) -> Tensor:
    x = torch.stack([target, canvas], 1).double()
    for n, stride in enumerate(STRIDES, 1):
        kernel = w[f"shape_feat.conv{n}.weight"]
        x = F.conv3d(x, kernel, w[f"shape_feat.conv{n}.bias"], stride, kernel.shape[-1] // 2)
        x = F.batch_norm(x, None, None, w[f"shape_feat.BN{n}.weight"], w[f"shape_feat.BN{n}.bias"], training=True)
        x = F.relu(x)
    pooled = F.avg_pool3d(x, 4).flatten(1)
    return F.relu(F.linear(pooled, w["shape_feat.fc.weight"], w["shape_feat.fc.bias"]))


def lstm(w: Weights, name: str, x: Tensor, state: tuple[Tensor, Tensor] | None) -> tuple[Tensor, Tensor]:
    hidden, cell = state or (torch.zeros_like(x), torch.zeros_like(x))
    gates = x @ w[f"{name}.weight_ih_l0"].T + hidden @ w[f"{name}.weight_hh_l0"].T
    enter, forget, fresh, leave = gates.chunk(4, -1)
    cell = forget.sigmoid() * cell + enter.sigmoid() * fresh.tanh()
    return leave.sigmoid() * cell.tanh(), cell


def step(w: Weights, x: Tensor, state: tuple[Tensor, Tensor] | None) -> tuple[Tensor, Tensor, tuple[Tensor, Tensor]]:
    state = lstm(w, "inner_net.core", x, state)

    def layer(name: str, value: Tensor) -> Tensor:
        return F.linear(value, w[f"inner_net.{name}.weight"], w[f"inner_net.{name}.bias"])

    logits = layer("logit2", F.relu(layer("logit1", state[0]))).log_softmax(-1)
    rows = layer("regress2", torch.cat([logits.exp(), F.relu(layer("regress1", state[0]))], -1))
    return logits, rows.reshape(len(x), -1, 7), state


def reference(w: Weights, target: Tensor, canvases: Tensor | None, ids: Tensor | None) -> tuple[Tensor, ...]:
    """Ids, log-probabilities and parameters of all blocks; told canvases and ids, or decoding by arg-max."""
    cells, blocks = torch.zeros_like(target), []
    outer: tuple[Tensor, Tensor] | None = None
    for k in range(BLOCKS):
        seen = cells if canvases is None else unpack(canvases[:, k])
        outer = lstm(w, "core", features(w, target, seen), outer)
        x, inner, said = F.relu(outer[0]), None, []
        for j in range(3):
            logits, rows, inner = step(w, x, inner)
            chosen = logits.argmax(-1) if ids is None else ids[:, k, j]
            said.append((chosen, logits, rows[torch.arange(len(chosen)), chosen]))
            x = w["inner_net.pgm_embed.weight"][chosen]
        blocks.append([torch.stack(each, 1) for each in zip(*said, strict=True)])
        cells = cells | unroll(Code(blocks[-1][0][:, None], blocks[-1][2][:, None].round())).voxels()
    return tuple(torch.stack(each, 1) for each in zip(*blocks, strict=True))


# ---------------------------------------------------------------- tests


def test_layers_are_those_published() -> None:
    made = published()
    assert sum(each.numel() for each in made.parameters()) == 1_417_404
    keys = [
        f"shape_feat.{kind}{n}.{what}" for n in range(1, 9) for kind in ("conv", "BN") for what in ("weight", "bias")
    ]
    keys += ["shape_feat.fc.weight", "shape_feat.fc.bias", "core.weight_ih_l0", "core.weight_hh_l0"]
    keys += [f"inner_net.{name}" for name in ("pgm_embed.weight", "core.weight_ih_l0", "core.weight_hh_l0")]
    keys += [
        f"inner_net.{head}{n}.{what}" for head in ("logit", "regress") for n in (1, 2) for what in ("weight", "bias")
    ]
    assert set(made.state_dict()) == set(keys)


@torch.no_grad()
def test_told_ids_and_canvases_it_says_and_loses_what_the_description_says(shapes: tuple[Tensor, Tensor, Code]) -> None:
    target, canvases, code = shapes
    made = published().double()
    _, logits, values = reference(made.state_dict(), target, canvases, code.ids)
    found = made.predict(target, canvases, code)
    assert found.live.all()
    torch.testing.assert_close(found.logits, logits.flatten(0, 1), rtol=1e-9, atol=1e-9)
    torch.testing.assert_close(found.parameters, values, rtol=1e-9, atol=1e-9)
    steps = torch.where(code.ids > 0, 1.0, 0.1)
    surprise = -logits.gather(-1, code.ids[..., None])[..., 0]
    used = Vocabulary.current().used[code.ids]
    slots = torch.where(used, 1.0, 0.1)
    off = 0.5 * (values - code.parameters * used) ** 2
    losses = made.losses(found, code)
    torch.testing.assert_close(losses["ids"], (surprise * steps).sum() / steps.sum())
    torch.testing.assert_close(losses["parameters"], (off * slots).sum() / slots.sum())
    single = made.float().predict(target, canvases, code)
    torch.testing.assert_close(single.logits.double(), found.logits, rtol=1e-3, atol=1e-3)


def taught(made: Tian2019, target: Tensor, canvases: Tensor, code: Code) -> None:
    """Teach the heads a program, so that it draws something."""
    with torch.no_grad():
        feature = made.perceive_all(target, canvases, torch.ones(code.ids.shape[:2], dtype=torch.bool))
    optimiser = torch.optim.Adam(made.inner_net.parameters(), 0.02)
    ids, values = code.ids.flatten(0, 1), code.parameters.flatten(0, 1)
    for _ in range(120):
        loss, state = torch.zeros(()), None
        for j in range(3):
            logits, heads, state = made.step(feature, Said(ids[:, j - 1], values[:, j - 1]) if j else None, j, state)
            off = made.parameter_loss(heads, ids[:, j], values[:, j]).mean()
            loss = loss + F.nll_loss(logits, ids[:, j]) + off
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()


def test_by_arg_max_it_writes_what_the_description_says(shapes: tuple[Tensor, Tensor, Code]) -> None:
    target, canvases, code = shapes
    made = published().double()
    taught(made, target, canvases, code)
    with torch.no_grad():
        ids, _, values = reference(made.state_dict(), target, None, None)
        found = decode(made, target, blocks=BLOCKS)
    assert (found.code.ids == ids).all()
    assert len(ids.unique()) > 1
    assert unpack(found.canvases[:, -1]).any()
    torch.testing.assert_close(found.code.parameters, values.float(), rtol=1e-5, atol=1e-5)


@torch.no_grad()
def test_a_prediction_does_not_depend_on_the_batch(shapes: tuple[Tensor, Tensor, Code]) -> None:
    target, canvases, code = shapes
    made = network().train()
    made.predict(target, canvases, code)
    made.eval()
    together = made.predict(target, canvases, code)
    alone = made.predict(target[1:2], canvases[1:2], code[1:2])
    torch.testing.assert_close(together.parameters[1:2], alone.parameters, rtol=1e-4, atol=1e-5)
    assert (together.live == live_blocks(code.ids)).all()
    one, all_at_once = decode(made, target[1:2], blocks=2), decode(made, target, blocks=2)
    torch.testing.assert_close(one.code.parameters, all_at_once.code.parameters[1:2], rtol=1e-4, atol=1e-4)
    by_batch = network(statistics="batch")
    pair = [by_batch.predict(target[:n], canvases[:n], code[:n]).parameters[:2] for n in (2, 3)]
    assert (pair[0] - pair[1]).abs().max() > 1e-5


def test_folded_statistics_are_batch_normalisation(shapes: tuple[Tensor, Tensor, Code]) -> None:
    target, canvases, code = shapes
    made = network().train()
    for each in made.modules():
        if isinstance(each, torch.nn.BatchNorm3d):
            each.momentum = 1.0  # the running statistics are those of the last batch, but for n - 1 instead of n
    taught = made.predict(target[:2], canvases[:2, :1], Code(code.ids[:2, :1], code.parameters[:2, :1])).parameters
    told = made.eval().predict(target[:2], canvases[:2, :1], Code(code.ids[:2, :1], code.parameters[:2, :1])).parameters
    torch.testing.assert_close(told, taught, rtol=0.02, atol=0.002)


def test_blocks_are_the_same_one_by_one_and_together(shapes: tuple[Tensor, Tensor, Code]) -> None:
    target, canvases, _ = shapes
    made = network()
    memory, features_of = None, []
    for k in range(BLOCKS):
        feature, memory = made.perceive(target.float(), unpack(canvases[:, k]).float(), memory)
        features_of.append(feature)
    whole = made.perceive_all(target, canvases, torch.ones(3, BLOCKS, dtype=torch.bool))
    torch.testing.assert_close(torch.stack(features_of, 1).flatten(0, 1), whole, rtol=1e-4, atol=1e-5)
    last = torch.tensor([[False, True]]).expand(3, BLOCKS)
    torch.testing.assert_close(made.perceive_all(target, canvases, last), features_of[-1], rtol=1e-4, atol=1e-5)


def test_every_weight_that_is_trained_learns(shapes: tuple[Tensor, Tensor, Code]) -> None:
    target, canvases, code = shapes
    made = network().train()
    losses = made.losses(made.predict(target, canvases, code), code)
    (losses["ids"] + losses["parameters"]).backward()
    silent = {name for name, each in made.named_parameters() if each.grad is None}
    assert silent == {f"shape_feat.conv{n}.bias" for n in range(1, 9)}
    assert all(each.grad.isfinite().all() for each in made.parameters() if each.grad is not None)
