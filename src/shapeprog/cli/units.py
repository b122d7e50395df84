"""The unit that a command is asked to write lengths in."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shapeprog.cli.terminal import about_input, about_program
from shapeprog.errors import InputError, ShapeProgError

if TYPE_CHECKING:
    from shapeprog.language.unit import Unit
    from shapeprog.space import Frame

CELLS = "cells"

LARGE = 10.0  # metres from which furniture is more likely to be in another unit

AsUnit = Annotated[
    str | None,
    about_program("--unit", metavar="UNIT", help="Unit of lengths: mm, cm, m, in, or cells (24 = the longest side)."),
]
FileUnit = Annotated[
    str | None,
    about_input("--file-unit", metavar="UNIT", help="Unit of the input file: mm, cm, m or in. Default: m, as in glTF."),
]


def check_units(unit: str | None, file_unit: str | None, needed: bool = True) -> None:
    """Refuse units that are none before the first file is read; ``needed`` if --file-unit needs --unit."""
    from shapeprog.language.unit import metres

    for option, name in (("--unit", unit), ("--file-unit", file_unit)):
        if name is not None and (option, name) != ("--unit", CELLS):
            try:
                metres(name)
            except ShapeProgError as mistake:
                raise InputError(f"{option}: {mistake.message}", mistake.hint) from None
    if file_unit is not None and (unit == CELLS or (needed and unit is None)):
        raise InputError("--file-unit has no effect on lengths in cells", "add --unit cm")


def assumed(side: float) -> str:
    """What is assumed of the unit of an input whose longest side is ``side``."""
    message = f"The unit of the file is assumed to be m, so that the longest side is {side:.3g} m."
    return f"{message} Another unit: --file-unit mm"


def asked_unit(
    own: Unit | None, frame: Frame | None, path: Path | str, unit: str | None, file_unit: str | None
) -> Unit | None:
    """The unit that was asked for, of the object in a file, or that which its program is in already; an ``InputError``
    if the size of the object is not known."""
    from shapeprog.language.unit import Unit

    if unit is None:
        return own
    if unit == CELLS:
        return None
    if own is not None and own.name and file_unit is None:
        return own.to(unit)
    if frame is None:
        message = f"cannot write {path} in {unit}: the size of its cells is unknown"
        raise InputError(message, "infer it with --unit, or add its size at the top, as in '# unit: cm, 3.75 per cell'")
    return Unit.of(frame, unit, file_unit or "m")
