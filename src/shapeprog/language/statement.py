"""One declaration per statement: id, named parameters, one line of doc, and the solids it draws.

    @statement("leg", id=1, paper=("Leg", "Cub"))
    def leg(at: Position, size: Extent) -> Solids:
        "A leg: an upright board or post from its low front right corner."
        return box(at, size)

From the signature follow syntax, printing, tensor slots, sampling range, legality, execution and the manual.
"""

from __future__ import annotations

import inspect
import keyword
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from typing import Any, get_type_hints

import numpy as np
from jaxtyping import Float

from shapeprog.arguments import number_of
from shapeprog.errors import DeclarationError, ShapeProgError
from shapeprog.geometry.batch import Solids
from shapeprog.geometry.primitive import SIZES
from shapeprog.language.hints import Box
from shapeprog.language.parameters import Parameter, Quantity
from shapeprog.lazy_torch import Tensor, torch

SLOTS = 7  # in published tensors for the parameters of one statement
MOST_SLOTS = 16  # tensors are as wide as the statements at hand need, up to here
EMPTY, END = 0, 21  # ids without a statement: nothing, and the end of a loop in flat listings
ROLES = 127  # ids of roles that are no statements lie above

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
    name, id, doc, parameters, paper
        Word in program text, number in tensors, one line of manual, and named parameters in slot order; names in the
        notation of the paper, such as ``("Leg", "Cub")``.
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
    paper: tuple[str, str] | None = None
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


WORDS = "use letters, digits and underscores"


def is_word(name: str) -> bool:
    """Whether program text can call something by this name."""
    return name.isidentifier() and not keyword.iskeyword(name)


