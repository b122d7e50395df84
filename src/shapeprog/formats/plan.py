"""The plan of a CAD script in any language: named numbers at the top, then loops around solids."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from shapeprog.formats.symbolic import Affine, Piece, Repeat, Slot, number, pieces, point, repeat
from shapeprog.language.evaluation import in_own_unit
from shapeprog.language.parameters import Quantity
from shapeprog.language.program import Draw, Loop, Node, Program
from shapeprog.language.statement import Statement, language
from shapeprog.language.text import variable
from shapeprog.language.unit import Unit
from shapeprog.space import FloatArray

NOWHERE = "[0, 0, 0]"
"""A zero shift, such as that of a mirror about the middle."""


@dataclass(frozen=True)
class Variable:
    """A parameter of a statement by name: one number, or several as a list."""

    name: str
    text: str
    quantity: Quantity
    fixed: bool


@dataclass(frozen=True)
class Heading:
    """The variables of one statement of the program."""

    name: str
    doc: str
    variables: tuple[Variable, ...]


@dataclass(frozen=True)
class Solid:
    """A solid to draw: ``arguments`` are expressions, ``shell`` names a mesh in :attr:`Plan.shells`."""

    name: str
    statement: int
    kind: str
    arguments: tuple[str, ...]
    axes: FloatArray | None
    shell: str | None


@dataclass(frozen=True)
class Repetition:
    """A loop: its letter, how many copies, and the expressions that reflect, turn and shift a copy, in this order."""

    letter: str
    count: str
    shift: tuple[str, str] | None
    turn: tuple[str, str] | None
    signs: str | None
    body: tuple[Step, ...]


@dataclass(frozen=True)
class Definition:
    """A named number: its expression, its comment, and its value and kind if it depends on no other."""

    name: str
    text: str
    note: str = ""
    value: float | None = None
    whole: bool = False


@dataclass(frozen=True)
class Invocation:
    """A call of a function with expressions for its parameters."""

    name: str
    arguments: tuple[tuple[str, str], ...]


Step: TypeAlias = Solid | Repetition | Definition | Invocation


@dataclass(frozen=True)
class Module:
    """A function: its parameters with their defaults, if they have any, and its body."""

    name: str
    parameters: tuple[tuple[str, str | None], ...]
    body: tuple[Step, ...]
    note: str


@dataclass
class Plan:
    """Everything a script needs, in order.

    Programs with names have ``numbers`` and ``functions``, others a heading for each statement.  Lengths are in the
    ``unit`` of the program.
    """

    unit: Unit | None = None
    headings: list[Heading] = field(default_factory=list)
    numbers: list[Definition] = field(default_factory=list)
    functions: list[Module] = field(default_factory=list)
    body: list[Step] = field(default_factory=list)
    shells: dict[str, tuple[FloatArray, npt.NDArray[np.int64]]] = field(default_factory=dict)
    tables: dict[str, FloatArray] = field(default_factory=dict)

    @property
    def cell(self) -> float:
        """Size of a cell in its unit."""
        return 1.0 if self.unit is None else self.unit.per_cell

    @property
    def word(self) -> str:
        """The unit of lengths."""
        return "cells" if self.unit is None else self.unit.name

    @property
    def step(self) -> float:
        """Step by which lengths are changed: a power of ten, a tenth of a cell or less."""
        return float(10.0 ** math.floor(math.log10(self.cell / 10) + 1e-9))


@dataclass(frozen=True)
class Planned:
    """A statement or loop with the names of its slots and, if it draws, its steps and pivot; or a call, without a node.

    ``pivoted`` marks a call whose statements have their own pivots.
    """

    node: Node | None
    name: str
    slots: tuple[Slot, ...] = ()
    body: tuple[Planned, ...] = ()
    drawn: tuple[Step, ...] = ()
    pivot: str = "[0, 0, 0]"
    pivoted: bool = False

    @property
    def quarter(self) -> bool:
        """Whether rotations turn it by quarters."""
        return self.node is not None and language()[self.node.name].quarter

    @property
    def draws(self) -> list[Planned]:
        """The statements and calls in it."""
        return [leaf for inner in self.body for leaf in inner.draws] if isinstance(self.node, Loop) else [self]

    def only(self, leaf: Planned) -> Planned:
        """The same loop around one of its drawing statements."""
        if self is leaf:
            return self
        inner = next(each for each in self.body if any(found is leaf for found in each.draws))
        return replace(self, body=(inner.only(leaf),))


class Inexpressible(Exception):
    """A program whose names a script cannot express."""


def plan(program: Program) -> Plan:
    """The plan of a program: loops stay loops, and numbers stay parameters wherever a solid is linear in them."""
    made = Plan(program.unit)
    shown = program.body if program.source is None else in_own_unit(program.source)
    counter: Counter[str] = Counter()
    named = [_named(node, own, made, counter) for node, own in zip(program.body, shown, strict=True)]
    for each in named:
        made.body.extend(steps(each, 0, made))
    return made


def numbered(node: Node, counter: Counter[str]) -> str:
    """The name of a statement or loop in a script: its role or own name, and a number."""
    word = re.sub(r"[^A-Za-z0-9_]", "_", node.word if isinstance(node, Draw) else node.name)
    counter[word] += 1
    return f"{word}_{counter[word]}"


def _named(node: Node, shown: Node, made: Plan, counter: Counter[str]) -> Planned:
    """What a node becomes; ``shown`` is the same in the unit of the program."""
    declared, name = language()[node.name], numbered(node, counter)
    slots = tuple(
        f"{name}_{parameter.name}" + (f"[{place}]" if parameter.quantity.width > 1 else "")
        for parameter in declared.parameters
        for place in range(parameter.quantity.width)
    )
    place = len(made.headings)
    if isinstance(node, Loop):
        if not declared.quantities[0].written_out:
            slots = (declared.quantities[0].written(node.values[0]), *slots[1:])
        assert isinstance(shown, Loop)
        inside = zip(node.body, shown.body, strict=True)
        each = Planned(node, name, slots, tuple(_named(inner, own, made, counter) for inner, own in inside))
        made.headings.insert(place, _heading(declared, name, shown.values, still_of(each)))
        return each
    found, fixed = pieces(declared, node.values, made.cell)
    made.headings.insert(place, _heading(declared, name, shown.values, fixed))
    return drawing(node, name, slots, found, made)


def still_of(each: Planned) -> frozenset[int]:
    """The slots of a loop that enter as plain numbers."""
    assert each.node is not None
    declared = language()[each.node.name]
    used = [repeat(declared, each.node.values, flag)[1] for flag in {leaf.quarter for leaf in each.draws}]
    return frozenset.intersection(*used) if used else frozenset(range(1, declared.size))


def drawing(node: Draw, name: str, slots: tuple[Slot, ...], found: Sequence[Piece], made: Plan) -> Planned:
    """A drawing statement of the solids that were found, with these slots."""
    pivot, _ = point(language()[node.name], node.values, made.cell)
    drawn = tuple(
        _solid(piece, f"{name}_{index}" if len(found) > 1 else name, language().called(node.word).id, slots, made)
        for index, piece in enumerate(found, 1)
    )
    return Planned(node, name, slots, (), drawn, "[0, 0, 0]" if pivot is None else _vector(pivot, slots))


def _heading(declared: Statement, name: str, values: Sequence[float], fixed: frozenset[int]) -> Heading:
    variables = []
    for parameter in declared.parameters:
        if parameter.quantity.kind == "axis" or not parameter.quantity.written_out:
            continue
        numbers = [parameter.quantity.written(value) for value in values[parameter.slots]]
        text = numbers[0] if len(numbers) == 1 else f"[{', '.join(numbers)}]"
        still = set(range(parameter.slots.start, parameter.slots.stop)) <= fixed
        variables.append(Variable(f"{name}_{parameter.name}", text, parameter.quantity, still))
    return Heading(name, declared.doc, tuple(variables))


def _solid(piece: Piece, name: str, statement: int, slots: tuple[Slot, ...], made: Plan) -> Solid:
    shell = None
    if piece.vertices is not None and piece.faces is not None:
        shell = f"{name}_shell"
        made.shells[shell] = (piece.vertices, piece.faces)
    arguments = tuple(_vector(group, slots) if len(group) > 1 else group[0].text(slots) for group in piece.groups)
    if piece.kind == "cuboid" and arguments[-1] == "0":
        arguments = arguments[:-1]
    return Solid(name, statement, piece.kind, arguments, piece.axes, shell)


def _vector(group: tuple[Affine, ...], slots: tuple[Slot, ...]) -> str:
    words = [one.text(slots) for one in group]
    stem = words[0].partition("[")[0]
    whole = [slot for slot in slots if isinstance(slot, str) and slot.startswith(f"{stem}[")]
    return stem if words == whole else f"[{', '.join(words)}]"


def steps(each: Planned, depth: int, made: Plan, taken: frozenset[str] = frozenset()) -> list[Step]:
    """What a node becomes: a loop that turns statements about different axes is written once for each axis.

    ``taken`` are names that no variable of a loop may have.
    """
    if not isinstance(each.node, Loop):
        return list(each.drawn)
    declared, values = language()[each.node.name], each.node.values
    motions: dict[tuple[str, bool], Repeat] = {}
    for leaf in each.draws:
        key = (leaf.pivot, leaf.quarter)
        if key not in motions:
            motions[key] = repeat(declared, values, leaf.quarter, made.cell)[0]
        if leaf.pivoted and motions[key].turns:
            raise Inexpressible
    if len(motions) > 1 and any(motion.turns for motion in motions.values()):
        return [step for leaf in each.draws for step in steps(each.only(leaf), depth, made, taken)]
    body = tuple(step for inner in each.body for step in steps(inner, depth + 1, made, taken))
    if not motions or not body:
        return []
    (pivot, _), motion = next(iter(motions.items()))
    return [_repetition(each, motion, pivot, variable(depth, taken), body, made)]


def _repetition(
    each: Planned, motion: Repeat, pivot: str, letter: str, body: tuple[Step, ...], made: Plan
) -> Repetition:
    count = str(each.slots[0])
    shift = turn = signs = None
    if motion.signs is not None:
        count, signs = number(len(motion.signs)), f"{each.name}_signs[{letter}]"
        made.tables[f"{each.name}_signs"] = motion.signs
    if motion.table is not None:
        count = number(len(motion.table))
        made.tables[f"{each.name}_turns"], made.tables[f"{each.name}_shifts"] = motion.table[:, 0], motion.table[:, 1:]
        shift, turn = ("1", f"{each.name}_shifts[{letter}]"), (f"{each.name}_turns[{letter}]", pivot)
    if motion.shift is not None:
        vector = _vector(motion.shift, each.slots)
        shift = (letter, vector) if vector != NOWHERE else None
    if motion.even:
        turn = (f"360 * {letter} / {count}", pivot)
    elif motion.turn is not None:
        angle = motion.turn.text(each.slots)
        turn = (f"{letter} * ({angle})" if " " in angle.replace(" * ", "") else f"{letter} * {angle}", pivot)
    return Repetition(letter, count, shift, turn, signs, body)
