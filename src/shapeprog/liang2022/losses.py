"""Losses of adaptation: of renderings (section 4.3), and of ids, which a renderer gives no gradient (end of 4.2).

A loss of renderings is a function of a :class:`Comparison`, declared by ``loss``, with one value for each shape of
the batch; lengths are in cells, and ``scene.distance`` is negative inside.  README.md has an example.  The gradient of
ids is estimated: programs are sampled, and the log-probability of their ids is weighed by the advantage, the cost above
a baseline (REINFORCE, Williams 1992).  The cost in adaptation is 1 - IoU of the canvas.  The baseline is a network
(NVIL, Mnih and Gregor 2014) or the mean cost of the other samples of the same shape (leave one out, Kool et al. 2019).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor, nn

from shapeprog.errors import DeclarationError, ShapeProgError, did_you_mean
from shapeprog.geometry import losses
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import SurfaceSample, sample_surface
from shapeprog.language import Code, unroll
from shapeprog.language.statement import is_word
from shapeprog.liang2022.settings import NEURAL
from shapeprog.space import HALF, RESOLUTION

SHARPNESS = 4.0  # slope of the logit of a soft cell, per cell of distance
SHORTEST = 0.2
"""Cells; lengths below are drawn as long in training: four steps of Adam at a rate of .05, beyond which its momentum
would carry a length that shrinks below zero."""

DECAY = 0.9  # decay of the running mean and variance of costs, as published for NVIL


@dataclass(frozen=True)
class Comparison:
    """Predicted scenes and their targets."""

    scene: Scene  # predictions (B, N), each with a surface
    points: Float[Tensor, "B P 3"]  # on the surfaces of the targets, in cells
    cells: UInt8[Tensor, "B 32 32 32"]  # of the targets, 1 or 0
    num_samples: int  # points drawn on each predicted surface
    generator: torch.Generator  # source of randomness
    canvas: Code | None = None  # programs without sub-cell offsets, as drawn on the canvas; for losses of cells

    @cached_property
    def surface(self) -> SurfaceSample:
        """Points on the predicted surfaces, with gradient; drawn once for all losses."""
        return sample_surface(self.scene, self.num_samples, self.generator)


Values = Float[Tensor, " B"]
Loss = Callable[[Comparison], Values]

LOSSES: dict[str, Loss] = {}  # declared losses by name


def loss(name: str) -> Callable[[Loss], Loss]:
    """Declare a loss by its name in settings such as ``chamfer=1``; a ``DeclarationError`` if taken or no word.

    The same function, declared again as by a cell of a notebook, replaces its former self.
    """
    if not is_word(name):
        raise DeclarationError(f"{name!r} cannot be the name of a loss", "use letters, digits and underscores")

    def declare(function: Loss) -> Loss:
        if name == NEURAL or _place(LOSSES.get(name, function)) != _place(function):
            raise DeclarationError(f"the loss {name!r} is declared twice", "give one of them another name")
        LOSSES[name] = function
        return function

    return declare


def _place(function: Loss) -> tuple[str, str]:
    """Module and qualified name of a function."""
    return getattr(function, "__module__", ""), getattr(function, "__qualname__", repr(function))


@loss("chamfer")
def chamfer(comparison: Comparison) -> Values:
    """Chamfer distance of points of the prediction and of the target (section 4.3.1)."""
    surface = comparison.surface
    return losses.chamfer(surface.points, comparison.points, weights=surface.weights)


@loss("coverage")
def coverage(comparison: Comparison) -> Values:
    """Mean distance of target points to the union of the primitives, 0 inside (equation 1)."""
    return losses.coverage(comparison.scene, comparison.points)


@loss("soft_iou")
def soft_iou(comparison: Comparison) -> Values:
    """One minus the IoU of cells with logits ``-SHARPNESS * distance``, from as many occupied as empty target cells."""
    flat, half, index, weight = comparison.cells.flatten(1), max(1, comparison.num_samples // 2), [], []
    for value in (1, 0):
        mask = (flat == value).float()
        index.append(torch.multinomial(mask + 1e-12, half, replacement=True, generator=comparison.generator))
        weight.append((mask.sum(1, keepdim=True) / half).expand(-1, half))
    sampled, weights = torch.cat(index, 1), torch.cat(weight, 1)
    scene = comparison.scene if comparison.canvas is None else unroll(comparison.canvas, shortest=SHORTEST)
    axes = [sampled.div(RESOLUTION**power, rounding_mode="floor") % RESOLUTION for power in (2, 1, 0)]
    distance = signed_distance(scene, torch.stack(axes, -1).to(scene.centre) + 0.5 - HALF)
    logits = -SHARPNESS * distance.clamp(-1e3, 1e3)
    soft, hard = logits.sigmoid(), flat.gather(1, sampled).to(logits)
    both, either = (soft * hard * weights).sum(-1), ((soft + hard - soft * hard) * weights).sum(-1)
    return 1 - torch.where(either > 0, both / either.clamp(min=1e-12), 1.0)


def parse_losses(text: str) -> dict[str, float]:
    """Weights by name from text such as ``chamfer=1,soft_iou=3``, 1 by default; a ``ShapeProgError`` if it has none."""
    weights: dict[str, float] = {}
    names = [*LOSSES, NEURAL]
    for part in text.split(","):
        name, _, number = (piece.strip() for piece in part.partition("="))
        if name not in names:
            hint = did_you_mean(name, names, f"choose from {', '.join(names)}", quoted=True)
            raise ShapeProgError(f"unknown loss {name!r}", hint)
        if name in weights:
            raise ShapeProgError(f"the loss {name!r} is given twice", "add the weights")
        try:
            weights[name] = float(number or 1)
        except ValueError:
            weights[name] = math.nan
        if not 0 < weights[name] < math.inf:
            raise ShapeProgError(f"the weight of {name!r} is {number!r}", "give a positive number, such as chamfer=1")
    return weights


def compute(comparison: Comparison, weights: Mapping[str, float]) -> dict[str, Values]:
    """Weighted losses by name but that of the neural executor; a ``ShapeProgError`` if one has no value or gradient."""
    values = {}
    for name in [name for name in weights if name != NEURAL]:
        try:
            value = LOSSES[name](comparison)
        except Exception as error:  # a function of a user may raise anything
            cause = f"{type(error).__name__}: {error}".removesuffix(": ")
            raise ShapeProgError(f"the loss {name!r} raised {cause}", "correct it") from error
        if value.shape != comparison.points.shape[:1]:
            message = f"the loss {name!r} returns values of shape {tuple(value.shape)}"
            raise ShapeProgError(message, f"return one for each of the {len(comparison.points)} shapes")
        if comparison.scene.centre.requires_grad and not value.requires_grad:
            raise ShapeProgError(f"the loss {name!r} has no gradient", "compute it from comparison.scene")
        values[name] = weights[name] * value
    return values


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

        The advantage is the cost minus running mean and prediction, divided by the running standard deviation where
        that is above 1, and 0 where no block was sampled.  Running statistics change in training alone.
        """
        centred = (costs - self.mean)[:, None].expand(live.shape)[live]
        predicted = self.layers(feature.detach().to(self.mean))[:, 0]
        with torch.no_grad():
            advantage = (centred - predicted) / self.variance.sqrt().clamp(min=1)
            if self.training:
                self.mean.lerp_(costs.mean(), 1 - DECAY)
                self.variance.lerp_((centred - predicted).square().mean(), 1 - DECAY)
        return advantage.new_zeros(live.shape).masked_scatter(live, advantage), (predicted - centred).square().mean()


def leave_one_out(costs: Float[Tensor, "S B"]) -> Float[Tensor, "S B"]:
    """The cost of each of S > 1 samples minus the mean cost of the others (Kool et al. 2019)."""
    return (costs - costs.mean(0)) * (len(costs) / (len(costs) - 1))


def reinforce_loss(log_probs: Float[Tensor, "*S B K"], advantage: Float[Tensor, "*S B #K"]) -> Float[Tensor, ""]:
    """A loss whose gradient estimates that of the expected cost: a sum over blocks, a mean over programs.

    Log-probabilities of the ids of every block times the advantage of block or program, which gets no gradient.
    """
    return (log_probs * advantage.detach()).sum(-1).mean()