class Language:
    """A registry of statements and loops, found by name or by id, and of roles."""

    def __init__(self) -> None:
        self._by_id: dict[int, Statement] = {}
        self._by_name: dict[str, Statement] = {}
        self.roles: dict[str, Role] = {}

    def register(self, declared: Statement) -> Statement:
        """Add a declaration and return it; a ``DeclarationError`` if its name or id is taken or it does not fit."""
        for message, hint in self._faults(declared):
            raise DeclarationError(message, hint)
        if not declared.ships:
            _try(declared)
        self._by_id = dict(sorted({**self._by_id, declared.id: declared}.items()))
        self._by_name[declared.name] = declared
        return declared

    def add_role(self, name: str, doc: str, label: str = "") -> Role:
        """Add a role and return it; a ``DeclarationError`` if there is one, or a loop, of this name.

        It has the id of the statement of its name, which brings its solid along, or else one above all others.
        """
        if name in self.roles:
            raise DeclarationError(f"role {name!r} is declared twice", "give one of them another name")
        if not is_word(name):
            raise DeclarationError(f"{name!r} is not a Python identifier", WORDS)
        if name in self and self[name].is_loop:
            raise DeclarationError(f"{name!r} is a loop", "give the role another name")
        number = max([ROLES, *self._by_id, *(role.id for role in self.roles.values())]) + 1
        self.roles[name] = Role(name, self[name].id if name in self else number, doc, label)
        return self.roles[name]

    def role(self, number: int) -> Role | None:
        """The role with this id, if there is one."""
        return next((role for role in self.roles.values() if role.id == number), None)

    def own_role(self, name: str) -> str:
        """The role that a statement has by itself, such as ``leg``; none if it is a shape that any part may have.

        ``cushion`` is called after a part, and yet the shape of many.
        """
        return name if name in self.roles and self[name].hint is None else ""

    def declaration(self, name: str, numbers: int) -> Statement:
        """The statement or loop of a name; a ``ShapeProgError`` if there is none with so many numbers."""
        if name not in self:
            raise ShapeProgError(f"unknown statement {name!r}", "load the module that declares it")
        if numbers != (right := len(self[name].quantities)):
            raise ShapeProgError(f"{name} has {numbers} numbers instead of {right}", "correct the program")
        return self[name]

    def called(self, word: str) -> Role | Statement:
        """What parts are called by a word: a role, or a statement that is none."""
        return self.roles[word] if word in self.roles else self._by_name[word]

    def _faults(self, declared: Statement) -> Iterator[tuple[str, str]]:
        """The mistakes in a declaration, found without drawing it, each with its cure."""
        what = f"statement {declared.name!r}"
        owners = dict.fromkeys((EMPTY, END), "the language itself") | {known.id: known.name for known in self}
        owners = {role.id: f"the role {role.name}" for role in self.roles.values()} | owners
        if not is_word(declared.name):
            yield f"{declared.name!r} is not a Python identifier", WORDS
        if declared.is_loop and [p.quantity.kind for p in declared.parameters][:1] != ["count"]:
            yield f"loop {declared.name!r} has no count", "annotate its first parameter with Count"
        elif declared.is_loop and [p.default for p in declared.parameters if p.quantity.written_out][:1] != [None]:
            yield f"loop {declared.name!r} needs a first argument without a default", "leave the default out"
        if type(declared.id) is not int or not 0 <= declared.id < 1 << 31:
            yield f"{what} wants id {declared.id!r}", "give a whole number below 2^31, or leave the id out"
        if declared.size > MOST_SLOTS:
            limit = f"{declared.size} numbers, but a statement has at most {MOST_SLOTS}"
            yield f"{what} has {limit}", "use fewer or narrower parameters"
        if any(quantity.low > quantity.high for quantity in declared.quantities):
            yield f"a range of {what} ends before it starts", "swap low and high"
        if declared.name in self._by_name:
            yield f"{what} is declared twice", "give one of them another name"
        if declared.id in owners:
            free = f"leave the id out; the next free one is {self.free_id()}"
            yield f"{what} wants id {declared.id}, which belongs to {owners[declared.id]}", free
        for twin in self:
            if declared.paper and twin.paper == declared.paper:
                cure = "leave it out; the notation then uses the statement's own name"
                yield f"{what} has the paper's name {declared.paper}, which belongs to {twin.name}", cure

    def forget(self, name: str) -> None:
        """Take a declaration out again."""
        del self._by_id[self._by_name.pop(name).id]

    def free_id(self) -> int:
        """The smallest id above those of the paper that is not taken."""
        used = {*self._by_id, *(role.id for role in self.roles.values())}
        return next(number for number in count(END + 1) if number not in used)

    def __contains__(self, key: str | int) -> bool:
        return key in (self._by_name if isinstance(key, str) else self._by_id)

    def __getitem__(self, key: str | int) -> Statement:
        return self._by_name[key] if isinstance(key, str) else self._by_id[key]

    def __iter__(self) -> Iterator[Statement]:
        return iter([*self._by_id.values()])  # a copy, as a loop may declare and forget statements

    @property
    def names(self) -> list[str]:
        """All names in order of id."""
        return [declared.name for declared in self]


standard = Language()
"""The language of this process: the built-in statements and those that users register."""

_active: ContextVar[Language] = ContextVar("language", default=standard)


def language() -> Language:
    """The language in force."""
    return _active.get()


@contextmanager
def using(other: Language) -> Iterator[Language]:
    """Put another language in force for a while."""
    token = _active.set(other)
    try:
        yield other
    finally:
        _active.reset(token)


def role(name: str, doc: str, label: str = "") -> Role:
    """Declare a role in the language in force, see :meth:`Language.add_role`."""
    return language().add_role(name, doc, label)


def statement(
    name: str,
    *,
    id: int | None = None,
    doc: str = "",
    paper: tuple[str, str] | None = None,
    pivot: Callable[..., Tensor] | None = None,
    quarter: bool = False,
    taught: bool = True,
    hint: Hint | None = None,
) -> Callable[[Callable[..., Any]], Statement]:
    """Declare a drawing statement from a function of annotated parameters that returns its solids.

    Without ``doc`` the manual shows the first paragraph of the function's docstring; :class:`Statement` has the rest.
    """
    fields = {"pivot": pivot, "quarter": quarter, "paper": paper, "taught": taught, "hint": hint}
    return lambda draw: _declare(name, id, doc, draw, 0, draw=draw, **fields)


def loop(
    name: str, *, id: int | None = None, paper: tuple[str, str] | None = None, taught: bool = True
) -> Callable[[Callable[..., Motion]], Statement]:
    """Declare a loop from a function ``(copy, quarter, count, ...) -> Motion``; the first parameter is the count."""
    return lambda move: _declare(name, id, "", move, 2, move=move, paper=paper, taught=taught)


