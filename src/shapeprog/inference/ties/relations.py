"""Relations that may hold between the numbers of a placed program: zero, equal, in contact, straight, symmetric.

Only quantities of one kind are related: a clearance with a clearance of the same anchor, a size with a size, a radius
with a radius.  Most relations are written with one name used twice; faces that meet may need a sum, an edge may be
half a size, and an angle the negative of another.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from shapeprog.inference.ties.anchored import Anchored
from shapeprog.inference.ties.layout import HIGH, LOW, MIDDLE, Element, Slot
from shapeprog.language.ast import Part
from shapeprog.language.placement import AXES
from shapeprog.space import FloatArray

WITHIN, HIDDEN = 0.3, 1.5
"""Cells by which a relation may be off; and one between parts that touch, which may end inside each other."""

DEGREES = 2.0
"""The same for angles, in degrees."""

FLOOR = 0.02
"""Share of the height of the whole up to which a part touches the floor."""

ALIKE, ROUNDING = 0.25, 0.05
"""Tolerance of equal sizes: a share of the larger, plus so many cells."""

THIN = 3.0
"""Cells below which sizes along different axes may be the two sides of one section."""


@dataclass(frozen=True)
class Trust:
    """Price of the number that a relation saves, as a multiple of the usual price.

    Parameters
    ----------
    zero
        A clearance of zero.
    floor
        A part that ends just above the floor.
    centred, even
        Equal clearances on both sides, left-right and front-rear.
    contact
        Faces that meet.
    flush
        Faces of touching parts that lie in one plane.
    straight
        Ends of a rod at equal distances, or a row along one axis.
    same_part, section, different
        Equal sizes of parts of one role; of thin sides of different roles; and others.
    aligned, opposite, across
        Equal clearances of parts that do not touch, at one side or at opposite sides; and of one part at a corner.
    centre
        An end of a rod on the middle line of a part that it touches.
    middle
        Faces in one plane of parts that touch, of which one is a sum.
    half
        An edge that is half a thin side of its part.
    hidden
        Contacts and centred parts with so large an error that only hidden surfaces can explain it.
    """

    zero: float = 1.0
    floor: float = 6.0
    centred: float = 4.0
    even: float = 2.0
    contact: float = 2.0
    flush: float = 1.0
    straight: float = 1.5
    same_part: float = 1.0
    section: float = 1.0
    different: float = 0.4
    aligned: float = 0.8
    opposite: float = 0.6
    across: float = 0.6
    centre: float = 1.5
    middle: float = 0.4
    half: float = 0.5
    hidden: float = 0.6

    def symmetric(self, axis: int) -> float:
        """That of equal clearances on both sides along a horizontal axis."""
        return self.centred if axis == 0 else self.even


class Relation(NamedTuple):
    """That factors (P,) times the numbers of a program sum to zero, and the price of the number it saves."""

    row: FloatArray
    trust: float


class Reading(NamedTuple):
    """A relation that the text may have, and how well it must hold already.

    Parameters
    ----------
    row, trust
        As of :class:`Relation`.
    limit
        Largest deviation, in cells or degrees.
    hidden
        Whether it may be off by up to ``HIDDEN`` with less trust, since only hidden surfaces would move.
    """

    row: FloatArray
    trust: float
    limit: float = WITHIN
    hidden: bool = False


class Face(NamedTuple):
    """An end of an element: its anchor, its row of factors (P,), its coordinate from the low side of the whole, whether
    it faces the low or the high side (-1 or 1; 0 for the middle), and whether it is one number."""

    element: Element
    anchor: int
    row: FloatArray
    at: float
    facing: int
    single: bool


def faces(anchored: Anchored, numbers: FloatArray) -> list[Face]:
    """All ends of all elements."""
    count, result = len(anchored.slots), list[Face]()

    def unit(line: int, word: str) -> FloatArray:
        row = np.zeros(count)
        row[anchored.index[line, word]] = 1.0
        return row

    for (line, key, axis), element in anchored.layout.elements.items():
        anchors, words, extent = anchored.anchors[line, key, axis], AXES[axis], numbers[axis]
        word = (words.low, words.offset, words.high)

        def face(anchor: int, row: FloatArray, facing: int, element: Element = element, extent: float = extent) -> Face:
            value = float(row @ numbers)
            at = (value, extent / 2 + value, extent - value)[anchor]
            return Face(element, anchor, row, at, facing, int((row != 0).sum()) == 1)

        if key == "across":
            if anchors == (LOW, HIGH):
                row = unit(line, words.low)
                result += [face(LOW, row, -1), face(HIGH, row, 1)]
            continue
        if element.kind == "interval":
            low, high = anchors
            if low == high == MIDDLE:
                middle, half = unit(line, words.offset), unit(line, words.size) / 2
                result += [face(MIDDLE, middle - half, -1), face(MIDDLE, middle + half, 1)]
            elif low == high:
                clearance, size = unit(line, word[low]), unit(line, words.size)
                sign = -1 if low == LOW else 1
                result += [face(low, clearance, sign), face(low, clearance + size, -sign)]
            else:
                result.append(face(low, unit(line, words.low), -1))
                result.append(face(high, unit(line, words.high) * (-1 if high == MIDDLE else 1), 1))
            continue
        (anchor,) = anchors
        name = f"{key}.{word[anchor]}" if key else word[anchor]
        if (line, name) not in anchored.index:
            continue  # the plane in the middle
        row = unit(line, name)
        if element.kind == "coordinate":
            result.append(face(anchor, row, 0))
            continue
        radius = unit(line, "radius") if (line, "radius") in anchored.index else unit(line, "radius.0")
        if anchor == MIDDLE:
            result += [face(anchor, row - radius, -1), face(anchor, row, 0), face(anchor, row + radius, 1)]
        else:
            sign = -1 if anchor == LOW else 1
            result += [face(anchor, row, sign), face(anchor, row + radius, 0), face(anchor, row + 2 * radius, -sign)]
    return result + [_image(face, numbers) for face in result if _is_mirrored(anchored, face.element)]


def _is_mirrored(anchored: Anchored, element: Element) -> bool:
    """Whether a mirror about the middle of the whole copies a part along the axis of its element."""
    if element.key not in ("", "start", "through", "end"):
        return False
    layout, axis = anchored.layout, element.axis
    planes = (layout.elements.get((loop, "plane", axis)) for loop in layout.loops_around[element.line])
    return any(plane is not None and abs(plane.low - layout.extents[axis] / 2) < WITHIN for plane in planes)


def _image(face: Face, numbers: FloatArray) -> Face:
    """The face of the mirror image of a part."""
    extent = numbers[face.element.axis]
    row = -face.row if face.anchor == MIDDLE else face.row
    return face._replace(anchor=2 - face.anchor, row=row, at=extent - face.at, facing=-face.facing)


def relations(anchored: Anchored, numbers: FloatArray, touching: set[tuple[int, int]], trust: Trust) -> list[Relation]:
    """Distinct relations that nearly hold, with the highest trust of any of their readings.

    Parameters
    ----------
    touching
        Pairs of lines, the smaller first, whose parts touch.
    """
    best: dict[bytes, Relation] = {}
    for row, weight, limit, hidden in _readings(anchored, numbers, touching, trust):
        used = np.flatnonzero(row)
        if not len(used):
            continue
        row = row / row[used[0]]
        off = abs(float(row @ numbers)) / float(np.abs(row).max())
        if off > limit:
            if not hidden or off > HIDDEN:
                continue
            weight = trust.hidden if weight < trust.centred else 1.3
        key = np.round(row, 6).tobytes()
        if key not in best or best[key].trust < weight:
            best[key] = Relation(row, weight)
    return list(best.values())


def _readings(
    anchored: Anchored, numbers: FloatArray, touching: set[tuple[int, int]], trust: Trust
) -> Iterator[Reading]:
    """Relations that the slots and faces of a program may have."""
    slots, count = anchored.slots, len(anchored.slots)
    eye = np.eye(count)
    upright = [abs(_angle(anchored, line)) < DEGREES for line in range(len(anchored.layout.lines))]
    for k, slot in enumerate(slots):
        if slot.kind == "clearance":
            floor = FLOOR * numbers[2]
            stands = slot.axis == 2 and slot.anchor == LOW and numbers[k] < floor
            yield Reading(eye[k], trust.floor, max(WITHIN, floor)) if stands else Reading(eye[k], trust.zero)
        elif slot.kind == "offset":
            yield Reading(eye[k], trust.symmetric(slot.axis), hidden=slot.axis == 0)
        elif slot.kind == "angle" and not slot.word.startswith("step"):
            yield Reading(eye[k], trust.zero, DEGREES)
    all_faces = faces(anchored, numbers)
    for axis in range(3):
        axis_faces = [face for face in all_faces if face.element.axis == axis]
        for face, partner in combinations(axis_faces, 2):
            yield from _pair(anchored, face, partner, touching, trust, upright)
    lengths = [k for k, slot in enumerate(slots) if slot.kind in ("size", "radius", "edge", "angle", "length")]
    for a, b in combinations(lengths, 2):
        if weight := _equal(anchored, slots[a], slots[b], numbers[a], numbers[b], trust):
            if slots[a].kind == "angle":
                yield Reading(eye[a] - eye[b], weight, DEGREES)
                yield Reading(eye[a] + eye[b], weight / 2, DEGREES)
            else:
                yield Reading(eye[a] - eye[b], weight)
        small, side = (a, b) if slots[b].kind == "size" else (b, a)
        kinds = slots[small].kind, slots[side].kind
        if kinds == ("edge", "size") and slots[small].line == slots[side].line and numbers[side] < THIN:
            yield Reading(eye[small] - eye[side] / 2, trust.half)
    across = [k for k, slot in enumerate(slots) if slot.kind == "clearance" and slot.axis < 2 and numbers[k] > WITHIN]
    for a, b in combinations(across, 2):
        if slots[a].axis != slots[b].axis and slots[a].line == slots[b].line and max(numbers[a], numbers[b]) < THIN:
            yield Reading(eye[a] - eye[b], trust.across)


def _pair(
    anchored: Anchored, face: Face, partner: Face, touching: set[tuple[int, int]], trust: Trust, upright: list[bool]
) -> Iterator[Reading]:
    """Relations of two faces of one axis."""
    first, second = face.element, partner.element
    axis, same = first.axis, first.line == second.line
    if face.anchor != partner.anchor:
        if {face.anchor, partner.anchor} == {LOW, HIGH} and face.single and partner.single and axis < 2:
            if same:
                yield Reading(face.row - partner.row, trust.symmetric(axis))
            elif first.key == "last" or second.key == "last":
                yield Reading(face.row - partner.row, trust.even)
            else:
                yield Reading(face.row - partner.row, trust.opposite)
        return
    row = face.row - partner.row
    if same:
        if first.key and second.key:  # both ends of a rod
            yield Reading(row, trust.straight)
            if face.anchor == MIDDLE:
                yield Reading(face.row + partner.row, trust.symmetric(axis))
        return
    if face.anchor == MIDDLE and face.facing == -partner.facing and face.single and partner.single:
        yield Reading(face.row + partner.row, trust.opposite)
    if "last" in (first.key, second.key):
        loop, element = (first, second) if first.key == "last" else (second, first)
        part = anchored.layout.first(loop.line)[0]
        if not (face.single or partner.single):
            return
        if element.line == part:
            if face.single and partner.single:
                yield Reading(row, trust.straight)
        elif (min(part, element.line), max(part, element.line)) in touching:
            yield Reading(row, trust.contact)
        elif face.single and partner.single:
            yield Reading(row, trust.aligned)
        return
    if "plane" in (first.key, second.key) or "centre" in (first.key, second.key):
        if face.single and partner.single:
            yield Reading(row, trust.aligned)
        return
    touches = (min(first.line, second.line), max(first.line, second.line)) in touching
    straight = axis == 0 or (upright[first.line] and upright[second.line])
    if touches and face.facing * partner.facing == -1 and straight:
        yield Reading(row, trust.contact, hidden=True)
    elif touches and 0 in (face.facing, partner.facing) and straight:
        middle = face.facing == 0 and partner.facing == 0
        ends = first.kind == second.kind == "coordinate"
        if ends or not middle:
            yield Reading(row, trust.contact, hidden=True)
        else:
            yield Reading(row, trust.flush)
    elif face.facing == partner.facing and straight:
        if face.single and partner.single:
            yield Reading(row, trust.flush if touches else trust.aligned)
        elif touches:
            yield Reading(row, trust.middle)
    if touches and axis < 2 and (first.kind, second.kind) in (("coordinate", "interval"), ("interval", "coordinate")):
        point, box = (face, partner) if first.kind == "coordinate" else (partner, face)
        if not box.single and box.facing:  # the middle of a box that it touches
            yield Reading(point.row - (box.row + _opposite_row(anchored, box)) / 2, trust.centre)


def _opposite_row(anchored: Anchored, face: Face) -> FloatArray:
    """The row of the near face of an interval whose far face this is."""
    element, row = face.element, np.zeros(len(anchored.slots))
    if face.anchor == MIDDLE:
        size = anchored.index[element.line, AXES[element.axis].size]
        row[size] = -np.sign(face.row[size])
        return face.row + row
    words = AXES[element.axis]
    anchor = anchored.anchors[element.line, element.key, element.axis][0]
    row[anchored.index[element.line, words.low if anchor == LOW else words.high]] = 1.0
    return row


def _equal(anchored: Anchored, slot: Slot, partner: Slot, a: float, b: float, trust: Trust) -> float:
    """The trust in the equality of two sizes; 0 for sizes that are not compared."""
    if slot.kind != partner.kind:
        return 0.0
    if slot.kind != "angle" and abs(a - b) > ALIKE * max(a, b) + ROUNDING:
        return 0.0
    roles = _role(anchored, slot.line), _role(anchored, partner.line)
    if slot.kind == "angle":
        return trust.same_part if slot.word == partner.word else 0.0
    if slot.kind in ("radius", "edge", "length"):
        return trust.same_part if roles[0] == roles[1] or slot.line == partner.line else trust.section * 0.6
    thin = max(a, b) < THIN
    if slot.axis != partner.axis and not thin:
        return 0.0
    if roles[0] == roles[1]:
        return trust.same_part
    return trust.section if thin else trust.different


def _role(anchored: Anchored, line: int) -> str:
    node = anchored.layout.lines[line]
    return (node.role or node.kind) if isinstance(node, Part) else ""


def _angle(anchored: Anchored, line: int) -> float:
    node = anchored.layout.lines[line]
    return float(dict(node.keywords).get("tilt", 0.0)) if isinstance(node, Part) else 0.0  # type: ignore[arg-type]
