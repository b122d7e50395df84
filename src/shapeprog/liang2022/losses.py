"""Losses of adaptation (section 4.3 of Liang 2022), each declared by a decorator.

    import torch
    from shapeprog.liang2022 import loss

    @loss("huber")
    def huber(comparison):
        distance = comparison.scene.distance(comparison.points)
        return torch.nn.functional.huber_loss(distance, torch.zeros_like(distance), reduction="none").mean(-1)

A loss is one value for each shape of the batch; lengths are in cells, and ``scene.distance`` is 0 inside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from shapeprog.errors import DeclarationError, ShapeProgError, did_you_mean
from shapeprog.geometry import losses
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import SurfaceSample, sample_surface
from shapeprog.language.program import Draw, Program
from shapeprog.language.statement import is_word
from shapeprog.language.tensors import Code, encode
from shapeprog.language.unroll import unroll
from shapeprog.liang2022.settings import NEURAL
from shapeprog.space import HALF, RESOLUTION

SHARPNESS = 4.0
"""Slope of the logit of a soft cell, per cell of distance."""

POINT = Program((Draw("leg", (-1e-4,) * 3 + (2e-4,) * 3),))
"""As good as a single point in the centre of the grid."""

Values = Float[Tensor, " B"]


@dataclass(frozen=True)
class Comparison:
    """Predicted scenes, their targets, and the samples that several losses share, drawn once.

    Parameters
    ----------
    scene
        Predictions (B, N), each with a surface.
    points
        Points on the surfaces of the targets, in cells.
    cells
        Cells of the targets, 1 or 0.
    num_samples
        S, points drawn on each predicted surface, and cells compared.
    generator
        Source of randomness.
    canvas
        Makes the scenes of the numbers without offsets, whose cells are compared; ``scene`` by default.
    """

    scene: Scene
    points: Float[Tensor, "B P 3"]
    cells: UInt8[Tensor, "B 32 32 32"]
    num_samples: int
    generator: torch.Generator
    canvas: Callable[[], Scene] | None = None

    @cached_property
    def surface(self) -> SurfaceSample:
        """Points on the predicted surfaces, with gradient."""
        return sample_surface(self.scene, self.num_samples, self.generator)

    @cached_property
    def cell_sample(self) -> tuple[Int[Tensor, "B S"], Float[Tensor, "B S"]]:
        """Flat indices of sampled cells, half occupied and half empty in the target, and their weights."""
        flat, half = self.cells.flatten(1), max(1, self.num_samples // 2)
        index, weight = [], []
        for value in (1, 0):
            mask = (flat == value).float()
            index.append(torch.multinomial(mask + 1e-12, half, replacement=True, generator=self.generator))
            weight.append((mask.sum(1, keepdim=True) / half).expand(-1, half))
        return torch.cat(index, 1), torch.cat(weight, 1)

    @cached_property
    def cell_logits(self) -> Float[Tensor, "B S"]:
        """Logits of the soft occupancy of the sampled cells: minus sharpness times distance of their centres."""
        index = self.cell_sample[0]
        axes = [index.div(RESOLUTION**power, rounding_mode="floor") % RESOLUTION for power in (2, 1, 0)]
        centres = torch.stack(axes, -1).to(self.scene.centre) + 0.5 - HALF
        cell_scene = self.scene if self.canvas is None else self.canvas()
        return -SHARPNESS * signed_distance(cell_scene, centres).clamp(-1e3, 1e3)

    @cached_property
    def cell_targets(self) -> Float[Tensor, "B S"]:
        """Whether the sampled cells are occupied in the target, 1 or 0."""
        return self.cells.flatten(1).gather(1, self.cell_sample[0]).to(self.cell_logits)


Function = Callable[[Comparison], Values]


class Loss(NamedTuple):
    """A declared loss: its function, and whether it has a gradient to the parameters of a program."""

    function: Function
    has_gradient: bool


LOSSES: dict[str, Loss] = {}
"""Declared losses by name."""


def loss(name: str, *, has_gradient: bool = True) -> Callable[[Function], Function]:
    """Declare the decorated function as a loss, called by its name in settings such as ``chamfer=1``.

    Raises
    ------
    DeclarationError
        If the name is taken, or cannot be written in settings.
    """
    if name in LOSSES or name == NEURAL:
        raise DeclarationError(f"the loss {name!r} is declared twice", "give one of them another name")
    if not is_word(name):
        raise DeclarationError(f"{name!r} cannot be the name of a loss", "use letters, digits and underscores")

    def declare(function: Function) -> Function:
        LOSSES[name] = Loss(function, has_gradient)
        return function

    return declare


@loss("chamfer")
def chamfer(comparison: Comparison) -> Values:
    """Chamfer distance of points of the prediction and of the target (section 4.3.1)."""
    surface = comparison.surface
    return losses.chamfer(surface.points, comparison.points, weights=surface.weights)


@loss("coverage")
def coverage(comparison: Comparison) -> Values:
    """Mean distance of target points to the union of the primitives, 0 inside (equation 1)."""
    return losses.coverage(comparison.scene, comparison.points)


@loss("surface")
def surface(comparison: Comparison) -> Values:
    """Mean distance of target points to the surface of the union: equation 1 with a price on depth inside."""
    return losses.coverage(comparison.scene, comparison.points, surface=True)


@loss("excess")
def excess(comparison: Comparison) -> Values:
    """Mean distance of points of the prediction to the target: the reverse of equation 1, which needs it."""
    surface = comparison.surface
    return losses.excess(surface.points, comparison.points, weights=surface.weights)


@loss("volume")
def volume(comparison: Comparison) -> Values:
    """Volumes of all primitives added, in cubic cells."""
    return losses.volume(comparison.scene)


@loss("parts", has_gradient=False)
def parts(comparison: Comparison) -> Values:
    """Number of primitives."""
    return losses.parts(comparison.scene)


@loss("occupancy")
def occupancy(comparison: Comparison) -> Values:
    """Cross-entropy of soft cells, occupied and empty ones with equal weight."""
    return losses.cell_cross_entropy(comparison.cell_logits, comparison.cell_targets).mean(-1)


@loss("soft_iou")
def soft_iou(comparison: Comparison) -> Values:
    """One minus the IoU of soft cells, estimated from the sampled ones."""
    weights = comparison.cell_sample[1]
    return 1 - losses.weighted_iou(comparison.cell_logits.sigmoid(), comparison.cell_targets, weights)


def parse_losses(text: str) -> dict[str, float]:
    """Weights by name from text such as ``chamfer=1,occupancy=0.3``; a name alone weighs 1.

    Raises
    ------
    ShapeProgError
        If a name is unknown or given twice, or a weight is not a positive number.
    """
    weights: dict[str, float] = {}
    known = [*LOSSES, NEURAL]
    for part in text.split(","):
        name, _, number = (piece.strip() for piece in part.partition("="))
        if name not in known:
            hint = did_you_mean(name, known, f"choose from {', '.join(known)}", quoted=True)
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


def check_gradient(weights: Mapping[str, float]) -> None:
    """Raise a ``ShapeProgError`` if none of these losses has a gradient to the parameters of a program."""
    if not any(name == NEURAL or LOSSES[name].has_gradient for name in weights):
        names = " and ".join(repr(name) for name in weights)
        message = f"the loss {names} has no gradient" if len(weights) == 1 else f"the losses {names} have no gradient"
        raise ShapeProgError(message, "add one that has, such as chamfer=1, or train ids with --estimator rloo")


def compute(comparison: Comparison, weights: Mapping[str, float]) -> dict[str, Values]:
    """Weighted losses by name, without the one of the neural executor; weights are as ``parse_losses`` returns them.

    Raises
    ------
    ShapeProgError
        If a loss fails, or does not return one value for each shape.
    """
    values = {}
    for name in weights.keys() - {NEURAL}:
        try:
            value = values[name] = LOSSES[name].function(comparison)
        except (AttributeError, IndexError, NameError, RuntimeError, TypeError, ValueError) as error:
            raise ShapeProgError(f"the loss {name!r} raised {type(error).__name__}: {error}", "correct it") from error
        if value.shape != comparison.points.shape[:1]:
            message = f"the loss {name!r} returns values of shape {tuple(value.shape)}"
            raise ShapeProgError(message, f"return one for each of the {len(comparison.points)} shapes")
    return {name: weights[name] * values[name] for name in weights if name != NEURAL}


@torch.no_grad()
def empty_program_losses(
    points: Float[Tensor, "B P 3"], cells: UInt8[Tensor, "B 32 32 32"], weights: Mapping[str, float]
) -> dict[str, Values]:
    """Weighted losses of programs that draw nothing: those of a single point in the centre of the grid.

    They have no gradient; estimators of the gradient of ids learn from them to draw something.  ``points`` and
    ``cells`` are those of the targets; user losses need no special case.
    """
    code = encode([POINT] * len(points))
    scene = unroll(Code(code.ids.to(points.device), code.parameters.to(points)))
    generator = torch.Generator(points.device).manual_seed(0)
    return compute(Comparison(scene, points, cells, points.shape[1], generator), weights)
