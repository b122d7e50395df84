"""Names for the measures that a program follows from, and the program written with them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from shapeprog.inference.ties.basis import Basis, Measure
from shapeprog.inference.ties.sums import SAME
from shapeprog.inference.tunable import Tunable
from shapeprog.language.ast import Assignment, Loop, Source
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import Name, Value, combined
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Draw, Node, Program
from shapeprog.language.statement import language
from shapeprog.space import DEPTH, SIDE, UP, FloatArray

EXTENTS = ("height", "depth", "width")
"""What the extents of the whole are called along the axes of the grid."""

FLOOR = "floor"
"""The name of half the height below the middle, where the program stands."""

SIDES = {
    ("low", 0): "bottom", ("high", 0): "top", ("low", 1): "front", ("high", 1): "rear", ("low", 2): "left",
    ("high", 2): "right",
}  # fmt: skip

BEGUN = ("top", "bottom", "inset")
"""Measures that begin somewhere."""

NOTES = {"above the floor": ("top", "bottom", "up"), "from the side": ("inset",), "from front or rear": ("setback",)}
"""Where they begin, by the ends of their names."""

SHARED = ("thickness", "radius", "edge", "spacing", "inset", "setback", "tilt")
"""What different parts may share and be called so without the name of a part."""

PLACED_AS = {"leaning_box": "box", "beam": "bar"}
"""What placed text calls statements that it does not have."""

WORDS = (("lower", "upper"), ("front", "rear"), ("inner", "outer"))
"""What tells parts with one role apart, along each axis; the last by how far from the middle they are."""

APART = 1.0
"""How far apart they must be for that, in cells."""

WIDE = 118
"""Letters of a line that names numbers, about."""

LEVEL = 0.6
"""A part is thin along an axis where it measures less than this share of the next longer."""


def written(tunable: Tunable, basis: Basis) -> Program:
    """The program whose numbers follow from named ones; those used once stay where they are used."""
    count = len(tunable.moving)
    uses = np.abs(basis.factors[:count]) > SAME
    alone = [  # used once, as it is; or, an extent that nothing follows from, not at all
        not uses[:, z].any() or bool(uses[:, z].sum() == 1 and abs(np.abs(basis.factors[:count, z]).sum() - 1) < SAME)
        for z in range(len(basis.chosen))
    ]
    names, order = _names(tunable, basis, alone)
    up = [z for z in range(len(basis.chosen)) if names[z] == EXTENTS[UP]]
    floors = bool(up) and not alone[up[0]] and int((basis.factors[:count, up[0]] == -0.5).sum()) > 1
    terms: dict[int, Value] = {
        z: to_float32(basis.values[z]) if alone[z] else Name(names[z]) for z in range(len(basis.chosen))
    }

    def sum_of(row: FloatArray) -> Value:
        parts: list[tuple[Value, float]] = []
        for z in order:
            if not row[z]:
                continue
            if floors and z == up[0] and row[z] == -0.5:
                parts.insert(0, (Name(FLOOR), 1.0))
            else:
                parts.append((terms[z], float(row[z])))
        parts.sort(key=lambda part: part[1] < 0)  # sums begin with what is added
        return combined(0.0, parts)

    table = {place: sum_of(row) for place, row in zip(tunable.moving, basis.factors[:count], strict=True)}
    floor: list[tuple[str, Value]] = [(FLOOR, -Name(EXTENTS[UP]) / 2)] if floors else []
    lines = _header(basis, names, order, alone, floor)
    body = _lines(tunable.program.body, iter(range(len(tunable.nodes))), table)
    return evaluated(Source((*lines, *body)))


def _header(
    basis: Basis, names: list[str], order: list[int], alone: list[bool], before: list[tuple[str, Value]]
) -> Iterator[Assignment]:
    """The lines that name numbers: the extents of the whole, then what comes before all others, then these."""
    free = [z for z in order if not alone[z]]
    words = [basis.chosen[z][0].word for z in free]
    named = [(names[z], to_float32(basis.values[z])) for z in free]
    whole = [pair for pair, word in zip(named, words, strict=True) if word == "extent"]
    others = [pair for pair, word in zip(named, words, strict=True) if word != "extent"]
    ends = {
        name.rstrip("_0123456789").rpartition("_")[2]
        for (name, _), word in zip(named, words, strict=True)
        if word in BEGUN
    }
    begins = {where: [end for end in about if end in ends] for where, about in NOTES.items()}
    note = "; ".join(f"{', '.join(found)}: {where}" for where, found in begins.items() if found)
    lines: list[list[tuple[str, Value]]] = [sorted(whole, key=lambda pair: -EXTENTS.index(pair[0])), []]
    for pair in (*before, *others):
        if lines[-1] and sum(len(name) + 8 for name, _ in [*lines[-1], pair]) > WIDE:
            lines.append([])
        lines[-1].append(pair)
    for line in filter(None, lines):
        yield Assignment(tuple(line), note)
        note = ""


def _names(tunable: Tunable, basis: Basis, alone: list[bool]) -> tuple[list[str], list[int]]:
    """A name for every measure, and the order in which they are met, the whole first, then by the order of the text.

    Those that nobody reads come last, so that they take no name from others.
    """
    known, taken = language(), {FLOOR, *(node.name for node in tunable.nodes), *_roles(tunable.nodes)}
    taken |= {*known.names, *known.roles}
    first = [min(each.feature.node for each in group) for group in basis.chosen]
    order = sorted(range(len(first)), key=lambda z: (basis.chosen[z][0].word != "extent", first[z], z))
    names, middles, holder = [""] * len(first), _middles(tunable), dict[str, int]()
    for z in sorted(order, key=lambda z: alone[z]):
        offered, node = _name(tunable, basis.chosen[z])
        words = [
            f"{word}_{offered[-1]}" for word in _apart(middles.get(holder.get(offered[-1], -1)), middles.get(node))
        ]
        names[z] = _unused(next((name for name in (*offered, *words) if name not in taken), offered[-1]), taken)
        holder[names[z]] = node
    return names, order


def _middles(tunable: Tunable) -> dict[int, FloatArray]:
    """For each node that draws the mean place of its copies: up, depth, and how far to either side."""
    scene = tunable.scene(tunable.values)
    drawn = [n for n, node in enumerate(tunable.nodes) if isinstance(node, Draw)]
    centre, block = scene.centre.abs().numpy(), scene.block.numpy()
    centre[:, :SIDE] = scene.centre[:, :SIDE].numpy()
    return {node: centre[block == place].mean(0) for place, node in enumerate(drawn) if (block == place).any()}


def _apart(one: FloatArray | None, other: FloatArray | None) -> Iterator[str]:
    """Words for the second of two places that tell it from the first, the best first."""
    if one is not None and other is not None:
        away = other - one
        for axis in np.argsort(-np.abs(away), kind="stable"):
            if abs(away[axis]) >= APART:
                yield WORDS[axis][int(away[axis] > 0)]


def _unused(base: str, taken: set[str]) -> str:
    """A name that is not taken, which it is then."""
    name, number = base, 2
    while name in taken:
        name, number = f"{base}_{number}", number + 1
    taken.add(name)
    return name


def _roles(nodes: list[Node]) -> Iterator[str]:
    return (node.role for node in nodes if isinstance(node, Draw) and node.role)


def _name(tunable: Tunable, group: list[Measure]) -> tuple[list[str], int]:
    """What measures that always agree may be called, the best first, and the node of the part that they are of.

    The name has that of the part, unless several kinds of parts share what is measured.
    """
    first = group[0]
    if first.word == "extent":
        return [EXTENTS[first.feature.axis]], first.feature.node
    alike = [each for each in group if each.word == first.word]
    parts = [_part(tunable, each.feature.node) for each in alike]
    part = max(dict.fromkeys(parts), key=parts.count)  # the one that has it most often, else the first
    mine = [each for each, owner in zip(alike, parts, strict=True) if owner == part]
    earliest = min(mine, key=lambda each: (each.feature.node, each.feature.all))
    square = len({each.feature.node for each in mine}) < len(mine)  # two sides of one section
    kind = "thickness" if first.word == "length" and square else _kind(tunable, earliest)
    shared = kind in SHARED and not square and len(set(parts)) > 1
    along = [f"{part}_{kind}_{EXTENTS[first.feature.axis]}"] if first.word == "offset" else []
    return [*([kind] if shared else []), f"{part}_{kind}", *along], _drawn(tunable, earliest.feature.node)[0]


def _part(tunable: Tunable, node: int) -> str:
    """What the part is called that a node is; of a loop the first part in it."""
    word = _drawn(tunable, node)[1].word
    return PLACED_AS.get(word, word)


def _drawn(tunable: Tunable, node: int) -> tuple[int, Draw]:
    """The node that draws, and where it stands: this one, or the first in a loop."""
    return next((n, each) for n, each in enumerate(tunable.nodes[node:], node) if isinstance(each, Draw))


def _kind(tunable: Tunable, measure: Measure) -> str:
    """What is measured, as the end of a name."""
    feature, word = measure.feature, measure.word
    node = tunable.nodes[feature.node]
    if word == "length":
        return _length(tunable, measure)
    if word == "shift":
        return "spacing"
    if word == "offset":
        parts = [_part(tunable, each) for each in (feature.node, measure.origin)]
        return f"to_{parts[1]}" if parts[0] != parts[1] else word
    if word == "inset":
        return "setback" if feature.axis == DEPTH else word
    if word == "side":
        return SIDES[feature.kind, feature.axis]
    if word in ("angle", "place") or (word == "top" and feature.kind == "place"):
        parameter = language()[node.name].parameter_at(_slot(tunable, measure))
        axis = ("up", "depth", "side")[feature.axis] if feature.axis >= 0 and parameter.quantity.width > 1 else ""
        return "_".join(filter(None, (parameter.name, axis)))
    return word


def _slot(tunable: Tunable, measure: Measure) -> int:
    """The slot of its node that a number is written in."""
    return tunable.moving[int(np.flatnonzero(measure.feature.row)[0])][1]


def _length(tunable: Tunable, measure: Measure) -> str:
    """Thickness where a part is thinnest, else what the axis says."""
    node = tunable.nodes[measure.feature.node]
    declared = language()[node.name]
    lengths = [s for s, quantity in enumerate(declared.quantities) if quantity.kind == "length"]
    sizes = sorted(node.values[s] for s in lengths)
    slot = _slot(tunable, measure)
    own = node.values[slot]
    if measure.feature.axis < 0:
        parameter = declared.parameter_at(slot)
        longer = parameter.name if parameter.quantity.width == 1 else "breadth"
        return "thickness" if own == sizes[0] else longer
    if len(sizes) < 2 or (own <= LEVEL * sizes[1] and own == sizes[0]):
        return "thickness"
    return EXTENTS[measure.feature.axis]


def _lines(
    body: tuple[Node, ...], counter: Iterator[int], table: dict[tuple[int, int], Value]
) -> tuple[Draw | Loop, ...]:
    found: list[Draw | Loop] = []
    for node in body:
        n = next(counter)
        values = tuple(table.get((n, slot), value + 0.0) for slot, value in enumerate(node.values))  # no minus zero
        if isinstance(node, Draw):
            found.append(Draw(node.name, values, node.role))
        else:
            found.append(Loop(node.name, values, _lines(node.body, counter, table)))
    return tuple(found)
