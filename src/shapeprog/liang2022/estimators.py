"""Gradient estimators for the ids of statements, which a renderer gives no gradient (end of section 4.2).

Programs are sampled, and the log-probability of their ids is weighed by the advantage, the cost above a baseline
(REINFORCE, Williams 1992).  The cost in adaptation is 1 - IoU of the canvas.  The baseline is a network (NVIL, Mnih and
Gregor 2014) or the mean cost of the other samples of the same shape (leave one out, Kool et al. 2019).
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

DECAY = 0.9  # decay of the running mean and variance of costs, as published for NVIL


class NvilBaseline(nn.Module):
    """Predicts the cost of a program from the feature, of width F, of a block (NVIL, Mnih and Gregor 2014)."""

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
        """The advantage of the ids of every block, without gradient, and the loss that trains the baseline.

        From the features of the M live blocks and the cost of every program.  The advantage is the cost minus running
        mean and prediction, divided by the running standard deviation where that is above 1, and 0 where no block was
        sampled; the loss is the mean squared error of the prediction.  The running statistics change after their use,
        in training alone.
        """
        centred = (costs - self.mean)[:, None].expand(live.shape)[live]
        predicted = self.layers(feature.detach().to(self.mean))[:, 0]
        with torch.no_grad():
            advantage = (centred - predicted) / self.variance.sqrt().clamp(min=1)
            if self.training:
                self.mean.lerp_(costs.mean(), 1 - DECAY)
                self.variance.lerp_((centred - predicted).square().mean(), 1 - DECAY)
        return advantage.new_zeros(live.shape).masked_scatter(live, advantage), (predicted - centred).square().mean()


def leave_one_out_advantage(costs: Float[Tensor, "S B"]) -> Float[Tensor, "S B"]:
    """The cost of each of S > 1 samples minus the mean cost of the others (Kool et al. 2019)."""
    return (costs - costs.mean(0)) * (len(costs) / (len(costs) - 1))


def reinforce_loss(log_probs: Float[Tensor, "*S B K"], advantage: Float[Tensor, "*S B #K"]) -> Float[Tensor, ""]:
    """A loss whose gradient estimates that of the expected cost (REINFORCE, Williams 1992).

    Log-probabilities of the ids of every block times the advantage of the block or the program, which gets no gradient;
    added over blocks, as a mean over programs.
    """
    return (log_probs * advantage.detach()).sum(-1).mean()
