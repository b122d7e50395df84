"""Where a program draws what a function would draw, and with which arguments.

The blocks of a function are linear in its parameters once its counts are known.  So a least-squares solution tells the
arguments for some blocks of a program, and its residual whether they fit; what the arguments are in the names of the
program follows from as many of its numbers as there are parameters, those with the shortest expressions.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import Call, Function, Source
from shapeprog.language.convert import call_in_cells
from shapeprog.language.dimensions import counted_names
from shapeprog.language.expression import Linear, Name, Value, combined, value_at
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import BOX_IN_CELLS, SIZES
from shapeprog.language.program import Loop, Node, Program
from shapeprog.library.blocks import Block, Kind, blocks_of
from shapeprog.library.independence import independent
from shapeprog.library.length import terms, written
from shapeprog.space import FloatArray

TOLERANCE = 0.05
"""How far in cells a number may be from what a function makes of its arguments."""

BOX = 12.0
"""Sides of the box of a parameter without an example, where that decides what lies above or beside what."""

GENERIC = 7.0
"""What a parameter without an example is tried with."""

STEEP = 8.0
"""How much smaller than another such parameter the next is: thin parts are."""

EXACT = 0.01
"""Largest difference in cells between the default of a parameter and a number that it replaces."""

TRIES = 12
"""Ways in which arguments are expressed, of which the shortest is kept."""


class Form(NamedTuple):
    """A block whose numbers are linear in names: (M, N) factors and (M,) constants."""

    block: Block
    factors: FloatArray
    constants: FloatArray


@dataclass(frozen=True)
class Pattern:
    """A function as what it draws.

    Parameters
    ----------
    source
        The library, whose functions it may call.
    function
        The function.
    example
        A typical call, if one is known.
    """

    source: Source
    function: Function
    example: Call | None = None

    @property
    def defaults(self) -> dict[str, Value | None]:
        """The defaults of its parameters, of which those of its box come first; ``None`` for those without one."""
        return dict.fromkeys(BOX_IN_CELLS) | dict(self.function.parameters)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return tuple(self.defaults)

    @cached_property
    def counts(self) -> tuple[str, ...]:
        """Parameters that say how often something is repeated."""
        counted = counted_names(self.source)
        return tuple(name for name in self.parameters if f"{self.function.name}.{name}" in counted)

    @property
    def measures(self) -> tuple[str, ...]:
        """Its other parameters, which are continuous."""
        return tuple(name for name in self.parameters if name not in self.counts)

    @cached_property
    def blocks(self) -> int:
        """How many blocks it draws; none if they are not linear in its measures."""
        return len(self.forms_at(self.arguments))

    def choices(self, seen: Iterable[tuple[int, ...]]) -> Iterator[dict[str, float]]:
        """What its counts may be where blocks are repeated as often as these; once only where it says so by itself.

        What draws one block repeats it as some block is.
        """
        known = {tuple(sorted(counts)): Counter(counts) for counts in seen}
        every = sorted({float(n) for counts in known for n in counts})
        options = [sorted({1.0, *every}) if self.defaults[name] == 1 else every for name in self.counts]
        for counts in itertools.product(*options):
            several = Counter(count for count in counts if count > 1)
            if self.blocks > 1 or any(several <= one for one in known.values()):
                yield dict(zip(self.counts, counts, strict=True))

    @property
    def shortens(self) -> bool:
        """Whether a call is less to write than what it draws."""
        return written(self.function.body) > 1

    @property
    def arguments(self) -> dict[str, float]:
        """A number for each parameter: that of the example, a default, or any."""
        return self._assumed(lambda place: GENERIC / STEEP**place)

    def forms(self, counts: Mapping[str, float]) -> tuple[tuple[Form, ...], ...]:
        """What it draws for these counts; nothing if that is not linear in its other parameters.

        Which of two copies lies below the other may depend on its arguments: where no example tells, several are tried.
        """
        key = tuple(counts.values())
        if key not in self._known:
            last = len(self.parameters)
            assumed = [self.arguments]
            if self.example is None:
                assumed += [
                    self._assumed(lambda place: GENERIC / STEEP ** (last - 1 - place)),
                    self._assumed(lambda _: GENERIC),
                ]
            apart = ({name: value or GENERIC for name, value in one.items()} for one in assumed)  # no copies on others
            found = {_key(each): each for one in apart if (each := self.forms_at({**one, **counts}))}
            self._known[key] = tuple(found.values())
        return self._known[key]

    @cached_property
    def _known(self) -> dict[tuple[float, ...], tuple[tuple[Form, ...], ...]]:
        return {}

    def _assumed(self, any_: Callable[[int], float]) -> dict[str, float]:
        known = self._shown
        return {name: 3.0 if name in self.counts else any_(n) for n, name in enumerate(self.parameters)} | known

    @property
    def _shown(self) -> dict[str, float]:
        """The parameters that have a default, or are in the example."""
        shown = (*self.defaults.items(), *(self.example.arguments if self.example else ()))
        return {name: value for name, value in shown if isinstance(value, float)}

    @cached_property
    def _drawn(self) -> dict[tuple[float, ...], tuple[Node, ...]]:
        return {}

    def nodes(self, numbers: Mapping[str, float]) -> tuple[Node, ...]:
        """What it draws for the counts among these numbers, with linear forms of its measures.

        A ``ShapeProgError`` if it is not linear in them.
        """
        counts = {name: numbers[name] for name in self.counts}
        key = tuple(counts.values())
        if key not in self._drawn:
            usual = {name: BOX if name in BOX_IN_CELLS else 1.0 for name in self.parameters} | self._shown | counts
            self._drawn[key] = call_in_cells(self.source, self.function.name, usual)
        return self._drawn[key]

    def drawn(self, numbers: Mapping[str, float]) -> tuple[Node, ...]:
        """What it draws with these numbers; a ``ShapeProgError`` as for :meth:`nodes`."""
        return tuple(_at(node, numbers) for node in self.nodes(numbers))

    def forms_at(self, numbers: Mapping[str, float]) -> tuple[Form, ...]:
        """What it draws about these numbers, one for each parameter; nothing if that is not linear in its measures."""
        try:
            return tuple(form for (form,) in forms(self.nodes(numbers), numbers, self.measures))
        except (ShapeProgError, ZeroDivisionError):
            return ()


def _at(node: Node, numbers: Mapping[str, float]) -> Node:
    """A statement or loop with the values of its linear forms."""
    values = (to_float32(_linear(value).at(numbers)) for value in node.values)
    node = replace(node, values=tuple(values))
    return replace(node, body=tuple(_at(inner, numbers) for inner in node.body)) if isinstance(node, Loop) else node


def _key(found: Sequence[Form]) -> tuple[tuple[Kind, bytes, bytes], ...]:
    return tuple((form.block.kind, form.factors.tobytes(), form.constants.tobytes()) for form in found)


class Match(NamedTuple):
    """Blocks of a program, by their places, that are a call of a function with these arguments."""

    blocks: tuple[int, ...]
    role: str
    arguments: tuple[tuple[str, Value], ...]
    error: float


def forms(
    nodes: Iterable[Node], numbers: Mapping[str, float], names: Sequence[str], ways: Sequence[Sequence[int]] = ((),)
) -> Iterator[tuple[Form, ...]]:
    """The blocks of statements and loops, linear in ``names``, as they are with these numbers.

    Each block has several forms: with mirror images as rows of two along these axes, where both draw the same.
    """
    given = {name: Linear.of(name) for name in names}
    for chain in Program(tuple(nodes)).chains:
        rows = [[_linear(value_at(value, given)) for value in node.values] for node in chain]
        values = (tuple(form.at(numbers) for form in row) for row in rows)
        plain = tuple(replace(node, values=new) for node, new in zip(chain, values, strict=True))
        every = [form for row in rows for form in row]
        factors = np.array([[dict(form.factors).get(name, 0.0) for name in names] for form in every])
        constants = np.array([form.constant for form in every])
        factors = factors.reshape(len(every), len(names))
        yield tuple(_form(next(blocks_of(plain, repeated)), factors, constants) for repeated in ways)


def _form(block: Block, factors: FloatArray, constants: FloatArray) -> Form:
    """A block of numbers that are linear in names, with their factors (V, N) and constants (V,)."""
    every = block.rows[:, :-1]
    return Form(block, every @ factors, every @ constants + block.rows[:, -1])


def _linear(value: Any) -> Linear:
    return value if isinstance(value, Linear) else Linear(float(value))


class Matcher:
    """The blocks of one program, and where functions fit them.

    Parameters
    ----------
    forms
        Its blocks, linear in its free names.
    units
        For each block the line that it is of: a call takes all blocks of a line or none.
    numbers
        Its names, and the N numbers that they stand for.
    """

    def __init__(self, forms: Sequence[Form], units: Sequence[int], numbers: Mapping[str, float]) -> None:
        self.forms, self.units, self.numbers = forms, units, numbers
        self.values = np.array([*numbers.values()])

    def matches(self, pattern: Pattern) -> Iterator[Match]:
        """All ways in which blocks of the program are a call of a function."""
        found: dict[tuple[int, ...], tuple[int, Match]] = {}
        for given in pattern.choices(form.block.counts for form in self.forms):
            for wanted in pattern.forms(given):
                for blocks in self._alike(wanted):
                    solved = self._solved(pattern, given, wanted, blocks)
                    key = tuple(sorted(blocks))
                    if solved is not None and (key not in found or solved[0] < found[key][0]):
                        found[key] = solved
        return (match for _, match in found.values())

    def _alike(self, wanted: Sequence[Form]) -> Iterator[tuple[int, ...]]:
        """Blocks of the kinds wanted, in their order, that make whole lines and share a role where one is open."""

        def extended(chosen: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
            if len(chosen) == len(wanted):
                lines = {self.units[k] for k in chosen}
                if all(k in chosen for k, line in enumerate(self.units) if line in lines):
                    yield chosen
                return
            kind = wanted[len(chosen)].block.kind
            open_roles = {
                self.forms[k].block.kind.word
                for k, form in zip(chosen, wanted, strict=False) if not form.block.kind.word
            }  # fmt: skip
            for k, form in enumerate(self.forms):
                own = form.block.kind
                alike = replace(own, word=kind.word) == kind and form.block.counts == wanted[len(chosen)].block.counts
                role = own.word == kind.word or (not kind.word and open_roles <= {own.word})
                if k not in chosen and alike and role:
                    yield from extended((*chosen, k))

        yield from extended(())

    def _solved(
        self, pattern: Pattern, counts: Mapping[str, float], wanted: Sequence[Form], blocks: tuple[int, ...]
    ) -> tuple[int, Match] | None:
        """The call of a function that draws some blocks, if there is one, and how many arguments are negative."""
        mine = [self.forms[k] for k in blocks]
        factors = np.vstack([form.factors for form in wanted])
        constants = np.concatenate([form.constants for form in wanted])
        values = np.concatenate([form.block.values for form in mine])
        defaults = [pattern.defaults[name] for name in pattern.measures]
        free: npt.NDArray[np.bool_] = np.any(factors, 0)  # the spacing of a row of one is not
        if np.linalg.matrix_rank(factors) < free.sum() or any(
            default is None for default, told in zip(defaults, free, strict=True) if not told
        ):
            return None
        found = np.linalg.lstsq(factors, values - constants, rcond=None)[0]
        if np.abs(factors @ found + constants - values).max(initial=0) > TOLERANCE:
            return None
        rows = np.vstack([np.column_stack([form.factors, form.constants]) for form in mine])
        rows[:, -1] -= constants
        told = iter(self._written(factors[:, free], rows, found[free]))
        written: list[Value] = [
            next(told) if each else default or 0.0 for each, default in zip(free, defaults, strict=True)
        ]
        for place, default in enumerate(defaults):
            if free[place] and isinstance(default, float) and abs(found[place] - default) <= EXACT:
                written[place] = default
        exact = np.array([value_at(value, self.numbers) for value in written])
        error = float(np.abs(factors @ exact + constants - values).max(initial=0))
        sizes = [value for name, value in zip(pattern.measures, exact, strict=True) if name in SIZES]
        if error > TOLERANCE or min(sizes) <= 0:
            return None
        table: dict[str, Value] = {**dict(zip(pattern.measures, written, strict=True)), **counts}
        roles = (form.block.kind.word for form, want in zip(mine, wanted, strict=True) if not want.block.kind.word)
        said = tuple((name, table[name]) for name, default in pattern.defaults.items() if table[name] != default)
        return int((exact < -TOLERANCE).sum()), Match(blocks, next(roles, ""), said, error)

    def _written(self, factors: FloatArray, rows: FloatArray, near: FloatArray) -> list[Value]:
        """The shortest expressions for parameters (P) whose factors (M, P) come to rows (M, N + 1) of the program.

        Of equally short ones that nearest to ``near`` (P) is taken.
        """
        sizes = (np.abs(rows) > 1e-9).sum(1)
        random = np.random.default_rng(0)
        offered: list[dict[bytes, FloatArray]] = [{} for _ in near]
        for attempt in range(TRIES):
            order = np.argsort(sizes + random.random(len(rows)) * attempt, kind="stable")
            chosen = np.array(independent(factors, order.tolist()), np.int64)
            for options, row in zip(offered, np.linalg.inv(factors[chosen]) @ rows[chosen], strict=True):
                options.setdefault((np.round(row, 5) + 0.0).tobytes(), row)
        found: list[Value] = []
        for options, wanted in zip(offered, near, strict=True):
            values = [self._sum(row) for row in options.values()]
            away = [abs(float(row[:-1] @ self.values + row[-1] - wanted)) for row in options.values()]
            best = min(range(len(values)), key=lambda k: (terms(values[k]), away[k]))
            found.append(values[best])
        return found

    def _sum(self, row: FloatArray) -> Value:
        """The expression of a row (N + 1,): factors of the names, and a constant."""
        parts = [(Name(name), factor) for name, factor in zip(self.numbers, np.round(row, 5).tolist(), strict=False)]
        parts = sorted((part for part in parts if part[1]), key=lambda part: part[1] < 0)
        return combined(round(float(row[-1]), 4) + 0.0, parts)
