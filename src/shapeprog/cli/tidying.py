"""``shapeprog tidy``: names and expressions for the numbers of a program that somebody else wrote."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shapeprog.cli import terminal
from shapeprog.cli.terminal import about_program
from shapeprog.errors import InputError


def tidy_command(
    program: Annotated[Path, typer.Argument(metavar="PROGRAM", help="Program file: .shape .json .txt")],
    out: Annotated[Path | None, typer.Argument(metavar="OUTPUT", help="File to write: .shape .json")] = None,
    file_unit: terminal.FileUnit = None,
    price: Annotated[
        float,
        about_program(metavar="FACTOR", help="Higher: fewer free numbers, parts may move further.", min=0, max=1000),
    ] = 1.0,
    unit: terminal.AsUnit = None,
    library: terminal.WithLibrary = False,
    modules: terminal.WithLibraries = None,
    seed: terminal.Seed = 0,
    overwrite: terminal.Overwrite = False,
) -> None:
    """Replace numbers of a program that follow from others by names and expressions.

    Example: shapeprog tidy old.shape new.shape

    Nearly equal lengths become equal, nearly flush or touching faces flush or touching, nearly centred parts centred.
    The remaining numbers get names; changing one moves every part that depends on it. The whole is not shrunk to its
    parts; comments and earlier names are left out. Programs with groups or functions are refused.
    """
    from shapeprog.formats import save
    from shapeprog.formats.frames import asked_unit
    from shapeprog.inference.surface.evidence import evidence_of_program
    from shapeprog.inference.ties.tying import tie
    from shapeprog.language.ast import Function
    from shapeprog.language.free import numbers
    from shapeprog.language.readable import in_readable_unit
    from shapeprog.library import joined, with_library

    terminal.check_units(unit, file_unit, needed=True)
    libraries = terminal.load_libraries(modules, library)
    given, _ = terminal.read_program_file(program)
    terminal.check_free([out] if out else [], overwrite, program)
    if not given.size:
        raise InputError(f"{program} draws nothing", "give a program with at least one drawing statement")
    lines = [] if given.source is None else [*given.source.walk()]
    if any(isinstance(line, Function) or getattr(line, "kind", "") in ("inside", "divide") for line in lines):
        cure = "tidy is for programs of plain numbers; edit this one by hand"
        raise InputError(f"{program} has groups or functions already, which tidy would write out", cure)
    if any(getattr(line, "text", "") or getattr(line, "note", "") for line in lines):  # a comment, or a line with one
        terminal.warn(program, "its comments are left out")
    wanted = asked_unit(given, unit, file_unit or "", program)
    result = tie(given, evidence_of_program(given, seed), price=price, known=True, seed=seed)
    if libraries:
        result = with_library(result, joined(libraries))
    result = in_readable_unit(result, wanted)
    if out is not None:
        save(result, out, given.frame)
    terminal.print_program(result)
    terminal.note(f"Free numbers: {numbers(given)} before, {numbers(result)} now.")
