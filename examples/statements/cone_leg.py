"""A tapered leg: a frustum, one of the built-in primitives (``--with examples/statements/cone_leg.py``)."""

from __future__ import annotations

import numpy as np
import torch

from shapeprog.geometry import Solids
from shapeprog.geometry.primitives.frustum import FRUSTUM
from shapeprog.language import statement
from shapeprog.language.parameters import Length, Position, Radius
from shapeprog.language.shapes import solid


def from_box(box):
    """Values to start fitting from: upright boxes with a square section, thinner at the bottom or at the top."""
    rising = int(np.abs(box.rotation[0]).argmax())
    small, large = sorted(np.delete(box.half, rising))
    if abs(box.rotation[0, rising]) < 0.998 or small < 0.75 * large:
        return
    (up, depth, side), height = box.centre.tolist(), float(2 * box.half[rising])
    for bottom, top in ((0.5, 1.0), (1.0, 0.5)):
        yield [up - height / 2, depth, side, height, bottom * large, top * large]


@statement("cone_leg", hint=from_box)
def cone_leg(at: Position, height: Length, bottom: Radius, top: Radius) -> Solids:
    """A tapered round leg on the centre of its bottom face."""
    centre = torch.stack([at[..., 0] + height / 2, at[..., 1], at[..., 2]], -1)
    return solid(FRUSTUM, centre, height / 2, bottom, top)
