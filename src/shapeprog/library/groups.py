"""Blocks of many programs that one function could draw: groups, and the relations that hold in most of them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from shapeprog.language.printer import source_of
from shapeprog.language.program import Chain, Draw, Program, nest
from shapeprog.language.statement import language
from shapeprog.library.blocks import PAIR, Block, Kind, Slot, blocks_of
from shapeprog.library.length import STATEMENT, length
from shapeprog.library.measures import LEAST_EXTENT, Group, Measure, boxes_of, measures, moved, relations
from shapeprog.space import BoolArray, FloatArray

NEAR = 0.03
"""Tolerance of a relation, in cells."""

LEAST_PROGRAMS, LEAST_SHARE = 3, 0.02
"""Fewest programs that use a function, and the least share of all programs for each of its blocks."""

LARGEST = 3
"""Most blocks of a function."""

PARAMETERS, SHARE = 6, 0.6
"""Most parameters of a function without its box, and the largest share of the numbers of several blocks that parameters
and box may be together.  Longer calls would not be used, and a function of two unrelated boxes would fit anything with
a base and a top."""

OPEN = 0.6
"""Least share of the uses in which a measure is zero for it to be an optional parameter."""


class Unit(NamedTuple):
    """A block of a program: its forms, its statement and role, and how long its lines are."""

    forms: tuple[Block, ...]
    draw: Draw
    length: int


Corpus = list[list[Unit | None]]
"""The blocks of each program; ``None`` for those that a function draws already."""


class Use(NamedTuple):
    """Blocks of one program, by index, that are a group: their numbers (M,), and how much shorter a call is."""

    program: int
    blocks: tuple[int, ...]
    values: FloatArray
    gain: int


@dataclass(frozen=True)
class Candidate:
    """A function that may be added to the library.

    Parameters
    ----------
    group, box, rows, openings
        Its blocks, the sides of its box (6, M), the relations (R, M) that hold for them, and angles (U, M) that are
        mostly zero.
    uses
        The blocks that calls would replace; no two uses share a block.
    gain
        How much shorter the programs would be.
    """

    group: Group
    box: FloatArray
    rows: FloatArray
    openings: FloatArray
    uses: tuple[Use, ...]
    gain: float

    @property
    def arguments(self) -> int:
        """How many arguments every call has without its box."""
        return _arguments(self.group, self.rows, self.openings)


def units_of(program: Program) -> list[Unit | None]:
    """The blocks of a program that functions may draw, in the order of its text."""
    units: list[Unit | None] = []
    shared = Counter(_around(chain) for chain in program.chains)
    for chain in program.chains:
        forms = [form for form in blocks_of(chain) if not form.kind.loops and not form.kind.steps]
        draw = chain[-1]
        assert isinstance(draw, Draw)
        units.append(Unit(tuple(forms), draw, _length(chain, shared)) if forms else None)
    return units


def _around(chain: Chain) -> tuple[tuple[str, tuple[float, ...]], ...]:
    """The loops around a statement."""
    return tuple((node.name, node.values) for node in chain[:-1])


def _length(chain: Chain, shared: Mapping[tuple[tuple[str, tuple[float, ...]], ...], int]) -> int:
    """How long a block is in placed text: mirrors are one loop, and blocks in the same loops share these."""
    mirrors = sum(node.name == "mirror" for node in chain[:-1])
    loops = len(chain) - 1 - max(mirrors - 1, 0)
    return length(source_of(Program((nest(chain[-1:]),))).lines) + round(STATEMENT * loops / shared[_around(chain)])


def least_of(corpus: Corpus, blocks: int = 1) -> int:
    """Fewest programs that must use a function of ``blocks`` blocks: equal blocks in few programs may be chance."""
    return max(LEAST_PROGRAMS, round(LEAST_SHARE * blocks * len(corpus)))


def candidates(corpus: Corpus) -> Iterator[Candidate]:
    """The best function for each group that is in enough programs."""
    minimum = least_of(corpus)
    slots: dict[Kind, tuple[Slot, ...]] = {}
    groups: dict[tuple[Kind, ...], list[Use]] = defaultdict(list)
    for number, units in enumerate(corpus):
        for index, unit in enumerate(units):
            for form in unit.forms if unit is not None else ():
                for kind in dict.fromkeys((form.kind, replace(form.kind, word=""))):
                    slots[kind] = form.slots
                    gain = unit.length - STATEMENT - _counted(form)  # type: ignore[union-attr]
                    use = Use(number, (index,), form.values, gain)
                    groups[(kind,)].append(use)
    level = _frequent({kinds: uses for kinds, uses in groups.items() if kinds[0].word}, minimum)
    for _ in range(1, LARGEST):
        level = _frequent(_larger(level, corpus), minimum)
        groups |= level
    for kinds, uses in groups.items():
        written = kinds[0].word or statement_of(kinds[0].shape)
        if programs(uses) >= least_of(corpus, len(kinds)) and written and (len(kinds) > 1 or kinds[0].repeats):
            group = Group(kinds, tuple(slots[kind] for kind in kinds))
            yield from _best(group, uses, least_of(corpus, len(kinds)))


def programs(uses: Iterable[Use]) -> int:
    """In how many programs something is used."""
    return len({use.program for use in uses})


def statement_of(shape: str) -> str:
    """The statement that draws a solid without a role; the empty string if there is none."""
    name, statements = {"cuboid": "box", "rounded_box": "cushion"}.get(shape, shape), language()
    return name if name in statements and not statements.own_role(name) else ""


def _counted(form: Block) -> int:
    """How many rows of a block do not have two copies, the default of a call."""
    return sum(way == "row" and count != PAIR for (_, way), count in zip(form.kind.repeats, form.counts, strict=True))


def _frequent(level: dict[tuple[Kind, ...], list[Use]], minimum: int) -> dict[tuple[Kind, ...], list[Use]]:
    return {kinds: uses for kinds, uses in level.items() if programs(uses) >= minimum}


def _larger(level: dict[tuple[Kind, ...], list[Use]], corpus: Corpus) -> dict[tuple[Kind, ...], list[Use]]:
    """Groups with one more block, of another role, and later in the order of kinds than the others."""
    larger: dict[tuple[Kind, ...], list[Use]] = defaultdict(list)
    for kinds, uses in level.items():
        for use in uses:
            for index, unit in enumerate(corpus[use.program]):
                if unit is None or index in use.blocks:
                    continue
                form = unit.forms[0]
                behind = repr(form.kind) > repr(kinds[-1])
                new_role = form.kind.word and form.kind.word not in [kind.word for kind in kinds]
                if new_role and behind:
                    values = np.append(use.values, form.values)
                    more = Use(use.program, (*use.blocks, index), values, use.gain + unit.length - _counted(form))
                    larger[(*kinds, form.kind)].append(more)
    return larger


def _best(group: Group, uses: Sequence[Use], minimum: int) -> Iterator[Candidate]:
    """The function for a group and each of its boxes that shortens most."""
    typical = np.median([use.values for use in uses], 0)
    for box in boxes_of(group, typical):
        yield from _best_in(box, group, typical, uses, minimum)


def _best_in(
    box: FloatArray, group: Group, typical: FloatArray, uses: Sequence[Use], minimum: int
) -> Iterator[Candidate]:
    """The function that shortens programs most; relations are added one by one, the most frequent first.

    No relation constrains its box, since every call has its own.
    """
    values = np.array([use.values for use in uses])
    extents = values @ box[3:].T
    uses = [use for use, sizes in zip(uses, extents, strict=True) if min(sizes) >= LEAST_EXTENT]
    values = np.array([use.values for use in uses]).reshape(-1, group.size)
    all_measures = list(measures(group, typical))
    openings = [measure for measure in all_measures if measure.sort == "angle" and len(group.kinds) == 1]
    offered = _offered(group, all_measures, openings)
    holds = np.abs(values @ offered.T) <= NEAR
    owner = np.repeat(np.arange(len(group.slots)), [len(slots) for slots in group.slots])
    alive: BoolArray = np.ones(len(uses), np.bool_)
    rows: FloatArray = np.zeros((0, group.size))
    joined = 0
    best: Candidate | None = None
    untried = np.arange(len(offered))
    while True:
        if joined >= len(group.kinds) - 1:
            fitting = [use for use, fits in zip(uses, alive, strict=True) if fits]
            candidate = _priced(group, box, rows, openings, fitting)
            limit = PARAMETERS if len(group.kinds) == 1 else min(PARAMETERS, SHARE * group.size - len(box))
            called = candidate.arguments + len(candidate.openings) <= limit
            if called and programs(candidate.uses) >= minimum and candidate.gain > (best.gain if best else 0):
                best = candidate
        support = (holds[:, untried] & alive[:, None]).sum(0)
        order = np.argsort(-support, kind="stable")
        untried = untried[order][support[order] >= minimum]
        following = next((k for k in untried if _independent(np.vstack([box, rows]), offered[k])), None)
        if following is None:
            break
        rows, alive = np.vstack([rows, offered[following]]), alive & holds[:, following]
        joined += len(set(owner[np.flatnonzero(offered[following])].tolist())) > 1
        untried = untried[untried != following]
    if best is not None:
        yield best


def _offered(group: Group, every: Sequence[Measure], angles: Sequence[Measure]) -> FloatArray:
    """Relations that may be required: none that makes an opening zero or fixes the position of the group."""
    rows = [row for row in relations(every) if all(np.linalg.matrix_rank([row, angle.row]) == 2 for angle in angles)]
    rows = [row for row in rows if not (moved(group) @ row).any()]
    return np.array(rows).reshape(-1, group.size)


def _priced(
    group: Group, box: FloatArray, rows: FloatArray, openings: Sequence[Measure], uses: Sequence[Use]
) -> Candidate:
    """The function of a group for which relations hold, and how much its uses shorten programs."""
    optional: FloatArray = np.zeros((0, group.size))
    for opening in openings:
        zero = [bool(abs(use.values @ opening.row) <= NEAR) for use in uses]
        if sum(zero) < OPEN * len(uses) or not _independent(np.vstack([box, rows, optional]), opening.row):
            continue
        if all(zero):
            rows = np.vstack([rows, opening.row])
        else:
            optional = np.vstack([optional, opening.row])
    values = np.array([use.values for use in uses]).reshape(-1, group.size)
    arguments = _arguments(group, rows, optional)
    extra = (np.abs(values @ optional.T) > NEAR).sum(1).tolist()
    used: set[tuple[int, int]] = set()
    selected: list[Use] = []
    for use, more in zip(uses, extra, strict=True):
        blocks = {(use.program, index) for index in use.blocks}
        if not blocks & used:
            used |= blocks
            selected.append(use._replace(gain=use.gain - arguments + group.counts - len(box) - more))
    lines = 1 + sum(1 + len(kind.repeats) for kind in group.kinds)
    cost = STATEMENT * lines + arguments + len(optional) + group.size
    return Candidate(group, box, rows, optional, tuple(selected), sum(use.gain for use in selected) - cost)


def _arguments(group: Group, rows: FloatArray, openings: FloatArray) -> int:
    """How many arguments every call of a function has without its box."""
    return group.size - 6 - len(rows) - len(openings) + group.counts


def _independent(rows: FloatArray, row: FloatArray) -> bool:
    return int(np.linalg.matrix_rank(np.vstack([rows, row]), tol=1e-6)) > len(rows)
