"""The neural executor of Tian et al. 2019, which draws a block whose ids are probabilities.

It is the baseline that guided adaptation differentiates through.
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from shapeprog.language.statement import SLOTS
from shapeprog.liang2022.generator import IDS

INITIAL_SCALE = 0.1
"""Scale of the initial weights of numbers, which reach 32 and would saturate the LSTM."""

EMPTY_LOGIT = -20.0
"""Logit of a cell that no block draws; its cross-entropy stays finite."""


class NeuralExecutor(nn.Module):
    """Draws a block: 862,272 weights, layers and names as published."""

    def __init__(self) -> None:
        super().__init__()
        self.pgm_embed, self.param_embed = nn.Linear(IDS, 64), nn.Linear(SLOTS, 64)
        with torch.no_grad():
            self.param_embed.weight *= INITIAL_SCALE
        self.lstm = nn.LSTM(128, 128, bias=False, batch_first=True)
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
        """Logits of the union of the blocks that draw.

        The sigmoid of the largest logit is the largest probability, which is the published union.
        """
        rows = self(ids[draws], numbers[draws])
        full = rows.new_full((*draws.shape, *rows.shape[1:]), EMPTY_LOGIT)
        return full.masked_scatter(draws[..., None, None, None], rows).amax(1)
