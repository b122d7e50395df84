"""Training of the neural executor: it learns to draw single blocks of synthetic programs.

The network is that of Tian et al. 2019.  They train it for 27 million visits of 899,000 blocks; to learn from a
hundredth of that, blocks are endless, the overlap counts beside the cross-entropy, and occupied cells count for more
in the beginning: few cells of a grid belong to a block, and to say that none does is hard to unlearn.  A share of the
blocks is widened, so that the executor has also seen numbers that the prior never writes.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor
from torch.nn.functional import one_hot

from shapeprog.data.synthetic import Stream, prior
from shapeprog.geometry.cells import unpack
from shapeprog.geometry.losses import cell_cross_entropy
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks
from shapeprog.models.checkpoint import card_of, save_checkpoint
from shapeprog.models.executor import NeuralExecutor
from shapeprog.models.vocabulary import Vocabulary
from shapeprog.training.engine import Engine, scrambled
from shapeprog.training.folder import Record
from shapeprog.training.loop import run
from shapeprog.training.settings import Settings
from shapeprog.training.validation import SEED

OCCUPIED = 5.0
"""Weight of an occupied cell against an empty one at the end of the training, as published."""

MOST_COPIES = 8
"""Most copies of a loop in a widened block."""

VALIDATION_BLOCKS = 1024
"""Blocks of each validation."""


@dataclass(frozen=True, kw_only=True)
class ExecutorSettings(Settings):
    """What training of the executor is told, besides what every training is; a visit is one block.

    Parameters
    ----------
    prior
        Name of the synthetic furniture whose blocks are drawn.
    widened
        Share of the blocks whose numbers are moved at random.
    spread
        By how many cells they are moved at most.
    emphasis
        Weight of an occupied cell against an empty one in the beginning.
    overlap
        What one minus the Dice coefficient (Milletari et al. 2016) counts beside the cross-entropy.
    """

    visits: int = 1_000_000
    batch: int = 16
    rate: float = 3e-3
    warm_up: int = 3200
    betas: tuple[float, float] = (0.5, 0.999)
    precision: Literal["bf16", "float32"] = "bf16"
    validate_every: int = 100_000
    prior: str = "narrow"
    widened: float = 0.5
    spread: int = 6
    emphasis: float = 30.0
    overlap: float = 1.0


class Blocks(NamedTuple):
    """Single blocks, and the cells that each draws."""

    ids: Int[Tensor, "N J"]
    parameters: Float[Tensor, "N J 7"]
    cells: UInt8[Tensor, "N 32 32 32"]


class ExecutorTraining:
    """What training of the executor minimises; an objective of the loop.

    Parameters
    ----------
    executor
        What learns.
    settings
        How.
    device
        Where the blocks are made.
    command
        How to make the weights again, for their card.
    """

    def __init__(
        self,
        executor: NeuralExecutor,
        settings: ExecutorSettings,
        device: torch.device | str = "cpu",
        command: str = "",
    ) -> None:
        self.module, self._settings, self._command = executor, settings, command
        self._stream = Stream(prior(settings.prior), settings.batch, seed=settings.seed, device=device)
        self._validation = {
            name: self._blocks(Stream(prior(settings.prior), VALIDATION_BLOCKS, seed=SEED, device=device), 0, share)
            for name, share in {"iou": 0.0, "widened_iou": 1.0}.items()
        }

    def batch(self, index: int) -> Blocks:
        """The blocks of an index."""
        return self._blocks(self._stream, index, self._settings.widened)

    def _blocks(self, stream: Stream, index: int, share: float) -> Blocks:
        """One block of each program of a batch, a share of them widened."""
        code = stream[index].code
        random = torch.Generator(code.ids.device).manual_seed(scrambled(stream.seed, index))
        rows = torch.arange(len(code.ids), device=code.ids.device)
        place = torch.multinomial((code.ids > 0).any(-1).float(), 1, generator=random)[:, 0]
        ids, parameters = code.ids[rows, place], code.parameters[rows, place]
        moved = widened(ids, parameters, self.module.vocabulary, self._settings.spread, random)
        parameters = torch.where((rows < round(share * len(rows)))[:, None, None], moved, parameters)
        drawn = draw_blocks(Code(ids[:, None], parameters[:, None]))[:, 0]
        return Blocks(ids, parameters, unpack(drawn))

    def loss(self, batch: Blocks, progress: float, random: torch.Generator) -> dict[str, Tensor]:
        """Cross-entropy of the cells, weighted, and what is missing of their overlap."""
        cells, logits = batch.cells.float(), self._drawn(batch)
        emphasis = OCCUPIED + (self._settings.emphasis - OCCUPIED) * (1 - progress)
        weights = 1 + (emphasis - 1) * cells
        each = cell_cross_entropy(logits, cells)
        chance = logits.sigmoid()
        both, sizes = ((one).flatten(1).sum(-1) for one in (chance * cells, chance + cells))
        dice = (2 * both + 1) / (sizes + 1)
        return {
            "cells": (each * weights).sum() / weights.sum(),
            "overlap": self._settings.overlap * (1 - dice).mean(),
        }

    def _drawn(self, blocks: Blocks) -> Float[Tensor, "N 32 32 32"]:
        logits: Tensor = self.module(one_hot(blocks.ids, self.module.vocabulary.size).float(), blocks.parameters)
        return logits.float()

    def validate(self) -> Record:
        """Mean IoU of blocks that draw something: of the prior (``iou``), and widened."""
        scores = {}
        for name, blocks in self._validation.items():
            parts = zip(*(each.split(self._settings.batch) for each in blocks), strict=True)
            drawn = torch.cat([self._drawn(Blocks(*part)) > 0 for part in parts])
            true = blocks.cells.bool()
            both, either = ((one).flatten(1).sum(-1).double() for one in (drawn & true, drawn | true))
            there = true.flatten(1).any(-1)
            scores[name] = float((both[there] / either[there]).mean())
        return {**scores, "score": scores["iou"]}

    def save(self, path: Path, visits: int, scores: Record) -> None:
        """Write the executor with its card."""
        told = f"blocks of synthetic programs, prior {self._settings.prior}, {self._settings.widened:.0%} widened"
        card = card_of(
            self.module, data=told, seed=self._settings.seed, command=self._command, visits=visits, scores=dict(scores)
        )
        save_checkpoint(path, self.module, card)


def widened(
    ids: Int[Tensor, "N J"],
    parameters: Float[Tensor, "N J 7"],
    vocabulary: Vocabulary,
    spread: int,
    random: torch.Generator,
) -> Float[Tensor, "N J 7"]:
    """Whole parameters moved evenly by up to ``spread`` cells within their ranges; turns and counts drawn anew."""
    device = parameters.device
    low, high = vocabulary.ranges.to(device)[ids].unbind(-1)
    discrete, used = vocabulary.discrete.to(device)[ids], vocabulary.used.to(device)[ids]
    chance = torch.rand(parameters.shape, generator=random, device=device)
    moved = parameters + ((2 * spread + 1) * chance).floor() - spread
    moved = torch.minimum(torch.maximum(moved, low), high)
    drawn = 1 + (MOST_COPIES * chance).floor()
    return torch.where(discrete, torch.minimum(drawn, high), moved) * used


def train_executor(
    folder: Path,
    settings: ExecutorSettings,
    engine: Engine,
    *,
    command: str = "",
    restart: bool = False,
    stop: threading.Event | None = None,
    tensorboard: bool = False,
) -> Iterator[Record]:
    """Train a neural executor, yielding one record per step; see :func:`shapeprog.training.loop.run`.

    Parameters
    ----------
    command
        How to make the weights again, for their card.
    """
    torch.manual_seed(settings.seed)
    objective = ExecutorTraining(NeuralExecutor(Vocabulary.current()), settings, engine.device, command)
    return run(objective, settings, folder, engine, restart=restart, stop=stop, tensorboard=tensorboard)
