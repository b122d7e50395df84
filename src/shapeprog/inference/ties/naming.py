"""Names for the numbers of a text, by the parts and keywords that use them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from shapeprog.language.ast import Group, Line, Part, Point, Source
from shapeprog.language.expression import Name, Value, names_in, value_at
from shapeprog.language.placement import AXES, BOX, RESERVED, SIZES, axis_of
from shapeprog.language.statement import language

THIN = 0.6
"""A side of a part is its thickness if it is at most this share of the next longer one."""

FLAT = ("seat", "top", "shelf", "mattress", "cushion", "pillow")
"""Parts whose height is called thickness: the height of a seat is that of its top above the floor."""

APART = 1.0
"""Cells by which the middles of parts must differ for names by position."""

WHERE = (("left", "right"), ("front", "rear"), ("lower", "upper"))
"""Words for parts at different positions along each axis."""

SHARED = ("thickness", "radius", "inset", "setback", "clearance", "edge", "tilt")
"""Quantities that parts of different roles share under this word alone."""

SIDES = ("inset", "setback", "clearance")
"""Those of them that measure from the sides of the whole: of two, the larger one is further in."""

STATEMENTS = {"leaning_box": "box", "beam": "bar"}


class Use(NamedTuple):
    """A keyword of a part, or of a group with that part, or of a point with this keyword."""

    part: Part
    point: str
    word: str


def named(lines: Sequence[Line], wanted: Mapping[str, Value], numbers: dict[str, float]) -> dict[str, str]:
    """A name for each of some numbers.

    Parameters
    ----------
    lines
        The lines that draw; in them these numbers have provisional names.
    wanted
        The provisional names with their values, plain numbers first.
    numbers
        What all names evaluate to.
    """
    uses: dict[str, list[Use]] = {name: [] for name in wanted}
    sums: dict[str, list[Use]] = {name: [] for name in wanted}
    for use, value in _uses(lines):
        for name in {*names_in(value)} & uses.keys():
            (uses if isinstance(value, Name) else sums)[name].append(use)
    for name, value in reversed([*wanted.items()]):
        for inner in {*names_in(value)} & uses.keys():
            sums[inner] += uses[name] or sums[name]
    words = language()
    roles = {role_of(use.part) for use, _ in _uses(lines)}
    used = {*SIZES, "diameter", *RESERVED, *words.names, *words.roles, *roles} - {"gap", "edge", "radius"}
    holders: dict[str, Part] = {}
    result: dict[str, str] = {}
    for provisional in wanted:
        selected = uses[provisional] or sums[provisional]
        offered, part = [*_offered(selected, numbers)], selected[0].part
        if offered[0] in result.values() and offered[0] in SIDES:
            first = next(before for before, name in result.items() if name == offered[0])
            further = "inner" if numbers[provisional] > numbers[first] else "outer"
            offered.insert(1, f"{further}_{offered[0]}")
        distinct = (
            f"{word}_{base}" for base in offered
            for word in _distinctions(holders.get(base, part), part, numbers)
        )  # fmt: skip
        numbered = (f"{offered[0]}_{number}" for number in range(2, len(wanted) + 2))
        name = next(name for name in (*offered, *distinct, *numbered) if name not in used)
        used.add(name)
        holders[name], result[provisional] = part, name
    return result


def role_of(part: Part) -> str:
    """The role of a part, or else its solid."""
    return part.role or STATEMENTS.get(part.kind, part.kind)


def interval(part: Part, axis: int, numbers: dict[str, float]) -> tuple[float, float]:
    """The low end and the length of a part along an axis; those of its start if it lies between points."""
    words, whole, arguments = AXES[axis], numbers[SIZES[axis]], dict(part.keywords)
    if isinstance(start := arguments.get("start"), Point):
        arguments = {**dict(start.keywords), words.size: 0.0}
    elif "radius" in arguments and axis < 2:
        arguments[words.size] = 0.0
    given = {word: value_at(value, numbers) for word, value in arguments.items() if word in words}  # type: ignore[arg-type]
    size = given.get(words.size, whole - given.get(words.low, 0.0) - given.get(words.high, 0.0))
    if words.low in given or (axis == 2 and not {words.high, words.offset} & given.keys()):
        return given.get(words.low, 0.0), size
    if words.high in given:
        return whole - given[words.high] - size, size
    return (whole - size) / 2 + given.get(words.offset, 0.0), size


def _uses(lines: Sequence[Line]) -> Iterator[tuple[Use, Value]]:
    """All numbers of parts and groups; those of a box are of all parts in it."""
    for line in Source(tuple(lines)).walk():
        if isinstance(line, Part | Group):
            inner = [each for each in Source((line,)).walk() if isinstance(each, Part)]
            for key, argument in line.keywords:
                point, pairs = (key, argument.keywords) if isinstance(argument, Point) else ("", ((key, argument),))
                for part in inner if isinstance(line, Group) and line.kind == "inside" else inner[:1]:
                    for word, value in pairs:
                        each = value if isinstance(value, tuple) else (value,)
                        yield from ((Use(part, point, word), number) for number in each)


def _offered(uses: Sequence[Use], numbers: dict[str, float]) -> Iterator[str]:
    """Candidate names of a number, the best first."""
    sizes = [use for use in uses if _quantity(use, numbers) not in CLEARANCES]
    selected = sizes or uses
    kinds = Counter(_quantity(use, numbers) for use in selected)
    roles = Counter(role_of(use.part) for use in selected)
    kind = kinds.most_common(1)[0][0]
    if not sizes and len(kinds) > 1:
        kind = "inset" if kinds.keys() <= {"inset", "setback"} else "clearance"
    if len(roles) > 1 and kind in SHARED:
        yield kind
        if kind == "thickness":
            yield "board_thickness"
    elif len(roles) > 1 and kind in SIZES:  # a number that no single part owns
        most, count = Counter(use.part for use in selected).most_common(1)[0]
        yield f"{role_of(most)}_width" if count > 1 else "board_width"  # that of a square section
    for role, _ in roles.most_common():
        yield f"{role}_{kind}"
        own = Counter(_quantity(use, numbers) for use in selected if role_of(use.part) == role)
        yield from (f"{role}_{quantity}" for quantity, _ in own.most_common())
    for use in selected:
        yield f"{role_of(use.part)}_{use.point or use.word}_{kind}" if use.point else f"{role_of(use.part)}_{use.word}"


CLEARANCES = ("inset", "setback", "drop", "bottom", "offset")
"""Quantities that measure where a part is."""


def _quantity(use: Use, numbers: dict[str, float]) -> str:
    """The measured quantity, as the end of a name."""
    if use.word not in BOX:
        return use.word
    axis = axis_of(use.word)
    if use.word in SIZES:
        return _size(use.part, axis, numbers)
    if use.word == AXES[axis].offset:
        return "offset"
    return ("inset", "setback", "drop" if use.word == "top" else "bottom")[axis]


def _size(part: Part, axis: int, numbers: dict[str, float]) -> str:
    lengths = [_length(part, each, numbers) for each in range(3)]
    least, second, _ = sorted(lengths)
    flat = axis == 2 and role_of(part) in FLAT
    return "thickness" if flat or (lengths[axis] <= least <= THIN * second) else SIZES[axis]


def _length(part: Part, axis: int, numbers: dict[str, float]) -> float:
    """The length of a part along an axis, infinite if it lies between two points."""
    arguments = dict(part.keywords)
    value = arguments.get(SIZES[axis])
    if value is None and "start" in arguments:
        return np.inf
    if value is None and "radius" in arguments and axis < 2:
        value = arguments["radius"]
    if value is None:
        return interval(part, axis, numbers)[1]
    return max(value_at(each, numbers) for each in (value if isinstance(value, tuple) else (value,)))  # type: ignore[arg-type]


def _distinctions(first: Part, second: Part, numbers: dict[str, float]) -> Iterator[str]:
    """Words that distinguish the second of two parts from the first, the best first."""
    middles = np.array([[_middle(part, axis, numbers) for axis in range(3)] for part in (first, second)])
    away = middles[1] - middles[0]
    for axis in np.argsort(-np.abs(away), kind="stable"):
        if abs(away[axis]) >= APART:
            if axis == 0:
                off = np.abs(middles[:, 0] - numbers["width"] / 2)
                yield ("inner", "outer")[int(off[1] > off[0])]
            else:
                yield WHERE[axis][int(away[axis] > 0)]


def _middle(part: Part, axis: int, numbers: dict[str, float]) -> float:
    low, size = interval(part, axis, numbers)
    return low + size / 2
