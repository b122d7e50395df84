"""A program as a CAD script sees it: named numbers at the top, then loops around solids, in any script language."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shapeprog.formats.symbolic import Affine, Piece, Repeat, number, pieces, point, repeat
from shapeprog.language.parameters import Quantity
from shapeprog.language.program import Draw, Loop, Node, Program
from shapeprog.language.statement import Statement, language
from shapeprog.language.text import variable
from shapeprog.space import FloatArray


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
    body: tuple[Solid | Repetition, ...]


@dataclass
class Plan:
    """Everything a script needs, in order."""

    headings: list[Heading] = field(default_factory=list)
    body: list[Solid | Repetition] = field(default_factory=list)
    shells: dict[str, tuple[FloatArray, npt.NDArray[np.int64]]] = field(default_factory=dict)
    tables: dict[str, FloatArray] = field(default_factory=dict)

    def solids(self) -> Iterator[Solid]:
        """Every solid in the order it is drawn."""
        stack = list(reversed(self.body))
        while stack:
            step = stack.pop()
            if isinstance(step, Solid):
                yield step
            else:
                stack.extend(reversed(step.body))


@dataclass(frozen=True)
class _Named:
    """A node of the program with the names of its slots and, if it draws, its solids and pivot."""

    node: Node
    declared: Statement
    name: str
    slots: tuple[str, ...]
    body: tuple[_Named, ...] = ()
    drawn: tuple[Solid, ...] = ()
    pivot: str = "[0, 0, 0]"

    @property
    def draws(self) -> list[_Named]:
        return [self] if not self.declared.is_loop else [leaf for inner in self.body for leaf in inner.draws]

    def only(self, leaf: _Named) -> _Named:
        """The same loop around one of its drawing statements."""
        if self is leaf:
            return self
        inner = next(each for each in self.body if any(found is leaf for found in each.draws))
        return _Named(self.node, self.declared, self.name, self.slots, (inner.only(leaf),))


def plan(program: Program) -> Plan:
    """The plan of a program: loops stay loops, and numbers stay parameters wherever a solid is linear in them."""
    made = Plan()
    counter: Counter[str] = Counter()
    named = [_named(node, made, counter) for node in program.body]
    for each in named:
        made.body.extend(_steps(each, 0, made))
    return made


def _named(node: Node, made: Plan, counter: Counter[str]) -> _Named:
    declared = language()[node.name]
    word = re.sub(r"[^A-Za-z0-9_]", "_", node.word if isinstance(node, Draw) else node.name)
    counter[word] += 1
    name = f"{word}_{counter[word]}"
    slots = tuple(
        f"{name}_{parameter.name}" + (f"[{place}]" if parameter.quantity.width > 1 else "")
        for parameter in declared.parameters
        for place in range(parameter.quantity.width)
    )
    place = len(made.headings)
    if isinstance(node, Loop):
        if not declared.quantities[0].written_out:
            slots = (declared.quantities[0].written(node.values[0]), *slots[1:])
        inner = tuple(_named(each, made, counter) for each in node.body)
        each = _Named(node, declared, name, slots, inner)
        used = [repeat(declared, node.values, flag)[1] for flag in {leaf.declared.quarter for leaf in each.draws}]
        fixed = frozenset.intersection(*used) if used else frozenset(range(1, declared.size))
        made.headings.insert(place, _heading(declared, name, node.values, fixed))
        return each
    found, fixed = pieces(declared, node.values)
    pivot, _ = point(declared, node.values)
    made.headings.insert(place, _heading(declared, name, node.values, fixed))
    drawn = tuple(
        _solid(piece, f"{name}_{index}" if len(found) > 1 else name, language().called(node.word).id, slots, made)
        for index, piece in enumerate(found, 1)
    )
    return _Named(node, declared, name, slots, (), drawn, "[0, 0, 0]" if pivot is None else _vector(pivot, slots))


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


def _solid(piece: Piece, name: str, statement: int, slots: tuple[str, ...], made: Plan) -> Solid:
    shell = None
    if piece.vertices is not None and piece.faces is not None:
        shell = f"{name}_shell"
        made.shells[shell] = (piece.vertices, piece.faces)
    arguments = tuple(_vector(group, slots) if len(group) > 1 else group[0].text(slots) for group in piece.groups)
    if piece.kind == "cuboid" and arguments[-1] == "0":
        arguments = arguments[:-1]
    return Solid(name, statement, piece.kind, arguments, piece.axes, shell)


def _vector(group: tuple[Affine, ...], slots: tuple[str, ...]) -> str:
    words = [one.text(slots) for one in group]
    stem = words[0].partition("[")[0]
    whole = [slot for slot in slots if slot.startswith(f"{stem}[")]
    return stem if words == whole else f"[{', '.join(words)}]"


def _steps(each: _Named, depth: int, made: Plan) -> list[Solid | Repetition]:
    """What a node becomes: a loop that turns statements about different axes is written once for each axis."""
    if not each.declared.is_loop:
        return list(each.drawn)
    motions: dict[tuple[str, bool], Repeat] = {}
    for leaf in each.draws:
        key = (leaf.pivot, leaf.declared.quarter)
        if key not in motions:
            motions[key] = repeat(each.declared, each.node.values, leaf.declared.quarter)[0]
    if len(motions) > 1 and any(motion.turns for motion in motions.values()):
        return [step for leaf in each.draws for step in _steps(each.only(leaf), depth, made)]
    body = tuple(step for inner in each.body for step in _steps(inner, depth + 1, made))
    if not motions or not body:
        return []
    (pivot, _), motion = next(iter(motions.items()))
    return [_repetition(each, motion, pivot, variable(depth), body, made)]


def _repetition(
    each: _Named, motion: Repeat, pivot: str, letter: str, body: tuple[Solid | Repetition, ...], made: Plan
) -> Repetition:
    count = each.slots[0]
    shift = turn = signs = None
    if motion.signs is not None:
        count, signs = number(len(motion.signs)), f"{each.name}_signs[{letter}]"
        made.tables[f"{each.name}_signs"] = motion.signs
    if motion.table is not None:
        count = number(len(motion.table))
        made.tables[f"{each.name}_turns"], made.tables[f"{each.name}_shifts"] = motion.table[:, 0], motion.table[:, 1:]
        shift, turn = ("1", f"{each.name}_shifts[{letter}]"), (f"{each.name}_turns[{letter}]", pivot)
    if motion.shift is not None:
        shift = (letter, _vector(motion.shift, each.slots))
    if motion.even:
        turn = (f"360 * {letter} / {count}", pivot)
    elif motion.turn is not None:
        angle = motion.turn.text(each.slots)
        turn = (f"{letter} * ({angle})" if " " in angle.replace(" * ", "") else f"{letter} * {angle}", pivot)
    return Repetition(letter, count, shift, turn, signs, body)
