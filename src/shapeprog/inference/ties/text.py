"""The text of a tied program: expressions for numbers that follow from others, and names for those that are shared, by
the parts and keywords that use them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shapeprog.inference.ties.elements import ends_of
from shapeprog.inference.ties.expressions import Solution
from shapeprog.inference.ties.groups import grouped, simplified
from shapeprog.inference.ties.layout import Layout
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Assignment, Group, Line, Part, Point, Source, changed_lines, changed_values, values
from shapeprog.language.expression import Expression, Linear, Name, Value, combined, names_in, replaced, value_at
from shapeprog.language.merging import merged_lines
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import AXES, BOX, RESERVED, SIZES, axis_of
from shapeprog.language.statement import language
from shapeprog.space import FloatArray

FLAT = ("seat", "top", "shelf", "mattress", "cushion", "pillow")
"""Parts whose height is called thickness: the height of a seat is that of its top above the floor."""

FURTHER = {
    "inset": ("outer", "inner"), "setback": ("outer", "inner"), "clearance": ("outer", "inner"),
    "drop": ("upper", "lower"), "bottom": ("lower", "upper"), "offset": ("inner", "outer"),
}  # fmt: skip
"""The quantities that measure where a part is, with words for the less and the larger of two of them."""


def written(layout: Layout, solution: Solution, free: FloatArray, *, group: bool = True) -> Source:
    """The program with names for its shared numbers and expressions for those that follow.

    Parameters
    ----------
    layout, solution
        The program, and how its numbers follow from free ones.
    free
        The values of these (Z,).
    group
        Whether lines are grouped where that is shorter.
    """
    is_round = np.array_equal(solution.factors[0], solution.factors[1])
    width, depth, height = (solution.factors[:3] @ free).tolist()
    header = [Assignment((("diameter", width),))] if is_round else []
    extents = (Name("diameter"), Name("diameter"), height) if is_round else (width, depth, height)
    header.append(Assignment(tuple(zip(SIZES, extents, strict=True))))
    shared, table = _expressions(layout, solution, free, "diameter" if is_round else "")
    body, shared = _inlined(_changed(layout.body, table), shared)
    known = Source((*header, Assignment(tuple(shared.items())))).evaluated_numbers()
    body = changed_lines(body, lambda line: simplified(line, known))
    body, shared = _inlined(grouped(body, known) if group else merged_lines(body), shared)
    names = named(body, shared, known)
    final: dict[str, Value] = {provisional: Name(name) for provisional, name in names.items()}
    pairs = [(names[name], _with(value, final)) for name, value in shared.items()]
    for sums in (False, True):
        header += _assignments([pair for pair in pairs if isinstance(pair[1], Expression) == sums])
    scale = layout.source.scale
    assert scale is not None
    floor = scale.floor + (layout.extents[2] - float(known["height"])) * scale.cells_per_unit / 2
    return Source((*header, *_changed(body, final)), layout.source.unit, replace(scale, floor=floor))


def _expressions(
    layout: Layout, solution: Solution, at_free: FloatArray, diameter: str
) -> tuple[dict[str, Value], dict[str, Value]]:
    """The free numbers, and sums that several numbers are, by provisional name; and all numbers by these names."""
    names, factors, free = layout.names, solution.factors, solution.free
    atoms = [Name(names[k] if k > 1 else diameter or names[k]) for k in free]
    order = sorted((layout.slots[k].line, k, float(value) + 0.0) for k, value in zip(free, at_free, strict=True))
    shared: dict[str, Value] = {names[k]: value for _, k, value in order if k > 2}
    alike: dict[bytes, list[int]] = {}  # numbers that follow from the free ones in the same way
    for p in range(3, len(names)):
        alike.setdefault(factors[p].round(6).tobytes(), []).append(p)
    table: dict[str, Value] = {}
    for first, *others in alike.values():
        name = f"{names[first]}_sum"
        terms = [(atoms[z], float(factors[first, z])) for z in np.flatnonzero(factors[first])]
        value = combined(0.0, terms)
        if others and isinstance(value, Expression) and not isinstance(value, Name):
            shared[name], value = value, Name(name)
        table |= {names[k]: value for k in (first, *others)}
    return shared, table


def _inlined(lines: tuple[Line, ...], shared: Mapping[str, Value]) -> tuple[tuple[Line, ...], dict[str, Value]]:
    """Lines and named values without the names that are used once."""
    uses = Counter(name for line in Source(lines).walk() for value in values(line) for name in names_in(value))
    uses += Counter(name for value in shared.values() for name in names_in(value))
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
    form = value_at(new, {name: Linear.of(name) for name in names_in(new)})
    terms = sorted(form.factors, key=lambda term: term[1] < 0)
    return combined(to_float32(form.constant), [(Name(name), factor) for name, factor in terms])


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

    @property
    def role(self) -> str:
        """The role of the part, or else its kind."""
        return self.part.role or self.part.kind


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
    uses: dict[str, list[Use]] = {}  # of numbers that are used in sums alone, those of the sums
    for name in reversed([*wanted]):
        uses[name] = [use for use, value in every if value == Name(name)] or [
            *(use for use, value in every if name in names_in(value)),
            *(use for outer in uses if name in names_in(wanted[outer]) for use in uses[outer]),
        ]
    words = language()
    used = {*SIZES, "diameter", *RESERVED, *words.names, *words.roles}
    values: dict[str, float] = {}  # of the names given
    result: dict[str, str] = {}
    for provisional in wanted:
        number = numbers[provisional]

        def further(base: str, number: float = number) -> str:
            less, larger = FURTHER.get(base.rpartition("_")[2], ("small", "large"))
            return f"{larger if abs(number) > abs(values.get(base, 0.0)) else less}_{base}"

        shared, own = _candidates(uses[provisional], numbers)
        offered = [*shared, *(further(base) for base in shared if base in FURTHER), *own, *map(further, own)]
        offered += (f"{own[0]}_{count}" for count in range(2, len(wanted) + 2))
        result[provisional] = name = next(name for name in offered if name not in used | values.keys())
        values[name] = number
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
    roles = Counter(use.role for use in selected)
    (kind, _), *others = kinds.most_common()
    if others and kind in FURTHER:
        kind = "inset" if kinds.keys() <= {"inset", "setback"} else "clearance"
    part, count = Counter(use.part for use in selected).most_common(1)[0]
    shared = []
    if kind in SIZES and count > 1:  # the section of a square part
        shared = [f"{part.role or part.kind}_width"]
    elif len(roles) > 1 and kind not in ("drop", "bottom", "offset"):
        shared = ["board_width"] if kind in SIZES else [kind]
        shared += ["board_thickness"] if kind == "thickness" else []
    # The second point of a part is not where the part is: the upper end of a leg is no ``leg_bottom``.
    plain = [use for use in selected if use.point not in ("through", "end")]
    own = [f"{role}_{kind}" for role, _ in Counter(use.role for use in plain).most_common()]
    own += [f"{use.role}_{quantities[use]}" for use in plain]
    own += [f"{use.role}_{use.point}_{quantities[use]}" for use in selected if use.point]
    return shared, own


def _quantity(use: Use, numbers: dict[str, float]) -> str:
    """The measured quantity, as the end of a name."""
    if use.word not in BOX:
        return use.word
    axis, part = axis_of(use.word), use.part
    if use.word != SIZES[axis]:
        low = "bottom" if use.word == "bottom" else "drop"
        return "offset" if use.word == AXES[axis].offset else ("inset", "setback", low)[axis]
    lengths = [high - low for low, high in (ends_of(part, "", each, numbers) for each in range(3))]
    flat = axis == 2 and use.role in FLAT
    least, second, _ = sorted(lengths)
    return "thickness" if flat or lengths[axis] <= least <= TIES.thin * second else SIZES[axis]
