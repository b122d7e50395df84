"""Statements without a hint made to draw another box: their numbers follow it to first order.

Which of its numbers move the faces of what a statement draws is known from its declaration alone.  What moves no face,
as how much a leg tapers, stays.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import torch

from shapeprog.inference.candidates.fitting import Renderer
from shapeprog.inference.fit.tunable import bounds, least
from shapeprog.language.hints import Box
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Draw
from shapeprog.language.statement import Statement, language
from shapeprog.space import FloatArray

OFF = 0.05
"""Cells by which the faces of what is drawn may miss those that are asked for."""

SMALLEST = 1e-3
"""Slopes below this share of the largest move nothing."""


def stretched(drawn: Draw, box: Box) -> Draw | None:
    """The same statement drawing another box along the same axes; none where its numbers do not let it."""
    declared = language()[drawn.name]
    known = _faces(declared, drawn.values)
    if known is None:
        return None
    faces, slopes = known
    wanted = np.concatenate([box.centre, box.half])
    values = np.array(drawn.values) + np.linalg.pinv(slopes, rcond=SMALLEST) @ (wanted - faces)
    lowest = np.array([least(quantity) for quantity in declared.quantities])
    found = tuple(to_float32(value) for value in np.maximum(values, lowest))
    reached = _faces(declared, found)
    if reached is None or np.abs(reached[0] - wanted).max() > OFF:
        return None
    return Draw(drawn.name, found, role=drawn.role)


@lru_cache(64)
def _faces(declared: Statement, values: tuple[float, ...]) -> tuple[FloatArray, FloatArray] | None:
    """Centre and half extents (6,) of the solid that a statement draws, and their slopes by its numbers (6, V); none
    where it draws several."""
    moving = torch.tensor([values] * 6, dtype=torch.float64, requires_grad=True)
    scene = Renderer([declared] * 6)(moving)
    if int(scene.mask[0].sum()) != 1:
        return None
    slot = int(scene.mask[0].nonzero())
    faces = torch.cat([scene.centre[:, slot], bounds(scene)[:, slot]], -1)
    (slopes,) = torch.autograd.grad(faces.diagonal().sum(), moving)
    free = torch.tensor([not quantity.discrete for quantity in declared.quantities])
    return faces[0].detach().numpy(), (slopes.nan_to_num(0) * free).numpy()
