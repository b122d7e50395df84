"""The neural executor of Tian et al. (ICLR 2019): one block of a program in, soft cells out.

It stands in for the renderer where a gradient to the ids is wanted (guided adaptation); the layers, and the names of
the weights, are those of the published network.
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from shapeprog.language.statement import SLOTS
from shapeprog.models.vocabulary import Vocabulary

FIRST = 0.1
"""Factor of the first weights of parameters."""

NOTHING = -20.0
"""Logit of a cell that no block draws: a chance of 2e-9, whose cross-entropy is still finite."""


class NeuralExecutor(nn.Module):
    """Draws a block whose ids are probabilities; 862,272 parameters for the built-in statements.

    Parameters
    ----------
    vocabulary
        The statements whose ids it takes.
    width
        Width of the LSTM and of what the decoder starts from.
    """

    def __init__(self, vocabulary: Vocabulary, width: int = 128) -> None:
        super().__init__()
        self.vocabulary = vocabulary
        self.pgm_embed = nn.Linear(vocabulary.size, width // 2)
        self.param_embed = nn.Linear(SLOTS, width - width // 2)
        with torch.no_grad():
            self.param_embed.weight *= FIRST  # numbers of up to 32 would saturate the LSTM from the start
        self.lstm = nn.LSTM(width, width, bias=False, batch_first=True)
        self.pgm_param_feat = nn.Linear(width, width)
        self.decoder = nn.Sequential(
            nn.ConvTranspose3d(width, 64, 4, 1, 0, bias=False), nn.BatchNorm3d(64), nn.ReLU(inplace=True),
            nn.Conv3d(64, 64, 3, 1, 1, bias=False), nn.BatchNorm3d(64), nn.ReLU(inplace=True),
            nn.ConvTranspose3d(64, 16, 4, 2, 1, bias=False), nn.BatchNorm3d(16), nn.ReLU(inplace=True),
            nn.Conv3d(16, 16, 3, 1, 1, bias=False), nn.BatchNorm3d(16), nn.ReLU(inplace=True),
            nn.ConvTranspose3d(16, 4, 4, 2, 1, bias=False), nn.BatchNorm3d(4), nn.ReLU(inplace=True),
            nn.Conv3d(4, 4, 3, 1, 1, bias=False), nn.BatchNorm3d(4), nn.ReLU(inplace=True),
            nn.ConvTranspose3d(4, 2, 4, 2, 1, bias=False),
        )  # fmt: skip

    def forward(self, ids: Float[Tensor, "N J V"], parameters: Float[Tensor, "N J 7"]) -> Float[Tensor, "N 32 32 32"]:
        """Logits of a cell being occupied: the score of the second class minus that of the first.

        Parameters
        ----------
        ids
            Probabilities of the ids of each step, or one-hot ids.
        parameters
            Parameters of each step in slot order.
        """
        told = torch.cat([self.pgm_embed(ids).relu(), self.param_embed(parameters).relu()], -1)
        heard = self.lstm(told)[0][:, -1]
        feature = self.pgm_param_feat(heard).relu()
        scores = self.decoder(feature[..., None, None, None]).float()
        return scores[:, 1] - scores[:, 0]

    def union(
        self,
        ids: Float[Tensor, "B K J V"],
        parameters: Float[Tensor, "B K J 7"],
        drawn: Bool[Tensor, "B K"] | None = None,
    ) -> Float[Tensor, "B 32 32 32"]:
        """Logits of the union of the blocks: for each cell the block that is surest of it.

        The largest of the logits is the logit of the largest probability, so its sigmoid is the maximum of the
        occupied probabilities, as published.

        Parameters
        ----------
        drawn
            The blocks that count; by default all.  The executor has never seen an empty block.
        """
        if drawn is None:
            drawn = torch.ones(ids.shape[:2], dtype=torch.bool, device=ids.device)
        each = self(ids[drawn], parameters[drawn])
        place = drawn[..., None, None, None]
        full = each.new_full((*drawn.shape, *each.shape[1:]), NOTHING)
        return full.masked_scatter(place, each).max(1).values
