"""An arch: one statement that draws several cuboids (``--with examples/statements/arch.py``)."""

from __future__ import annotations

import torch

from shapeprog.geometry import Solids
from shapeprog.language import statement
from shapeprog.language.parameters import Extent, Length, Position
from shapeprog.language.shapes import box


@statement("arch")
def arch(at: Position, size: Extent, thickness: Length) -> list[Solids]:
    """An arch: two posts and a lintel of one thickness, from its low corner and its full extents."""
    (up, depth, side), zero = size.unbind(-1), torch.zeros_like(thickness)
    post = torch.stack([up - thickness, depth, thickness], -1)
    right = at + torch.stack([zero, zero, side - thickness], -1)
    lintel = at + torch.stack([up - thickness, zero, zero], -1)
    return [box(at, post), box(right, post), box(lintel, torch.stack([thickness, depth, side], -1))]
