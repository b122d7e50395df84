"""The neural executor of Tian et al. 2019, which draws a block whose ids are probabilities, and its training.

The published one was trained on 27 million blocks; to learn from a twentieth of that, blocks are endless, the Dice loss
is added, and occupied cells weigh more at first: a network that has learned to draw none does not recover.
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn.functional import one_hot

from shapeprog.geometry.cells import iou, pack, unpack
from shapeprog.language.statement import SLOTS
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks
from shapeprog.liang2022.generator import IDS, vocabulary
from shapeprog.liang2022.prior import PRIORS, SyntheticBatch, scramble
from shapeprog.liang2022.settings import ExecutorSettings
from shapeprog.liang2022.tian2019 import LSTM

INITIAL_SCALE = 0.1  # scale of the initial weights of numbers, which reach 32 and would saturate the LSTM
EMPTY_LOGIT = -20.0  # logit of a cell that no block draws; its cross-entropy stays finite
OCCUPIED_WEIGHT = (30.0, 5.0)  # weight of an occupied cell at the start of training, and at its end as published
MOVED_BY, MAX_COUNT = 6, 8  # cells that a widened number is moved by at most, and its largest loop count
VALIDATION_BLOCKS = 512
BLOCKS_OF_PROGRAM = 3  # blocks that are taken of each synthetic program, in the mean; a program has four


class NeuralExecutor(nn.Module):
    """Draws a block: 862,272 weights, layers and names as published."""

    def __init__(self) -> None:
        super().__init__()
        self.pgm_embed, self.param_embed = nn.Linear(IDS, 64), nn.Linear(SLOTS, 64)
        with torch.no_grad():
            self.param_embed.weight *= INITIAL_SCALE
        self.lstm = LSTM(128, 128, bias=False, batch_first=True)
        self.pgm_param_feat = nn.Linear(128, 128)
        self.decoder = nn.Sequential(
            nn.ConvTranspose3d(128, 64, 4, 1, 0, bias=False), nn.BatchNorm3d(64), nn.ReLU(inplace=True),
            nn.Conv3d(64, 64, 3, 1, 1, bias=False), nn.BatchNorm3d(64), nn.ReLU(inplace=True),
            nn.ConvTranspose3d(64, 16, 4, 2, 1, bias=False), nn.BatchNorm3d(16), nn.ReLU(inplace=True),
            nn.Conv3d(16, 16, 3, 1, 1, bias=False), nn.BatchNorm3d(16), nn.ReLU(inplace=True),
            nn.ConvTranspose3d(16, 4, 4, 2, 1, bias=False), nn.BatchNorm3d(4), nn.ReLU(inplace=True),
            nn.Conv3d(4, 4, 3, 1, 1, bias=False), nn.BatchNorm3d(4), nn.ReLU(inplace=True),
            nn.ConvTranspose3d(4, 2, 4, 2, 1, bias=False),
        )  # fmt: skip

    def forward(self, ids: Float[Tensor, "N J V"], numbers: Float[Tensor, "N J 7"]) -> Float[Tensor, "N 32 32 32"]:
        """Logits of occupied cells, for probabilities of the ids of each step."""
        inputs = torch.cat([self.pgm_embed(ids).relu(), self.param_embed(numbers).relu()], -1)
        feature = self.pgm_param_feat(self.lstm(inputs)[0][:, -1]).relu()
        scores = self.decoder(feature[..., None, None, None]).float()
        return scores[:, 1] - scores[:, 0]

    def union(
        self, ids: Float[Tensor, "B K J V"], numbers: Float[Tensor, "B K J 7"], draws: Bool[Tensor, "B K"]
    ) -> Float[Tensor, "B 32 32 32"]:
        """Logits of the union of the blocks that draw: the largest, as published the largest probability."""
        rows = self(ids[draws], numbers[draws])
        full = rows.new_full((*draws.shape, *rows.shape[1:]), EMPTY_LOGIT)
        return full.masked_scatter(draws[..., None, None, None], rows).amax(1)


class ExecutorTask:
    """Training of the executor on blocks of synthetic programs; a task of :func:`~shapeprog.liang2022.loop.train`."""

    def __init__(self, settings: ExecutorSettings) -> None:
        torch.manual_seed(settings.seed)
        self.module = self.network = NeuralExecutor()
        self.data = f"synthetic blocks, prior {settings.prior}, {settings.widened:.0%} widened"
        self._settings, shares = settings, {"iou": 0.0, "widened": 1.0}
        self._validation = {name: self._blocks(VALIDATION_BLOCKS, -1, 0, share) for name, share in shares.items()}

    def batch(self, index: int) -> SyntheticBatch:
        """Blocks (N, J) of synthetic programs, a share of them widened, and their cells."""
        return self._blocks(self._settings.batch_size, self._settings.seed, index, self._settings.widened)

    def _blocks(self, count: int, seed: int, index: int, share: float) -> SyntheticBatch:
        code = PRIORS[self._settings.prior].batch(-(-count // BLOCKS_OF_PROGRAM), seed, index).code
        rng = torch.Generator().manual_seed(scramble(self._settings.seed, 1, index))
        drawing = (code.ids > 0).any(-1).nonzero()
        row, block = drawing[torch.randperm(len(drawing), generator=rng)[:count]].unbind(-1)
        ids, numbers, widened = code.ids[row, block], code.parameters[row, block], round(share * len(row))
        numbers[:widened] = _widened(ids, numbers, rng)[:widened]
        cells = draw_blocks(Code(ids[:, None], numbers[:, None]))[:, 0]
        return SyntheticBatch(Code(ids, numbers), unpack(cells))

    def losses(self, batch: SyntheticBatch, progress: float, rng: torch.Generator) -> dict[str, Tensor]:
        """Weighted cross-entropy of the cells, and the Dice loss (Milletari et al. 2016)."""
        logits = self._logits(batch.code)
        cells, (first, last) = batch.voxels.to(logits), OCCUPIED_WEIGHT
        weights = 1 + (first + (last - first) * progress - 1) * cells
        overlap, size = (part.flatten(1).sum(-1) for part in (logits.sigmoid() * cells, logits.sigmoid() + cells))
        dice = (2 * overlap + 1) / (size + 1)
        total = torch.nn.functional.binary_cross_entropy_with_logits(logits, cells, weights, reduction="sum")
        return {"cells": total / weights.sum(), "dice": 1 - dice.mean()}

    def _logits(self, blocks: Code) -> Float[Tensor, "N 32 32 32"]:
        device = self.module.param_embed.weight.device
        logits: Tensor = self.module(one_hot(blocks.ids, IDS).float().to(device), blocks.parameters.to(device))
        return logits.float()

    def validate(self) -> dict[str, float]:
        """Mean IoU of blocks of the prior (``iou``) and of widened ones, where they draw something."""
        scores = {}
        for name, (blocks, cells) in self._validation.items():
            overlap = iou(pack(self._logits(blocks).cpu() > 0), pack(cells))
            scores[name] = float(overlap[cells.flatten(1).amax(-1) > 0].mean())
        return {**scores, "score": scores["iou"]}


def _widened(ids: Int[Tensor, "N J"], numbers: Float[Tensor, "N J 7"], rng: torch.Generator) -> Float[Tensor, "N J 7"]:
    """Numbers moved evenly by some cells within their ranges; counts and quarter turns drawn anew."""
    table = vocabulary()
    uniform = torch.rand(numbers.shape, generator=rng)
    moved = numbers + ((2 * MOVED_BY + 1) * uniform).floor() - MOVED_BY
    moved = torch.minimum(torch.maximum(moved, table.low[ids]), table.high[ids])
    counts = torch.minimum(1 + (MAX_COUNT * uniform).floor(), table.high[ids])
    return torch.where(table.discrete[ids], counts, moved) * table.used[ids]
