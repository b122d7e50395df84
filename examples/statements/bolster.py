"""A bolster: a rounded box whose ends are half balls (``--with examples/statements/bolster.py``)."""

from __future__ import annotations

import torch

from shapeprog.geometry import Solids
from shapeprog.language import statement
from shapeprog.language.parameters import Length, Position, Radius
from shapeprog.language.shapes import rounded_box


@statement("bolster")
def bolster(at: Position, length: Length, radius: Radius) -> Solids:
    """A bolster from its middle, lying from left to right: so much of its length is straight, its ends are round."""
    half = torch.stack([radius, radius, length / 2 + radius], -1)
    return rounded_box(at - half, 2 * half, radius)
