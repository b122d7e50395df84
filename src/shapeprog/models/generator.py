"""What every program generator has in common: features of blocks in, ids and parameters of their steps out.

A generator looks at the target and at what has been drawn so far, and writes one block of up to J steps.  Designs
differ in how they look (``perceive``) and in how they say numbers (``values`` and ``parameter_loss``, ``offsets``).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor, nn

from shapeprog.geometry.cells import unpack
from shapeprog.language.tensors import Code
from shapeprog.models.vocabulary import Vocabulary

Memory = Any
"""What a design carries from block to block; ``None`` at the first."""


class Said(NamedTuple):
    """What has been said at a step: ids (...) and parameters (..., 7)."""

    ids: Int[Tensor, "*batch"]
    values: Float[Tensor, "*batch 7"]


@dataclass(frozen=True)
class Prediction:
    """What a generator says when it is told the programs, for the blocks that are live.

    Parameters
    ----------
    live
        Which blocks (B, K) were computed; the rows of everything else are theirs in order.
    logits
        Log-probabilities of the ids; illegal ones are minus infinity where the design masks them.
    heads
        What the design needs to measure its parameters.
    feature
        What it saw before it wrote each block.
    told
        The ids and parameters that it was told.
    generator
        Whose prediction it is.
    """

    live: Bool[Tensor, "B K"]
    logits: Float[Tensor, "M J V"]
    heads: Tensor
    feature: Float[Tensor, "M F"]
    told: Said
    generator: Generator

    @cached_property
    def values(self) -> Float[Tensor, "M J 7"]:
        """Parameters of the ids that were told, with gradient."""
        return self.generator.values(self.heads, self.told.ids, self.told.values)

    @cached_property
    def offsets(self) -> Float[Tensor, "M J 7"]:
        """How far the surface is meant to be from what was told, with gradient; zero for designs that do not say."""
        return self.generator.offsets(self.heads, self.told.ids, self.told.values)

    @property
    def parameters(self) -> Float[Tensor, "B K J 7"]:
        """Parameters of the surface that is meant, with gradient, at their places; zero in blocks that are not live."""
        meant = self.told.values + self.offsets if self.generator.says_offsets else self.values
        full = meant.new_zeros(*self.live.shape, *meant.shape[1:])
        return full.masked_scatter(self.live[..., None, None], meant)

    def log_probability(self, ids: Int[Tensor, "B K J"]) -> Float[Tensor, "B K"]:
        """Log-probability of the ids of each block, zero where it is not live."""
        told = ids[self.live][..., None]
        each = self.logits.gather(-1, told)[..., 0].sum(-1)
        return each.new_zeros(self.live.shape).masked_scatter(self.live, each)


class Step(NamedTuple):
    """Output of one step: log-probabilities of ids, what the parameters are read from, and the state after it."""

    logits: Float[Tensor, "M V"]
    heads: Tensor
    state: Any


class Generator(nn.Module, ABC):
    """A network that writes programs block by block.

    Parameters
    ----------
    settings
        An instance of the design's own ``Settings``, a frozen dataclass of JSON values.
    vocabulary
        The statements it may use.
    """

    design: ClassVar[str]
    Settings: ClassVar[Any]
    by_batch: bool = False
    """Whether a prediction depends on the other shapes of its batch, those that have ended included."""
    says_offsets: ClassVar[bool] = False
    """Whether it says how far surfaces are meant to be from what is drawn."""

    def __init__(self, settings: Any, vocabulary: Vocabulary) -> None:
        super().__init__()
        self.settings = settings
        self.vocabulary = vocabulary

    @abstractmethod
    def perceive(
        self, target: Float[Tensor, "B 32 32 32"], canvas: Float[Tensor, "B 32 32 32"], memory: Memory
    ) -> tuple[Float[Tensor, "B F"], Memory]:
        """The feature of the next block, and the memory after it."""

    @abstractmethod
    def perceive_all(
        self, target: UInt8[Tensor, "B 32 32 32"], canvases: Int[Tensor, "B K 32 32"], live: Bool[Tensor, "B K"]
    ) -> Float[Tensor, "M F"]:
        """Features of all live blocks at once, for canvases that are known."""

    @abstractmethod
    def step(self, feature: Float[Tensor, "M F"], previous: Said | None, step: int, state: Any) -> Step:
        """One step of each block, after what was said before it; ``None`` at the first."""

    @abstractmethod
    def values(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], told: Float[Tensor, "*batch 7"] | None = None
    ) -> Float[Tensor, "*batch 7"]:
        """The parameters that the heads give the ids, with gradient.

        Parameters
        ----------
        told
            What designs that say one number after the other take the earlier ones to be; by default what they said.
        """

    @abstractmethod
    def parameter_loss(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], values: Float[Tensor, "*batch 7"]
    ) -> Float[Tensor, "*batch 7"]:
        """How far the heads are from the true values of each slot."""

    def offsets(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], told: Float[Tensor, "*batch 7"]
    ) -> Float[Tensor, "*batch 7"]:
        """How far the surface is meant to be from the parameters, with gradient; zero for designs that do not say.

        Cells say where something is to a cell, a surface may be anywhere in it.  A block is drawn on the canvas with
        its parameters alone, so that offsets may change without changing what is written next.
        """
        return torch.zeros_like(told)

    def offset_weights(self) -> Iterator[nn.Parameter]:
        """The weights that say offsets and nothing else."""
        yield from ()

    def sampled(self, heads: Tensor, ids: Int[Tensor, "*batch"], random: torch.Generator) -> Float[Tensor, "*batch 7"]:
        """Parameters drawn at random, for designs whose heads are a distribution; else those of ``values``."""
        return self.values(heads, ids)

    def predict(
        self,
        target: UInt8[Tensor, "B 32 32 32"],
        canvases: Int[Tensor, "B K 32 32"],
        code: Code,
        live: Bool[Tensor, "B K"] | None = None,
    ) -> Prediction:
        """What it says of each block when it is told the canvas and the program (teacher forcing), with gradient.

        Parameters
        ----------
        target
            Cells, 1 or 0.
        canvases
            What each block finds drawn, packed.
        code
            The programs; their ids pick the parameters, and each step is told those before it.
        live
            The blocks to compute; by default those that draw, and the empty one after the last, which says stop.
        """
        if live is None:
            live = live_blocks(code.ids)
        told = Said(code.ids[live], code.parameters[live].detach())
        feature = self.perceive_all(target, canvases, live)
        logits, heads = self.tell(feature, told)
        return Prediction(live, logits, heads, feature, told, self)

    def tell(self, feature: Float[Tensor, "M F"], told: Said) -> tuple[Float[Tensor, "M J V"], Tensor]:
        """Log-probabilities and heads of all steps, each told what was said at those before it."""
        outputs: list[Step] = []
        for j in range(told.ids.shape[1]):
            state = outputs[-1].state if outputs else None
            previous = Said(told.ids[:, j - 1], told.values[:, j - 1]) if j else None
            outputs.append(self.step(feature, previous, j, state))
        return torch.stack([each.logits for each in outputs], 1), torch.stack([each.heads for each in outputs], 1)

    def losses(
        self, prediction: Prediction, code: Code, weights: Float[Tensor, "B K"] | None = None
    ) -> dict[str, Float[Tensor, ""]]:
        """Cross-entropy of the ids, and loss of the parameters in use, as means over live steps.

        Parameters
        ----------
        prediction
            Of the programs of ``code``.
        code
            The right programs.
        weights
            How much each block counts; evenly by default.
        """
        ids, values = code.ids[prediction.live], code.parameters[prediction.live]
        share = (torch.ones_like(prediction.live) if weights is None else weights)[prediction.live].float()[:, None]
        total = (share.sum() * ids.shape[1]).clamp(min=1)
        surprise = -prediction.logits.gather(-1, ids[..., None])[..., 0]
        off = self.parameter_loss(prediction.heads, ids, values)
        used = self.vocabulary.used.to(ids.device)[ids]
        each = (off * used).sum(-1)
        return {"ids": (surprise * share).sum() / total, "parameters": (each * share).sum() / total}

    def masked(
        self, logits: Float[Tensor, "M V"], step: int, previous: Int[Tensor, " M"] | None
    ) -> Float[Tensor, "M V"]:
        """Log-probabilities over the legal ids alone."""
        allowed = self.vocabulary.allowed(step, previous).to(logits.device)
        return logits.float().masked_fill(~allowed, -torch.inf).log_softmax(-1)


def live_blocks(ids: Int[Tensor, "B K J"]) -> Bool[Tensor, "B K"]:
    """The blocks up to and including the first empty one, which says that the program ends."""
    empty = (ids == 0).all(-1)
    before = empty.long().cumsum(-1) - empty.long()
    return before == 0


def stacked(
    target: UInt8[Tensor, "B 32 32 32"],
    canvases: Int[Tensor, "B K 32 32"],
    live: Bool[Tensor, "B K"],
    dtype: torch.dtype,
) -> Float[Tensor, "M 2 32 32 32"]:
    """Target and canvas of every live block as two channels."""
    shape = live.nonzero()[:, 0]
    return torch.stack([target.to(dtype)[shape], unpack(canvases[live]).to(dtype)], 1)
