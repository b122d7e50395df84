"""The declaration of a statement, a loop or a role, as a plain value: parameters, one line of doc, functions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from jaxtyping import Float

from shapeprog.geometry.batch import Solids
from shapeprog.language.hints import Box
from shapeprog.language.parameters import Parameter, Quantity
from shapeprog.lazy_torch import Tensor

Hint = Callable[[Box], Iterable[Sequence[float]]]


@dataclass(frozen=True)
class Motion:
    """How a loop moves one copy: reflections, a turn or a rotation about the pivot, then a shift in cells.

    The reflections are -1 or 1 for each axis of the grid, about the planes through its origin.  The turn is about the
    vertical axis, as a fraction of a full circle from depth towards left-right; it is exact at quarters.  The default
    pivot is that of the statement.
    """

    turn: Float[Tensor, "*batch"] | None = None
    rotation: Float[Tensor, "*batch 3 3"] | None = None
    pivot: Float[Tensor, "*batch 3"] | None = None
    shift: Float[Tensor, "*batch 3"] | None = None
    signs: Float[Tensor, "*batch 3"] | None = None


@dataclass(frozen=True)
class Role:
    """The purpose of a part, whatever its solid: ``leg(taper(...))`` and ``leg(bar(...))`` are both legs.

    Parameters
    ----------
    name, id, doc
        Word in program text, number in tensors, one line of manual.  A role may share them with a statement, which then
        brings its solid along: ``leg(at=..., size=...)`` is a leg, too.
    label
        What data sets of labelled parts call it; empty if they have no word for it.
    """

    name: str
    id: int
    doc: str
    label: str = ""


@dataclass(frozen=True)
class Statement:
    """The declaration of a statement that draws, or of a loop.

    Parameters
    ----------
    name, id, doc, parameters
        Word in program text, number in tensors, one line of manual, and named parameters in slot order.
    draw, move
        The function of a drawing statement from parameter tensors by name to one or more :class:`Solids`; or of a loop
        ``(copy index, quarter, **parameters) -> Motion``.
    pivot, quarter
        Parameter tensors by name to a point (..., 3) on the vertical axis about which rotation loops turn what the
        statement draws, by default that of the grid; whether they do so by quarter turns instead of evenly.
    taught
        Whether synthetic furniture draws it, so that generators learn it.
    hint
        Starting values of inference for an oriented box that its solid fills about; none where it would not.
    """

    name: str
    id: int
    doc: str
    parameters: tuple[Parameter, ...]
    draw: Callable[..., Solids | Sequence[Solids]] | None = None
    move: Callable[..., Motion] | None = None
    pivot: Callable[..., Float[Tensor, "*batch 3"]] | None = None
    quarter: bool = False
    taught: bool = True
    hint: Hint | None = None

    @property
    def is_loop(self) -> bool:
        """Whether it repeats its body instead of drawing."""
        return self.move is not None

    @property
    def ships(self) -> bool:
        """Whether it comes with the package: it is known to work, on NumPy arrays as on tensors."""
        functions = (function for function in (self.draw, self.move, self.pivot) if function is not None)
        return all(function.__module__.startswith("shapeprog.") for function in functions)

    @property
    def size(self) -> int:
        """Number of tensor slots in use."""
        return sum(parameter.quantity.width for parameter in self.parameters)

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantity of every slot in use, in order."""
        return tuple(p.quantity for p in self.parameters for _ in range(p.quantity.width))

    def call(self, numbers: Sequence[str]) -> str:
        """How it is written with these numbers, in slot order; the first argument of a loop has no keyword."""
        words = [p.call(numbers[p.slots]) for p in self.parameters if not p.silent(numbers[p.slots])]
        if self.is_loop:
            words[0] = words[0].removeprefix(f"{self.first.name}=")
        return f"{self.name}({', '.join(words)})"

    def written(self, values: Sequence[float]) -> int:
        """How many continuous numbers text writes for these values."""
        shown = (p for p in self.parameters if not p.quantity.discrete)
        return sum(p.quantity.width for p in shown if p.unsaid is None or values[p.start] != p.unsaid)

    @property
    def first(self) -> Parameter:
        """The first parameter that is written."""
        return next(parameter for parameter in self.parameters if parameter.quantity.written_out)

    @property
    def signature(self) -> str:
        """How it is written, with a blank for each number that it leaves open; loops begin with ``for i in``."""
        call = self.call([quantity.blank for quantity in self.quantities])
        return f"for i in {call}:" if self.is_loop else call

    def split(self, values: Float[Tensor, "*batch slots"]) -> dict[str, Tensor]:
        """Parameter tensors by name: (...) for one slot, (..., width) for several; turns and counts are rounded."""
        named = {}
        for parameter in self.parameters:
            part = values[..., parameter.slots if parameter.quantity.width > 1 else parameter.start]
            named[parameter.name] = part.detach().round() if parameter.quantity.discrete else part
        return named

    def solids(self, values: Float[Tensor, "*batch slots"]) -> list[Solids]:
        """What the statement draws for parameters, of which it takes the first, before any loop."""
        assert self.draw is not None
        result = self.draw(**self.split(values))
        return [result] if isinstance(result, Solids) else list(result)
