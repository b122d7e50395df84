"""The unit of the lengths in a program text, where it is not the cell: the head of the text says how large a cell is.

    # unit: cm, 3.75 per cell

Positions, lengths and shifts in statements and loops are then in centimetres of the object, and so are the names and
expressions that they are written with; angles and counts are what they are.  Everything behind the text is in cells.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from shapeprog.errors import ProgramError, ShapeProgError, did_you_mean
from shapeprog.language.parameters import shortest, to_float32
from shapeprog.language.place import Text
from shapeprog.space import Frame

METRES = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254}
"""Units by name, and what they are in metres."""

HEAD = "unit:"
"""What the comment begins with that tells the unit of a text."""

_FORM = "write it as # unit: cm, 3.75 per cell"
_HEADER = re.compile(rf"#[ \t]*{HEAD}[ \t]*(.*?)[ \t]*")
_SAID = re.compile(r"([^,]*?)(?:[ \t]*,[ \t]*(.*?)[ \t]*per[ \t]+cell)?")


@dataclass(frozen=True)
class Unit:
    """A unit of length: its name, one of ``METRES``, and how many of it a cell has, exact in float32."""

    name: str
    per_cell: float

    def __post_init__(self) -> None:
        metres(self.name)
        try:
            size = to_float32(self.per_cell)
        except (ShapeProgError, TypeError):
            size = 0.0
        if not size > 0:
            said = f"invalid cell size {self.per_cell!r} {self.name}"
            raise ShapeProgError(said, "use a positive number, such as 3.75")
        object.__setattr__(self, "per_cell", size)

    @staticmethod
    def of(frame: Frame, name: str, file: str = "m") -> Unit:
        """The unit ``name`` of an object that lies in the grid as a frame says; ``file`` is what its file counts in."""
        return Unit(name, frame.scale * metres(file) / metres(name))

    def to(self, name: str) -> Unit:
        """Another unit of the same object."""
        return Unit(name, self.per_cell * metres(self.name) / metres(name))

    @property
    def header(self) -> str:
        """The line that tells it at the head of a text."""
        return f"# {HEAD} {self.name}, {shortest(self.per_cell)} per cell"


def metres(name: str) -> float:
    """What a unit is in metres; a ``ShapeProgError`` if there is none of this name."""
    if name not in METRES:
        raise ShapeProgError(f"unknown unit {name!r}", did_you_mean(name, METRES))
    return METRES[name]


def read_unit(text: Text, first: float) -> tuple[Unit | None, Sequence[str]]:
    """The unit that a text tells above its ``first`` row, and its lines without that.

    Raises
    ------
    ProgramError
        If it cannot be read, stands further down, or is told twice.
    """
    found: Unit | None = None
    lines = list(text.lines)
    for row, line in enumerate(text.lines, 1):
        header = _HEADER.fullmatch(line)
        if header is None:
            continue
        if found is not None or row > first:
            said = "duplicate unit" if found is not None else "the unit must be above all statements"
            raise text.at(row, 1, said, "write it in one line at the top")
        found, lines[row - 1] = _unit(text, row, header), ""
    return found, lines


def _unit(text: Text, row: int, header: re.Match[str]) -> Unit:
    def wrong(group: int, message: str, hint: str) -> ProgramError:
        return text.at(row, header.start(1) + (said.start(group) if said else 0) + 1, message, hint)

    said = _SAID.fullmatch(header[1])
    if said is None:
        raise wrong(0, "missing cell size", _FORM)
    name, size = said.groups()
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
