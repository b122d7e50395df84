"""The unit of the lengths in a placed text, which a comment at its head names: ``# unit: cm``.

Angles and counts have no unit.  What the text is evaluated to is in cells.
"""

from __future__ import annotations

from dataclasses import dataclass

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.parameters import to_float32
from shapeprog.space import SPAN, Frame

METRES = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254}  # units by name, in metres

MOST_METRES, MOST_CENTIMETRES = 10.0, 300.0
"""Longest sides up to which the numbers of a file are read as metres, and as centimetres; larger ones as millimetres.
Furniture is between .2 and 3 m long, with few exceptions."""

HEAD = "unit:"  # the beginning of the comment with the unit of a text


@dataclass(frozen=True)
class Unit:
    """A unit of length: its name, one of ``METRES`` or empty if it is not known, and how many of it a cell has."""

    name: str
    per_cell: float

    def __post_init__(self) -> None:
        if self.name:
            metres(self.name)
        try:
            size = to_float32(self.per_cell)
        except (ShapeProgError, TypeError):
            size = 0.0
        if not size > 0:
            message = f"invalid cell size {self.per_cell!r} {self.name}"
            raise ShapeProgError(message, "use a positive number, such as 3.75")
        object.__setattr__(self, "per_cell", size)

    @staticmethod
    def of(frame: Frame, name: str, file: str = "") -> Unit:
        """The unit ``name`` of an object that a frame places in the grid; ``file`` is the unit of its file, assumed by
        its size if it is empty."""
        return Unit(name, frame.scale * metres(file or assumed_unit(SPAN * frame.scale)) / metres(name))


def metres(name: str) -> float:
    """The metres of a unit; a ``ShapeProgError`` if there is none of this name, or it is ``cells``, which have none."""
    if not isinstance(name, str) or name not in METRES:
        raise ShapeProgError(f"unknown unit {name!r}", did_you_mean(str(name), METRES, "use mm, cm, m or in"))
    return METRES[name]


def assumed_unit(longest: float) -> str:
    """The unit of a file that does not name it, by the longest side of the furniture in it."""
    return "m" if longest <= MOST_METRES else "cm" if longest <= MOST_CENTIMETRES else "mm"
