"""A tapered leg: a frustum, one of the built-in primitives (``--with examples/statements/cone_leg.py``)."""

from __future__ import annotations

import torch

from shapeprog.geometry import Solids
from shapeprog.geometry.primitives.frustum import FRUSTUM
from shapeprog.language import statement
from shapeprog.language.parameters import Length, Position, Radius
from shapeprog.language.shapes import solid


@statement("cone_leg")
def cone_leg(at: Position, height: Length, bottom: Radius, top: Radius) -> Solids:
    """A tapered round leg on the centre of its bottom face."""
    centre = torch.stack([at[..., 0] + height / 2, at[..., 1], at[..., 2]], -1)
    return solid(FRUSTUM, centre, height / 2, bottom, top)
