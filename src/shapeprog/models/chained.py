"""``chained``: as ``swift``, but each number is said knowing those before it in its block.

Two answers to one shape, such as feet at both ends or a bar along all of it, differ in several numbers together: where
each number is drawn on its own, the count and shift of one come with the size of the other.  Here the chance of a
block's numbers is a product of conditional ones, as in the neural autoregressive density estimator (Larochelle and
Murray, AISTATS 2011): numbers of the same step are added to the hidden layer of the next, those of the steps before
are told to the step LSTM.

A confident distribution has no gradient to give: its likeliest value stays what it is, whatever is next to it.  So the
surface is meant to be at the numbers and their *offsets*, a plain regression that is zero until a loss moves it.
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from shapeprog.language.statement import SLOTS
from shapeprog.models.generator import Said
from shapeprog.models.swift import Swift, SwiftSettings
from shapeprog.models.vocabulary import Vocabulary

REACH = 0.95
"""Most cells of an offset: rounded, numbers are within one of what was drawn, as snapping asks."""


class Chained(Swift):
    """The network; see the module."""

    design = "chained"
    says_offsets = True

    def __init__(self, settings: SwiftSettings, vocabulary: Vocabulary) -> None:
        super().__init__(settings, vocabulary)
        width, bins = settings.feature, len(self.ticks)
        self.bins = nn.Sequential(nn.Linear(width, width), nn.ReLU(), nn.Linear(width, bins))
        self.offset = nn.Sequential(nn.Linear(width, width), nn.ReLU(), nn.Linear(width, 1))
        for weight in self.offset[-1].parameters():
            nn.init.zeros_(weight)
        self.slot = nn.Parameter(torch.zeros(SLOTS, width))
        self.link = nn.Embedding(SLOTS * bins, width)
        self.before = nn.Embedding(SLOTS * bins, width)
        for table in (self.link, self.before):
            nn.init.normal_(table.weight, std=0.05)  # up to seven are added

    def heard(self, previous: Said) -> Float[Tensor, "M F"]:
        """What the step LSTM is told of the step before: its id and its numbers."""
        rows = self.before(self._row(previous.values)) * self.used[previous.ids][..., None]
        return super().heard(previous) + rows.sum(-2)

    def values(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], told: Float[Tensor, "*batch 7"] | None = None
    ) -> Float[Tensor, "*batch 7"]:
        """The likeliest value of each slot and its neighbours, given the slots before it."""
        if told is None:
            return self._in_turn(heads, ids, None)
        mixed = self._mixed(heads, ids, told)
        return self.likeliest(self._scored(mixed, self.fits[ids]), ids)

    def offsets(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], told: Float[Tensor, "*batch 7"]
    ) -> Float[Tensor, "*batch 7"]:
        """Less than a cell; none for whole numbers, and none that leaves the range."""
        low, high = self._range(ids)
        free = self.used[ids] & ~self.whole[ids]
        offset = REACH * self.offset(self._mixed(heads, ids, told))[..., 0].float().tanh() * free
        return torch.minimum(torch.maximum(offset, (low - told).clamp(max=0)), (high - told).clamp(min=0))

    def offset_weights(self) -> Iterator[nn.Parameter]:
        """Those of the regression."""
        yield from self.offset.parameters()

    def sampled(self, heads: Tensor, ids: Int[Tensor, "*batch"], random: torch.Generator) -> Float[Tensor, "*batch 7"]:
        """Whole values drawn by their chances, one after the other."""
        return self._in_turn(heads, ids, random)

    def parameter_loss(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], values: Float[Tensor, "*batch 7"]
    ) -> Float[Tensor, "*batch 7"]:
        """Cross-entropy of each number, given the right ones before it."""
        return self.surprise(self._scored(self._mixed(heads, ids, values), self.fits[ids]), ids, values)

    def _mixed(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], told: Float[Tensor, "*batch 7"]
    ) -> Float[Tensor, "*batch 7 F"]:
        """What scores and offsets of all slots are read from, given the numbers that were told."""
        links = self.link(self._row(told)) * self.used[ids][..., None]
        known = links.cumsum(-2) - links
        start = self.numbers(heads) + self.told(ids)
        return (start[..., None, :] + self.slot + known).relu()

    def _scored(self, mixed: Tensor, fits: Bool[Tensor, "*batch bins"]) -> Float[Tensor, "*batch bins"]:
        """Scores of the whole values that a slot may take."""
        scores: Tensor = self.bins(mixed).float()
        return scores.masked_fill(~fits, -torch.inf)

    def _in_turn(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], random: torch.Generator | None
    ) -> Float[Tensor, "*batch 7"]:
        """Values slot by slot: the likeliest, or drawn at random."""
        known = self.numbers(heads) + self.told(ids)
        fits, used, whole = self.fits[ids], self.used[ids], self.whole[ids]
        said: list[Tensor] = []
        needed = int(used.flatten(0, -2).any(0).sum())  # slots in use come first
        for slot in range(needed):
            mixed = (known + self.slot[slot]).relu()
            scores = self._scored(mixed, fits[..., slot, :])
            if random is None:
                value = self.mean_near_best(scores, whole[..., slot])
            else:
                drawn = torch.multinomial(scores.softmax(-1).flatten(0, -2), 1, generator=random)
                value = self.ticks[drawn.reshape(scores.shape[:-1])]
            value = value * used[..., slot]
            said.append(value)
            known = known + self.link(self._row(value, slot)) * used[..., slot, None]
        rest = [torch.zeros_like(ids, dtype=self.ticks.dtype)] * (SLOTS - needed)
        return torch.stack([*said, *rest], -1)

    def _row(self, values: Tensor, slot: int | None = None) -> Int[Tensor, ...]:
        """Row of the tables for a value (...) of one slot, or values (..., 7) of all."""
        bins = len(self.ticks)
        place = (values.detach().round() - self.settings.low).clamp(0, bins - 1).long()
        return place + bins * (torch.arange(SLOTS, device=values.device) if slot is None else slot)
