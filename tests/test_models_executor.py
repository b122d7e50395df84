"""The neural executor: its size, and the union that it renders."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F

from shapeprog.models.executor import NOTHING, NeuralExecutor
from shapeprog.models.vocabulary import Vocabulary


@pytest.fixture
def executor() -> NeuralExecutor:
    return NeuralExecutor(Vocabulary.current()).eval()


def told(*lead: int) -> tuple[torch.Tensor, torch.Tensor]:
    return torch.rand(*lead, 3, 22).softmax(-1), torch.randn(*lead, 3, 7)


def test_size_and_names_are_those_published(executor: NeuralExecutor) -> None:
    assert sum(each.numel() for each in executor.parameters()) == 862_272
    assert {"pgm_embed.weight", "param_embed.bias", "lstm.weight_ih_l0", "pgm_param_feat.weight"} <= set(
        executor.state_dict()
    )
    assert executor.decoder[-1].weight.shape == (4, 2, 4, 4, 4)


def test_logits_are_those_of_two_classes(executor: NeuralExecutor) -> None:
    ids, values = told(2)
    found = executor(ids, values)
    assert found.shape == (2, 32, 32, 32)
    heard = torch.cat([F.relu(executor.pgm_embed(ids)), F.relu(executor.param_embed(values))], -1)
    feature = F.relu(executor.pgm_param_feat(executor.lstm(heard)[0][:, 2]))
    scores = executor.decoder(feature.reshape(2, 128, 1, 1, 1))
    torch.testing.assert_close(found.sigmoid(), scores.softmax(1)[:, 1])


def test_the_union_is_the_largest_probability(executor: NeuralExecutor) -> None:
    ids, values = told(2, 3)
    each = executor(ids.flatten(0, 1), values.flatten(0, 1)).unflatten(0, (2, 3)).sigmoid()
    torch.testing.assert_close(executor.union(ids, values).sigmoid(), each.amax(1))
    drawn = torch.tensor([[True, False, True], [False, False, False]])
    found = executor.union(ids, values, drawn)
    torch.testing.assert_close(found[0].sigmoid(), each[0, [0, 2]].amax(0))
    assert (found[1] == NOTHING).all()


def test_gradients_reach_ids_and_parameters(executor: NeuralExecutor) -> None:
    ids, values = (each.requires_grad_() for each in told(1, 2))
    F.binary_cross_entropy_with_logits(executor.union(ids, values), torch.ones(1, 32, 32, 32)).backward()
    for leaf in (ids, values):
        assert leaf.grad is not None
        assert leaf.grad.isfinite().all()
        assert leaf.grad.abs().sum() > 0
