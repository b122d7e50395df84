"""A pouf: a box with edges as round as its height allows (``--with examples/statements/pouf.py``)."""

from __future__ import annotations

from shapeprog.geometry import Solids
from shapeprog.language import statement
from shapeprog.language.parameters import Extent, Position
from shapeprog.language.shapes import rounded_box


@statement("pouf")
def pouf(at: Position, size: Extent) -> Solids:
    """A pouf: a rounded box from the low corner of its box and its full extents."""
    return rounded_box(at, size, size[..., 0] / 2)
