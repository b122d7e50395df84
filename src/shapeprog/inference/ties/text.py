"""The text of a tied program: expressions for numbers that follow from others, and names for those that are shared, by
the parts and keywords that use them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shapeprog.inference.ties.elements import ends_of
from shapeprog.inference.ties.expressions import Solution
from shapeprog.inference.ties.groups import grouped, simplified
from shapeprog.inference.ties.layout import Layout
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Assignment, Group, Line, Part, Point, Source, changed_lines, changed_values, values
from shapeprog.language.expression import Expression, Linear, Name, Value, names_in, replaced
from shapeprog.language.merging import merged_lines
from shapeprog.language.placement import BOX, RESERVED, SIZES
from shapeprog.language.statement import language
from shapeprog.space import FloatArray

FLAT = ("seat", "top", "shelf", "mattress", "cushion", "pillow")
"""Parts whose height is called thickness: the height of a seat is that of its top above the floor."""

PLACES = {
    "left": "inset", "right": "inset", "front": "setback", "rear": "setback", "top": "drop",
    "x": "offset", "y": "offset", "z": "offset",
}  # fmt: skip
"""The quantities that keywords measure whose names do not say so."""

FURTHER = {
    "inset": ("outer", "inner"), "setback": ("outer", "inner"), "clearance": ("outer", "inner"),
    "drop": ("upper", "lower"), "bottom": ("lower", "upper"), "offset": ("inner", "outer"),
}  # fmt: skip
"""The quantities that measure where a part is, with words for the less and the larger of two of them."""


def written(layout: Layout, solution: Solution, free: FloatArray, *, group: bool = True) -> Source:
    """The program, given the values (Z,) of its free numbers, with names for those that are shared and expressions for
    what follows; lines may be grouped where that is shorter."""
    is_round = np.array_equal(*solution.factors[:2])
    width, depth, height = (solution.factors[:3] @ free).tolist()
    header = [Assignment((("diameter", width),))] if is_round else []
    extents = (Name("diameter"), Name("diameter"), height) if is_round else (width, depth, height)
    header.append(Assignment(tuple(zip(SIZES, extents, strict=True))))
    numbers = sorted((k, float(value) + 0.0) for k, value in zip(solution.free, free, strict=True))
    shared: dict[str, Value] = {layout.names[k]: value for k, value in numbers if k > 2}
    table: dict[str, Value] = {}  # how the numbers follow from the free ones
    sums: dict[Value, str] = {}  # equal sums have one name; ``_inlined`` takes back those that are used once
    free_names = [layout.names[k] for k in solution.free]
    for name, factors in zip(layout.names[3:], solution.factors[3:].round(12).tolist(), strict=True):
        value = Linear(0.0, tuple(term for term in zip(free_names, factors, strict=True) if term[1])).written()
        is_sum = isinstance(value, Expression) and not isinstance(value, Name)
        table[name] = Name(sums.setdefault(value, f"{name}_sum")) if is_sum else value
    shared |= {name: value for value, name in sums.items()}
    body, shared = _inlined(_changed(layout.body, table), shared)
    known = Source((*header, Assignment(tuple(shared.items())))).evaluated_numbers()
    body = changed_lines(body, lambda line: simplified(line, known))
    body, shared = _inlined(grouped(body, known) if group else merged_lines(body), shared)
    names = named(body, shared, known)
    final: dict[str, Value] = {provisional: Name(name) for provisional, name in names.items()}
    pairs = [(names[name], _with(value, final)) for name, value in shared.items()]
    for are_sums in (False, True):
        header += _assignments([pair for pair in pairs if isinstance(pair[1], Expression) == are_sums])
    floor = layout.scale.floor + (layout.extents[2] - float(known["height"])) * layout.scale.cells_per_unit / 2
    return Source((*header, *_changed(body, final)), layout.source.unit, replace(layout.scale, floor=floor))


def _inlined(lines: tuple[Line, ...], shared: Mapping[str, Value]) -> tuple[tuple[Line, ...], dict[str, Value]]:
    """Lines and named values without the names that are used once."""
    every = Source((Assignment(tuple(shared.items())), *lines)).walk()
    uses = Counter(name for line in every for value in values(line) for name in names_in(value))
    once: dict[str, Value] = {}
    for name, value in shared.items():  # sums come last
        if uses[name] < 2:
            once[name] = _with(value, once)
    return _changed(lines, once), {name: _with(value, once) for name, value in shared.items() if name not in once}


def _with(value: Value, table: Mapping[str, Value]) -> Value:
    """A number or an expression with names replaced; a sum has each name and number once."""
    new = replaced(value, lambda each: table.get(each.name, each) if isinstance(each, Name) else each)
    if not isinstance(new, Expression):
        return new
    form: Linear = new.at({name: Linear.of(name) for name in names_in(new)})
    return form.written()


def _changed(lines: tuple[Line, ...], table: Mapping[str, Value]) -> tuple[Line, ...]:
    """Lines with names replaced."""
    return changed_lines(lines, lambda line: changed_values(line, lambda value: _with(value, table)))


def _assignments(pairs: list[tuple[str, Value]]) -> list[Assignment]:
    """Names and their values on as many lines as it takes."""
    lines: list[list[tuple[str, Value]]] = [[]]
    for pair in pairs:
        if sum(len(f"{name}{value}") + 4 for name, value in [*lines[-1], pair]) > 118:
            lines.append([])
        lines[-1].append(pair)
    return [Assignment(tuple(line)) for line in lines if line]


class Use(NamedTuple):
    """A keyword of a part, of a point of it, or of a group with this part."""

    part: Part
    point: str
    word: str


def named(lines: Sequence[Line], wanted: Mapping[str, Value], numbers: dict[str, float]) -> dict[str, str]:
    """A name for each of the provisional names in lines, given with their values, plain numbers first, and what all
    names evaluate to."""
    every = [*_uses(lines)]
    words = language()
    taken = dict.fromkeys((*SIZES, "diameter", *RESERVED, *words.names, *words.roles), 0.0)  # names with their values
    result: dict[str, str] = {}
    for provisional in wanted:
        number = numbers[provisional]
        uses = [use for use, value in every if value == Name(provisional)] or [  # or else of sums with it
            use for use, value in every for name in names_in(value)
            if provisional in (name, *names_in(wanted.get(name, 0.0)))
        ]  # fmt: skip
        shared, own = _candidates(uses, numbers)
        placing = [base for base in shared if base in FURTHER]
        offered = [*shared, *_further(placing, number, taken), *own, *_further(own, number, taken)]
        offered += (f"{own[0]}_{count}" for count in range(2, len(wanted) + 2))
        result[provisional] = name = next(name for name in offered if name not in taken)
        taken[name] = number
    return result


def _further(names: Iterable[str], number: float, taken: Mapping[str, float]) -> Iterator[str]:
    """Names for a number beside another that has the name itself."""
    for name in names:
        less, larger = FURTHER.get(name.rpartition("_")[2], ("small", "large"))
        yield f"{larger if abs(number) > abs(taken.get(name, 0.0)) else less}_{name}"


def _uses(lines: Sequence[Line]) -> Iterator[tuple[Use, Value]]:
    """All numbers of parts and groups; those of a box are of all parts in it."""
    for line in Source(tuple(lines)).walk():
        if isinstance(line, Part | Group):
            inner = [each for each in Source((line,)).walk() if isinstance(each, Part)]
            parts = inner if line.kind == "inside" else inner[:1]
            if line.kind == "divide":  # its parts have the sides of its box
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
    (kind, _), *others = kinds.most_common()
    if others and kind in FURTHER:
        kind = "inset" if kinds.keys() <= {"inset", "setback"} else "clearance"
    part, count = Counter(use.part for use in selected).most_common(1)[0]
    shared = []
    if kind in SIZES and count > 1:  # the section of a square part
        shared = [f"{part.word}_width"]
    elif len({use.part.word for use in selected}) > 1 and kind not in ("drop", "bottom", "offset"):
        shared = ["board_width"] if kind in SIZES else [kind]
        shared += ["board_thickness"] if kind == "thickness" else []
    # The second point of a part is not where the part is: the upper end of a leg is no ``leg_bottom``.
    plain = [use for use in selected if use.point not in ("through", "end")]
    own = [f"{role}_{kind}" for role, _ in Counter(use.part.word for use in plain).most_common()]
    own += [f"{use.part.word}_{use.point}_{quantities[use]}" for use in selected if use.point]
    return shared, own


def _quantity(use: Use, numbers: dict[str, float]) -> str:
    """The measured quantity, as the end of a name."""
    if use.word not in SIZES:
        return PLACES.get(use.word, use.word)
    lengths = {word: np.ptp(ends_of(use.part, "", axis, numbers)) for axis, word in enumerate(SIZES)}
    least, second, _ = sorted(lengths.values())
    flat = use.word == "height" and use.part.word in FLAT
    return "thickness" if flat or lengths[use.word] <= least <= TIES.thin * second else use.word
