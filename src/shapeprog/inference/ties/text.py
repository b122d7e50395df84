"""The text of a tied program: expressions for numbers that follow from others, and names for those that are shared, by
the parts and keywords that use them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from shapeprog.inference.ties.expressions import Solution
from shapeprog.inference.ties.groups import grouped, simplified
from shapeprog.inference.ties.layout import Layout
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Assignment, Group, Line, Part, Point, Source, changed_lines, changed_values, values
from shapeprog.language.expression import Expression, Linear, Name, Value, names_in, replaced
from shapeprog.language.placement import RESERVED, SIZES, ends_of
from shapeprog.language.printer import assigned
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
    **dict.fromkeys(("inset", "setback", "margin", "clearance"), ("outer", "inner")),
    "drop": ("upper", "lower"), "bottom": ("lower", "upper"), "offset": ("inner", "outer"),
}  # fmt: skip
"""The quantities that measure where a part is, with words for the less and the larger of two of them."""


def written(layout: Layout, solution: Solution, free: FloatArray) -> Source:
    """The program, given the offsets (Z,) of its free numbers, with names for those that are shared and expressions for
    what follows; lines are grouped where that is shorter."""
    whole = solution.factors[:3] @ solution.chained() @ free
    sizes: dict[str, Value] = dict(zip(SIZES, whole.tolist(), strict=True))
    header: list[Line] = []
    if np.array_equal(*solution.factors[:2]):
        header = [Assignment((("diameter", sizes["width"]),))]
        sizes |= dict.fromkeys(SIZES[:2], Name("diameter"))
    header.append(Assignment(tuple(sizes.items())))
    shared: dict[str, Value] = {}
    symbols = np.array([Linear.of(layout.names[k]) for k in solution.free])
    for z in np.lexsort((solution.free, np.count_nonzero(solution.chained(), axis=1))):  # by number of origins
        k, form = solution.free[z], solution.measured[z] @ symbols + float(free[z]) + 0.0
        if not free[z] and len(form.factors) < 2:
            symbols[z] = form  # zero, or equal to another
        elif k > 2:
            shared[layout.names[k]] = form.written()
    table: dict[str, Value] = {}  # how the numbers follow from the free ones
    sums: dict[Value, str] = {}  # equal sums have one name
    forms = solution.factors.round(12) @ symbols
    for name, value in zip(layout.names[3:], (form.written() for form in forms[3:]), strict=True):
        is_sum = isinstance(value, Expression) and not isinstance(value, Name)
        table[name] = Name(sums.setdefault(value, f"{name}_sum")) if is_sum else value
    shared |= {name: value for value, name in sums.items()}
    known = Source((*header, Assignment(tuple(shared.items())))).evaluated_numbers()
    body = grouped(changed_lines(_changed(layout.body, table), lambda line: simplified(line, known)), known)
    uses = Counter(name for line in Source(body).walk() for value in values(line) for name in names_in(value))
    uses.update(name for value in shared.values() for name in names_in(value))
    once: dict[str, Value] = {}
    for name in [name for name in shared if uses[name] < 2]:  # sums come last
        once[name] = _with(shared.pop(name), once)
    body = _changed(body, once)
    shared = {name: _with(value, once) for name, value in shared.items()}
    names = named(body, shared, known)
    final: dict[str, Value] = {provisional: Name(name) for provisional, name in names.items()}
    pairs = [(names[name], _with(value, final)) for name, value in shared.items()]
    for are_sums in (False, True):
        header += assigned([pair for pair in pairs if isinstance(pair[1], Expression) == are_sums])
    floor = layout.scale.floor + (layout.extents[2] - float(known["height"])) * layout.scale.cells_per_unit / 2
    return Source((*header, *_changed(body, final)), layout.source.unit, replace(layout.scale, floor=floor))


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


class Use(NamedTuple):
    """A keyword of a part, of a point of it, or of a group with a part of this role, and the quantity it measures."""

    line: Part | Group
    role: str
    point: str
    quantity: str


def named(lines: Sequence[Line], wanted: Mapping[str, Value], numbers: dict[str, float]) -> dict[str, str]:
    """A name for each of the provisional names in lines, given with their values, plain numbers first, and what all
    names evaluate to."""
    every = [*_uses(lines, numbers)]
    sums = {name: value for name, value in wanted.items() if isinstance(value, Expression)}
    words = language()
    taken = dict.fromkeys((*SIZES, "diameter", *RESERVED, *words.names, *words.roles), 0.0)  # names with their values
    result: dict[str, str] = {}
    for provisional in wanted:
        number = numbers[provisional]
        uses = [use for use, value in every if value == Name(provisional)]
        # Else those of expressions with it, or with a sum of it.
        uses = uses or [use for use, value in every if provisional in names_in(value) + names_in(_with(value, sums))]
        shared, own = _candidates(uses)
        further = _further([base for base in shared if base in FURTHER], number, taken)
        numbered = (f"{own[0]}_{count}" for count in range(2, len(wanted) + 2))
        offered = [*shared, *further, *own, *_further(own, number, taken), *numbered]
        result[provisional] = name = next(name for name in offered if name not in taken)
        taken[name] = number
    return result


def _further(names: Iterable[str], number: float, taken: Mapping[str, float]) -> Iterator[str]:
    """Names for a number beside another that has the name itself."""
    for name in names:
        less, larger = FURTHER.get(name.rpartition("_")[2], ("small", "large"))
        yield f"{larger if abs(number) > abs(taken.get(name, 0.0)) else less}_{name}"


def _uses(lines: Sequence[Line], numbers: Mapping[str, float]) -> Iterator[tuple[Use, Value]]:
    """All numbers of parts and groups; those of a box are of all parts in it."""
    for line in Source(tuple(lines)).walk():
        if isinstance(line, Part | Group):
            roles = [each.word for each in Source((line,)).walk() if isinstance(each, Part)]
            for role, (key, argument) in product(roles if line.kind == "inside" else roles[:1], line.keywords):
                point, pairs = (key, argument.keywords) if isinstance(argument, Point) else ("", ((key, argument),))
                for word, value in pairs:
                    use = Use(line, role, point, _quantity(line, role, word, numbers))
                    yield from ((use, number) for number in (value if isinstance(value, tuple) else (value,)))


def _quantity(line: Part | Group, role: str, word: str, numbers: Mapping[str, float]) -> str:
    """What a keyword measures, as the end of a name."""
    if word not in SIZES:
        return PLACES.get(word, word)
    lengths = {size: np.ptp(ends_of(line, "", axis, numbers)) for axis, size in enumerate(SIZES)}
    least, second, _ = sorted(lengths.values())
    flat = word == "height" and role in FLAT
    return "thickness" if flat or lengths[word] <= least <= TIES.thin * second else word


def _candidates(uses: Sequence[Use]) -> tuple[list[str], list[str]]:
    """Names of a number for parts of several roles, and for those of one role, each with the best first."""
    selected = [use for use in uses if use.quantity not in FURTHER] or uses
    kinds = Counter(use.quantity for use in selected)
    (kind, _), *others = kinds.most_common()
    if others and kind in FURTHER:
        kind = "margin" if kinds.keys() <= {"inset", "setback"} else "clearance"
    ((_, role), count), *_ = Counter((use.line, use.role) for use in selected).most_common()
    shared = []
    if kind in SIZES and count > 1:  # the section of a square part
        shared = [f"{role}_width"]
    elif len({use.role for use in selected}) > 1 and kind not in ("drop", "bottom", "offset"):
        shared = ["board_width"] if kind in SIZES else [kind]
        shared += ["board_thickness"] if kind == "thickness" else []
    # The second point of a part is not where the part is: the upper end of a leg is no ``leg_bottom``.
    plain = [use for use in selected if use.point not in ("through", "end")]
    own = [f"{role}_{kind}" for role, _ in Counter(use.role for use in plain).most_common()]
    own += [f"{use.role}_{use.point}_{use.quantity}" for use in selected if use.point]
    return shared, own
