"""The unit of the lengths in a program text, where it is not the cell: the head of the text has the size of a cell.

    # unit: cm, 3.75 per cell

Positions, lengths and shifts in statements and loops are then in centimetres of the object, and so are the names and
expressions in them; angles and counts have no unit.  Everything behind the text is in cells.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from shapeprog.errors import ProgramError, ShapeProgError, did_you_mean
from shapeprog.language.parameters import shortest, to_float32
from shapeprog.language.text import Text
from shapeprog.space import SPAN, Frame

METRES = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254}  # units by name, in metres

MOST_METRES, MOST_CENTIMETRES = 10.0, 300.0
"""Longest sides up to which the numbers of a file are read as metres, and as centimetres; larger ones as millimetres.
Furniture is between .2 and 3 m long, with few exceptions."""

HEAD = "unit:"  # the beginning of the comment with the unit of a text

_FORM = "write it as # unit: cm, 3.75 per cell"
_HEADER = re.compile(rf"#[ \t]*{HEAD}[ \t]*(.*?)[ \t]*")
_SAID = re.compile(r"([^,]*?)(?:[ \t]*,[ \t]*(.*?)[ \t]*per[ \t]+cell)?")


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

    def to(self, name: str) -> Unit:
        """Another unit of the same object."""
        return Unit(name, self.per_cell * metres(self.name) / metres(name))

    @property
    def header(self) -> str:
        """The line that declares it at the head of a text."""
        return f"# {HEAD} {self.name}, {shortest(self.per_cell)} per cell"


def metres(name: str) -> float:
    """The metres of a unit; a ``ShapeProgError`` if there is none of this name."""
    if name not in METRES:
        raise ShapeProgError(f"unknown unit {name!r}", did_you_mean(name, METRES))
    return METRES[name]


def assumed_unit(longest: float) -> str:
    """The unit of a file that does not name it, by the longest side of the furniture in it."""
    return "m" if longest <= MOST_METRES else "cm" if longest <= MOST_CENTIMETRES else "mm"


def read_unit(text: Text, first: float) -> tuple[Unit | None, Sequence[str]]:
    """The unit in a comment of a text above its ``first`` row, and its lines without it; a ``ProgramError`` if it
    cannot be read, is further down, or is declared twice."""
    result: Unit | None = None
    lines = list(text.lines)
    for row, line in enumerate(text.lines, 1):
        header = _HEADER.fullmatch(line)
        if header is None:
            continue
        if result is not None or row > first:
            message = "duplicate unit" if result is not None else "the unit must be above all statements"
            raise text.at(row, 1, message, "write it in one line at the top")
        result, lines[row - 1] = _unit(text, row, header), ""
    return result, lines


def _unit(text: Text, row: int, header: re.Match[str]) -> Unit:
    def wrong(group: int, message: str, hint: str) -> ProgramError:
        return text.at(row, header.start(1) + (match.start(group) if match else 0) + 1, message, hint)

    match = _SAID.fullmatch(header[1])
    if match is None:
        raise wrong(0, "missing cell size", _FORM)
    name, size = match.groups()
    try:
        metres(name)
    except ShapeProgError as mistake:
        raise wrong(1, mistake.message, mistake.hint) from None
    if size is None:
        raise wrong(1, f"missing number of {name} per cell", _FORM)
    try:
        return Unit(name, float(size))
    except (ShapeProgError, ValueError):
        raise wrong(2, f"invalid cell size {size!r}: expected a positive number", _FORM) from None
