"""The unit that a command is asked to write lengths in."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shapeprog.errors import InputError, ShapeProgError

if TYPE_CHECKING:
    from shapeprog.language.unit import Unit
    from shapeprog.space import Frame

CELLS = "cells"

AsUnit = Annotated[
    str | None,
    typer.Option(
        "--unit",
        help="Write lengths in mm, cm, m or in of the object, with the decimals that a person expects, or in cells: "
        "24 along its longest side. By default cells, or what the program is in.",
    ),
]
FileUnit = Annotated[
    str | None,
    typer.Option(
        "--file-unit", help="What one unit of the input file is: mm, cm, m or in; by default a metre, as in glTF."
    ),
]


def check_units(unit: str | None, file_unit: str | None) -> None:
    """Refuse units that are none before the first file is read."""
    from shapeprog.language.unit import metres

    for option, name in (("--unit", unit), ("--file-unit", file_unit)):
        if name is not None and (option, name) != ("--unit", CELLS):
            try:
                metres(name)
            except ShapeProgError as mistake:
                raise InputError(f"{option}: {mistake.message}", mistake.hint) from None
    if file_unit is not None and unit in (None, CELLS):
        raise InputError("--file-unit changes nothing where lengths are in cells", "say --unit cm as well")


def asked_unit(
    own: Unit | None, frame: Frame | None, path: Path | str, unit: str | None, file_unit: str | None
) -> Unit | None:
    """The unit that was asked for, of the object in a file, or that which its program is in already.

    Raises
    ------
    InputError
        If the size of the object is not known.
    """
    from shapeprog.language.unit import Unit

    if unit is None:
        return own
    if unit == CELLS:
        return None
    if own is not None and file_unit is None:
        return own.to(unit)
    if frame is None:
        said = f"{path} does not say how large its cells are, so that nothing is known of it in {unit}"
        raise InputError(said, "infer it with --unit, or put its frame at its top: see 'shapeprog export --help'")
    return Unit.of(frame, unit, file_unit or "m")
