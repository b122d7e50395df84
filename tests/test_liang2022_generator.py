"""The networks: sizes and names as published, what they may write, and numbers that are the same however they come."""

from __future__ import annotations

import pytest
import torch
from commands import PROGRAM
from liang2022_toys import small, targets

from shapeprog.language import encode
from shapeprog.language.tensors import Code
from shapeprog.liang2022.adapt import predicted_code
from shapeprog.liang2022.decode import decode
from shapeprog.liang2022.executor import NeuralExecutor
from shapeprog.liang2022.generator import vocabulary
from shapeprog.liang2022.tian2019 import PUBLISHED, Tian2019

pytestmark = pytest.mark.paper
DESIGNS = ("fast", "tian2019")
CROSS, LINE, TRANSLATE, ROTATE = 10, 17, 19, 20


def test_published_networks_have_their_published_sizes_and_names():
    generator = Tian2019(PUBLISHED)
    sizes = [sum(weight.numel() for weight in module.parameters()) for module in (generator, NeuralExecutor())]
    assert sizes == [1_417_404, 862_272]
    both = ("weight", "bias")
    names = {f"shape_feat.{layer}{n}.{kind}" for layer in ("conv", "BN") for n in range(1, 9) for kind in both}
    names |= {f"{lstm}.weight_{kind}_l0" for lstm in ("core", "inner_net.core") for kind in ("ih", "hh")}
    heads = ("shape_feat.fc", *(f"inner_net.{head}{n}" for head in ("logit", "regress") for n in (1, 2)))
    names |= {"inner_net.pgm_embed.weight", *(f"{head}.{kind}" for head in heads for kind in both)}
    assert generator.state_dict().keys() == names


def is_legal(block: list[int]) -> bool:
    """Whether a block is empty, or loops and one statement that draws, without a gap."""
    chain = [each for each in block if each]
    if block != chain + [0] * (3 - len(chain)) or not chain:
        return not any(block)
    *loops, last = chain
    turned = loops == [ROTATE] and last in (CROSS, LINE)
    return 0 < last < TRANSLATE and (turned or loops in ([], [TRANSLATE], [TRANSLATE] * 2))


@pytest.mark.parametrize("design", DESIGNS)
def test_sampled_blocks_are_legal_and_their_numbers_within_range(design: str):
    code = decode(small(design), targets(8), decoder="sample", rng=torch.Generator().manual_seed(0)).code
    blocks = code.ids.flatten(0, 1).tolist()
    assert all(map(is_legal, blocks))
    assert len({tuple(block) for block in blocks}) > 15
    if design == "fast":
        used, low, high = (part[code.ids] for part in (vocabulary().used, vocabulary().low, vocabulary().high))
        assert ((code.parameters >= low) & (code.parameters <= high))[used].all()
        assert not code.parameters[~used].any()


@pytest.mark.parametrize("design", DESIGNS)
def test_teacher_forcing_gives_the_numbers_and_probabilities_of_decoding(design: str):
    generator, cells = small(design), targets()
    decoded = decode(generator, cells, decoder="argmax", blocks=6)
    prediction = generator.predict(decoded)
    code, offsets = predicted_code(prediction), decoded.offsets
    assert torch.equal(code.ids, decoded.code.ids)
    torch.testing.assert_close(code.parameters, decoded.code.parameters + offsets, atol=1e-3, rtol=0)
    assert (prediction.logits.argmax(-1) == prediction.ids).all()
    log_prob = prediction.logits.amax(-1).sum(-1)
    torch.testing.assert_close(prediction.log_prob()[prediction.batch.live], log_prob)
    assert (float(offsets.abs().max()) < 1, bool(offsets.any())) == (True, design == "fast")
    assert not offsets[vocabulary().discrete[code.ids]].any()


@pytest.mark.parametrize("design", DESIGNS)
def test_a_program_does_not_depend_on_the_other_shapes_of_its_batch(design: str):
    generator, cells = small(design), targets()
    together, alone = decode(generator, cells, decoder="argmax"), decode(generator, cells[:1], decoder="argmax")
    assert torch.equal(together.code.ids[:1], alone.code.ids)
    torch.testing.assert_close(together.code.parameters[:1], alone.code.parameters, atol=1e-3, rtol=0)


def test_fast_remembers_the_block_before_once_its_memory_has_weights():
    generator, cells, code = small(), targets(1).float(), encode([PROGRAM])
    leg = Code(code.ids[:, 1], code.parameters[:, 1])
    none, moved = Code(torch.zeros_like(leg.ids), leg.parameters), Code(leg.ids, leg.parameters + 1)
    first, second, third = (generator.encode(cells, cells, each, ())[0] for each in (none, leg, moved))
    assert not torch.allclose(first, second, atol=1e-3)
    assert not torch.allclose(second, third, atol=1e-4)
    for weight in generator.block_memory.parameters():
        torch.nn.init.zeros_(weight)
    first, second = (generator.encode(cells, cells, each, ())[0] for each in (none, leg))
    assert torch.equal(first, second)
