"""Plans of CAD scripts for programs with names: numbers, expressions and functions keep their names.

This requires that every named number enters its solids linearly, and in the same way in every call of a function; any
other program is written out.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection

from shapeprog.formats.plan import (
    Definition,
    Inexpressible,
    Invocation,
    Module,
    Plan,
    Planned,
    drawing,
    numbered,
    plan,
    steps,
    still_of,
)
from shapeprog.formats.symbolic import Affine, Piece, Repeat, Slot, pieces, repeat
from shapeprog.language.evaluation import occurrences
from shapeprog.language.expression import Expression, Name, Value, text_of, value_at
from shapeprog.language.named import inline, names
from shapeprog.language.program import Draw, Loop, Node, Program
from shapeprog.language.source import (
    Assignment,
    Call,
    Comment,
    Function,
    Line,
    Source,
    WrittenDraw,
    WrittenLoop,
    names_of,
)
from shapeprog.language.statement import language
from shapeprog.language.unroll import on_numpy_if_shipped
from shapeprog.space import FloatArray

_OWN = re.compile(r"\w+_\d+_(signs|turns|shifts|shell)|at_[a-z]\d*")
"""Names that scripts define themselves."""


def script_plan(program: Program, reserved: Collection[str]) -> Plan:
    """The plan of a program; numbers and functions named by a ``reserved`` word of the script are renamed."""
    with on_numpy_if_shipped(program):
        if program.source is None or program.source.plain:
            return plan(program)
        try:
            return _Planner(program, program.source, reserved).made
        except Inexpressible:
            return plan(inline(program))


class _Planner:
    """Plans the lines of one program."""

    def __init__(self, program: Program, source: Source, reserved: Collection[str]) -> None:
        self.made = Plan(source.unit)
        self.functions = source.functions
        self.met = occurrences(source)
        self.counter: Counter[str] = Counter()
        self.words = _words([*sorted(names_of(source)), *self.functions], reserved)
        self.scope = {name: Name(word) for name, word in self.words.items()}
        self.taken = frozenset(self.words.values())
        self.pivoted: dict[str, bool] = {}
        self._numbers(program, source)
        for function in self.functions.values():
            planned = [found for line in function.body for found in self._planned(line)]
            leaves = [leaf for each in planned for leaf in each.draws]
            own = (leaf.pivoted or (leaf.node is not None and language()[leaf.node.name].pivot) for leaf in leaves)
            self.pivoted[function.name] = any(own)
            given = tuple((self.words[word], self._optional(value)) for word, value in function.parameters)
            body = tuple(step for each in planned for step in steps(each, 0, self.made, self.taken))
            self.made.functions.append(Module(self.words[function.name], given, body, function.note))
        for line in source.lines:
            if not isinstance(line, Assignment | Function):
                for each in self._planned(line):
                    self.made.body += steps(each, 0, self.made, self.taken)

    def _numbers(self, program: Program, source: Source) -> None:
        """The named numbers of the program itself."""
        found = {named.name: named for named in names(program)}
        for line in source.lines:
            if isinstance(line, Assignment):
                for place, (name, value) in enumerate(line.numbers):
                    free, note = found[name].value if found[name].free else None, "" if place else line.note
                    definition = Definition(self.words[name], self._text(value), note, free, found[name].whole)
                    self.made.numbers.append(definition)

    def _planned(self, line: Line) -> list[Planned]:
        """The steps of a line; none for a comment, or in a function that is never called."""
        match line:
            case Comment() | Function():
                return []
            case Assignment(pairs):
                drawn = tuple(Definition(self.words[name], self._text(value), line.note) for name, value in pairs)
                return [Planned(None, "", drawn=drawn)]
            case Call(name, pairs):
                call = Invocation(self.words[name], tuple((self.words[word], self._text(v)) for word, v in pairs))
                return [Planned(None, name, drawn=(call,), pivoted=self.pivoted[name])]
        if not self.met[id(line)]:
            return []
        node, name = self.met[id(line)][0], numbered(self.met[id(line)][0], self.counter)
        slots = self._slots(line, node)
        if isinstance(line, WrittenLoop):
            body = tuple(found for inner in line.body for found in self._planned(inner))
            loop = Planned(node, name, slots, body)
            self._refuse(slots, still_of(loop))
            self._refuse_motions(line, loop)
            return [loop]
        assert isinstance(node, Draw)
        found, fixed = self._pieces(line, node)
        self._refuse(slots, fixed)
        return [drawing(node, name, slots, found, self.made)]

    def _pieces(self, line: Line, node: Draw) -> tuple[list[Piece], frozenset[int]]:
        """The solids of a statement, which must be the same expressions of its numbers in every call around it."""
        declared = language()[node.name]
        found, fixed = pieces(declared, node.values, self.made.cell)
        for other in {each.values for each in self.met[id(line)]} - {node.values}:
            if not _same(found, pieces(declared, other, self.made.cell)[0]):
                raise Inexpressible
        return found, fixed

    def _refuse_motions(self, line: Line, loop: Planned) -> None:
        """A loop must move its copies alike in every call, and by no table if their count may change."""
        assert loop.node is not None
        declared, values = language()[loop.node.name], loop.node.values
        for quarter in {leaf.quarter for leaf in loop.draws}:
            motion = repeat(declared, values, quarter)[0]
            listed = motion.table is not None or motion.signs is not None
            if listed and str(loop.slots[0]).startswith("round("):
                raise Inexpressible
            for other in {each.values for each in self.met[id(line)]} - {values}:
                if not _alike(motion, repeat(declared, other, quarter)[0]):
                    raise Inexpressible

    def _refuse(self, slots: tuple[Slot, ...], fixed: frozenset[int]) -> None:
        """Named numbers cannot enter as plain numbers."""
        if any(isinstance(slots[slot], str) for slot in fixed):
            raise Inexpressible

    def _slots(self, line: WrittenDraw | WrittenLoop, node: Node) -> tuple[Slot, ...]:
        slots: list[Slot] = []
        for value in line.values:
            text = self._text(value)
            loose = isinstance(value, Expression) and (value.level == 1 or text.startswith("-"))
            slots.append((f"({text})" if loose else text) if isinstance(value, Expression) else value)
        if isinstance(node, Loop):
            count = slots[0]
            slots[0] = f"round({self._text(line.values[0])})" if isinstance(count, str) else f"{count:.0f}"
        return tuple(slots)

    def _text(self, value: Value) -> str:
        return text_of(value_at(value, self.scope))

    def _optional(self, value: Value | None) -> str | None:
        return None if value is None else self._text(value)


def _words(given: list[str], reserved: Collection[str]) -> dict[str, str]:
    """Script names for names: unchanged except for non-ASCII letters and reserved words."""
    found: dict[str, str] = {}
    for name in given:
        word = re.sub(r"[^A-Za-z0-9_]", "_", name)
        while word in reserved or word in found.values() or _OWN.fullmatch(word) or not word.strip("_"):
            word = f"{word}_" if word.strip("_") else f"number{word}"
        found[name] = word
    return found


def _same(one: list[Piece], other: list[Piece]) -> bool:
    """Whether two statements draw the same expressions."""

    def told(each: Piece) -> tuple[object, ...]:
        return each.kind, *map(_told, each.groups), _listed(each.axes), _listed(each.vertices)

    return [told(each) for each in one] == [told(each) for each in other]


def _alike(one: Repeat, other: Repeat) -> bool:
    """Whether two loops move their copies by the same expressions."""

    def told(each: Repeat) -> tuple[object, ...]:
        turn = None if each.turn is None else _told((each.turn,))
        shift = None if each.shift is None else _told(each.shift)
        return turn, each.even, shift, _listed(each.table), _listed(each.signs)

    return told(one) == told(other)


def _told(group: tuple[Affine, ...]) -> list[tuple[object, ...]]:
    return [(round(each.constant, 5) + 0.0, each.terms) for each in group]


def _listed(array: FloatArray | None) -> object:
    return None if array is None else array.round(9).tolist()
