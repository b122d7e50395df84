"""Losses between shapes: chamfer, coverage and its reverse, occupancy, and the price of volume and of parts.

Sections and equations are those of Liang (2022), "Learning to Infer 3D Shape Programs with Differentiable Renderer".
All return one value for each shape of the batch.  Distances are in cells; squared ones are means, not sums.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from shapeprog.geometry.batch import Batch
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.nearest import mean_squared_distances, squared_distance
from shapeprog.geometry.primitive import primitives

Cloud = Float[Tensor, "*batch P 3"]
Weights = Float[Tensor, "*batch P"]
Target = Float[Tensor, "*batch Q 3"]
TargetWeights = Float[Tensor, "*batch Q"]
Values = Float[Tensor, "*batch"]
Grid = Float[Tensor, "*batch R R R"]
Marked = Shaped[Tensor, "*batch R R R"]
Row = Float[Tensor, "*batch S"]
Cells = Float[Tensor, "*cells"]


class Chamfer(NamedTuple):
    """Mean squared distance of points to the target (precision) and back (completeness)."""

    to_target: Values
    from_target: Values

    @property
    def total(self) -> Values:
        """Both directions added."""
        return self.to_target + self.from_target


def chamfer_directions(
    points: Cloud, target: Target, *, weights: Weights | None = None, target_weights: TargetWeights | None = None
) -> Chamfer:
    """Both directions of the chamfer distance, as means of squared distances over clouds that may differ in size.

    Weights of points in the mean, such as those of a surface sample; equal by default.
    """
    if weights is None and target_weights is None:
        return Chamfer(*mean_squared_distances(points, target))
    forward = _mean(squared_distance(points, target), weights)
    return Chamfer(forward, _mean(squared_distance(target, points), target_weights))


def chamfer(
    points: Cloud, target: Target, *, weights: Weights | None = None, target_weights: TargetWeights | None = None
) -> Values:
    """Chamfer distance: mean squared distance to the nearest neighbour, points to target plus target to points.

    That of section 4.3.1, where "sum" is a mean by its numbers.

    Parameters
    ----------
    points, target
        Clouds (..., P, 3) and (..., Q, 3) in cells, with gradient to both.
    weights, target_weights
        How much each point counts in the mean of its cloud; evenly by default.  Those of :func:`shapeprog.sample` make
        the gradient exact.

    Returns
    -------
    Tensor
        One value for each shape, in squared cells.
    """
    return chamfer_directions(points, target, weights=weights, target_weights=target_weights).total


def coverage(scene: Batch, target: Cloud, *, surface: bool = False) -> Values:
    """How far the target is from the union on average: the coverage loss, equation 1 of section 4.3.2.

    The distance to a union is equation 2, that to a cuboid equation 3, to a primitive in any pose equation 4; that to
    a cylinder is appendix A, mended.  A target point inside a primitive costs nothing, so alone it is minimised by one
    box that fills everything: add :func:`shapeprog.geometry.losses.excess` and a price.

    Parameters
    ----------
    scene
        What programs unroll to, with gradient to sizes and poses.
    target
        Points (..., P, 3) in cells.
    surface
        Whether the distance to the surface counts, so that points deep inside cost too.

    Returns
    -------
    Tensor
        One value for each shape, in cells.
    """
    distance = signed_distance(scene, target)
    return (distance.abs() if surface else distance.clamp(min=0)).mean(-1)


def excess(points: Cloud, target: Target, *, weights: Weights | None = None) -> Values:
    """How far points of the prediction are from the target on average: the reverse of coverage."""
    return _mean(torch.sqrt(squared_distance(points, target).clamp(min=1e-12)), weights)


def volume(scene: Batch) -> Values:
    """Price of volume: the volumes of all primitives added, in cubic cells; overlaps are paid for twice."""
    total = torch.zeros_like(scene.centre[..., 0])
    for kind in scene.kinds:
        here = scene.mask & (scene.kind == kind)
        total = total + torch.where(here, primitives[kind].volume(scene.size), 0)
    return total.sum(-1)


def parts(scene: Batch, presence: Float[Tensor, "*batch N"] | None = None) -> Values:
    """Price of parts: how many primitives there are, or are expected where ``presence`` gives their probabilities.

    It has a gradient to ``presence`` alone: no size or position changes how many there are.
    """
    mask = scene.mask.to(scene.size)
    return (mask if presence is None else mask * presence).sum(-1)


def cell_cross_entropy(logits: Cells, target: Cells, reduction: str = "none") -> Tensor:
    """Cross-entropy of the occupancy of each cell against the target, or its ``mean``, from logits."""
    return torch.nn.functional.binary_cross_entropy_with_logits(logits, target, reduction=reduction)


def occupancy_cross_entropy(logits: Grid, target: Marked) -> Values:
    """Cross-entropy of soft occupancy, see ``soft_logits``, as a mean over target cells, 0, 1 or a share between."""
    logits = logits.clamp(-1e4, 1e4)  # an empty scene is infinitely far away
    return cell_cross_entropy(logits, target.to(logits)).flatten(-3).mean(-1)


def soft_iou(occupancy: Grid, target: Marked) -> Values:
    """Intersection over union of soft cells against target cells; 1 when both are empty, exact for hard cells."""
    return weighted_iou(occupancy.flatten(-3), target.to(occupancy).flatten(-3))


def weighted_iou(occupancy: Row, target: Row, weights: Row | None = None) -> Values:
    """The same for some cells in a row, each weighted by the number of cells it represents."""
    both, either = occupancy * target, occupancy + target - occupancy * target
    if weights is not None:
        both, either = both * weights, either * weights
    shared, all_cells = both.sum(-1), either.sum(-1)
    return torch.where(all_cells > 0, shared / all_cells.clamp(min=1e-12), 1.0)


def _mean(values: Weights, weights: Weights | None) -> Values:
    return values.mean(-1) if weights is None else (values * weights).sum(-1) / weights.sum(-1)
