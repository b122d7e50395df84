"""``swift``: a generator made for few cores, without memory from block to block.

Against the published network: the encoder halves the grid at once (a third of the arithmetic), keeps where things are
by reading all cells of its last layer instead of their mean, and numbers are said as a distribution over whole values
instead of one regressed value, so that they can be sampled, two answers are not averaged, and each is told the id it
belongs to.  What has been drawn is on the canvas, so blocks need no memory: any canvas can be continued, and training
may mix canvases freely.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor, nn

from shapeprog.errors import ShapeProgError
from shapeprog.language.statement import SLOTS
from shapeprog.models.generator import Generator, Memory, Said, Step, stacked
from shapeprog.models.vocabulary import Vocabulary

LARGEST_SIZE = 1024
"""Channels of the widest layer, and the largest value: what a damaged card asks for still fits the memory."""

WINDOW = 2
"""Values on either side of the likeliest over which the mean is taken."""


@dataclass(frozen=True)
class SwiftSettings:
    """Sizes of the network.

    Parameters
    ----------
    widths
        Channels at 16^3, 8^3 and 4^3 cells.
    squeeze
        Channels of the last 4^3 cells that are read one by one.
    feature
        Width of the feature of a block, of the step LSTM and of its heads.
    low, high
        Range of the whole values that numbers are drawn from.
    """

    widths: tuple[int, int, int] = (16, 32, 64)
    squeeze: int = 48
    feature: int = 256
    low: int = -24
    high: int = 40

    def __post_init__(self) -> None:
        sizes = (*self.widths, self.squeeze, self.feature) if isinstance(self.widths, tuple) else ()
        if len(sizes) != 5 or not all(type(each) is int and 0 < each <= LARGEST_SIZE for each in sizes):
            raise ShapeProgError(
                "three widths, squeeze and feature are sizes of layers",
                f"choose whole numbers from 1 to {LARGEST_SIZE}",
            )
        ends = (self.low, self.high)
        if not all(type(each) is int and abs(each) <= LARGEST_SIZE for each in ends) or self.low >= self.high:
            raise ShapeProgError(
                "low and high are no range of whole numbers", f"they end at {LARGEST_SIZE}, as -24 to 40"
            )


class Swift(Generator):
    """The network; see the module."""

    design = "swift"
    Settings = SwiftSettings
    ticks: Tensor
    fits: Tensor
    bounds: Tensor
    whole: Tensor
    used: Tensor

    def __init__(self, settings: SwiftSettings, vocabulary: Vocabulary) -> None:
        super().__init__(settings, vocabulary)
        fine, middle, coarse = settings.widths
        width, bins = settings.feature, settings.high - settings.low + 1
        self.encoder = nn.Sequential(
            _layer(2, fine, 4, 2),
            _layer(fine, middle, 3, 2),
            _layer(middle, middle, 3, 1),
            _layer(middle, coarse, 3, 2),
            _layer(coarse, coarse, 3, 1),
            _layer(coarse, settings.squeeze, 1, 1),
        )
        self.summary = nn.Sequential(
            nn.Linear(settings.squeeze * 64, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU()
        )
        self.embedding = nn.Embedding(vocabulary.size, width)
        self.core = nn.LSTMCell(width, width)
        self.name = nn.Sequential(nn.Linear(2 * width, width), nn.ReLU(), nn.Linear(width, vocabulary.size))
        self.numbers = nn.Linear(2 * width, width)
        self.told = nn.Embedding(vocabulary.size, width)
        self.bins = nn.Sequential(nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, SLOTS * bins))
        self.register_buffer("ticks", torch.arange(settings.low, settings.high + 1.0), persistent=False)
        low, high = vocabulary.ranges[..., :1], vocabulary.ranges[..., 1:]
        fits = (self.ticks >= low) & (self.ticks <= high)
        fits = fits | ~fits.any(-1, keepdim=True)
        self.register_buffer("fits", fits, persistent=False)
        ends = torch.stack([fits.int().argmax(-1), bins - 1 - fits.flip(-1).int().argmax(-1)])
        self.register_buffer("bounds", self.ticks[ends], persistent=False)
        self.register_buffer("whole", vocabulary.discrete, persistent=False)
        self.register_buffer("used", vocabulary.used, persistent=False)

    def perceive(
        self, target: Float[Tensor, "B 32 32 32"], canvas: Float[Tensor, "B 32 32 32"], memory: Memory
    ) -> tuple[Float[Tensor, "B F"], Memory]:
        """The feature of the next block; there is no memory."""
        return self._encode(torch.stack([target, canvas], 1)), None

    def perceive_all(
        self, target: UInt8[Tensor, "B 32 32 32"], canvases: Int[Tensor, "B K 32 32"], live: Bool[Tensor, "B K"]
    ) -> Float[Tensor, "M F"]:
        """Features of all live blocks at once."""
        return self._encode(stacked(target, canvases, live, self.ticks.dtype))

    def _encode(self, cells: Float[Tensor, "M 2 32 32 32"]) -> Float[Tensor, "M F"]:
        seen = self.encoder(cells.to(memory_format=torch.channels_last_3d))
        feature: Tensor = self.summary(seen.flatten(1))
        return feature.float()

    def step(self, feature: Float[Tensor, "M F"], previous: Said | None, step: int, state: Any) -> Step:
        """One step; the heads hold its output beside the feature of the block."""
        state = self.core(feature if previous is None else self.heard(previous), state)
        heads = torch.cat([state[0], feature], -1)
        return Step(self.masked(self.name(heads), step, None if previous is None else previous.ids), heads, state)

    def heard(self, previous: Said) -> Float[Tensor, "M F"]:
        """What the step LSTM is told of the step before: its id."""
        return self.embedding(previous.ids)

    def values(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], told: Float[Tensor, "*batch 7"] | None = None
    ) -> Float[Tensor, "*batch 7"]:
        """The mean of the likeliest value and its neighbours; counts and turns are the likeliest itself."""
        return self.likeliest(self._scores(heads, ids), ids)

    def likeliest(
        self, scores: Float[Tensor, "*batch 7 bins"], ids: Int[Tensor, "*batch"]
    ) -> Float[Tensor, "*batch 7"]:
        """The values of scores; those of slots that are not used are zero."""
        return self.mean_near_best(scores, self.whole[ids]) * self.used[ids]

    def mean_near_best(
        self, scores: Float[Tensor, "*batch bins"], whole: Bool[Tensor, "*batch"]
    ) -> Float[Tensor, "*batch"]:
        """The mean of the likeliest value and its neighbours, or itself where the value is ``whole``."""
        best = scores.argmax(-1, keepdim=True)
        place = torch.arange(scores.shape[-1], device=scores.device)
        near = (place - best).abs() <= WINDOW
        mean = (scores.masked_fill(~near, -torch.inf).softmax(-1) * self.ticks).sum(-1)
        return torch.where(whole, self.ticks[best[..., 0]], mean)

    def sampled(self, heads: Tensor, ids: Int[Tensor, "*batch"], random: torch.Generator) -> Float[Tensor, "*batch 7"]:
        """Whole values drawn by their chances."""
        chances = self._scores(heads, ids).softmax(-1)
        drawn = torch.multinomial(chances.flatten(0, -2), 1, generator=random).reshape(chances.shape[:-1])
        return self.ticks[drawn] * self.used[ids]

    def parameter_loss(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], values: Float[Tensor, "*batch 7"]
    ) -> Float[Tensor, "*batch 7"]:
        """Cross-entropy of each number."""
        return self.surprise(self._scores(heads, ids), ids, values)

    def surprise(
        self, scores: Float[Tensor, "*batch 7 bins"], ids: Int[Tensor, "*batch"], values: Float[Tensor, "*batch 7"]
    ) -> Float[Tensor, "*batch 7"]:
        """Minus the log-probability of values; one between two whole ones counts for each by its nearness."""
        surprise = -scores.log_softmax(-1)
        low, high = self._range(ids)
        inside = torch.minimum(torch.maximum(values, low), high) - self.settings.low
        below = inside.floor().clamp(max=surprise.shape[-1] - 2)
        part = inside - below
        pair = torch.stack([below, below + 1], -1).long()
        weights = torch.stack([1 - part, part], -1)
        return torch.where(weights > 0, surprise.gather(-1, pair) * weights, 0).sum(-1)

    def _range(self, ids: Int[Tensor, "*batch"]) -> tuple[Float[Tensor, "*batch 7"], Float[Tensor, "*batch 7"]]:
        """Lowest and highest value that each slot of an id may take here."""
        low, high = self.bounds
        return low[ids], high[ids]

    def _scores(self, heads: Tensor, ids: Int[Tensor, "*batch"]) -> Float[Tensor, "*batch 7 bins"]:
        mixed = self.bins(self.numbers(heads) + self.told(ids))
        scores = mixed.unflatten(-1, (SLOTS, len(self.ticks))).float()
        return scores.masked_fill(~self.fits[ids], -torch.inf)


def _layer(inside: int, outside: int, kernel: int, stride: int) -> nn.Sequential:
    """Convolution, batch norm with running statistics, ReLU; halves the grid where the stride is two."""
    pad = 1 if kernel > 1 else 0
    convolution = nn.Conv3d(inside, outside, kernel, stride, pad, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm3d(outside, momentum=0.02), nn.ReLU(inplace=True))
