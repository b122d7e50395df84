"""Matching of functions to the blocks of a program, with the arguments of the calls.

For fixed counts the blocks of a function are linear in its parameters.  So a least-squares solution gives the arguments
for some blocks of a program, and its residual whether they fit.  Expressions of the arguments in the names of the
program follow from as many of its numbers as there are parameters, those with the shortest expressions.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import Call, Function, Source, changed_lines, changed_values
from shapeprog.language.convert import call_in_cells
from shapeprog.language.dimensions import counted_names
from shapeprog.language.expression import Linear, Value, value_at
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import BOX_IN_CELLS, SIZES
from shapeprog.language.program import Node, Program
from shapeprog.library.blocks import Block, Kind, blocks_of
from shapeprog.library.independence import independent
from shapeprog.library.length import terms, written
from shapeprog.space import BoolArray, FloatArray

TOLERANCE = 0.05
"""Largest difference in cells between a number of a program and that of a call that replaces it."""

BOX = 12.0
"""Least sides of the box of a call without an example; they decide the order of parts along each axis."""

GENERIC = 7.0
"""Value of a parameter without an example."""

STEEP = 8.0
"""Ratio of the values of successive parameters without an example: parts may be thin."""

EXACT = 0.01
"""Largest difference in cells between the default of a parameter and a number that it replaces."""

TRIES = 12
"""Sets of numbers tried to express the arguments; the shortest expressions win."""


class Form(NamedTuple):
    """A block whose numbers are linear in names: (M, N) factors and (M,) constants."""

    block: Block
    factors: FloatArray
    constants: FloatArray


@dataclass(frozen=True)
class Pattern:
    """A function as the blocks that it draws.

    Parameters
    ----------
    source
        The library, whose functions it may call.
    function
        The function.
    example
        A typical call, if there is one.
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
        """Parameters that are counts of repetitions."""
        counted = counted_names(self.source)
        return tuple(name for name in self.parameters if f"{self.function.name}.{name}" in counted)

    @property
    def measures(self) -> tuple[str, ...]:
        """Its other parameters, which are continuous."""
        return tuple(name for name in self.parameters if name not in self.counts)

    @cached_property
    def blocks(self) -> int:
        """How many blocks it draws; zero if they are not linear in its measures."""
        return len(self.forms_at(self.arguments))

    def choices(self, existing: Iterable[tuple[int, ...]]) -> Iterator[dict[str, float]]:
        """Possible values of its counts, given those of the blocks; 1 is added for those with that default.

        Counts above 1 of a function that draws one block occur together in one of the blocks.
        """
        multisets = {tuple(sorted(counts)): Counter(counts) for counts in existing}
        every = sorted({float(n) for counts in multisets for n in counts})
        options = [sorted({1.0, *every}) if self.defaults[name] == 1 else every for name in self.counts]
        for counts in itertools.product(*options):
            repeated = Counter(count for count in counts if count > 1)
            if self.blocks > 1 or any(repeated <= multiset for multiset in multisets.values()):
                yield dict(zip(self.counts, counts, strict=True))

    @property
    def shortens(self) -> bool:
        """Whether a call has fewer statements than the body."""
        return written(self.function.body) > 1

    @property
    def arguments(self) -> dict[str, float]:
        """A number for each parameter: that of the example, its default, or a generic one."""
        return self._assumed(lambda index: GENERIC / STEEP**index)

    def forms(self, counts: Mapping[str, float]) -> tuple[tuple[Form, ...], ...]:
        """The forms of its blocks for these counts; empty if those are not linear in its other parameters.

        Which of two copies is the lower may depend on the arguments: without an example, several sets are tried.
        """
        key = tuple(counts.values())
        if key not in self._forms:
            last = len(self.parameters)
            assumed = [self.arguments]
            if self.example is None:
                assumed += [
                    self._assumed(lambda index: GENERIC / STEEP ** (last - 1 - index)),
                    self._assumed(lambda _: GENERIC),
                ]
            # Zero would put copies on top of each other.
            distinct = ({name: value or GENERIC for name, value in arguments.items()} for arguments in assumed)
            unique = {_key(forms): forms for arguments in distinct if (forms := self.forms_at({**arguments, **counts}))}
            self._forms[key] = tuple(unique.values())
        return self._forms[key]

    @cached_property
    def _forms(self) -> dict[tuple[float, ...], tuple[tuple[Form, ...], ...]]:
        return {}

    def _assumed(self, any_: Callable[[int], float]) -> dict[str, float]:
        shown = self._shown
        return {name: 3.0 if name in self.counts else any_(n) for n, name in enumerate(self.parameters)} | shown

    @property
    def _shown(self) -> dict[str, float]:
        """The parameters that have a default, or are in the example."""
        shown = (*self.defaults.items(), *(self.example.arguments if self.example else ()))
        return {name: value for name, value in shown if isinstance(value, float)}

    @cached_property
    def _nodes(self) -> dict[tuple[float, ...], tuple[Node, ...]]:
        return {}

    def nodes(self, numbers: Mapping[str, float]) -> tuple[Node, ...]:
        """Its statements for the counts among these numbers, with linear forms of its measures.

        Raises a ``ShapeProgError`` if they are not linear in the measures.
        """
        counts = {name: numbers[name] for name in self.counts}
        key = tuple(counts.values())
        if key not in self._nodes:
            shown = self._shown
            side = max([BOX, *(4 * abs(shown.get(name, 0.0)) for name in self.measures)])  # large defaults fit in
            usual = {name: side if name in BOX_IN_CELLS else 1.0 for name in self.parameters} | shown | counts
            self._nodes[key] = call_in_cells(self.source, self.function.name, usual)
        return self._nodes[key]

    def drawn(self, numbers: Mapping[str, float]) -> tuple[Node, ...]:
        """Its statements with these numbers; raises a ``ShapeProgError`` as :meth:`nodes` does."""
        at_numbers = partial(changed_values, change=lambda value: to_float32(_linear(value).at(numbers)))
        return changed_lines(self.nodes(numbers), at_numbers)

    def forms_at(self, numbers: Mapping[str, float]) -> tuple[Form, ...]:
        """The forms of its blocks at these numbers, one for each parameter; empty if not linear in its measures."""
        try:
            return tuple(form for (form,) in forms(self.nodes(numbers), numbers, self.measures))
        except (ShapeProgError, ZeroDivisionError):
            return ()


