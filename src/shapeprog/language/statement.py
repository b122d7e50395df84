"""One declaration per statement: id, named parameters, one line of doc, and the solids it draws.

    @statement("leg", id=1, paper=("Leg", "Cub"))
    def leg(at: Position, size: Extent) -> Solids:
        "A leg: an upright board or post from its low, front, left corner."
        return box(at, size)

From the signature follow syntax, printing, tensor slots, sampling range, legality, execution and the manual.
"""

from __future__ import annotations

import inspect
import keyword
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, get_type_hints

import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.errors import DeclarationError
from shapeprog.geometry.batch import Solids
from shapeprog.geometry.primitive import SIZES, primitives
from shapeprog.geometry.primitives import built_in_names
from shapeprog.language.parameters import Parameter, Quantity

SLOTS = 7  # in tensors for the parameters of one statement
EMPTY, END = 0, 21  # ids without a statement: nothing, and the end of a loop in flat listings


@dataclass(frozen=True)
class Motion:
    """How a loop moves one copy: a turn about the vertical axis through the pivot, then a shift in cells.

    The turn is a fraction of a full circle, from depth towards left-right.
    """

    turn: Float[Tensor, "*batch"] | None = None
    shift: Float[Tensor, "*batch 3"] | None = None


@dataclass(frozen=True)
class Statement:
    """The declaration of a statement that draws, or of a loop.

    Parameters
    ----------
    name, id, doc, parameters, paper
        Word in program text, number in tensors, one line of manual, and named parameters in slot order; names in the
        notation of the paper, such as ``("Leg", "Cub")``.
    draw, move
        What a drawing statement makes of parameter tensors by name, one or more :class:`Solids`; or for a loop
        ``(copy index, quarter, **parameters) -> Motion``.
    pivot, quarter
        Parameter tensors by name to a point (..., 3) on the vertical axis about which rotation loops turn what the
        statement draws, by default that of the grid; whether they do so by quarter turns instead of evenly.
    """

    name: str
    id: int
    doc: str
    parameters: tuple[Parameter, ...]
    draw: Callable[..., Solids | Sequence[Solids]] | None = None
    move: Callable[..., Motion] | None = None
    pivot: Callable[..., Float[Tensor, "*batch 3"]] | None = None
    quarter: bool = False
    paper: tuple[str, str] | None = None

    @property
    def is_loop(self) -> bool:
        """Whether it repeats what is inside instead of drawing."""
        return self.move is not None

    @property
    def size(self) -> int:
        """Number of tensor slots in use."""
        return sum(parameter.quantity.width for parameter in self.parameters)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantity of every slot in use, in order."""
        return tuple(p.quantity for p in self.parameters for _ in range(p.quantity.width))

    def call(self, numbers: Sequence[str]) -> str:
        """How it is written with these numbers, in slot order; the count of a loop goes without its name."""
        words = [parameter.call(numbers[parameter.slots]) for parameter in self.parameters]
        if self.is_loop:
            words[0] = words[0].removeprefix(f"{self.parameters[0].name}=")
        return f"{self.name}({', '.join(words)})"

    @property
    def signature(self) -> str:
        """How it is written, with a blank for each number; loops begin with ``for i in``."""
        call = self.call("_" * self.size)
        return f"for i in {call}:" if self.is_loop else call

    def split(self, values: Float[Tensor, "*batch 7"]) -> dict[str, Tensor]:
        """Parameter tensors by name: (...) for one slot, (..., width) for several; turns and counts are rounded."""
        named = {}
        for parameter in self.parameters:
            part = values[..., parameter.slots if parameter.quantity.width > 1 else parameter.start]
            named[parameter.name] = part.detach().round() if parameter.quantity.discrete else part
        return named

    def solids(self, values: Float[Tensor, "*batch 7"]) -> list[Solids]:
        """What the statement draws for parameters (..., 7), before any loop."""
        assert self.draw is not None
        drawn = self.draw(**self.split(values))
        return [drawn] if isinstance(drawn, Solids) else list(drawn)


class Language:
    """A registry of statements and loops, found by name or by id, and the names of its primitives."""

    def __init__(self, solids: dict[str, int] | None = None) -> None:
        self._by_id: dict[int, Statement] = {}
        self._by_name: dict[str, Statement] = {}
        self.primitives = built_in_names() if solids is None else solids

    def register(self, declared: Statement) -> Statement:
        """Add a declaration and return it; a ``DeclarationError`` if its name or id is taken or it does not fit."""
        for message, hint in self._faults(declared):
            raise DeclarationError(message, hint)
        _try(declared)
        self._by_id[declared.id] = declared
        self._by_name[declared.name] = declared
        return declared

    def _faults(self, declared: Statement) -> Iterator[tuple[str, str]]:
        """What is wrong with a declaration before it is tried, and the cure."""
        said = f"statement {declared.name!r}"
        owners = dict.fromkeys((EMPTY, END), "the language itself") | {each.id: each.name for each in self}
        if not declared.name.isidentifier() or keyword.iskeyword(declared.name):
            yield f"{declared.name!r} is not a word of Python", "use letters, digits and underscores"
        if declared.is_loop and [p.quantity.kind for p in declared.parameters][:1] != ["count"]:
            yield f"loop {declared.name!r} has no count", "annotate its first parameter with Count"
        if declared.size > SLOTS:
            limit = f"{declared.size} numbers, but a statement has {SLOTS} slots"
            yield f"{said} has {limit}", "use fewer or narrower parameters"
        if any(quantity.low > quantity.high for quantity in declared.quantities):
            yield f"a range of {said} ends before it starts", "swap low and high"
        if declared.name in self._by_name:
            yield f"{said} is declared twice", "give one of them another name"
        if declared.id in owners:
            free = f"leave the id out; the next free one is {self.free_id()}"
            yield f"{said} wants id {declared.id}, which belongs to {owners[declared.id]}", free
        for twin in self:
            if declared.paper and twin.paper == declared.paper:
                own = "leave it out; the notation then uses the statement's own name"
                yield f"{said} has the paper's name {declared.paper}, which belongs to {twin.name}", own

    def forget(self, name: str) -> None:
        """Take a declaration out again, as when the module that made it fails."""
        del self._by_id[self._by_name.pop(name).id]

    def free_id(self) -> int:
        """The smallest id above all that are taken."""
        return max([END, *self._by_id]) + 1

    def __contains__(self, key: str | int) -> bool:
        return key in (self._by_name if isinstance(key, str) else self._by_id)

    def __getitem__(self, key: str | int) -> Statement:
        return self._by_name[key] if isinstance(key, str) else self._by_id[key]

    def __iter__(self) -> Iterator[Statement]:
        return iter(sorted(self._by_id.values(), key=lambda declared: declared.id))

    @property
    def names(self) -> list[str]:
        """All names in order of id."""
        return [declared.name for declared in self]


standard = Language(primitives.names)
"""The language of this process: the built-in statements and those that users register."""

_active: ContextVar[Language] = ContextVar("language", default=standard)


def language() -> Language:
    """The language in force."""
    return _active.get()


@contextmanager
def using(other: Language) -> Iterator[Language]:
    """Put another language in force for a while, its names of primitives included."""
    token = _active.set(other)
    try:
        with primitives.using(other.primitives):
            yield other
    finally:
        _active.reset(token)


def statement(
    name: str,
    *,
    id: int | None = None,
    doc: str = "",
    paper: tuple[str, str] | None = None,
    pivot: Callable[..., Tensor] | None = None,
    quarter: bool = False,
) -> Callable[[Callable[..., Any]], Statement]:
    """Declare a drawing statement from a function of annotated parameters that returns its solids.

    Without ``doc`` the manual shows the first paragraph of the function's docstring.
    """
    return lambda draw: _declare(name, id, doc, draw, 0, draw=draw, pivot=pivot, quarter=quarter, paper=paper)


def loop(
    name: str, *, id: int | None = None, paper: tuple[str, str] | None = None
) -> Callable[[Callable[..., Motion]], Statement]:
    """Declare a loop from a function ``(copy, quarter, count, ...) -> Motion``; the first parameter is the count."""
    return lambda move: _declare(name, id, "", move, 2, move=move, paper=paper)


def _declare(name: str, id: int | None, doc: str, function: Callable[..., Any], skip: int, **fields: Any) -> Statement:
    """Register what a function declares by its annotations, the first ``skip`` left out."""
    hints = get_type_hints(function, include_extras=True)
    parameters, start = [], 0
    for word in list(inspect.signature(function).parameters)[skip:]:
        quantity = next((m for m in getattr(hints.get(word), "__metadata__", ()) if isinstance(m, Quantity)), None)
        if quantity is None:
            raise DeclarationError(
                f"parameter {word!r} of statement {name!r} has no kind",
                "annotate it with one of Position, Extent, Half, Length, Radius, Shift, Shift3, Count, Turn",
            )
        parameters.append(Parameter(word, quantity, start))
        start += quantity.width
    doc = doc or inspect.getdoc(function) or ""
    if not doc:
        raise DeclarationError(f"statement {name!r} has no docstring", "say in one line what it draws")
    known, line = language(), " ".join(doc.split("\n\n")[0].split())
    return known.register(Statement(name, known.free_id() if id is None else id, line, tuple(parameters), **fields))


def _try(declared: Statement) -> None:
    """Draw or move once with mid-range parameters, so that a wrong shape is refused now and not amid a run."""
    values = torch.zeros(2, SLOTS)
    values[:, : declared.size] = torch.tensor([(quantity.low + quantity.high) / 2 for quantity in declared.quantities])
    kind = "loop" if declared.is_loop else "statement"
    try:
        if declared.move is not None:
            motion = declared.move(torch.arange(2.0), torch.zeros(2, dtype=torch.bool), **declared.split(values))
            shapes: list[Any] = [part if part is None else tuple(part.shape) for part in (motion.turn, motion.shift)]
            fitting = shapes[0] in (None, (2,)) and shapes[1] in (None, (2, 3))
            found, wanted = "a motion", "a turn must be (...) and a shift (..., 3)"
        else:
            shapes = [(tuple(solids.size.shape), tuple(solids.centre.shape)) for solids in declared.solids(values)]
            fitting = bool(shapes) and all(pair == ((2, SIZES), (2, 3)) for pair in shapes)
            found, wanted = "solids", "sizes must be (..., 4) and centres (..., 3)"
    except Exception as cause:
        said = f"statement {declared.name!r} cannot be {'moved' if declared.is_loop else 'drawn'}: {cause}"
        hint = "its function gets one tensor (...) or (..., width) per parameter, with any leading dimensions"
        raise DeclarationError(said, hint) from cause
    if not fitting:
        said = f"{kind} {declared.name!r} returns {found} of shapes {shapes}"
        raise DeclarationError(said, f"{wanted} with the leading dimensions of the parameters")
