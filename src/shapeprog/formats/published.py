"""Defaults for the numbers that the printer published with the paper omits, each with a note.

It prints a cross arm and a turned line alike as ``draw('Base', 'Line', P1=.., P2=..)`` without thickness, quarter turn
or radius, the tilt of a back as an angle in whole degrees, and a rotation without its step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from shapeprog.errors import ShapeProgError
from shapeprog.language.parameters import shortest, to_float32

THICKNESS = 1.0
"""Default thickness of a cross arm, in cells."""

RADIUS = 1.0
"""Default radius of a line, in cells; the published data have no other."""

STEP = 1.0
"""Default quarter turns from one copy of a rotation to the next."""

COUNT = ""
"""The group that holds the count of a loop; no name of the notation can be empty."""

Groups = dict[str, list[float]]
"""Numbers by the name of their group."""


def is_published(words: Sequence[str], groups: Groups) -> bool:
    """Whether a ``draw`` or ``for`` has a form that only the published printer writes."""
    first, *following = [*words, ""]
    if set(groups) == {"P1", "P2"}:
        return first in ("Base", "Connect") and following == ["Line", ""]
    return "theta" in groups and (words == ["Rot"] or words == ["Back", "Cub"])


def restored(words: Sequence[str], groups: Groups) -> tuple[str, tuple[float, ...], str]:
    """Statement name, values and a note on the defaults used; a ``ShapeProgError`` if the text is not that of the
    published printer, or a number is too large."""
    for number in (number for numbers in groups.values() for number in numbers):
        to_float32(number)
    if words == ["Rot"]:
        count = groups[COUNT]
        if set(groups) - {COUNT, "theta", "axis"}:
            raise ShapeProgError("a rotation takes a step, or theta and axis", "write for(i<4, 'Rot', step=1)")
        note = f"the step of a rotation was not printed; taken as {shortest(STEP)} quarter turn"
        return "rotate", (*count, STEP), note
    if set(groups) == {"P1", "P2"}:
        start, end = groups["P1"], groups["P2"]
        if len(start) != 3 or len(end) != 3:
            raise ShapeProgError("both ends of a line take 3 numbers", "write P1=(_, _, _), P2=(_, _, _)")
        along = [b - a for a, b in zip(start, end, strict=True)]
        if words[0] == "Base" and along[0] == 0 and 0 in along[1:]:
            return _arm(start, along)
        note = f"the radius of a line was not printed; taken as {shortest(RADIUS)}"
        return "line", (*start, *end, RADIUS), note
    if words == ["Back", "Cub"] and set(groups) == {"P", "G", "theta"}:
        extent, (angle, *more) = groups["G"], groups["theta"]
        if len(groups["P"]) != 3 or len(extent) != 3 or more:
            raise ShapeProgError("a back takes P of 3 numbers, G of 3 and one angle", "write P=(_, _, _), G=(_, _, _)")
        tilt = _tilt(extent[0], angle)
        note = f"the tilt of a back was printed as {shortest(angle)} degrees; taken as {shortest(tilt)} cells"
        return "back", (*groups["P"], *extent, tilt), note
    raise ShapeProgError(f"the published printer does not write {', '.join(groups)} here", "write P=.. and G=..")


def _arm(start: list[float], along: list[float]) -> tuple[str, tuple[float, ...], str]:
    _, depth, side = along
    quarter = 1 if depth > 0 else 3 if depth < 0 else 2 if side > 0 else 0
    length = max(abs(depth), abs(side))
    note = (
        f"the thickness of a cross arm was not printed; taken as {shortest(THICKNESS)}"
        " (a line on the floor of a rotation is printed alike)"
    )
    return "base_cross", (*start, THICKNESS, length, float(quarter)), note


def _tilt(height: float, angle: float) -> float:
    """The smallest whole tilt that the printer, which cuts off fractions of a degree, writes as this angle."""
    if not height:
        return 0.0
    exact = height * math.tan(math.radians(angle))
    candidates = [round(exact) + offset for offset in range(-2, 3)]
    fitting = [tilt for tilt in candidates if int(math.degrees(math.atan(tilt / height))) == int(angle)]
    return float(min(fitting, key=abs)) if fitting else exact