def _key(forms: Sequence[Form]) -> tuple[tuple[Kind, bytes, bytes], ...]:
    return tuple((form.block.kind, form.factors.tobytes(), form.constants.tobytes()) for form in forms)


class Match(NamedTuple):
    """Blocks of a program, by index, that a call of a function with these arguments can replace."""

    blocks: tuple[int, ...]
    role: str
    arguments: tuple[tuple[str, Value], ...]
    error: float


def forms(
    nodes: Iterable[Node], numbers: Mapping[str, float], names: Sequence[str], ways: Sequence[Sequence[int]] = ((),)
) -> Iterator[tuple[Form, ...]]:
    """The blocks of statements and loops at these numbers, linear in ``names``.

    A block has one form for each of ``ways``: the axes along which equal mirror images are read as rows of two.
    """
    variables = {name: Linear.of(name) for name in names}
    for chain in Program(tuple(nodes)).chains:
        rows = [[_linear(value_at(value, variables)) for value in node.values] for node in chain]
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
    """The blocks of one program, and the calls of functions that fit them.

    Parameters
    ----------
    forms
        Its blocks, linear in its free names.
    units
        For each block the index of its line: a call replaces all blocks of a line or none.
    numbers
        Its names, and their N numbers.
    """

    def __init__(self, forms: Sequence[Form], units: Sequence[int], numbers: Mapping[str, float]) -> None:
        self.forms, self.units, self.numbers = forms, units, numbers
        self.values = np.array([*numbers.values()])

    def matches(self, pattern: Pattern) -> Iterator[Match]:
        """All sets of blocks of the program that a call of a function can replace."""
        best: dict[tuple[int, ...], tuple[int, Match]] = {}
        for counts in pattern.choices(form.block.counts for form in self.forms):
            for targets in pattern.forms(counts):
                for blocks in self._candidates(targets):
                    solved = self._solved(pattern, counts, targets, blocks)
                    key = tuple(sorted(blocks))
                    if solved is not None and (key not in best or solved[0] < best[key][0]):
                        best[key] = solved
        return (match for _, match in best.values())

    def _candidates(self, targets: Sequence[Form]) -> Iterator[tuple[int, ...]]:
        """Blocks of the kinds of ``targets``, in order, that fill lines completely and share a role if one is open."""

        def extended(prefix: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
            if len(prefix) == len(targets):
                lines = {self.units[k] for k in prefix}
                if all(k in prefix for k, line in enumerate(self.units) if line in lines):
                    yield prefix
                return
            kind = targets[len(prefix)].block.kind
            open_roles = {
                self.forms[k].block.kind.word
                for k, form in zip(prefix, targets, strict=False) if not form.block.kind.word
            }  # fmt: skip
            for k, form in enumerate(self.forms):
                actual = form.block.kind
                matching = (
                    replace(actual, word=kind.word) == kind and form.block.counts == targets[len(prefix)].block.counts
                )
                role = actual.word == kind.word or (not kind.word and open_roles <= {actual.word})
                if k not in prefix and matching and role:
                    yield from extended((*prefix, k))

        yield from extended(())

    def _solved(
        self, pattern: Pattern, counts: Mapping[str, float], targets: Sequence[Form], blocks: tuple[int, ...]
    ) -> tuple[int, Match] | None:
        """The call of a function that draws some blocks, if there is one, and how many arguments are negative."""
        mine = [self.forms[k] for k in blocks]
        factors = np.vstack([form.factors for form in targets])
        constants = np.concatenate([form.constants for form in targets])
        values = np.concatenate([form.block.values for form in mine])
        defaults = [pattern.defaults[name] for name in pattern.measures]
        free: BoolArray = np.any(factors, 0)  # the spacing of a row of one copy has no effect
        if np.linalg.matrix_rank(factors) < free.sum() or any(
            default is None for default, used in zip(defaults, free, strict=True) if not used
        ):
            return None
        solution = np.linalg.lstsq(factors, values - constants, rcond=None)[0]
        if np.abs(factors @ solution + constants - values).max(initial=0) > TOLERANCE:
            return None
        rows = np.vstack([np.column_stack([form.factors, form.constants]) for form in mine])
        rows[:, -1] -= constants
        expressions = iter(self._written(factors[:, free], rows, solution[free]))
        written: list[Value] = [
            next(expressions) if used else default or 0.0 for used, default in zip(free, defaults, strict=True)
        ]
        for index, default in enumerate(defaults):
            if free[index] and isinstance(default, float) and abs(solution[index] - default) <= EXACT:
                written[index] = default
        exact = np.array([value_at(value, self.numbers) for value in written])
        error = float(np.abs(factors @ exact + constants - values).max(initial=0))
        sizes = [value for name, value in zip(pattern.measures, exact, strict=True) if name in SIZES]
        if error > TOLERANCE or min(sizes) <= 0:
            return None
        table: dict[str, Value] = {**dict(zip(pattern.measures, written, strict=True)), **counts}
        roles = (form.block.kind.word for form, target in zip(mine, targets, strict=True) if not target.block.kind.word)
        arguments = tuple((name, table[name]) for name, default in pattern.defaults.items() if table[name] != default)
        return int((exact < -TOLERANCE).sum()), Match(blocks, next(roles, ""), arguments, error)

    def _written(self, factors: FloatArray, rows: FloatArray, solution: FloatArray) -> list[Value]:
        """The shortest expressions for parameters (P) whose factors (M, P) give rows (M, N + 1) of the program.

        Of equally short expressions, the one closest to ``solution`` (P) is used.
        """
        sizes = (np.abs(rows) > 1e-9).sum(1)
        random = np.random.default_rng(0)
        offered: list[dict[bytes, FloatArray]] = [{} for _ in solution]
        for attempt in range(TRIES):
            order = np.argsort(sizes + random.random(len(rows)) * attempt, kind="stable")
            selected = np.array(independent(factors, order.tolist()), np.int64)
            for options, row in zip(offered, np.linalg.inv(factors[selected]) @ rows[selected], strict=True):
                options.setdefault((np.round(row, 5) + 0.0).tobytes(), row)
        result: list[Value] = []
        for options, target in zip(offered, solution, strict=True):
            values = [self._sum(row) for row in options.values()]
            away = [abs(float(row[:-1] @ self.values + row[-1] - target)) for row in options.values()]
            best = min(range(len(values)), key=lambda k: (terms(values[k]), away[k]))
            result.append(values[best])
        return result

    def _sum(self, row: FloatArray) -> Value:
        """The expression of a row (N + 1,): factors of the names, and a constant."""
        factors = tuple(zip(self.numbers, np.round(row[:-1], 5).tolist(), strict=True))
        constant = float(row[-1])
        return Linear(round(constant, 7) if abs(constant) >= 5e-5 else 0.0, factors).written()
