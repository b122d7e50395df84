"""Lines of a tied program written shorter: without redundant keywords, and parts with equal clearances inside of a new
box."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

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
        for keywords in _shorter(line.keywords):
            if _same(line, shorter := replace(line, keywords=keywords), numbers):
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


def grouped(lines: Sequence[Line], numbers: dict[str, float]) -> tuple[Line, ...]:
    """Parts and loops, given the values of all names: merged, and in boxes with the clearances that they share where
    that saves words."""
    lines, saved = merged_lines(lines), 1
    while saved:
        sides = {line: _sides(line) for line in lines if not isinstance(line, Group) or line.kind != "inside"}
        frames = {one & other for one, other in combinations(sides.values(), 2)} - {frozenset()}
        options = [(0, lines)]
        for frame in sorted((tuple(sorted(frame, key=lambda side: BOX.index(side[0]))) for frame in frames), key=str):
            moved = changed_lines(sides, partial(_inside, frame=frame, numbers=numbers))
            inner = {line: new for line, new in zip(sides, moved, strict=True) if new != line}
            members = [line for line, new in inner.items() if _same(line, Group("inside", frame, (new,)), numbers)]
            box = Group("inside", frame, tuple(inner[line] for line in members))
            instead = tuple(box if line in members[:1] else line for line in lines if line not in members[1:])
            after, *before = (sum(cost(tuple(_keywords(line)))) for line in (box, *members))  # words and operators
            options.append((sum(before) - after - 2, instead))
        saved, lines = max(options, key=lambda option: option[0])
    return lines


def _sides(line: Line) -> frozenset[tuple[str, Argument]]:
    """The named clearances in a line, with their keywords."""
    words = {word for words in AXES for word in words[:2]}
    return frozenset(pair for pair in _keywords(line) if pair[0] in words and isinstance(pair[1], Expression))


def _keywords(line: Line) -> Iterator[tuple[str, Argument]]:
    return (pair for each in Source((line,)).walk() if isinstance(each, Part | Group) for pair in each.keywords)


def _inside(line: Line, frame: Keywords, numbers: dict[str, float]) -> Line:
    """A line as it is written in a box with these clearances: with 0 for them where its size needs a side to start
    from."""
    assert isinstance(line, Part | Group)
    inner = tuple((word, 0.0 if (word, value) in frame else value) for word, value in line.keywords)
    return line if inner == line.keywords else simplified(replace(line, keywords=inner), numbers)


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


def _same(line: Line, other: Line, numbers: dict[str, float]) -> bool:
    """Whether two lines draw the same whatever the numbers are."""
    drawn, others = _drawn(line, numbers), _drawn(other, numbers)
    return drawn.shape == others.shape and np.allclose(drawn, others)
