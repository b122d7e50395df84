"""The keywords by which placed parts lie in a box, and the tables of placed solids, loops and groups.

Seen from the front, x points right, y to the rear and z up.  The whole stands on z = 0, centred at x = 0, y = 0.
The grid has the axes up, depth and *left*: ``up = z + floor``, ``depth = y``, ``side = -x``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from shapeprog.language.ast import Group, Keywords, Part, Point
from shapeprog.language.expression import value_at


class AxisWords(NamedTuple):
    """The keywords of one axis: its low and high side, the size along it, and the offset of the centre."""

    low: str
    high: str
    size: str
    offset: str


AXES = (
    AxisWords("left", "right", "width", "x"),
    AxisWords("front", "rear", "depth", "y"),
    AxisWords("bottom", "top", "height", "z"),
)
"""Left-right, front-rear, vertical."""

SIZES = tuple(words.size for words in AXES)
BOX = tuple(word for words in AXES for word in words)  # keywords of a box
POINT = tuple(word for word in BOX if word not in SIZES)  # keywords of a point
POINTS = ("start", "through", "end")  # keywords of a solid that take a point


class Needs(NamedTuple):
    """Keywords that a solid needs, and keywords that it may have, beside those of its box."""

    required: tuple[str, ...]
    optional: tuple[str, ...]


IN_BOX = {
    "box": Needs((), ("tilt", "lean")),
    "cushion": Needs(("edge",), ("tilt",)),
    "cylinder": Needs((), ("radius", "tilt")),
    "rod": Needs((), ("radius", "tilt")),
    "taper": Needs(("radius",), ("tilt",)),
}
"""Solids that are placed by a box."""

BETWEEN = {
    "bar": Needs(("start", "end"), (*SIZES, "turn")),
    "rod": Needs(("start", "end", "radius"), ()),
    "taper": Needs(("start", "end", "radius"), ()),
    "bent_rod": Needs((*POINTS, "radius"), ()),
}
"""Solids between points; ``rod`` and ``taper`` are these if they have a ``start``."""

ROUND = ("cylinder", "rod", "taper")  # solids that stand upright and round in a box
ROUND_ROLES = ("top_circle", "base_circle", "support_cylinder", "line")  # roles of round parts, which are never a box


class GroupWords(NamedTuple):
    """Keywords of a loop or group, how many arguments stand before them, and an example."""

    keywords: tuple[str, ...]
    arguments: int
    example: str


GROUPS = {
    "inside": GroupWords((*BOX, "tilt"), 0, "with inside(left=..., width=...):"),
    "divide": GroupWords((*BOX, "gap", "tilt"), 2, "for _ in divide(3, z, gap=0.5):"),
    "mirror": GroupWords(POINT, 0, "for _ in mirror(x=0):"),
    "rotate": GroupWords((*POINT[:6], "step"), 1, "for _ in rotate(5):"),
    "translate": GroupWords(("x", "y", "z"), 1, "for _ in translate(3, z=20):"),
    "row": GroupWords(("last",), 1, "for _ in row(3, last=at(top=2)):"),
}

RESERVED = frozenset([*BOX, *IN_BOX, *BETWEEN, *GROUPS, *POINTS, "at"])
"""Words that are never names, beside roles."""

BOX_IN_CELLS = ("bottom", "front", "left", "height", "depth", "width")
"""Parameters in cells that are the box of a function: its low corner along up, depth and left, and its extents."""

ATTRIBUTES = frozenset(["radius", "edge", "tilt", "lean", "turn", "step", "gap"])
"""Keywords that may be names of numbers, but not of functions."""

MOST_SOLIDS = 1 << 17  # most solids, and most evaluated bodies
LEAST_ALONG = 0.25  # least share of its length that a bar covers along the axis that its two sizes leave open


def axis_of(word: str) -> int:
    """The axis of a keyword of a box: 0, 1 or 2."""
    return next(axis for axis, words in enumerate(AXES) if word in words)


def is_sized(keywords: Iterable[str], axis: int) -> bool:
    """Whether keywords determine the size along an axis."""
    words, (low, high, size, _) = set(keywords), AXES[axis]
    return size in words or {low, high} <= words


def interval_of(axis: int, given: Mapping[str, Any], low: Any, high: Any) -> tuple[Any, Any]:
    """Where a part lies along an axis of a box, from one coordinate to another.

    Parameters
    ----------
    axis
        0 left-right, 1 front-rear, 2 vertical.
    given
        The values of its keywords: numbers, tensors or linear forms.
    low, high
        The sides of the box.
    """
    words = AXES[axis]
    if words.size not in given:
        return low + given.get(words.low, 0.0), high - given.get(words.high, 0.0)
    size = given[words.size]
    if words.low in given:
        low = low + given[words.low]
    elif words.high in given:
        low = high - given[words.high] - size
    elif words.offset in given or axis < 2:
        low = (low + high - size) / 2 + given.get(words.offset, 0.0)
    return low, low + size


def coordinate_of(axis: int, given: Mapping[str, Any], low: Any, high: Any, default: Any = None) -> Any:
    """The coordinate of a point along an axis of a box; without a keyword the default, by default the middle of the
    bottom."""
    words = AXES[axis]
    if words.low in given:
        return low + given[words.low]
    if words.high in given:
        return high - given[words.high]
    if words.offset in given:
        return (low + high) / 2 + given[words.offset]
    return default if default is not None else low if axis == 2 else (low + high) / 2


def ends_of(
    line: Part | Group, key: str, axis: int, numbers: Mapping[str, float], forms: Mapping[str, Any] | None = None
) -> tuple[Any, Any]:
    """The low and high coordinate along an axis of what a line places in the whole, from the low side of that.

    Parameters
    ----------
    line
        A part or loop.
    key
        A keyword that takes a point; ``plane`` or ``centre`` of a loop; ``across`` for the size of a bar; else empty,
        for the box of the part.
    axis
        0 left-right, 1 front-rear, 2 vertical.
    numbers
        The values of all names, among them the sizes of the whole.
    forms
        What the result is computed from in place of the values, for example linear forms.
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
