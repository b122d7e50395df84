"""``shapeprog tidy``: names and expressions for the numbers of a program that somebody else wrote."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shapeprog.cli import terminal
from shapeprog.cli.units import AsUnit, FileUnit, asked_unit, check_units
from shapeprog.errors import InputError


def tidy_command(
    program: Annotated[Path, typer.Argument(help="A program: .shape, .json or .notation.")],
    out: Annotated[
        Path | None, typer.Argument(help="Where to write it, as .shape or .json; else it is printed.")
    ] = None,
    price: Annotated[
        float, typer.Option(help="What a number is worth, times the usual: how far parts may move.", min=0, max=1000)
    ] = 1.0,
    seed: terminal.Seed = 0,
    library: terminal.WithLibrary = False,
    modules: terminal.WithLibraries = None,
    unit: AsUnit = None,
    file_unit: FileUnit = None,
) -> None:
    """Tie the numbers of a program: lengths that are nearly equal, faces that are flush or meet, parts in the middle.

    What is left free gets names, so that a change of one number moves all that belongs to it.
    """
    from shapeprog.formats import load_with_frame, save
    from shapeprog.inference.evidence import evidence_of_program
    from shapeprog.inference.readable import in_readable_unit
    from shapeprog.inference.ties.tying import tie
    from shapeprog.language.free import numbers
    from shapeprog.language.merging import merged
    from shapeprog.library import with_library

    check_units(unit, file_unit)
    libraries = terminal.load_libraries(modules, library)
    given, frame = load_with_frame(program)
    if not given.size:
        raise InputError(f"{program} draws nothing", "name a program that draws something")
    wanted = asked_unit(given.unit, frame, program, unit, file_unit)
    tied = tie(given, evidence_of_program(given, seed), price=price, known=True, seed=seed)
    found = tied.program
    for each in libraries:
        found = with_library(found, each)
    found = in_readable_unit(merged(found), wanted, seed)
    if out is not None:
        save(found, out, frame)
    terminal.print_program(terminal.output(), found)
    before = numbers(given)
    terminal.errors().print(f"{numbers(found)} numbers are free; {before} were.", style="dim", markup=False)
