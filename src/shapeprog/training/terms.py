"""Terms of the loss of adaptation by name: each says how far predicted shapes are from their targets.

Lengths are in cells, so a chamfer of 1 is a mean squared distance of one cell, both directions added.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.geometry import losses
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import SurfaceSample, sample_surface
from shapeprog.space import HALF, RESOLUTION

NEURAL = "neural"
"""The term of the neural executor, which looks at the prediction itself and not at a scene."""

SHARPNESS = 4.0
"""How fast a soft cell fills, per cell of distance."""

Values = Float[Tensor, " B"]


@dataclass(frozen=True)
class Comparison:
    """Predicted scenes beside their targets, and what several terms need of both, made once.

    Parameters
    ----------
    scene
        Scenes (B, N), each with a surface.
    points
        Points on the surfaces of the targets.
    cells
        Cells of the targets, 1 or 0.
    samples
        Points drawn on each predicted surface, and cells looked at.
    random
        Where they are drawn from.
    """

    scene: Scene
    points: Float[Tensor, "B P 3"]
    cells: UInt8[Tensor, "B 32 32 32"]
    samples: int
    random: torch.Generator

    @cached_property
    def surface(self) -> SurfaceSample:
        """Points on the predicted surfaces."""
        return sample_surface(self.scene, self.samples, self.random)

    @cached_property
    def places(self) -> tuple[Int[Tensor, "B S"], Float[Tensor, "B S"]]:
        """Cells to look at, half of them occupied and half empty in the target, and how many each stands for."""
        flat = self.cells.flatten(1)
        half = max(1, self.samples // 2)
        both = [
            torch.multinomial((flat == kind).float() + 1e-12, half, replacement=True, generator=self.random)
            for kind in (1, 0)
        ]
        occupied = flat.sum(1, dtype=torch.float32)[:, None]
        shares = [(count / half).expand(-1, half) for count in (occupied, flat.shape[1] - occupied)]
        return torch.cat(both, 1), torch.cat(shares, 1)

    @cached_property
    def logits(self) -> Float[Tensor, "B S"]:
        """Logits of the soft occupancy of these cells: minus the sharpness times the distance of their centres."""
        place = self.places[0]
        up, rest = place.div(RESOLUTION**2, rounding_mode="floor"), place % RESOLUTION**2
        centre = torch.stack([up, rest.div(RESOLUTION, rounding_mode="floor"), rest % RESOLUTION], -1) - HALF + 0.5
        return -SHARPNESS * signed_distance(self.scene, centre.to(self.scene.centre)).clamp(-1e3, 1e3)

    @cached_property
    def wanted(self) -> Float[Tensor, "B S"]:
        """What these cells are in the target."""
        return self.cells.flatten(1).gather(1, self.places[0]).to(self.logits)


def _occupancy(seen: Comparison) -> Values:
    """Cross-entropy of soft cells, occupied and empty ones counting alike."""
    return losses.cell_cross_entropy(seen.logits, seen.wanted).mean(-1)


def _soft_iou(seen: Comparison) -> Values:
    """One minus the IoU of soft cells, estimated from those that are looked at."""
    return 1 - losses.weighted_iou(seen.logits.sigmoid(), seen.wanted, seen.places[1])


TERMS: dict[str, Callable[[Comparison], Values]] = {
    "chamfer": lambda seen: losses.chamfer(seen.surface.points, seen.points, weights=seen.surface.weights),
    "coverage": lambda seen: losses.coverage(seen.scene, seen.points),
    "surface": lambda seen: losses.coverage(seen.scene, seen.points, surface=True),
    "excess": lambda seen: losses.excess(seen.surface.points, seen.points, weights=seen.surface.weights),
    "volume": lambda seen: losses.volume(seen.scene),
    "parts": lambda seen: losses.parts(seen.scene),
    "occupancy": _occupancy,
    "soft_iou": _soft_iou,
}
"""Terms that look at scenes, by name: the paper's chamfer, and its coverage with what that needs beside it."""


def parse_terms(text: str) -> dict[str, float]:
    """Weights by name from ``NAME=WEIGHT,NAME=WEIGHT``; a name alone weighs one.

    Raises
    ------
    ShapeProgError
        If a name is not known, or given twice, or a weight is no positive number.
    """
    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, number = (each.strip() for each in part.partition("="))
        known = [*TERMS, NEURAL]
        if name not in known:
            cure = did_you_mean(name, known, f"choose from {', '.join(known)}", quoted=True)
            raise ShapeProgError(f"there is no loss {name!r}", cure)
        try:
            weight = float(number or 1)
        except ValueError:
            weight = math.nan
        if not (weight > 0 and math.isfinite(weight)):
            raise ShapeProgError(f"the weight of {name} is {number!r}", "give a positive number, such as chamfer=1")
        if name in found:
            raise ShapeProgError(f"the loss {name} is given twice", "add its weights up")
        found[name] = weight
    return found


def compare(seen: Comparison, weights: Mapping[str, float]) -> dict[str, Values]:
    """The weighted terms (B,) of scenes; the one of the neural executor is left out."""
    return {name: weight * TERMS[name](seen) for name, weight in weights.items() if name != NEURAL}


def lacking(seen_points: Float[Tensor, "B P 3"], weights: Mapping[str, float]) -> dict[str, Values]:
    """The same terms for programs that draw nothing, as if a single point in the centre of the grid were drawn.

    Without gradient: what tells the ids to draw something.
    """
    squared = (seen_points**2).sum(-1)
    nearest, length = squared.amin(-1), squared.sqrt().mean(-1)
    values = {
        "chamfer": squared.mean(-1) + nearest,
        "coverage": length,
        "surface": length,
        "excess": nearest.sqrt(),
        "volume": torch.zeros_like(length),
        "parts": torch.zeros_like(length),
        "occupancy": torch.full_like(length, _NOTHING),
        "soft_iou": torch.ones_like(length),
    }
    return {name: weight * values[name] for name, weight in weights.items() if name != NEURAL}


_NOTHING = 0.5 * SHARPNESS * HALF / 2
"""Balanced cross-entropy of an empty grid: half the cells are missed, by half the way from the centre to a side."""
