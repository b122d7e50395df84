"""The unit that a command is asked to write lengths in."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shapeprog.cli.terminal import about_input, about_program
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.formats.format import CELLS

if TYPE_CHECKING:
    from shapeprog.language.unit import Unit
    from shapeprog.space import Frame

AsUnit = Annotated[
    str | None,
    about_program(
        "--unit", metavar="UNIT", help="mm, cm, m, in, or cells (24 = the longest side). Default: that of the input."
    ),
]
FileUnit = Annotated[
    str | None,
    about_input("--file-unit", metavar="UNIT", help="Unit of the input file: mm, cm, m or in. Default: m, up to 10 m."),
]


def check_units(unit: str | None, file_unit: str | None, needed: bool = False) -> None:
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


def assumed(frame: Frame, unit: str = "") -> str:
    """What is assumed of the unit of an input with a frame; ``unit`` where it does not follow from its size."""
    from shapeprog.language.unit import assumed_unit, metres
    from shapeprog.space import SPAN

    longest = SPAN * frame.scale
    unit = unit or assumed_unit(longest)
    message = f"The unit of the file is assumed to be {unit}, so that the longest side is"
    return f"{message} {longest * metres(unit):.3g} m. Another unit: --file-unit {'cm' if unit == 'mm' else 'mm'}"


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
        raise InputError(message, "infer it with --unit, or name its unit at the top, as in '# unit: cm'")
    return Unit.of(frame, unit, file_unit or "")
