"""Relations that may hold between the numbers of a placed program: zero, equal, in contact, straight, symmetric.

Only quantities of one kind are related: a clearance with a clearance of the same anchor, a size with a size, a radius
with a radius.  Most relations are written with one name used twice; faces that meet may need a sum, an edge may be
half a size, and an angle the negative of another.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
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
    """That factors (P,) times the numbers of a program sum to zero.

    Parameters
    ----------
    row
        The factors (P,).
    trust
        Price of the number that it saves, as a multiple of the usual one.
    meetings
        The lines that meet where it holds.
    """

    row: FloatArray
    trust: float
    meetings: frozenset[Meeting] = frozenset()


class Reading(NamedTuple):
    """A relation that the text may have, and how well it must hold already.

    Parameters
    ----------
    row, trust
        As of :class:`Relation`.
    limit
        Largest deviation, in cells or degrees.
    meeting
        The lines that meet where it holds.
    """

    row: FloatArray
    trust: float
    limit: float = TIES.within
    meeting: Meeting | None = None


class Face(NamedTuple):
    """A low or high end of an element, or its middle.

    Parameters
    ----------
    element
        The element.
    anchor
        From where it is measured.
    row
        How its coordinate from the low side of the whole follows from the numbers (P,).
    facing
        Whether it faces the low or the high side, -1 or 1; 0 for the middle.
    """

    element: Element
    anchor: int
    row: FloatArray
    facing: int

    @property
    def single(self) -> bool:
        """Whether it is one number, the distance from its anchor."""
        return int((self.row[3:] != 0).sum()) == 1


def faces(anchored: Anchored) -> list[Face]:
    """All ends and middles of all elements, and those of their mirror images."""
    result = list[Face]()
    for element, low, high in anchored.ends():
        rows = [(low + high) / 2] if element.kind == "coordinate" else [low, (low + high) / 2, high]
        facing = [0] if element.kind == "coordinate" else [-1, 0, 1]
        result += [Face(element, _anchor(row, element), row, way) for row, way in zip(rows, facing, strict=True)]
    return result + [_image(face) for face in result if _is_mirrored(anchored, face.element)]


def _anchor(row: FloatArray, element: Element) -> int:
    """The anchor of a coordinate: that of the low side moves with none of the whole, of the high side with all."""
    return round(2 * row[element.axis])


def _is_mirrored(anchored: Anchored, element: Element) -> bool:
    """Whether a mirror about the middle of the whole copies a part along the axis of its element."""
    if element.key not in ("", "start", "through", "end"):
        return False
    layout, axis = anchored.layout, element.axis
    planes = (layout.elements.get((loop, "plane", axis)) for loop in layout.loops_around[element.line])
    return any(plane is not None and abs(plane.low - layout.extents[axis] / 2) < TIES.within for plane in planes)


def _image(face: Face) -> Face:
    """The face of the mirror image of a part."""
    row = -face.row
    row[face.element.axis] += 1
    return face._replace(anchor=2 - face.anchor, row=row, facing=-face.facing)


def relations(anchored: Anchored, numbers: FloatArray, touching: set[tuple[int, int]]) -> list[Relation]:
    """Distinct relations that nearly hold, with the highest trust of any of their readings.

    Parameters
    ----------
    touching
        Pairs of lines, the smaller first, whose parts touch.
    """
    best: dict[bytes, Relation] = {}
    for row, trust, limit, meeting in _readings(anchored, numbers, touching):
        used = np.flatnonzero(row)
        if not len(used):
            continue
        row = row / row[used[0]]
        off = abs(float(row @ numbers)) / float(np.abs(row).max())
        if off > limit:
            continue
        key = np.round(row, 6).tobytes()
        known = best.get(key, Relation(row, trust))
        best[key] = Relation(row, max(trust, known.trust), known.meetings | ({meeting} if meeting else frozenset()))
    return list(best.values())


def _readings(anchored: Anchored, numbers: FloatArray, touching: set[tuple[int, int]]) -> Iterator[Reading]:
    """Relations that the slots and faces of a program may have."""
    slots, count = anchored.slots, len(anchored.slots)
    eye = np.eye(count)
    upright = [abs(_angle(anchored, line)) < TIES.degrees for line in range(len(anchored.layout.lines))]
    for k, slot in enumerate(slots):
        if slot.kind == "clearance":
            floor = TIES.at_floor * numbers[2]
            stands = slot.axis == 2 and slot.anchor == LOW and numbers[k] < floor
            yield Reading(eye[k], TIES.floor, max(TIES.within, floor)) if stands else Reading(eye[k], TIES.equal)
        elif slot.kind == "offset":
            yield Reading(eye[k], TIES.symmetric(slot.axis), TIES.askew)
        elif slot.kind == "angle" and not slot.word.startswith("step"):
            yield Reading(eye[k], TIES.equal, TIES.degrees)
    all_faces = faces(anchored)
    for axis in range(3):
        axis_faces = [face for face in all_faces if face.element.axis == axis]
        for face, partner in combinations(axis_faces, 2):
            yield from _pair(anchored, face, partner, touching, upright)
    lengths = [k for k, slot in enumerate(slots) if slot.kind in ("size", "radius", "edge", "angle", "length")]
    for a, b in combinations(lengths, 2):
        if _comparable(anchored, slots[a], slots[b], numbers[a], numbers[b]):
            angles = slots[a].kind == "angle"
            yield Reading(eye[a] - eye[b], TIES.equal, TIES.degrees if angles else TIES.within)
            if angles:
                yield Reading(eye[a] + eye[b], TIES.equal / 2, TIES.degrees)
    across = [
        k for k, slot in enumerate(slots) if slot.kind == "clearance" and slot.axis < 2 and numbers[k] > TIES.within
    ]
    for a, b in combinations(across, 2):
        if (
            slots[a].axis != slots[b].axis
            and slots[a].line == slots[b].line
            and max(numbers[a], numbers[b]) < TIES.section
        ):
            yield Reading(eye[a] - eye[b], TIES.equal)


def _pair(
    anchored: Anchored, face: Face, partner: Face, touching: set[tuple[int, int]], upright: list[bool]
) -> Iterator[Reading]:
    """Relations of two faces of one axis."""
    first, second, axis = face.element, partner.element, face.element.axis
    keys, anchors = {first.key, second.key}, {face.anchor, partner.anchor}
    same, single = first.line == second.line, face.single and partner.single
    row, image = face.row - partner.row, face.row + partner.row
    image[axis] -= 1  # zero where one is the mirror image of the other
    points = [f.element.kind == "coordinate" for f in (face, partner)]
    middles = [f.facing == 0 and f.element.kind == "interval" for f in (face, partner)]
    lines = sorted(anchored.layout.first(line)[0] if key == "last" else line
                   for line, key in ((first.line, first.key), (second.line, second.key)))  # fmt: skip
    touches = lines[0] != lines[1] and tuple(lines) in touching
    if len(anchors) > 1:
        if anchors == {LOW, HIGH} and single and axis < 2 and not any(middles):
            if same:
                yield Reading(image, TIES.symmetric(axis), TIES.askew)
            else:
                yield Reading(image, TIES.contact if "last" in keys else TIES.equal)
    elif any(middles):
        if touches and axis < 2 and any(points) and not single and not keys & {"last", "plane", "centre"}:
            yield Reading(row, TIES.straight)
    elif same:
        if first.key and second.key:  # both ends of a rod
            yield Reading(row, TIES.straight)
            if face.anchor == MIDDLE:
                yield Reading(image, TIES.symmetric(axis), TIES.askew)
    elif keys & {"last", "plane", "centre"}:
        if "last" in keys and touches and (face.single or partner.single):
            yield Reading(row, TIES.contact)
        elif single:
            yield Reading(row, TIES.straight if lines[0] == lines[1] else TIES.equal)
    else:
        if face.anchor == MIDDLE and face.facing == -partner.facing and single:
            yield Reading(image, TIES.equal)
        if axis > 0 and not (upright[first.line] and upright[second.line]):
            return
        if touches and (face.facing * partner.facing == -1 or all(points) or bool(face.facing) != bool(partner.facing)):
            meeting = Meeting(lines[0], lines[1], axis) if face.facing * partner.facing == -1 else None
            yield Reading(row, TIES.contact, meeting=meeting)
        elif face.facing == partner.facing and (single or touches):
            yield Reading(row, TIES.equal if single else TIES.equal / 2)


def _comparable(anchored: Anchored, slot: Slot, partner: Slot, a: float, b: float) -> bool:
    """Whether two sizes, which are about equal, measure the same quantity of parts of one role, or of two sections."""
    if slot.kind != partner.kind:
        return False
    if slot.kind == "angle":
        return slot.word == partner.word
    if abs(a - b) > TIES.alike * max(a, b) + TIES.rounding:
        return False
    if slot.kind != "size":
        return True
    same = slot.line == partner.line or _role(anchored, slot.line) == _role(anchored, partner.line)
    sections = same or (_is_section(anchored, slot) and _is_section(anchored, partner))
    return (sections and max(a, b) < TIES.section) or (same and slot.axis == partner.axis)


def _is_section(anchored: Anchored, slot: Slot) -> bool:
    """Whether a size is that of a cross-section: not the longest of its part."""
    box = [anchored.layout.elements.get((slot.line, "", axis)) for axis in range(3)]
    return any(element is None or element.high - element.low > slot.value + TIES.rounding for element in box)


def _role(anchored: Anchored, line: int) -> str:
    node = anchored.layout.lines[line]
    return (node.role or node.kind) if isinstance(node, Part) else ""


def _angle(anchored: Anchored, line: int) -> float:
    node = anchored.layout.lines[line]
    return float(dict(node.keywords).get("tilt", 0.0)) if isinstance(node, Part) else 0.0  # type: ignore[arg-type]