def _declare(name: str, id: int | None, doc: str, function: Callable[..., Any], skip: int, **fields: Any) -> Statement:
    """Register the statement that the annotations of a function declare, the first ``skip`` left out."""
    hints = get_type_hints(function, include_extras=True)
    parameters, start = [], 0
    for word, argument in list(inspect.signature(function).parameters.items())[skip:]:
        quantity = next((m for m in getattr(hints.get(word), "__metadata__", ()) if isinstance(m, Quantity)), None)
        if quantity is None:
            raise DeclarationError(
                f"parameter {word!r} of statement {name!r} has no kind",
                "annotate it with one of Position, Extent, Half, Section, Length, Radius, Radii, Place, Shift, Shift3, "
                "Angle, Count, Turn, Axis",
            )
        parameter = Parameter(word, quantity, start)
        if argument.default is not inspect.Parameter.empty:
            try:
                (default,) = parameter.checked(name, [number_of(argument.default)])
            except ShapeProgError as mistake:
                raise DeclarationError(f"wrong default of {word!r}: {mistake.message}", mistake.hint) from None
            parameter = replace(parameter, default=default)
        parameters.append(parameter)
        start += quantity.width
    doc = doc or inspect.getdoc(function) or ""
    if not doc:
        raise DeclarationError(f"statement {name!r} has no docstring", "describe it in one line")
    registry, line = language(), " ".join(doc.split("\n\n")[0].split())
    return registry.register(
        Statement(name, registry.free_id() if id is None else id, line, tuple(parameters), **fields)
    )


def _try(declared: Statement) -> None:
    """Draw or move once with mid-range parameters, so that a wrong shape is refused now and not amid a run."""
    values = torch.tensor([(quantity.low + quantity.high) / 2 for quantity in declared.quantities]).repeat(2, 1)
    parts: list[tuple[Tensor | None, tuple[int, ...]]] = []  # with their shapes
    try:
        if declared.move is not None:
            motion = declared.move(torch.arange(2.0), torch.zeros(2, dtype=torch.bool), **declared.split(values))
            parts += [(motion.turn, (2,)), (motion.rotation, (2, 3, 3))]
            parts += [(part, (2, 3)) for part in (motion.pivot, motion.shift, motion.signs)]
            what = f"loop {declared.name!r} returns a motion"
            requirement = "a turn must be (...), a rotation (..., 3, 3), a pivot, a shift and signs (..., 3)"
        else:
            for numbers, lead in ((values, (2,)), (values[0], ())):
                for solids in declared.solids(numbers):
                    parts += [(solids.size, (*lead, SIZES)), (solids.centre, (*lead, 3))]
            if parts and declared.pivot is not None:
                parts.append((declared.pivot(**declared.split(values)), (2, 3)))
            what = f"statement {declared.name!r} returns solids"
            requirement = "sizes must be (..., 4), centres and a pivot (..., 3)"
        shapes = [part if part is None else tuple(part.shape) for part, _ in parts]
    except Exception as cause:
        message = f"statement {declared.name!r} cannot be {'moved' if declared.is_loop else 'drawn'}: {cause}"
        hint = "its function gets one tensor (...) or (..., width) per parameter, with any leading dimensions or none"
        raise DeclarationError(message, hint) from cause
    if not parts or any(shape not in (None, right) for shape, (_, right) in zip(shapes, parts, strict=True)):
        requirement += " with the leading dimensions of the parameters"
        raise DeclarationError(f"{what} of shapes {shapes}", requirement)
    what, box = f"the hint of statement {declared.name!r}", Box(np.zeros(3), np.eye(3), np.array([6.0, 1.0, 1.0]))
    try:
        counts = {len(start) for start in declared.hint(box)} - {declared.size} if declared.hint else set()
    except Exception as cause:
        raise DeclarationError(f"{what} fails: {cause}", "it gets a box and returns lists of numbers") from cause
    if counts:
        raise DeclarationError(f"{what} yields {min(counts)} numbers", f"yield {declared.size}, one for each parameter")
