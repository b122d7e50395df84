"""Elements of a placed program: where its lines are along the axes of the whole.

The position of a part is given by *elements*: an interval (a box), the axis of a round part with its radius, or a
single coordinate (an end of a rod, the plane of a mirror, the last copy of a row).  Each end of an element is measured
from an anchor, the low side, the middle or the high side of the whole, see :mod:`shapeprog.inference.ties.anchors`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from shapeprog.geometry.scene import Scene
from shapeprog.geometry.separation import OrientedBoxes
from shapeprog.language.ast import Group, Keywords, Part, Point
from shapeprog.language.expression import value_at
from shapeprog.language.placement import AXES, POINTS, SIZES, coordinate_of, interval_of

LOW, MIDDLE, HIGH = 0, 1, 2  # anchors
ALIGNED = 1e-5  # cells by which coordinates may differ that are the same

Anchors = tuple[int, ...]
"""The anchors of both ends of an interval, or of a single coordinate."""

ElementKind = Literal["interval", "round", "coordinate"]

Key = tuple[int, str, int]
"""Line, key and axis of an element."""

Kind = Literal["extent", "clearance", "offset", "size", "radius", "edge", "gap", "angle", "length"]

KINDS: dict[str, Kind] = {
    "radius": "radius", "edge": "edge", "gap": "gap", "lean": "length",
    "tilt": "angle", "turn": "angle", "step": "angle",
}  # fmt: skip
"""What keywords measure that are not measured from a side."""


@dataclass(frozen=True)
class Element:
    """The coordinates of a line along one axis.

    Parameters
    ----------
    line
        Number of the line, in the order of the text.
    key
        Empty for the box of a part or a division; else ``start``, ``through``, ``end``, ``across`` (the size of a bar),
        ``plane``, ``centre`` or ``last``.
    axis
        0 left-right, 1 front-rear, 2 vertical.
    kind
        Whether it is an interval, the axis of a round part, or a single coordinate.
    low, high
        Ends from the low side of the whole, in the unit of the text; the same for a single coordinate.
    anchors
        From where they are measured.
    """

    line: int
    key: str
    axis: int
    kind: ElementKind
    low: float
    high: float
    anchors: Anchors

    @property
    def middle(self) -> float:
        """Half-way between its ends."""
        return (self.low + self.high) / 2


@dataclass(frozen=True)
class Slot:
    """One number of the text.

    Parameters
    ----------
    line, word
        Number of the line, and keyword; that of a point begins with ``start.`` or such.
    kind, axis
        The quantity that it measures, along an axis 0, 1 or 2, else -1.
    value
        Its value, in the unit of the text, or in degrees.
    """

    line: int
    word: str
    kind: Kind
    axis: int
    value: float


def ends_of(
    line: Part | Group, key: str, axis: int, numbers: Mapping[str, float], forms: Mapping[str, Any] | None = None
) -> tuple[Any, Any]:
    """The low and high coordinate of an element from the low side of the whole.

    Parameters
    ----------
    line, key, axis
        As of :class:`Element`.
    numbers
        The values of all names.
    forms
        What names stand for in the result, such as linear forms; by default their values.
    """
    keywords, values = dict(line.keywords), numbers if forms is None else forms
    pairs: Keywords = line.keywords
    if key in (*POINTS, "last"):
        argument = keywords[key]
        assert isinstance(argument, Point)
        pairs = argument.keywords
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
    edges = scene.rotation.transpose(1, 2) * scene.bounds[..., None]
    return OrientedBoxes(*(vectors.numpy()[..., ::-1] * [-1, 1, 1] for vectors in (scene.centre, edges)))
