"""Relations between the numbers of a placed program: zero, equal, in contact, straight, symmetric.

Only quantities of one kind are related: a clearance with a clearance (of the same anchor, at a corner, or of opposite
sides), a size with a size, a radius with a radius.  Most relations are written with one name used twice; faces that
meet may need a sum.  Those whose price in fit is below that of the number they save are selected.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from shapeprog.inference.ties.elements import HIGH, LOW, MIDDLE, Element, Slot
from shapeprog.inference.ties.layout import Layout
from shapeprog.inference.ties.settings import TIES
from shapeprog.library.independence import beside
from shapeprog.space import FloatArray

HOLDS = 1e-6  # deviation up to which a relation holds


class Relation(NamedTuple):
    """That factors times the numbers of a program sum to zero."""

    row: FloatArray  # the factors (P,)
    trust: float = 1.0  # price of the number that it saves, as a multiple of the usual one
    meetings: frozenset[tuple[int, int, int]] = frozenset()  # lines whose parts then meet face to face, with the axis
    limit: float = TIES.within  # largest deviation, in cells or degrees, with which it is considered


class _Face:
    """A low or high end of an element, or its middle.

    It is given with how its coordinate from the low side of the whole follows from the numbers (P,), and with whether
    it faces the low or the high side, -1 or 1; 0 for the middle.
    """

    def __init__(self, element: Element, row: FloatArray, facing: int) -> None:
        self.element, self.row, self.facing = element, row, facing
        # From where it is measured: from the low side if it does not move when the whole grows, and so on.
        self.anchor = round(2 * row[element.axis])
        self.single = np.count_nonzero(row[3:]) == 1  # whether it is one number, the distance from its anchor


def relations(layout: Layout, numbers: FloatArray, touching: set[tuple[int, int]]) -> list[Relation]:
    """Distinct relations that nearly hold where the numbers are these (P,), each with its highest trust; ``touching``
    are the pairs of lines, the smaller first, whose parts touch."""
    best: dict[bytes, Relation] = {}
    for relation in (*_of_faces(layout, numbers, touching), *_of_numbers(layout, numbers)):
        row, largest = relation.row, np.abs(relation.row).max()
        if largest > 0 and abs(row @ numbers) <= relation.limit * largest:
            row = row / row[row.nonzero()[0][0]]
            key = np.round(row, 6).tobytes()
            known = best.get(key, relation)
            best[key] = Relation(row, max(relation.trust, known.trust), relation.meetings | known.meetings)
    return list(best.values())


def worthwhile(
    candidates: list[Relation],
    numbers: FloatArray,
    curvature: FloatArray,
    price: float,
    bounded: FloatArray,
    low: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """The rows (M, V) of the selected relations, and the optimum (V,) where they hold.

    Near its optimum the misfit of a program is quadratic.  With H half its curvature and p the numbers, c p = 0
    costs (c p)^2 / (c H^-1 c'), so thousands of relations are priced without a refit; the one that saves most is
    imposed, H^-1 and p follow by one elimination, and so on.  Parts that meet along two axes would touch along an edge
    alone, so a relation by which they would is not imposed.

    Parameters
    ----------
    candidates
        The relations; those of infinite trust hold in any case.
    numbers, curvature
        The optimum (V,), and half the curvature (V, V) of the misfit there.
    price
        Price of a number, in the unit of the misfit.
    bounded, low
        Rows (G, V) and lower bounds (G,) of their products with the numbers, which relations of finite trust keep.
    """
    rows: FloatArray = np.array([relation.row for relation in candidates]).reshape(-1, len(numbers))
    imposed, free, axes, edges = list[FloatArray](), np.linalg.inv(curvature), rows[:0], 0
    low = np.minimum(low, bounded @ numbers) - HOLDS
    meetings = [(k, where) for k, relation in enumerate(candidates) for where in relation.meetings]
    spread, off = np.einsum("kv,vw,kw->k", rows, free, rows, optimize=True), rows @ numbers
    benefit = price * np.array([relation.trust for relation in candidates])
    # Below this share of its freedom a relation holds already: for numbers that nothing determines, rounding alone
    # leaves more, so independence is tested on the rows themselves.
    minimum = 1e-9 * spread
    while True:
        gain = np.where(spread > minimum, benefit - off**2 / np.maximum(spread, minimum), -np.inf)
        if gain.max(initial=0.0) <= 0:
            return np.array(imposed).reshape(-1, len(numbers)), numbers
        best = int(gain.argmax())
        along = free @ rows[best]
        moved = numbers - along * off[best] / spread[best]
        across = rows @ along
        off_then, spread_then = off - across * off[best] / spread[best], spread - across**2 / spread[best]
        holds = (spread_then <= minimum) & (np.abs(off_then) < HOLDS)
        met = {where for k, where in meetings if holds[k]}
        edges_then = len(met) - len({where[:2] for where in met})  # axes beyond the first along which pairs meet
        worse = (bounded @ moved < low).any() or edges_then > edges
        new = beside(rows[best], axes)
        if new is not None and (not worse or benefit[best] == np.inf):
            imposed.append(rows[best])
            axes = np.vstack([axes, new])
            free = free - np.outer(along, along) / spread[best]
            numbers, off, spread, edges = moved, off_then, spread_then, edges_then
        spread[best] = 0.0


def _of_numbers(layout: Layout, numbers: FloatArray) -> Iterator[Relation]:
    """Zeros, equal lengths and angles, and equal clearances of a part along two axes."""
    slots, eye = layout.slots, np.eye(len(layout.slots))
    floor = TIES.reach * numbers[2]
    for k, slot in enumerate(slots):
        if slot.kind == "clearance" and slot.word.endswith("bottom") and numbers[k] < floor:
            yield Relation(eye[k], TIES.floor, limit=max(TIES.within, floor))
        elif slot.kind == "clearance" or (slot.kind == "gap" and abs(slot.value) <= TIES.touch):
            yield Relation(eye[k], TIES.contact if abs(slot.value) <= TIES.zero else 1.0)  # reaches at the start
        elif slot.kind == "offset":
            limit = TIES.plane if slot.word.startswith("plane") else TIES.within
            yield Relation(eye[k], TIES.symmetric[slot.axis], limit=limit)
        elif slot.kind == "angle" and slot.word != "step":
            yield Relation(eye[k], limit=TIES.degrees)
    for (a, slot), (b, other) in combinations(enumerate(slots), 2):
        limit = TIES.degrees if slot.kind == "angle" else TIES.within
        smaller, larger = sorted((numbers[a], numbers[b]))
        if slot.kind != other.kind or larger - smaller > limit:
            continue
        corner = slot.line == other.line and {slot.axis, other.axis} == {0, 1}
        near = larger - smaller <= TIES.alike * larger + TIES.rounding
        if slot.kind == "clearance":
            related = corner and TIES.within < smaller and larger < TIES.section
        elif slot.kind == "angle":
            related = slot.word == other.word
        else:
            related = near and (slot.kind != "size" or _comparable(layout, slot, other, larger))
        if related and slot.kind not in ("extent", "offset"):
            yield Relation(eye[a] - eye[b], limit=limit)


def _comparable(layout: Layout, slot: Slot, other: Slot, larger: float) -> bool:
    """Whether two sizes measure the same quantity of parts of one role, or of two sections."""
    same = layout.words[slot.line] == layout.words[other.line]
    sections = same or all(_is_section(layout, each) for each in (slot, other))
    return (sections and larger < TIES.section) or (same and slot.axis == other.axis)


def _is_section(layout: Layout, slot: Slot) -> bool:
    """Whether a size is that of a cross-section: not the longest of its part."""
    box = [layout.elements.get((slot.line, "", axis)) for axis in range(3)]
    return any(element is None or element.high - element.low > slot.value + TIES.rounding for element in box)


def _of_faces(layout: Layout, numbers: FloatArray, touching: set[tuple[int, int]]) -> Iterator[Relation]:
    """Relations of pairs of faces of one axis, those of mirror images included."""
    unit = np.eye(len(numbers))
    faces: list[_Face] = []
    for element, low, high in layout.ends():
        rows = {0: low} if element.kind == "coordinate" else {-1: low, 0: (low + high) / 2, 1: high}
        faces += [_Face(element, row, facing) for facing, row in rows.items()]
    for axis, extent in enumerate(numbers[:3]):
        along = [face for face in faces if face.element.axis == axis]
        mirrored = [face for face in along if _is_mirrored(layout, face.element)]
        along += [_Face(face.element, unit[axis] - face.row, -face.facing) for face in mirrored]
        at = np.array([face.row @ numbers for face in along])
        off = np.minimum(np.abs(at - at[:, None]), np.abs(at + at[:, None] - extent))
        for first, second in np.argwhere(np.triu(off <= 2 * TIES.within, 1)).tolist():  # no relation allows more
            yield from _pair(layout, along[first], along[second], touching)


def _is_mirrored(layout: Layout, element: Element) -> bool:
    """Whether a mirror about the middle of the whole copies an element, of a part or a loop, along its axis."""
    axis = element.axis
    planes = (layout.elements.get((loop, "plane", axis)) for loop in layout.loops_around[element.line])
    return any(plane is not None and abs(plane.low - layout.extents[axis] / 2) < TIES.within for plane in planes)


def _pair(layout: Layout, face: _Face, other: _Face, touching: set[tuple[int, int]]) -> Iterator[Relation]:
    """Relations of two faces of one axis."""
    first, second, axis = face.element, other.element, face.element.axis
    keys = {first.key, second.key}
    same, single = first.line == second.line, face.single and other.single
    row, image = face.row - other.row, face.row + other.row
    image[axis] -= 1  # zero where one is the mirror image of the other
    points = [element.kind == "coordinate" for element in (first, second)]
    middles = any(f.facing == 0 and f.element.kind == "interval" for f in (face, other))
    lines = sorted(layout.first(each.line)[0] if each.key == "last" else each.line for each in (first, second))
    touches = lines[0] != lines[1] and tuple(lines) in touching
    if face.anchor != other.anchor:
        if {face.anchor, other.anchor} == {LOW, HIGH} and single and axis < 2:
            trust = TIES.symmetric[axis] if same else TIES.contact if "last" in keys else 1.0
            yield Relation(image, trust)
    elif middles:
        if touches and axis < 2 and any(points) and not single:
            yield Relation(row, TIES.straight)
    elif same:
        if first.key and second.key:  # both ends of a rod
            yield Relation(row, TIES.straight)
            if face.anchor == MIDDLE:
                yield Relation(image, TIES.symmetric[axis])
    elif keys & {"last", "plane", "centre"}:
        if "last" in keys and touches and (face.single or other.single):
            yield Relation(row, TIES.contact)
        elif single:
            yield Relation(row)
    else:
        meet = face.facing * other.facing == -1
        if touches and (face.facing != other.facing or all(points)):
            yield Relation(row, TIES.contact, frozenset([(lines[0], lines[1], axis)] if meet else ()))
        elif face.facing == other.facing and (single or touches):
            yield Relation(row, 1.0 if single else 0.5)
