"""Elements of a placed program: where its lines are along the axes of the whole.

The position of a part is given by *elements*: an interval (a box), the axis of a round part with its radius, or a
single coordinate (an end of a rod, the plane of a mirror, the last copy of a row).  Each end of an element is measured
from an anchor, the low side, the middle or the high side of the whole, see :mod:`shapeprog.inference.ties.anchors`.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from shapeprog.geometry import separation
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.separation import OrientedBoxes

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


def boxes_of(scene: Scene) -> OrientedBoxes:
    """The boxes around the primitives of a scene (N,), for a person in front: to the right, to the rear, upwards."""
    return OrientedBoxes(*(vectors[..., ::-1] * [-1, 1, 1] for vectors in separation.boxes_of(scene)))
