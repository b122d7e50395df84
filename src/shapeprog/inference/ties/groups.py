"""Lines of a tied program written shorter: without redundant keywords, and parts with equal clearances inside of a new
box."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import TypeGuard

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import Argument, Assignment, Group, Keywords, Line, Part, Point, Source, changed_lines
from shapeprog.language.convert.forms import cost
from shapeprog.language.evaluate import placed_source, symbolic
from shapeprog.language.expression import Expression
from shapeprog.language.merging import merged_lines
from shapeprog.language.placement import AXES, BOX, SIZES
from shapeprog.language.program import Program
from shapeprog.space import FloatArray


def simplified(line: Line, numbers: dict[str, float]) -> Line:
    """The line without keywords of zero, and of points, that change nothing that it draws, given the values of all
    names; a taper with equal radii is a rod."""
    if isinstance(line, Part | Group):
        drawn = _drawn(line, numbers)
        for keywords in _shorter(line.keywords):
            if _same(drawn, _drawn(shorter := replace(line, keywords=keywords), numbers)):
                return simplified(shorter, numbers)
        radius = dict(line.keywords).get("radius")
        if line.kind == "taper" and isinstance(radius, tuple) and radius[0] == radius[1]:
            keywords = tuple((word, radius[0] if word == "radius" else value) for word, value in line.keywords)
            return replace(line, kind="rod", keywords=keywords)
    return line


def _shorter(keywords: Keywords) -> Iterator[Keywords]:
    """The keywords without one of zero, or one of a point that has more of them."""
    for k, (word, argument) in enumerate(keywords):
        before, behind = keywords[:k], keywords[k + 1 :]
        if isinstance(argument, Point) and len(argument.keywords) > 1:
            for pairs in combinations(argument.keywords, len(argument.keywords) - 1):
                yield (*before, (word, Point(pairs)), *behind)
        elif argument == 0:
            yield (*before, *behind)


def _has_box(line: Line) -> TypeGuard[Part | Group]:
    """Whether a line has a box and draws in it: a part, or a division, whose part has no other box."""
    return isinstance(line, Part) or (isinstance(line, Group) and line.kind == "divide")


def grouped(lines: Sequence[Line], numbers: dict[str, float]) -> tuple[Line, ...]:
    """Parts and loops, given the values of all names: merged, and in boxes with the clearances that they share where
    that saves words."""
    lines = merged_lines(lines)
    while True:
        sides = {line: _sides(line) for line in lines if not isinstance(line, Group) or line.kind != "inside"}
        frames = {one & other for one, other in combinations(sides.values(), 2)} - {frozenset()}
        drawn = {line: _drawn(line, numbers) for line, own in sides.items() if own and frames}
        best, saved = lines, 0
        for frame in sorted((tuple(sorted(frame, key=lambda side: BOX.index(side[0]))) for frame in frames), key=str):
            moved = changed_lines(sides, partial(_inside, frame=frame))
            inner = dict(zip(sides, moved, strict=True))
            members = [
                line for line in sides
                if line != inner[line] and _same(drawn[line], _drawn(Group("inside", frame, (inner[line],)), numbers))
            ]  # fmt: skip
            box = Group("inside", frame, tuple(inner[line] for line in members))
            words = sum(map(_words, members)) - _words(box) - 2
            if len(members) > 1 and words > saved:
                saved, first = words, members[0]
                best = tuple(box if line == first else line for line in lines if line == first or line not in members)
        if not saved:
            return lines
        lines = best


def _sides(line: Line) -> frozenset[tuple[str, Argument]]:
    """The named clearances of the parts in a line, with their keywords."""
    words = {word for words in AXES for word in words[:2]}
    pairs = (pair for inner in Source((line,)).walk() if _has_box(inner) for pair in inner.keywords)
    return frozenset(pair for pair in pairs if pair[0] in words and isinstance(pair[1], Expression))


def _inside(line: Line, frame: Keywords) -> Line:
    """A part or division as it is written in a box with these clearances: without them, or with 0 where its size needs
    a side to start from."""
    if not _has_box(line):
        return line
    needed = {word for words in AXES if words.size in dict(line.keywords) for word in words} - {"bottom"}
    return replace(line, keywords=tuple(
        (word, 0.0 if (word, value) in frame else value)
        for word, value in line.keywords if (word, value) not in frame or word in needed
    ))  # fmt: skip


def _words(line: Line) -> int:
    """How many words and operators its keywords and their values have."""
    keywords = (inner.keywords for inner in Source((line,)).walk() if isinstance(inner, Part | Group))
    return sum(sum(cost(pairs)) for pairs in keywords)


def _drawn(line: Line, numbers: dict[str, float]) -> FloatArray:
    """The values of all statements in cells that a line draws for some irregular numbers; not a number if it cannot."""
    random = np.random.default_rng(0)
    changed = {name: (value or 0.1) * random.uniform(0.9, 1.1) for name, value in numbers.items()}
    if "diameter" in changed:
        changed |= dict.fromkeys(SIZES[:2], changed["diameter"])
    try:
        nodes = Program(symbolic(placed_source((Assignment(tuple(numbers.items())), line)), changed)).walk()
    except ShapeProgError:
        return np.array([np.nan])
    return np.array([float(value) for node in nodes for value in node.values])


def _same(drawn: FloatArray, other: FloatArray) -> bool:
    """Whether two lines draw the same whatever the numbers are."""
    return drawn.shape == other.shape and np.allclose(drawn, other)
