"""Relations that may hold between the numbers of a placed program: zero, equal, in contact, straight, symmetric.

Only quantities of one kind are related: a clearance with a clearance of the same anchor, a size with a size, a radius
with a radius.  Most relations are written with one name used twice.  Faces that meet may need a sum, and an angle may
be the negative of another.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np

from shapeprog.inference.ties.anchored import Anchored
from shapeprog.inference.ties.layout import HIGH, LOW, MIDDLE, Element, Slot
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Part
from shapeprog.space import FloatArray


class Meeting(NamedTuple):
    """Two lines whose parts meet face to face along an axis."""

    first: int
    second: int
    axis: int


class Relation(NamedTuple):
    """That factors times the numbers of a program sum to zero.

    Parameters
    ----------
    row
        The factors (P,).
    trust
        Price of the number that it saves, as a multiple of the usual one.
    meetings
        The lines that meet where it holds.
    limit
        Largest deviation, in cells or degrees, with which it is considered.
    """

    row: FloatArray
    trust: float
    meetings: frozenset[Meeting] = frozenset()
    limit: float = TIES.within


class Face(NamedTuple):
    """A low or high end of an element, or its middle.

    Parameters
    ----------
    element
        The element.
    row
        How its coordinate from the low side of the whole follows from the numbers (P,).
    at
        That coordinate.
    facing
        Whether it faces the low or the high side, -1 or 1; 0 for the middle.
    """

    element: Element
    row: FloatArray
    at: float
    facing: int

    @property
    def anchor(self) -> int:
        """From where it is measured: from the low side if it does not move when the whole grows, and so on."""
        return round(2 * self.row[self.element.axis])

    @property
    def single(self) -> bool:
        """Whether it is one number, the distance from its anchor."""
        return int((self.row[3:] != 0).sum()) == 1


def relations(anchored: Anchored, numbers: FloatArray, touching: set[tuple[int, int]]) -> list[Relation]:
    """Distinct relations that nearly hold, each with its highest trust.

    Parameters
    ----------
    anchored, numbers
        The program, and where its numbers are (P,).
    touching
        Pairs of lines, the smaller first, whose parts touch.
    """
    best: dict[bytes, Relation] = {}
    for relation in chain(_of_faces(anchored, numbers, touching), _of_numbers(anchored, numbers)):
        used = np.flatnonzero(relation.row)
        if not len(used):
            continue
        row = relation.row / relation.row[used[0]]
        if abs(float(row @ numbers)) <= relation.limit * float(np.abs(row).max()):
            key = np.round(row, 6).tobytes()
            known = best.get(key, relation)
            trust, meetings = max(relation.trust, known.trust), relation.meetings | known.meetings
            best[key] = Relation(row, trust, meetings)
    return list(best.values())


def _of_numbers(anchored: Anchored, numbers: FloatArray) -> Iterator[Relation]:
    """Zeros, equal lengths and angles, and equal clearances of a part along two axes."""
    slots, eye = anchored.slots, np.eye(len(anchored.slots))
    floor = TIES.at_floor * numbers[2]
    for k, slot in enumerate(slots):
        if slot.kind == "clearance":
            if slot.axis == 2 and slot.anchor == LOW and numbers[k] < floor:
                yield Relation(eye[k], TIES.floor, limit=max(TIES.within, floor))
            else:
                yield Relation(eye[k], TIES.equal)
        elif slot.kind == "offset":
            yield Relation(eye[k], TIES.symmetric(slot.axis), limit=TIES.askew)
        elif slot.kind == "angle" and not slot.word.startswith("step"):
            yield Relation(eye[k], TIES.equal, limit=TIES.degrees)
    for (a, slot), (b, other) in combinations(enumerate(slots), 2):
        larger = max(numbers[a], numbers[b])
        if slot.kind == other.kind == "angle" and slot.word == other.word:
            yield Relation(eye[a] - eye[b], TIES.equal, limit=TIES.degrees)
            yield Relation(eye[a] + eye[b], TIES.equal / 2, limit=TIES.degrees)
        elif slot.kind == other.kind == "clearance":
            corner = slot.line == other.line and {slot.axis, other.axis} == {0, 1}
            if corner and TIES.within < min(numbers[a], numbers[b]) and larger < TIES.section:
                yield Relation(eye[a] - eye[b], TIES.equal)
        elif slot.kind == other.kind and slot.kind in ("size", "radius", "edge", "length"):
            near = abs(numbers[a] - numbers[b]) <= TIES.alike * larger + TIES.rounding
            if near and (slot.kind != "size" or _comparable(anchored, slot, other, larger)):
                yield Relation(eye[a] - eye[b], TIES.equal)


def _comparable(anchored: Anchored, slot: Slot, other: Slot, larger: float) -> bool:
    """Whether two sizes measure the same quantity of parts of one role, or of two sections."""
    same = slot.line == other.line or _role(anchored, slot.line) == _role(anchored, other.line)
    sections = same or (_is_section(anchored, slot) and _is_section(anchored, other))
    return (sections and larger < TIES.section) or (same and slot.axis == other.axis)


def _is_section(anchored: Anchored, slot: Slot) -> bool:
    """Whether a size is that of a cross-section: not the longest of its part."""
    box = [anchored.layout.elements.get((slot.line, "", axis)) for axis in range(3)]
    return any(element is None or element.high - element.low > slot.value + TIES.rounding for element in box)


def _role(anchored: Anchored, line: int) -> str:
    node = anchored.lines[line]
    return (node.role or node.kind) if isinstance(node, Part) else ""


def _of_faces(anchored: Anchored, numbers: FloatArray, touching: set[tuple[int, int]]) -> Iterator[Relation]:
    """Relations of pairs of faces of one axis, those of mirror images included."""
    faces: list[list[Face]] = [[], [], []]
    unit, images = np.eye(len(numbers)), list[Face]()
    for element, low, high in anchored.ends():
        rows = {0: low} if element.kind == "coordinate" else {-1: low, 0: (low + high) / 2, 1: high}
        for facing, row in rows.items():
            faces[element.axis].append(Face(element, row, float(row @ numbers), facing))
            if _is_mirrored(anchored, element):
                image = unit[element.axis] - row
                images.append(Face(element, image, float(image @ numbers), -facing))
    for axis, extent in enumerate(numbers[:3]):
        every = faces[axis] + [image for image in images if image.element.axis == axis]
        for face, other in combinations(every, 2):
            off = min(abs(face.at - other.at), abs(face.at + other.at - extent))
            if off <= 2 * TIES.askew:  # no relation allows more
                yield from _pair(anchored, face, other, touching)


def _is_mirrored(anchored: Anchored, element: Element) -> bool:
    """Whether a mirror about the middle of the whole copies a part along the axis of its element."""
    if element.key not in ("", "start", "through", "end"):
        return False
    layout, axis = anchored.layout, element.axis
    planes = (layout.elements.get((loop, "plane", axis)) for loop in layout.loops_around[element.line])
    return any(plane is not None and abs(plane.low - layout.extents[axis] / 2) < TIES.within for plane in planes)


def _pair(anchored: Anchored, face: Face, other: Face, touching: set[tuple[int, int]]) -> Iterator[Relation]:
    """Relations of two faces of one axis."""
    first, second, axis = face.element, other.element, face.element.axis
    keys = {first.key, second.key}
    same, single = first.line == second.line, face.single and other.single
    row, image = face.row - other.row, face.row + other.row
    image[axis] -= 1  # zero where one is the mirror image of the other
    points = [element.kind == "coordinate" for element in (first, second)]
    middles = any(f.facing == 0 and f.element.kind == "interval" for f in (face, other))
    lines = sorted(anchored.layout.first(line)[0] if key == "last" else line
                   for line, key in ((first.line, first.key), (second.line, second.key)))  # fmt: skip
    touches = lines[0] != lines[1] and tuple(lines) in touching
    if face.anchor != other.anchor:
        if {face.anchor, other.anchor} == {LOW, HIGH} and single and axis < 2 and not middles:
            trust = TIES.contact if "last" in keys else TIES.equal
            yield Relation(image, TIES.symmetric(axis), limit=TIES.askew) if same else Relation(image, trust)
    elif middles:
        if touches and axis < 2 and any(points) and not single and not keys & {"last", "plane", "centre"}:
            yield Relation(row, TIES.straight)
    elif same:
        if first.key and second.key:  # both ends of a rod
            yield Relation(row, TIES.straight)
            if face.anchor == MIDDLE:
                yield Relation(image, TIES.symmetric(axis), limit=TIES.askew)
    elif keys & {"last", "plane", "centre"}:
        if "last" in keys and touches and (face.single or other.single):
            yield Relation(row, TIES.contact)
        elif single:
            yield Relation(row, TIES.straight if lines[0] == lines[1] else TIES.equal)
    else:
        if axis > 0 and any(_leans(anchored, line) for line in lines):
            return
        if touches and (face.facing * other.facing == -1 or all(points) or bool(face.facing) != bool(other.facing)):
            meet = face.facing * other.facing == -1
            yield Relation(row, TIES.contact, frozenset([Meeting(lines[0], lines[1], axis)] if meet else ()))
        elif face.facing == other.facing and (single or touches):
            yield Relation(row, TIES.equal if single else TIES.equal / 2)


def _leans(anchored: Anchored, line: int) -> bool:
    return abs(float(dict(anchored.layout.lines[line].keywords).get("tilt", 0.0))) >= TIES.degrees  # type: ignore[arg-type]
