"""How far numbers of a program can be changed, one at a time, before it falls apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from shapeprog.geometry.contacts import contact_groups
from shapeprog.language.program import Program
from shapeprog.language.unroll import on_numpy_if_shipped, unroll

FARTHEST = 3.0
"""Multiple of a number up to which it is tried."""

LEAST = 1.0
"""Magnitude assumed for smaller numbers, in cells."""

STEPS, HALVINGS = 4, 4
"""Values that are tried on either side of a number, and bisections between the last good and the first bad one."""

MOST = 256
"""Most primitives of a program of which it is looked at whether they hold together."""

Edit = Callable[[str, float], Program | None]
"""The program with another value of a name; ``None`` if it cannot be drawn so."""


@dataclass(frozen=True)
class Number:
    """A number that can be set; ``whole`` if it is a count."""

    name: str
    value: float
    whole: bool


@dataclass(frozen=True)
class _Search:
    """A number that is changed in one direction: the last good value, and the next that is bad or the last to try."""

    number: Number
    good: float
    bad: float

    def between(self, share: float) -> float:
        """A value between both."""
        value = self.good + (self.bad - self.good) * share
        return float(round(value)) if self.number.whole else value


def ranges(program: Program, numbers: Sequence[Number], edited: Edit) -> dict[str, tuple[float, float]]:
    """The values of numbers within which no size is negative, no part vanishes and the parts hang together.

    Each number is changed alone, from nothing to three times its value.  The ends are values that were tried, within a
    few percent of the last good one.  A program whose parts form several groups that touch may keep as many.
    """
    least = LEAST * (1.0 if program.unit is None else program.unit.per_cell)
    searches = []
    for number in numbers:
        size = max(abs(number.value), 1.0 if number.whole else least)
        low = min(1.0, number.value) if number.whole else number.value - size
        ends = low, number.value + (FARTHEST - 1) * size
        searches += [_Search(number, number.value, end) for end in ends]
    with on_numpy_if_shipped(program):
        check = _Check(program, edited)
        values = [[search.between(step / STEPS) for step in range(STEPS + 1)] for search in searches]
        tried = [(search.number, at) for search, row in zip(searches, values, strict=True) for at in row[1:]]
        good = iter(check(tried))
        for place, row in enumerate(values):
            results = [next(good) for _ in row[1:]]
            reached = results.index(False) if False in results else STEPS
            searches[place] = replace(searches[place], good=row[reached], bad=row[min(reached + 1, STEPS)])
        for _ in range(HALVINGS):
            pending = [place for place, search in enumerate(searches) if search.good != search.bad]
            tried = [(searches[place].number, searches[place].between(0.5)) for place in pending]
            for place, (_, at), fits in zip(pending, tried, check(tried), strict=True):
                search = searches[place]
                searches[place] = replace(search, good=at) if fits else replace(search, bad=at)
    return {low.number.name: (low.good, high.good) for low, high in zip(searches[::2], searches[1::2], strict=True)}


class _Check:
    """Whether a program holds together with other values of its numbers."""

    def __init__(self, program: Program, edited: Edit) -> None:
        self.edited, self.most = edited, max(MOST, program.size)
        scene = unroll([program])
        self.parts = int(scene.mask.sum())
        self.groups = contact_groups(scene)[0] if program.size <= MOST else None

    def __call__(self, changes: Sequence[tuple[Number, float]]) -> list[bool]:
        programs = [self.edited(number.name, value) for number, value in changes]
        drawn = {place: each for place, each in enumerate(programs) if each is not None and each.size <= self.most}
        results = [False] * len(changes)
        if drawn:
            scenes = unroll(list(drawn.values()))
            groups = [None] * len(drawn) if self.groups is None else contact_groups(scenes)
            for place, parts, count in zip(drawn, scenes.mask.sum(-1).tolist(), groups, strict=True):
                whole = parts >= self.parts or changes[place][0].whole
                results[place] = whole and (count is None or self.groups is None or count <= self.groups)
        return results
