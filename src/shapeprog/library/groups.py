"""Blocks of many programs that might be calls of one function: groups, and the relations that hold in most of them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.language.program import Draw, Program, nest
from shapeprog.language.statement import language
from shapeprog.language.text import source_of
from shapeprog.library.blocks import Block, Kind, Slot, blocks_of, gridded, readings
from shapeprog.library.length import STATEMENT, length
from shapeprog.library.measures import Group, Measure, measures, relations
from shapeprog.space import FloatArray

NEAR = 0.03
"""How far in cells a relation may be from holding."""

LEAST_PROGRAMS, LEAST_SHARE = 3, 0.02
"""How many programs must use a function, and which share of all for each of its blocks."""

LARGEST = 3
"""Most blocks of a function."""

ARGUMENTS, SHARE = 10, 0.6
"""Most arguments of a function that draws several blocks, and the share of their numbers that these may be: nobody
would call one with more, and whatever has a base and a top would do for one of two loose boxes."""

OPEN = 0.6
"""Share of the uses from which a measure that is zero need not be said."""


class Unit(NamedTuple):
    """A block of a program: its forms, its statement and role, and how long its lines are."""

    forms: tuple[Block, ...]
    draw: Draw
    length: int


Corpus = list[list[Unit | None]]
"""The blocks of each program that no function draws yet."""


class Use(NamedTuple):
    """Blocks of one program, by their places, that are a group: their numbers (M,), and how much a call is shorter."""

    program: int
    blocks: tuple[int, ...]
    values: FloatArray
    gain: int


@dataclass(frozen=True)
class Candidate:
    """A function that might be.

    Parameters
    ----------
    group, rows, openings
        Its blocks, the relations (R, M) that hold for them, and measures (U, M) that are mostly zero.
    uses
        Where it would be called; no two of them share a block.
    gain
        How much shorter the programs would be.
    """

    group: Group
    rows: FloatArray
    openings: FloatArray
    uses: tuple[Use, ...]
    gain: float

    @property
    def arguments(self) -> int:
        """How many arguments every call says."""
        return _arguments(self.group, self.rows, self.openings)


def units_of(program: Program) -> list[Unit | None]:
    """The blocks of a program that functions may draw, in the order of its text."""
    found: list[Unit | None] = []
    for chain in program.chains:
        forms = [form for form in blocks_of(chain) if not form.kind.others]
        forms += {form.kind: form for each in readings(chain) for form in gridded(each)}.values()
        draw = chain[-1]
        assert isinstance(draw, Draw)
        found.append(Unit(tuple(forms), draw, length(source_of(Program((nest(chain),))).lines)) if forms else None)
    return found


def least_of(corpus: Corpus, blocks: int = 1) -> int:
    """How many programs a function of so many blocks must serve: what is alike in a few may be so by chance."""
    return max(LEAST_PROGRAMS, round(LEAST_SHARE * blocks * len(corpus)))


def candidates(corpus: Corpus) -> Iterator[Candidate]:
    """The best function for each group that is in enough programs."""
    least = least_of(corpus)
    slots: dict[Kind, tuple[Slot, ...]] = {}
    groups: dict[tuple[Kind, ...], list[Use]] = defaultdict(list)
    for number, units in enumerate(corpus):
        for place, unit in enumerate(units):
            for form in unit.forms if unit is not None else ():
                for kind in dict.fromkeys((form.kind, replace(form.kind, word=""))):
                    slots[kind] = form.slots
                    use = Use(number, (place,), form.values, unit.length - STATEMENT)  # type: ignore[union-attr]
                    groups[(kind,)].append(use)
    level = _frequent(
        {kinds: uses for kinds, uses in groups.items() if kinds[0].word and not (kinds[0].grid or kinds[0].steps)},
        least,
    )
    for _ in range(1, LARGEST):
        level = _frequent(_larger(level, corpus), least)
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
    """The statement that draws a solid and gives it no role; nothing if there is none."""
    name, known = {"cuboid": "box", "rounded_box": "cushion"}.get(shape, shape), language()
    return name if name in known and not known.own_role(name) else ""


def _frequent(level: dict[tuple[Kind, ...], list[Use]], least: int) -> dict[tuple[Kind, ...], list[Use]]:
    return {kinds: uses for kinds, uses in level.items() if programs(uses) >= least}


def _larger(level: dict[tuple[Kind, ...], list[Use]], corpus: Corpus) -> dict[tuple[Kind, ...], list[Use]]:
    """Groups with one more block each, of another role, which comes behind the others in the order of kinds."""
    found: dict[tuple[Kind, ...], list[Use]] = defaultdict(list)
    for kinds, uses in level.items():
        for use in uses:
            for place, unit in enumerate(corpus[use.program]):
                if unit is None or place in use.blocks:
                    continue
                form = unit.forms[0]
                if form.kind.steps:
                    continue
                behind = repr(form.kind) > repr(kinds[-1])
                other = form.kind.word and form.kind.word not in [kind.word for kind in kinds]
                if other and behind:
                    values = np.append(use.values, form.values)
                    more = Use(use.program, (*use.blocks, place), values, use.gain + unit.length)
                    found[(*kinds, form.kind)].append(more)
    return found


def _best(group: Group, uses: Sequence[Use], least: int) -> Iterator[Candidate]:
    """The function for a group that shortens most: those relations that hold most often are asked for, one by one."""
    values = np.array([use.values for use in uses])
    known = list(measures(group, np.median(values, 0)))
    openings = [each for each in known if each.opening and len(group.kinds) == 1]
    offered = _offered(group, known, openings)
    holds = np.abs(values @ offered.T) <= NEAR
    owner = np.repeat(np.arange(len(group.slots)), [len(each) for each in group.slots])
    alive: npt.NDArray[np.bool_] = np.ones(len(uses), np.bool_)
    rows: FloatArray = np.zeros((0, group.size))
    joined = 0
    best: Candidate | None = None
    untried = np.arange(len(offered))
    while True:
        if joined >= len(group.kinds) - 1:
            fitting = [use for use, fits in zip(uses, alive, strict=True) if fits]
            found = _priced(group, rows, openings, fitting)
            called = len(group.kinds) == 1 or found.arguments <= min(ARGUMENTS, SHARE * group.size)
            if called and programs(found.uses) >= least and found.gain > (best.gain if best else 0):
                best = found
        support = (holds[:, untried] & alive[:, None]).sum(0)
        order = np.argsort(-support, kind="stable")
        untried = untried[order][support[order] >= least]
        following = next((k for k in untried if _independent(rows, offered[k])), None)
        if following is None:
            break
        rows, alive = np.vstack([rows, offered[following]]), alive & holds[:, following]
        joined += len(set(owner[np.flatnonzero(offered[following])].tolist())) > 1
        untried = untried[untried != following]
    if best is not None:
        yield best


def _offered(group: Group, known: Sequence[Measure], openings: Sequence[Measure]) -> FloatArray:
    """Relations that may be asked for: not those by which an opening is zero."""
    rows = [row for row in relations(known) if all(np.linalg.matrix_rank([row, each.row]) == 2 for each in openings)]
    return np.array(rows).reshape(-1, group.size)


def _priced(group: Group, rows: FloatArray, openings: Sequence[Measure], uses: Sequence[Use]) -> Candidate:
    """The function of a group for which relations hold, and what it saves where it is used."""
    chosen: FloatArray = np.zeros((0, group.size))
    sorts: list[str] = []
    for each in openings:
        zero = [bool(abs(use.values @ each.row) <= NEAR) for use in uses]
        free = group.kinds[0].grid and each.sort in ("spacing", "step")
        rare = free or sum(zero) >= OPEN * len(uses)
        if not rare or not _independent(np.vstack([rows, chosen]), each.row):
            continue
        if all(zero) and each.sort != "spacing":
            rows = np.vstack([rows, each.row])
        else:
            chosen = np.vstack([chosen, each.row])
            sorts.append(each.sort)
    values = np.array([use.values for use in uses]).reshape(-1, group.size)
    arguments = _arguments(group, rows, chosen)
    told = np.abs(values @ chosen.T) > NEAR
    counted = [sort == "spacing" for sort in sorts]  # each with a count of its own, steps with one
    stepping = [sort == "step" and group.kinds[0].grid for sort in sorts]
    said = (told.sum(1) + told[:, counted].sum(1) + told[:, stepping].any(1)).tolist()
    taken: set[tuple[int, int]] = set()
    kept: list[Use] = []
    for use, more in zip(uses, said, strict=True):
        own = {(use.program, place) for place in use.blocks}
        if not own & taken:
            taken |= own
            kept.append(use._replace(gain=use.gain - arguments - more))
    lines = 1 + sum(1 + len(kind.repeats) + kind.steps for kind in group.kinds)
    cost = STATEMENT * lines + arguments + len(chosen) + group.size
    return Candidate(group, rows, chosen, tuple(kept), sum(use.gain for use in kept) - cost)


def _arguments(group: Group, rows: FloatArray, openings: FloatArray) -> int:
    return group.size - len(rows) - len(openings) + group.counts


def _independent(rows: FloatArray, row: FloatArray) -> bool:
    return int(np.linalg.matrix_rank(np.vstack([rows, row]), tol=1e-6)) > len(rows)
