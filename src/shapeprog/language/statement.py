"""One declaration per statement: id, named parameters, one line of doc, and the solids it draws.

    @statement("leg", id=1)
    def leg(at: Position, size: Extent) -> Solids:
        "A leg: an upright board or post from its low front right corner."
        return box(at, size)

From the signature follow syntax, printing, tensor slots, sampling range, legality, execution and the manual.
"""

from __future__ import annotations

import inspect
import keyword
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import lru_cache, wraps
from itertools import count
from typing import Any, ParamSpec, TypeVar, get_type_hints

from shapeprog.arguments import number_of
from shapeprog.errors import DeclarationError, ShapeProgError
from shapeprog.language.declaration import Hint
from shapeprog.language.declaration import Motion as Motion
from shapeprog.language.declaration import Role as Role
from shapeprog.language.declaration import Statement as Statement
from shapeprog.language.parameters import Parameter, Quantity
from shapeprog.language.trial import check_declaration
from shapeprog.lazy_torch import Tensor

SLOTS = 7  # in published tensors for the parameters of one statement
MOST_SLOTS = 16  # tensors are as wide as the statements at hand need, up to here
EMPTY, END = 0, 21  # ids without a statement: nothing, and the end of a loop in flat listings
ROLES = 127  # ids of roles that are no statements lie above

WORDS = "use letters, digits and underscores"


def is_word(name: str) -> bool:
    """Whether program text can call something by this name."""
    return name.isidentifier() and not keyword.iskeyword(name)


_versions = count()
P = ParamSpec("P")
R = TypeVar("R")


class Language:
    """A registry of statements and loops, found by name or by id, and of roles."""

    def __init__(self) -> None:
        self.version = next(_versions)  # another one after each declaration, and in every other language
        self._by_id: dict[int, Statement] = {}
        self._by_name: dict[str, Statement] = {}
        self.roles: dict[str, Role] = {}

    def register(self, declared: Statement, replaced: Statement | None = None) -> Statement:
        """Add a declaration, in the place of one of the same name if given, and return it.

        A ``DeclarationError`` if its name or id is taken or it does not fit.
        """
        for message, hint in self._faults(declared, replaced):
            raise DeclarationError(message, hint)
        if not declared.ships:
            check_declaration(declared)
        remaining = {number: entry for number, entry in self._by_id.items() if entry is not replaced}
        self._by_id = dict(sorted({**remaining, declared.id: declared}.items()))
        self._by_name[declared.name] = declared
        self.version = next(_versions)
        return declared

    def earlier(self, name: str, function: Callable[..., Any]) -> Statement | None:
        """The declaration of a user that a function replaces: of the same lines run again, or of a cell of a notebook.

        Cells and lines typed at a prompt are in no file.
        """
        old = self._by_name.get(name)
        codes = [getattr(source, "__code__", None) for source in (old and (old.draw or old.move), function)]
        if old is None or old.ships or None in codes:
            return None
        locations = {(code.co_filename, code.co_firstlineno) for code in codes if code}
        return old if len(locations) == 1 or not any(os.path.exists(file) for file, _ in locations) else None

    def add_role(self, name: str, doc: str, label: str = "") -> Role:
        """Add a role and return it; a ``DeclarationError`` if there is another one, or a loop, of this name.

        It has the id of the statement of its name, which brings its solid along, or else one above all others.
        """
        if name in self.roles and (self.roles[name].doc, self.roles[name].label) == (doc, label):
            return self.roles[name]  # a cell that is run again
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
            raise ShapeProgError(
                f"unknown statement {name!r}",
                "load the file that declares it: --with of the commands, sp.load_statements in Python",
            )
        if numbers != (right := len(self[name].quantities)):
            raise ShapeProgError(f"{name} has {numbers} numbers instead of {right}", "correct the program")
        return self[name]

    def called(self, word: str) -> Role | Statement:
        """What parts are called by a word: a role, or a statement that is none."""
        return self.roles[word] if word in self.roles else self._by_name[word]

    def _faults(self, declared: Statement, replaced: Statement | None) -> Iterator[tuple[str, str]]:
        """The mistakes in a declaration, found without drawing it, each with its cure."""
        remaining = [entry for entry in self if entry is not replaced]
        what = f"statement {declared.name!r}"
        owners = dict.fromkeys((EMPTY, END), "the language itself") | {entry.id: entry.name for entry in remaining}
        roles = [role for role in self.roles.values() if replaced is None or role.name != replaced.name]
        owners = {role.id: f"the role {role.name}" for role in roles} | owners
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
        if declared.name in self._by_name and replaced is None:
            yield f"{what} is declared twice", "give one of them another name"
        if declared.id in owners:
            free = f"leave the id out; the next free one is {self.free_id()}"
            yield f"{what} wants id {declared.id}, which belongs to {owners[declared.id]}", free

    def forget(self, name: str) -> None:
        """Take a declaration out again."""
        del self._by_id[self._by_name.pop(name).id]
        self.version = next(_versions)

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


def remembered(most: int) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Keep the results of so many calls of a function of programs, until a statement is declared anew."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        cached = lru_cache(most)(lambda version, args, named: function(*args, **dict(named)))

        @wraps(function)
        def call(*args: P.args, **named: P.kwargs) -> R:
            return cached(language().version, args, tuple(named.items()))

        return call

    return decorate


def role(name: str, doc: str, label: str = "") -> Role:
    """Declare a role in the language in force, see :meth:`Language.add_role`."""
    return language().add_role(name, doc, label)


def statement(
    name: str,
    *,
    id: int | None = None,
    doc: str = "",
    pivot: Callable[..., Tensor] | None = None,
    quarter: bool = False,
    taught: bool = True,
    hint: Hint | None = None,
) -> Callable[[Callable[..., Any]], Statement]:
    """Declare a drawing statement from a function of annotated parameters that returns its solids.

    Without ``doc`` the manual shows the first paragraph of the function's docstring; :class:`Statement` has the rest.
    A cell of a notebook that is run again, or another one that declares the same name, replaces the declaration.
    """
    _check_name(name)
    fields = {"pivot": pivot, "quarter": quarter, "taught": taught, "hint": hint}
    return lambda draw: _declare(name, id, doc, draw, 0, draw=draw, **fields)


def loop(name: str, *, id: int | None = None, taught: bool = True) -> Callable[[Callable[..., Motion]], Statement]:
    """Declare a loop from a function ``(copy, quarter, count, ...) -> Motion``; the first parameter is the count."""
    _check_name(name)
    return lambda move: _declare(name, id, "", move, 2, move=move, taught=taught)


def _check_name(name: object) -> None:
    if not isinstance(name, str):
        raise DeclarationError(f"{name!r} is no name", 'write the name in brackets, as in @statement("shelf")')


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
    replaced = registry.earlier(name, function)
    if id is None:
        id = registry.free_id() if replaced is None else replaced.id
    return registry.register(Statement(name, id, line, tuple(parameters), **fields), replaced)
