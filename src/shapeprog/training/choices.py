"""Gradients for choices: how the probability of each id should change, given what it led to.

``nvil`` and ``rloo`` sample whole programs and weigh the log-probability of their ids by how much better than
expected they turned out (REINFORCE, Williams 1992).  What is expected is said by a learned network (NVIL, Mnih and
Gregor, ICML 2014) or by the other samples of the same shape (leave one out, Kool et al. 2019).  ``expected`` samples
nothing: it looks at the likeliest blocks in place of each block, draws them all, and differentiates their mean.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from shapeprog.geometry.cells import preceding
from shapeprog.language.statement import EMPTY, language
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks
from shapeprog.models.generator import Generator, Said, Step

DECAY = 0.9
"""How slowly the running mean and variance of the costs change, as published for NVIL."""


class Baseline(nn.Module):
    """What the cost will be, from what the generator sees before it writes a block.

    Parameters
    ----------
    width
        Of the feature of a block.
    """

    mean: Tensor
    variance: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        last = nn.Linear(64, 1)
        nn.init.zeros_(last.weight)
        self.layers = nn.Sequential(nn.Linear(width, 64), nn.Tanh(), last)
        self.register_buffer("mean", torch.zeros(()))
        self.register_buffer("variance", torch.ones(()))

    def forward(
        self, feature: Float[Tensor, "M F"], live: Bool[Tensor, "B K"], costs: Float[Tensor, " B"]
    ) -> tuple[Float[Tensor, "B K"], Float[Tensor, ""]]:
        """How much worse than expected each block turned out, without gradient, and the loss that trains this network.

        Costs are centred by their running mean, and divided by their running deviation where that is above one.
        """
        offset = (costs - self.mean)[:, None].expand(live.shape)[live]
        expected = self.layers(feature.detach().float())[:, 0]
        with torch.no_grad():
            surprise = (offset - expected) / self.variance.sqrt().clamp(min=1)
            if self.training:
                self.mean.lerp_(costs.mean(), 1 - DECAY)
                self.variance.lerp_(offset.sub(expected).square().mean(), 1 - DECAY)
        full = surprise.new_zeros(live.shape).masked_scatter(live, surprise)
        return full, (expected - offset).square().mean()


def leave_one_out(costs: Float[Tensor, "S B"]) -> Float[Tensor, "S B"]:
    """How much worse each of S samples turned out than the mean of the others; its mean gradient is unbiased."""
    samples = len(costs)
    return (costs - costs.mean(0)) * (samples / (samples - 1))


def surrogate(chance: Float[Tensor, "*S B K"], surprise: Float[Tensor, "*S B K"]) -> Float[Tensor, ""]:
    """What has the gradient of the expected cost: log-probabilities of blocks times surprises, a mean over programs."""
    return (chance * surprise.detach()).sum(-1).mean()


class Alternatives(NamedTuple):
    """Blocks that could stand in each place.

    Parameters
    ----------
    ids
        Their ids.
    chance
        Log-probability of each among those that are looked at.
    values
        The parameters that the generator would give them, without gradient.
    meant
        The same with their offsets.
    """

    ids: Int[Tensor, "M A J"]
    chance: Float[Tensor, "M A"]
    values: Float[Tensor, "M A J 7"]
    meant: Float[Tensor, "M A J 7"]


def alternatives(generator: Generator, feature: Float[Tensor, "M F"], most: int = 0) -> Alternatives:
    """The likeliest legal blocks for features of blocks, with the exact gradient of their probabilities.

    Only loops leave a choice for the next step, so a handful of steps tells the probabilities of all blocks.

    Parameters
    ----------
    feature
        What the generator saw.
    most
        How many blocks A to look at, the likeliest; all where it is 0.
    """
    known, steps = generator.vocabulary, generator.vocabulary.steps
    loops = {each.id for each in language() if each.is_loop}
    blocks: list[list[int]] = []
    chances, visits, places = [], list[Step](), []
    queue: list[tuple[list[int], Tensor, list[int], Step | None]] = [([], feature.new_zeros(len(feature)), [], None)]
    while queue:
        prefix, chance, path, before = queue.pop()
        place = len(prefix)
        previous = None if before is None else _said(generator, before, prefix[-1])
        step = generator.step(feature, previous, place, None if before is None else before.state)
        visits.append(step)
        path = [*path, len(visits) - 1]
        for number in known.legal[place, prefix[-1] if prefix else -1].nonzero()[:, 0].tolist():
            block, total = [*prefix, number], chance + step.logits[:, number]
            if number in loops:
                queue.append((block, total, path, step))
            else:
                missing = steps - len(block)
                blocks.append([*block, *[EMPTY] * missing])
                chances.append(total)
                places.append([*path, *[0] * missing])
    table = torch.tensor(blocks, device=feature.device)
    among = torch.stack(chances, 1)
    chosen = among.detach().argsort(-1, descending=True)[:, : most or None]
    with torch.no_grad():
        heads = torch.stack([each.heads for each in visits], 1)
        which = torch.tensor(places, device=feature.device)[chosen]
        rows = torch.arange(len(feature), device=feature.device)[:, None, None]
        there = heads[rows, which]
        values = generator.values(there, table[chosen]).float()
        meant = values + generator.offsets(there, table[chosen], values)
    return Alternatives(table[chosen], among.gather(1, chosen).log_softmax(-1), values, meant)


def _said(generator: Generator, step: Step, number: int) -> Said:
    """What a step says, if it says that id."""
    ids = torch.full_like(step.logits[:, 0], number, dtype=torch.long)
    return Said(ids, generator.values(step.heads, ids).detach())


def in_place(
    code: Code, live: Bool[Tensor, "B K"], other: Alternatives
) -> tuple[Int[Tensor, "M A 32 32"], Int[Tensor, " M"]]:
    """What programs draw with each alternative in the place of one block, packed, and which program each belongs to.

    All other blocks stay as they are; an empty block ends the program there.
    """
    drawn = draw_blocks(code)
    before = preceding(drawn)
    after = preceding(drawn.flip(1)).flip(1)
    alone = draw_blocks(Code(other.ids[:, :, None], other.values[:, :, None]))[:, :, 0]
    going = (other.ids[..., 0] != EMPTY)[..., None, None]
    rest = torch.where(going, after[live][:, None], 0)
    return before[live][:, None] | alone | rest, live.nonzero()[:, 0]


def expected(chance: Float[Tensor, "M A"], costs: Float[Tensor, "M A"], programs: int) -> Float[Tensor, ""]:
    """The expected cost over the alternatives of each block, added over blocks, as a mean over programs."""
    return (chance.exp() * costs.detach()).sum() / programs


def replaced(code: Code, live: Bool[Tensor, "B K"], other: Alternatives, choice: int) -> tuple[Code, Int[Tensor, " M"]]:
    """Programs with one alternative in the place of each live block, and which program each comes from.

    An empty block ends the program there.
    """
    owner, place = live.nonzero(as_tuple=True)
    row = torch.arange(len(owner), device=owner.device)
    ids, values = code.ids[owner].clone(), code.parameters.detach()[owner].clone()
    ids[row, place], values[row, place] = other.ids[:, choice], other.meant[:, choice].to(values)
    block = torch.arange(ids.shape[1], device=owner.device)
    ended = (ids[row, place, 0] == EMPTY)[:, None] & (block > place[:, None])
    return Code(torch.where(ended[..., None], EMPTY, ids), values), owner
