"""A pouf: an ellipsoid, one of the built-in primitives (``--with examples/statements/pouf.py``)."""

from __future__ import annotations

from shapeprog.geometry import Solids
from shapeprog.geometry.primitives.ellipsoid import ELLIPSOID
from shapeprog.language import statement
from shapeprog.language.parameters import Extent, Position
from shapeprog.language.shapes import solid


@statement("pouf")
def pouf(at: Position, size: Extent) -> Solids:
    """A pouf: an ellipsoid from the low corner of its box and its full extents."""
    return solid(ELLIPSOID, at + size / 2, *(size / 2).unbind(-1))
