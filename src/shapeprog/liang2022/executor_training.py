"""Training of the neural executor on single blocks of synthetic programs.

The published one was trained on 27 million blocks; to learn from a hundredth of that, blocks are endless, the Dice loss
is added to the cross-entropy, and occupied cells weigh more at the start: few cells belong to a block, and a network
that has learned to draw none does not recover.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor
from torch.nn.functional import one_hot

from shapeprog.geometry.cells import iou, pack, unpack
from shapeprog.geometry.losses import cell_cross_entropy
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks
from shapeprog.liang2022.executor import NeuralExecutor
from shapeprog.liang2022.generator import IDS, vocabulary
from shapeprog.liang2022.loop import Record, scramble
from shapeprog.liang2022.prior import SyntheticStream, prior
from shapeprog.liang2022.settings import ExecutorSettings
from shapeprog.liang2022.weights import save_weights

OCCUPIED_WEIGHT = (30.0, 5.0)
"""Weight of an occupied cell at the start of training, and at its end as published."""

MOVED_BY, MAX_COUNT = 6, 8
"""Cells that a widened number is moved by at most, and its largest loop count."""

VALIDATION_BLOCKS = 512


class Blocks(NamedTuple):
    """Single blocks and their cells."""

    ids: Int[Tensor, "N J"]
    numbers: Float[Tensor, "N J 7"]
    cells: UInt8[Tensor, "N 32 32 32"]


class ExecutorTask:
    """Training of the executor on blocks of synthetic programs; a task of :func:`~shapeprog.liang2022.loop.train`."""

    def __init__(self, settings: ExecutorSettings, command: str = "") -> None:
        torch.manual_seed(settings.seed)
        self.module, self._settings, self._command = NeuralExecutor(), settings, command
        self._stream = SyntheticStream(prior(settings.prior), settings.batch_size, settings.seed)
        held_out = SyntheticStream(prior(settings.prior), VALIDATION_BLOCKS, -1)
        self._validation = {name: self._blocks(held_out, 0, share) for name, share in (("iou", 0.0), ("widened", 1.0))}

    def batch(self, index: int) -> Blocks:
        """One block of each synthetic program, a share of them widened."""
        return self._blocks(self._stream, index, self._settings.widened)

    def _blocks(self, stream: SyntheticStream, index: int, share: float) -> Blocks:
        code = stream[index].code
        rng = torch.Generator().manual_seed(scramble(self._settings.seed, 1, index))
        block = torch.multinomial((code.ids > 0).any(-1).float(), 1, generator=rng)[:, 0]
        row, widened = torch.arange(len(block)), round(share * len(block))
        ids, numbers = code.ids[row, block], code.parameters[row, block]
        numbers[:widened] = _widened(ids, numbers, rng)[:widened]
        return Blocks(ids, numbers, unpack(draw_blocks(Code(ids[:, None], numbers[:, None]))[:, 0]))

    def losses(self, batch: Blocks, progress: float, rng: torch.Generator) -> dict[str, Tensor]:
        """Weighted cross-entropy of the cells, and the Dice loss (Milletari et al. 2016)."""
        logits = self._logits(batch)
        cells = batch.cells.to(logits)
        first, last = OCCUPIED_WEIGHT
        weights = 1 + (first + (last - first) * progress - 1) * cells
        overlap, size = (part.flatten(1).sum(-1) for part in (logits.sigmoid() * cells, logits.sigmoid() + cells))
        dice = (2 * overlap + 1) / (size + 1)
        cross_entropy = (cell_cross_entropy(logits, cells) * weights).sum() / weights.sum()
        return {"cells": cross_entropy, "dice": 1 - dice.mean()}

    def _logits(self, blocks: Blocks) -> Float[Tensor, "N 32 32 32"]:
        device = self.module.param_embed.weight.device
        logits: Tensor = self.module(one_hot(blocks.ids, IDS).float().to(device), blocks.numbers.to(device))
        return logits.float()

    def validate(self) -> Record:
        """Mean IoU of blocks of the prior (``iou``) and of widened ones, where they draw something."""
        scores = {}
        for name, blocks in self._validation.items():
            overlap = iou(pack(self._logits(blocks).cpu() > 0), pack(blocks.cells))
            scores[name] = float(overlap[blocks.cells.flatten(1).amax(-1) > 0].mean())
        return {**scores, "score": scores["iou"]}

    def save(self, path: Path, samples_seen: int, scores: Record) -> None:
        """Write the executor with its card."""
        data = f"synthetic blocks, prior {self._settings.prior}, {self._settings.widened:.0%} widened"
        save_weights(
            path, self.module, data=data, seed=self._settings.seed, command=self._command, samples_seen=samples_seen,
            scores=dict(scores),
        )  # fmt: skip


def _widened(ids: Int[Tensor, "N J"], numbers: Float[Tensor, "N J 7"], rng: torch.Generator) -> Float[Tensor, "N J 7"]:
    """Numbers moved evenly by some cells within their ranges; counts and quarter turns drawn anew."""
    table = vocabulary()
    uniform = torch.rand(numbers.shape, generator=rng)
    moved = numbers + ((2 * MOVED_BY + 1) * uniform).floor() - MOVED_BY
    moved = torch.minimum(torch.maximum(moved, table.low[ids]), table.high[ids])
    counts = torch.minimum(1 + (MAX_COUNT * uniform).floor(), table.high[ids])
    return torch.where(table.discrete[ids], counts, moved) * table.used[ids]
