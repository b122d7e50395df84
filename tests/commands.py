"""What tests of the commands share: how a command ended, and a table to run it on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from shapeprog.formats import export
from shapeprog.language.parser import parse
from shapeprog.space import Frame, grid_axes

PROGRAM = parse(
    "top_rectangle(at=(10, 0, 0), thickness=2, half=(9, 12))\n"
    "for i in translate(2, by=(0, 0, 22)):\n"
    "    for j in translate(2, by=(0, 16, 0)):\n"
    "        leg(at=(-12, -9, -12), size=(22, 2, 2))\n"
)
FRAME = Frame.around([1, 2, 3], [3, 4, 4.5], grid_axes("+y", "+z"))


@dataclass(frozen=True)
class Ended:
    """The exit code of a command, and what it printed."""

    code: int
    out: str
    err: str


Run = Callable[..., Ended]


def table(path: Path) -> Path:
    """A mesh of the table, as somebody would have it on the disk."""
    return export(PROGRAM, path, FRAME, on_input=True)
