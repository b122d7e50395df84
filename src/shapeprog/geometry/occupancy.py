"""Soft occupancy of the grid, which has a gradient."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.geometry.batch import Batch
from shapeprog.geometry.distance import signed_distance
from shapeprog.space import RESOLUTION


def cell_centres(resolution: int = RESOLUTION, like: Tensor | None = None) -> Float[Tensor, "R R R 3"]:
    """Centres of all cells in the grid frame."""
    cell = RESOLUTION / resolution
    ticks = (torch.arange(resolution, dtype=torch.float64) + 0.5) * cell - RESOLUTION / 2
    grid = torch.stack(torch.meshgrid(ticks, ticks, ticks, indexing="ij"), -1)
    return grid.float() if like is None else grid.to(like)


def soft_logits(
    batch: Batch, sharpness: float | Tensor = 4.0, resolution: int = RESOLUTION
) -> Float[Tensor, "*batch R R R"]:
    """Logits of the soft occupancy: minus sharpness times the signed distance of the union at the cell centres."""
    centres = cell_centres(resolution, batch.centre)
    points = centres.reshape(-1, 3).expand(*batch.batch_shape, -1, 3)
    distance: Tensor = signed_distance(batch, points).unflatten(-1, centres.shape[:-1])
    return distance * -sharpness


def soft_occupancy(
    batch: Batch, sharpness: float | Tensor = 4.0, resolution: int = RESOLUTION
) -> Float[Tensor, "*batch R R R"]:
    """How far each cell is inside the union, between 0 and 1, with gradient to every size and pose.

    As the sharpness grows it tends to 1 where the centre of the cell is inside and to 0 where it is outside.

    Parameters
    ----------
    sharpness
        Slope per cell of the logit; the transition is about 4 / sharpness cells wide.
    """
    return torch.sigmoid(soft_logits(batch, sharpness, resolution))
