"""Calls of functions among the blocks of a program: the blocks of a call compete as a unit, at the price of one line.

For fixed counts, the numbers of the blocks that a function draws are linear in its measures.  Fitting keeps these
relations, and least squares give the call that is nearest to moved blocks.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from shapeprog.errors import ShapeProgError
from shapeprog.inference.fit.tunable import CELLS, Tunable, least
from shapeprog.inference.roles.roles import with_roles
from shapeprog.language.ast import Call, Source
from shapeprog.language.expression import Expression, Value
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Draw, Loop, Node, Program, nest
from shapeprog.language.statement import language
from shapeprog.library.blocks import Block, forms_of
from shapeprog.library.matching import EXACT, Form, Pattern
from shapeprog.library.rewriting import offers, within
from shapeprog.library.store import Library
from shapeprog.space import FloatArray

FOLLOWS = 1e-6
"""Factors below this are zero: such a relation follows from others."""


@dataclass(frozen=True)
class Called:
    """A call of a function, with a number for each of its parameters, and the loops around it, without bodies."""

    pattern: Pattern
    numbers: tuple[float, ...]
    around: tuple[Loop, ...] = ()

    @staticmethod
    def of(pattern: Pattern, numbers: Mapping[str, float], around: tuple[Loop, ...] = ()) -> Called | None:
        """The call with these numbers, rounded, and set to defaults that they equal; None if it draws nothing."""
        tidy = [round(numbers[name], CELLS) + 0.0 for name in pattern.parameters]
        for index, default in enumerate(pattern.defaults.values()):
            if isinstance(default, float) and abs(tidy[index] - default) <= EXACT:
                tidy[index] = default
        call = Called(pattern, tuple(map(to_float32, tidy)), around)
        try:
            return call if call.forms and all(map(_solid, call.program.walk())) else None
        except ShapeProgError:  # a number out of the range of its parameter
            return None

    @cached_property
    def program(self) -> Program:
        """The program of this call alone."""
        pairs = zip(self.pattern.defaults.items(), self.numbers, strict=True)
        call = Call(
            self.pattern.function.name, tuple((name, value) for (name, usual), value in pairs if value != usual)
        )
        loops = [Loop(loop.name, loop.values, ()) for loop in self.around]
        nodes = (within(loops, node) for node in self.pattern.drawn(self._table))
        return Program(tuple(nodes), Source((self.pattern.function, within(loops, call))))  # type: ignore[arg-type]

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """The nodes that the call draws, one block each."""
        return self.program.flat().body

    @cached_property
    def forms(self) -> tuple[Form, ...]:
        """The forms of the blocks within its loops, computed from its measures."""
        return self.pattern.forms_at(self._table)

    @property
    def _table(self) -> dict[str, float]:
        return dict(zip(self.pattern.parameters, self.numbers, strict=True))

    @property
    def _linear(self) -> tuple[FloatArray, FloatArray]:
        """Factors (M, P) and constants (M,) of the linear map from its measures to the numbers of its forms."""
        factors, constants = zip(*((form.factors, form.constants) for form in self.forms), strict=True)
        return np.concatenate(factors), np.concatenate(constants)

    def moved(self, nodes: Sequence[Node]) -> Called:
        """The call whose blocks are nearest to the given nodes in least squares; this call if there is none."""
        factors, constants = self._linear
        values = np.concatenate([block.values for block in self._blocks(nodes)])
        start = np.array([self._table[name] for name in self.pattern.measures])
        solution = start + np.linalg.pinv(factors) @ (values - constants - factors @ start)
        chains = Program(tuple(nodes)).chains
        loops = [
            replace(
                loop, values=tuple(to_float32(value) for value in np.mean([chain[k].values for chain in chains], 0))
            )
            for k, loop in enumerate(self.around)
        ]
        table = self._table | dict(zip(self.pattern.measures, solution.tolist(), strict=True))
        return Called.of(self.pattern, table, tuple(loops)) or self

    def relations(self, nodes: Sequence[Node]) -> FloatArray:
        """Linear relations between the concatenated numbers (V,) of its blocks, as rows (R, V) of factors.

        If a function contains constants, the relations fix their ratios.
        """
        factors, constants = self._linear
        across = np.linalg.svd(factors)[0].T[np.linalg.matrix_rank(factors) :]
        blocks = self._blocks(nodes)
        unequal = across @ (constants - np.concatenate([block.rows[:, -1] for block in blocks]))
        if np.abs(unequal).max(initial=0) > EXACT:
            across = np.linalg.svd(unequal[:, None])[0].T[1:] @ across
        outer = sum(len(loop.values) for loop in self.around)
        inner = block_diag(*(np.pad(block.rows[:, :-1], ((0, 0), (outer, 0))) for block in blocks))
        ends = np.cumsum([0, *(outer + block.rows.shape[1] - 1 for block in blocks)])
        identity = np.eye(ends[-1])
        equal = [identity[start : start + outer] - identity[:outer] for start in ends[1:-1]]
        return np.concatenate([across @ inner, *equal])

    def _blocks(self, nodes: Sequence[Node]) -> list[Block]:
        """The blocks within its loops, in the forms of its function."""
        chains = [chain[len(self.around) :] for chain in Program(tuple(nodes)).chains]
        return [
            next(
                block for block in forms_of(chain) if replace(block.kind, word=form.block.kind.word) == form.block.kind
            )
            for chain, form in zip(chains, self.forms, strict=True)
        ]


def _solid(node: Node) -> bool:
    """Whether all numbers are at least the minimum of their quantity."""
    quantities = language()[node.name].quantities
    return all(value >= least(quantity) for value, quantity in zip(node.values, quantities, strict=True))


Part = Node | Called
"""An element of a selection: a block, or a call of a function that draws several blocks."""


class Placed(NamedTuple):
    """A call, and the indices of its blocks among those of a program."""

    call: Called
    places: Sequence[int]


def program_of(part: Part) -> Program:
    """The program of a part alone."""
    return part.program if isinstance(part, Called) else Program((part,))


def drawn(parts: Sequence[Part]) -> Program:
    """The plain program of some parts, whose nodes are one block each."""
    return Program(tuple(node for part in parts for node in _nodes(part)))


def _nodes(part: Part) -> tuple[Node, ...]:
    return part.nodes if isinstance(part, Called) else (part,)


def placed(parts: Sequence[Part]) -> list[Placed]:
    """The calls among some parts, with the indices of their blocks in the program of all parts."""
    starts = np.cumsum([0, *(len(_nodes(part)) for part in parts)]).tolist()
    ranges = itertools.pairwise(starts)
    return [Placed(part, range(*ends)) for part, ends in zip(parts, ranges, strict=True) if isinstance(part, Called)]


def recognised(program: Program, libraries: Sequence[Library]) -> list[Placed]:
    """The calls that a program of single blocks can be written with, see :func:`shapeprog.library.with_library`."""
    calls: list[Placed] = []
    for library in libraries:
        patterns = {pattern.function.name: pattern for pattern in library.patterns}
        for offer in offers(program, library):
            pattern = patterns[offer.call.name]
            usual = {name: value for name, value in pattern.defaults.items() if isinstance(value, float)}
            loops = tuple(Loop(loop.name, _plain(loop.values), ()) for loop in offer.around)
            words, measures = zip(*offer.call.arguments, strict=True) if offer.call.arguments else ((), ())
            call = Called.of(pattern, usual | dict(zip(words, _plain(measures), strict=True)), loops)
            if call and not any({*offer.lines} & {*existing.places} for existing in calls):
                calls.append(Placed(call, offer.lines))
    return calls


def _plain(values: Sequence[Value]) -> tuple[float, ...]:
    """The values that are numbers; expressions are left out."""
    return tuple(value for value in values if not isinstance(value, Expression))


def relations(program: Program, calls: Sequence[Placed]) -> FloatArray:
    """Linear relations between the free numbers of a program with calls, as independent rows (R, F) of factors."""
    tunable = Tunable(program)
    if not calls:
        return np.zeros((0, len(tunable.moving)))
    starts = np.cumsum([0, *(len(node.values) for node in tunable.nodes)])
    widths = [sum(len(node.values) for node in chain) for chain in program.chains]
    firsts = np.cumsum([0, *widths])
    rows: list[FloatArray] = []
    for call, indices in calls:
        factors = call.relations([program.body[index] for index in indices])
        rows.append(np.zeros((len(factors), starts[-1])))
        rows[-1][:, np.concatenate([firsts[index] + np.arange(widths[index]) for index in indices])] = factors
    return _reduced(np.concatenate(rows)[:, [starts[n] + slot for n, slot in tunable.moving]])


def _reduced(rows: FloatArray) -> FloatArray:
    """Independent rows that span the same space, in reduced row echelon form (Gauss-Jordan elimination)."""
    rows, count = rows.copy(), 0
    for column in range(rows.shape[1]):
        if count < len(rows) and np.abs(rows[count:, column]).max() > FOLLOWS:
            pivot = count + int(np.abs(rows[count:, column]).argmax())
            rows[[count, pivot]] = rows[[pivot, count]]
            rows[count] /= rows[count, column]
            mask = np.arange(len(rows)) != count
            rows[mask] -= np.outer(rows[mask, column], rows[count])
            rows[np.abs(rows) < FOLLOWS] = 0
            count += 1
    return rows[:count]


def moved(parts: Sequence[Part], program: Program) -> list[Part]:
    """The parts with the numbers of a program, which has the same blocks in the same order."""
    nodes = iter(program.body)
    return [
        part.moved([next(nodes) for _ in part.nodes]) if isinstance(part, Called) else next(nodes) for part in parts
    ]


def regrouped(parts: Sequence[Part], program: Program) -> list[Part]:
    """The parts of a program in which single blocks were changed or removed, and the blocks of calls are unchanged."""
    waiting = [part for part in parts if isinstance(part, Called)]
    result: list[Part] = []
    index = 0
    while index < len(program.body):
        following = program.body[index : index + len(waiting[0].nodes)] if waiting else ()
        if waiting and following == waiting[0].nodes:
            result.append(waiting.pop(0))
            index += len(following)
        else:
            result.append(program.body[index])
            index += 1
    return result


def named(parts: Sequence[Part], program: Program) -> Program:
    """The program of some parts with roles; blocks without a role in their function get the commonest of the call."""
    chains, roles = program.chains, with_roles(program)
    nodes = list(roles.body)
    first = 0
    for part in parts:
        blocks = range(first, first + len(_nodes(part)))
        first = blocks.stop
        if isinstance(part, Called):
            free = [k for k, form in zip(blocks, part.forms, strict=True) if not form.block.kind.word]
            words = Counter(roles.chains[k][-1].word for k in free)  # type: ignore[union-attr]
            for k in free:
                *loops, draw = chains[k]
                assert isinstance(draw, Draw)
                role = words.most_common(1)[0][0]
                nodes[k] = nest((*loops, replace(draw, role="" if role == draw.name else role)))
    return Program(tuple(nodes))
