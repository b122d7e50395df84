"""Names for the numbers of a text, by the parts and keywords that use them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from shapeprog.inference.ties.elements import ends_of
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Group, Line, Part, Point, Source
from shapeprog.language.expression import Name, Value, names_in
from shapeprog.language.placement import AXES, BOX, RESERVED, SIZES, axis_of
from shapeprog.language.statement import language

FLAT = ("seat", "top", "shelf", "mattress", "cushion", "pillow")
"""Parts whose height is called thickness: the height of a seat is that of its top above the floor."""

FURTHER = {
    "inset": ("outer", "inner"),
    "setback": ("outer", "inner"),
    "clearance": ("outer", "inner"),
    "drop": ("upper", "lower"),
    "bottom": ("lower", "upper"),
    "offset": ("inner", "outer"),
}
"""The quantities that measure where a part is, with words for the less and the larger of two of them."""


class Use(NamedTuple):
    """A keyword of a part, of a point of it, or of a group with this part."""

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
    every = [*_uses(lines)]
    alone = {name: [use for use, value in every if value == Name(name)] for name in wanted}
    in_sums = {name: [use for use, value in every if name in names_in(value)] for name in wanted}  # used if not alone
    for name, value in reversed([*wanted.items()]):
        for inner in {*names_in(value)} & wanted.keys():
            in_sums[inner] += alone[name] or in_sums[name]
    words = language()
    used = {*SIZES, "diameter", *RESERVED, *words.names, *words.roles, *(_role(use.part) for use, _ in every)}
    used -= {"gap", "edge", "radius"}
    values: dict[str, float] = {}  # of the names given
    result: dict[str, str] = {}
    for provisional in wanted:
        number = numbers[provisional]

        def further(base: str, number: float = number) -> str:
            less, larger = FURTHER.get(base.rpartition("_")[2], ("small", "large"))
            return f"{larger if abs(number) > abs(values.get(base, 0.0)) else less}_{base}"

        uses = alone[provisional] or in_sums[provisional]
        shared, own = _candidates(uses, numbers)
        offered = [*shared, *(further(base) for base in shared if base in FURTHER), *own, *map(further, own)]
        offered += (f"{_role(use.part)}_{use.word}" for use in uses if use.word not in SIZES)
        offered += (f"{own[0]}_{count}" for count in range(2, len(wanted) + 2))
        result[provisional] = name = next(name for name in offered if name not in used)
        values[name] = number
        used.add(name)
    return result


def _uses(lines: Sequence[Line]) -> Iterator[tuple[Use, Value]]:
    """All numbers of parts and groups; those of a box are of all parts in it."""
    for line in Source(tuple(lines)).walk():
        if isinstance(line, Part | Group):
            inner = [each for each in Source((line,)).walk() if isinstance(each, Part)]
            parts = inner if isinstance(line, Group) and line.kind == "inside" else inner[:1]
            if isinstance(line, Group) and line.kind == "divide":  # its parts have the sides of its box
                box = tuple(pair for pair in line.keywords if pair[0] in BOX)
                parts = [replace(part, keywords=(*box, *part.keywords)) for part in parts]
            for key, argument in line.keywords:
                point, pairs = (key, argument.keywords) if isinstance(argument, Point) else ("", ((key, argument),))
                for word, value in pairs:
                    for number in value if isinstance(value, tuple) else (value,):
                        yield from ((Use(part, point, word), number) for part in parts)


def _candidates(uses: Sequence[Use], numbers: dict[str, float]) -> tuple[list[str], list[str]]:
    """Names of a number for parts of several roles, and for those of one role, each with the best first."""
    quantities = {use: _quantity(use, numbers) for use in uses}
    selected = [use for use in uses if quantities[use] not in FURTHER] or uses
    kinds = Counter(quantities[use] for use in selected)
    roles = Counter(_role(use.part) for use in selected)
    (kind, _), *others = kinds.most_common()
    if others and kind in FURTHER:
        kind = "inset" if kinds.keys() <= {"inset", "setback"} else "clearance"
    most, count = Counter(use.part for use in selected).most_common(1)[0]
    shared = []
    if kind in SIZES and count > 1:  # the section of a square part
        shared = [f"{_role(most)}_width"]
    elif len(roles) > 1 and kind not in ("drop", "bottom", "offset"):
        shared = ["board_width"] if kind in SIZES else [kind]
        shared += ["board_thickness"] if kind == "thickness" else []
    own = [f"{role}_{kind}" for role, _ in roles.most_common()]
    own += [f"{_role(use.part)}_{quantities[use]}" for use in selected]
    own += [f"{_role(use.part)}_{use.point}_{quantities[use]}" for use in selected if use.point]
    return shared, own


def _role(part: Part) -> str:
    return part.role or part.kind


def _quantity(use: Use, numbers: dict[str, float]) -> str:
    """The measured quantity, as the end of a name."""
    if use.word not in BOX:
        return use.word
    axis, part = axis_of(use.word), use.part
    if use.word != SIZES[axis]:
        low = "bottom" if use.word == "bottom" else "drop"
        return "offset" if use.word == AXES[axis].offset else ("inset", "setback", low)[axis]
    lengths = [high - low for low, high in (ends_of(part, "", each, numbers) for each in range(3))]
    flat = axis == 2 and _role(part) in FLAT
    least, second, _ = sorted(lengths)
    return "thickness" if flat or lengths[axis] <= least <= TIES.thin * second else SIZES[axis]
