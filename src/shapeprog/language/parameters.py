"""What the parameters of a statement mean: their kinds, widths and ranges, written as annotations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from torch import Tensor

from shapeprog.space import HALF, RESOLUTION

Kind = Literal["position", "length", "shift", "count", "turn"]


@dataclass(frozen=True)
class Quantity:
    """A group of numbers of one kind.

    ``position`` and ``shift`` are coordinates in cells (a shift is relative), ``length`` is an extent in cells,
    ``count`` a number of copies, ``turn`` a number of quarter turns.  The width is how many numbers there are, one
    tensor slot each; programs are sampled from ``low`` to ``high``, which errors name.
    """

    kind: Kind
    width: int = 1
    low: float = 0.0
    high: float = 0.0

    @property
    def discrete(self) -> bool:
        """Whether the numbers are whole and carry no gradient."""
        return self.kind in ("count", "turn")


Position = Annotated[Tensor, Quantity("position", 3, -HALF, HALF)]
Extent = Annotated[Tensor, Quantity("length", 3, 0, RESOLUTION)]
Half = Annotated[Tensor, Quantity("length", 2, 0, HALF)]
Length = Annotated[Tensor, Quantity("length", 1, 0, RESOLUTION)]
Radius = Annotated[Tensor, Quantity("length", 1, 0, HALF)]
Shift = Annotated[Tensor, Quantity("shift", 1, -RESOLUTION, RESOLUTION)]
Shift3 = Annotated[Tensor, Quantity("shift", 3, -RESOLUTION, RESOLUTION)]
Count = Annotated[Tensor, Quantity("count", 1, 0, 64)]
Turn = Annotated[Tensor, Quantity("turn", 1, -64, 64)]


@dataclass(frozen=True)
class Parameter:
    """One named parameter of a statement and the first of the tensor slots it takes."""

    name: str
    quantity: Quantity
    start: int

    @property
    def slots(self) -> slice:
        """Its slots among those of the statement."""
        return slice(self.start, self.start + self.quantity.width)
