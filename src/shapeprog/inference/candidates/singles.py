"""Single drawing statements as candidates, one for each piece of a target.

Every statement with a hint is tried on every piece; statements without a hint are tried on the most important pieces,
with many starts.  The best are fitted to the points of the piece.  Of those with nearly equal misfit, the one with the
fewest numbers is a candidate, so that copies have the same statement.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from scipy.ndimage import minimum
from torch import Tensor

from shapeprog.geometry.distance import distance_and_slopes
from shapeprog.inference.candidates.drawings import drawings, is_unhinted, scene_of, starts
from shapeprog.inference.candidates.settings import SETTINGS
from shapeprog.inference.fit.tunable import STEP, THINNEST, least
from shapeprog.inference.pieces.pieces import Pieces, near
from shapeprog.language.hints import Box
from shapeprog.language.printer import numbers_written
from shapeprog.language.program import Draw, Node, Program
from shapeprog.language.statement import language
from shapeprog.language.tensors import Code, encode
from shapeprog.language.unroll import Plan
from shapeprog.space import Array, FloatArray


def single_candidates(pieces: Pieces) -> list[Node]:
    """The simplest drawing statement for every piece with points, in the order of the pieces."""
    points, normals, indices = _target(pieces)
    found = pieces.boxes.take(indices)
    boxes = list(map(Box, found.centre, found.rotation, np.maximum(found.half, THINNEST / 2)))
    tried = [drawings(box) for box in boxes]
    for declared in filter(is_unhinted, language()):
        for box, options in zip(boxes[: SETTINGS.fitted], tried, strict=False):
            options += starts(declared, box)
    draws = [draw for options in tried for draw in options]
    if not draws:
        return []
    owner = np.repeat(np.arange(len(boxes)), [len(options) for options in tried])
    misfit = misfits(draws, points[owner], normals[owner])
    best = minimum(misfit, owner, owner)  # of the same piece
    unsure = np.flatnonzero((owner < SETTINGS.fitted) & (best > SETTINGS.good) & (misfit <= best + SETTINGS.worth))
    if len(unsure):
        better = fitted([draws[k] for k in unsure], points[owner[unsure]])
        misfit = np.append(misfit, misfits(better, points[owner[unsure]], normals[owner[unsure]]))
        draws, owner = [*draws, *better], np.append(owner, owner[unsure])
        best = minimum(misfit, owner, owner)
    order = np.flatnonzero(misfit <= best + SETTINGS.slack).tolist()
    order.sort(key=lambda k: (numbers_written(draws[k]), misfit[k]), reverse=True)
    simplest = {int(owner[k]): k for k in order}
    return [draws[k] for _, k in sorted(simplest.items())]


def fitted(draws: Sequence[Draw], target: Float[Tensor, "B P 3"]) -> list[Draw]:
    """Statements, at least one, fitted to points (B, P, 3) by Gauss-Newton steps with a prior on their numbers."""
    code = encode([Program((draw,)) for draw in draws], dtype=torch.float64)
    ids, start = code.ids[:, :, :1], code.parameters[:, 0, 0]  # a drawing is the first step of its block
    values, slots, points = start, start.shape[1], target.shape[1]
    free, low = torch.zeros(start.shape, dtype=torch.bool), torch.zeros_like(start)
    for row, draw in enumerate(draws):
        for slot, quantity in enumerate(language()[draw.name].quantities):
            free[row, slot], low[row, slot] = not quantity.discrete, least(quantity)
    away = STEP * torch.eye(slots, dtype=torch.float64)
    away = torch.cat([torch.zeros_like(away[:1]), away, -away])[:, None]
    plan = Plan(Code(*(part.expand(len(away), *part.shape) for part in (ids, code.parameters[:, :, :1]))))
    prior = torch.where(free, SETTINGS.prior * points, 1.0)
    for _ in range(SETTINGS.steps):
        scene = plan.scene((values + away * free)[:, :, None, None])
        placed = torch.cat([scene.size, scene.centre, scene.rotation.flatten(-2)], -1).flatten(2)
        by_number = ((placed[1 : slots + 1] - placed[slots + 1 :]) / (2 * STEP)).permute(1, 2, 0)
        single = scene[0][torch.arange(len(draws)).repeat_interleave(points)]
        distance, by_row, _ = distance_and_slopes(single, target.reshape(-1, 1, 3))
        slopes = by_row.reshape(len(draws), points, -1) @ by_number
        residual = (distance.reshape(-1, points) - SETTINGS.offset).nan_to_num(0)
        weighted = ((SETTINGS.width**2 / (SETTINGS.width**2 + residual**2)) ** 2)[..., None] * slopes
        slope = (weighted * residual[..., None]).sum(1) + prior * (values - start)
        move = torch.linalg.solve(weighted.mT @ slopes + torch.diag_embed(prior), slope)
        values = torch.maximum(values - move.clamp(-SETTINGS.farthest, SETTINGS.farthest), low)
    rows = zip(draws, values.float().tolist(), strict=True)
    return [Draw(draw.name, tuple(row[: len(draw.values)])) for draw, row in rows]


def misfits(draws: Sequence[Draw], points: Float[Tensor, "B P 3"], normals: Float[Tensor, "B P 3"]) -> FloatArray:
    """Misfit (B,) of each statement to points: mean distance over ``SETTINGS.wrong`` plus 1 - the mean cosine."""
    distance, _, slopes = distance_and_slopes(scene_of(draws), points)
    cosine = (slopes * normals).sum(-1).abs().mean(1)
    off = (distance.abs() / SETTINGS.wrong).clamp(max=1).mean(1) + 1 - cosine
    return off.nan_to_num(np.inf).numpy()


def _target(pieces: Pieces) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B P 3"], Array]:
    """Points just above the surface near the faces of B pieces, normals, and the indices (B,) of these pieces."""
    step = max(1, len(pieces.cloud.points) // SETTINGS.surface_points)
    points, normals = pieces.cloud.points[::step], pieces.cloud.normals[::step]
    mask, _ = near(pieces.boxes, points, SETTINGS.near)
    indices = np.flatnonzero(mask.any(1))
    share, selected = np.arange(SETTINGS.points) / SETTINGS.points, np.empty((len(indices), SETTINGS.points), np.int64)
    for row, members in enumerate(map(np.flatnonzero, mask[indices])):
        selected[row] = members[(share * len(members)).astype(np.int64)]
    above = points[selected] + SETTINGS.offset * normals[selected]
    return torch.from_numpy(above), torch.from_numpy(normals[selected]), indices
