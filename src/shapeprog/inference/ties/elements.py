"""Elements of a placed program: where its lines are along the axes of the whole.

The position of a part is given by *elements*: an interval (a box), the axis of a round part with its radius, or a
single coordinate (an end of a rod, the plane of a mirror, the last copy of a row).  Each end of an element is measured
from an anchor, the low side, the middle or the high side of the whole, see :mod:`shapeprog.inference.ties.anchors`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from shapeprog.geometry.scene import Scene
from shapeprog.geometry.separation import OrientedBoxes
from shapeprog.language.ast import Group, Keywords, Part, Point
from shapeprog.language.expression import value_at
from shapeprog.language.placement import AXES, SIZES, coordinate_of, interval_of

LOW, MIDDLE, HIGH = 0, 1, 2  # anchors

Anchors = tuple[int, ...]
"""The anchors of both ends of an interval, or of a single coordinate."""

ElementKind = Literal["interval", "round", "coordinate"]

Key = tuple[int, str, int]
"""Line, key and axis of an element."""

Kind = Literal["extent", "clearance", "offset", "size", "radius", "edge", "gap", "angle", "length"]
"""What a number measures."""


class Element(NamedTuple):
    """The coordinates of a line along one axis, from the low side of the whole, in the unit of the text."""

    line: int  # its number, in the order of the text
    key: str  # empty for a box; else ``across`` for the size of a bar, a point, ``plane``, ``centre`` or ``last``
    axis: int  # 0 left-right, 1 front-rear, 2 vertical
    kind: ElementKind  # a box, the axis of a round part, or a single coordinate
    low: float
    high: float
    anchors: Anchors

    @property
    def middle(self) -> float:
        """Half-way between its ends."""
        return (self.low + self.high) / 2


class Slot(NamedTuple):
    """One number of the text."""

    line: int  # the number of its line
    word: str  # its keyword; that of a point begins with ``start.`` or such
    kind: Kind
    axis: int  # 0, 1 or 2, else -1
    value: float  # in the unit of the text, or in degrees


def ends_of(
    line: Part | Group, key: str, axis: int, numbers: Mapping[str, float], forms: Mapping[str, Any] | None = None
) -> tuple[Any, Any]:
    """The low and high coordinate of an element, see :class:`Element`, from the low side of the whole.

    Expressions are evaluated with the values of all names in ``numbers``.  With ``forms``, the result is computed from
    these objects in place of the values, for example from linear forms.
    """
    keywords, values = dict(line.keywords), numbers if forms is None else forms
    point = keywords.get(key)
    pairs: Keywords = point.keywords if isinstance(point, Point) else line.keywords
    given = {word: value_at(value, values) for word, value in pairs if word in AXES[axis]}  # type: ignore[arg-type]
    sides = 0.0, values[SIZES[axis]]
    if key in ("", "across"):
        if "radius" in keywords and axis < 2:
            radii = keywords["radius"] if isinstance(keywords["radius"], tuple) else (keywords["radius"],)
            largest = max(radii, key=lambda radius: value_at(radius, numbers))
            given[SIZES[axis]] = 2 * value_at(largest, values)  # type: ignore[arg-type]
        return interval_of(axis, given, *sides)
    start = ends_of(line, "start", axis, numbers, forms)[0] if key in ("through", "end") else None
    coordinate = coordinate_of(axis, given, *sides, start)
    return coordinate, coordinate


def boxes_of(scene: Scene) -> OrientedBoxes:
    """The boxes around the primitives of a scene (N,), for a person in front: to the right, to the rear, upwards."""
    edges = scene.rotation.transpose(-1, -2) * scene.bounds[..., None]
    return OrientedBoxes(*(vectors.numpy()[..., ::-1] * [-1, 1, 1] for vectors in (scene.centre, edges)))
