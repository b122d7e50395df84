"""Rows of neighbours as divisions of a box."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from shapeprog.language.ast import Group, Line, Part
from shapeprog.language.placement import AXES, BOX, axis_of, ends_of


def divided(line: Line, numbers: Mapping[str, float], *, touch: float, gap: float) -> Line:
    """A row of neighbours, or a part beside its mirror image, as the division of a box; other lines unchanged.

    Parameters
    ----------
    line
        A placed line of plain numbers.
    numbers
        The sizes of the whole.
    touch
        How far neighbours may overlap, and a row may run along another axis, in the unit of the text.
    gap
        The largest gap between neighbours, as a share of their size.
    """
    match line:
        case Group("translate", keywords, (Part("box" | "cushion") as part,), float(count)) if count > 1:
            ways = ((axis_of(word), (count - 1) * float(step)) for word, step in keywords)  # type: ignore[arg-type]
            moving = [(axis, way) for axis, way in ways if abs(way) >= touch]
        case Group("translate", _, (Group("translate") as row,)):  # rows may be nested in either order
            outer = divided(replace(line, body=row.body), numbers, touch=touch, gap=gap)
            return replace(row, body=(outer,)) if isinstance(outer, Group) and outer.kind == "divide" else line
        case Group("mirror", ((word, _),), (Part("box" | "cushion") as part,)) if axis_of(word) < 2:
            axis, count = axis_of(word), 2.0
            plane, _ = ends_of(line, "plane", axis, numbers)
            moving = [(axis, 2 * plane - sum(ends_of(part, "", axis, numbers)))]
        case _:
            return line
    given = dict(part.keywords)
    if len(moving) != 1 or not given.keys().isdisjoint({"tilt", "lean"}):
        return line
    ((axis, away),) = moving
    words, (low, high) = AXES[axis], ends_of(part, "", axis, numbers)
    size = high - low
    between = abs(away) / (count - 1) - size
    if not -touch < between <= gap * size:
        return line
    box = {word: value for word, value in given.items() if word in BOX and word not in words}
    box |= {words.low: low + min(away, 0.0), words.size: size + abs(away)}
    part = replace(part, keywords=tuple(pair for pair in part.keywords if pair[0] not in BOX))
    return Group("divide", (*box.items(), ("gap", between)), (part,), count, "xyz"[axis])
