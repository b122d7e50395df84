"""Losses between shapes: chamfer, coverage and its reverse.

Sections and equations are those of Liang (2022), "Learning to Infer 3D Shape Programs with Differentiable Renderer".
All return one value for each shape of the batch.  Distances are in cells; squared ones are means, not sums.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.arguments import check_points, check_tensor
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.nearest import squared_distance

Cloud = Float[Tensor, "*batch P 3"]
Weights = Float[Tensor, "*batch P"]
Target = Float[Tensor, "*batch Q 3"]
TargetWeights = Float[Tensor, "*batch Q"]
Values = Float[Tensor, "*batch"]


def chamfer(
    points: Cloud, target: Target, *, weights: Weights | None = None, target_weights: TargetWeights | None = None
) -> Values:
    """Chamfer distance: mean squared distance to the nearest neighbour, points to target plus target to points.

    Section 4.3.1 says "sum", but only means fit its published values.

    Parameters
    ----------
    points, target
        Clouds (..., P, 3) and (..., Q, 3) in cells with equal leading dimensions, with gradient to both.
    weights, target_weights
        How much each point counts in the mean of its cloud; evenly by default.  Those of :func:`shapeprog.sample` add
        to the gradient how the areas of faces change.

    Returns
    -------
    Tensor
        One value for each shape, in squared cells.

    Raises
    ------
    ShapeProgError
        If a tensor has another type or shape, or the target a number that is not finite.
    """
    check_points("target", target)
    there = _mean(squared_distance(points, target), weights)
    return there + _mean(squared_distance(target, points), target_weights)


def coverage(scene: Batch, target: Cloud, *, surface: bool = False) -> Values:
    """How far the target is from the union on average: the coverage loss, equation 1 of section 4.3.2.

    The distance to a union is equation 2, that to a cuboid equation 3, to a primitive in any pose equation 4; that to
    a cylinder is appendix A, corrected.  A target point inside a primitive costs nothing, so alone it is minimised by a
    box that fills everything: add :func:`shapeprog.geometry.losses.excess`.

    Parameters
    ----------
    scene
        What programs unroll to, with gradient to sizes and poses.
    target
        Points (P, 3) in cells, the same for all scenes, or (..., P, 3) with their leading dimensions.
    surface
        Whether the distance to the surface counts, so that points deep inside cost too.

    Returns
    -------
    Tensor
        One value for each shape, in cells.

    Raises
    ------
    ShapeProgError
        If ``scene`` is no scene, or the target has another type or shape, or numbers that are not finite.
    """
    check_points("target", target)
    distance = signed_distance(scene, target)
    return (distance.abs() if surface else distance.clamp(min=0)).mean(-1)


def excess(points: Cloud, target: Target, *, weights: Weights | None = None) -> Values:
    """How far points of the prediction are from the target on average: the reverse of coverage; raises what
    :func:`chamfer` does."""
    check_points("target", target)
    return _mean(torch.sqrt(squared_distance(points, target).clamp(min=1e-12)), weights)


def _mean(values: Weights, weights: Weights | None) -> Values:
    if weights is None:
        return values.mean(-1)
    check_tensor("weights", weights, *values.shape, lead=False)
    return (values * weights).sum(-1) / weights.sum(-1)
