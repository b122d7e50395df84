"""``shapeprog library``: functions learned from many programs, shown and drawn."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shapeprog.cli import terminal
from shapeprog.errors import InputError, ShapeProgError

if TYPE_CHECKING:
    from shapeprog.library import Library

Sheet = Annotated[Path | None, typer.Option(metavar="FILE", help="Picture of the functions, such as library.png.")]


def learn_command(
    folders: Annotated[list[Path], typer.Argument(metavar="PROGRAMS", help="Program files, or folders of them.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="Library to write.")] = Path("library.shape"),
    most: Annotated[int, typer.Option(metavar="N", help="Maximum number of functions.", min=1, max=100)] = 12,
    sheet: Sheet = None,
    modules: terminal.With = None,
    overwrite: terminal.Overwrite = False,
) -> None:
    """Learn the functions that shorten a collection of programs most.

    Example: shapeprog library learn results --out mine.shape

    A comment above each function counts its uses and shows a typical call. Use the library with
    'shapeprog infer --with mine.shape' and 'shapeprog tidy --with mine.shape'.
    """
    from dataclasses import replace

    from shapeprog.formats.files import program_files
    from shapeprog.language.ast import Comment
    from shapeprog.library import learn, save_library

    terminal.check_free([out], overwrite)
    terminal.load_modules(modules)
    paths = [path for folder in folders for path in ([folder] if folder.is_file() else program_files(folder))]
    programs = [terminal.read_program_file(path)[0] for path in paths]
    library = learn(programs, most)
    if not library.functions:
        message = f"no function shortens {'this program' if len(programs) == 1 else f'these {len(programs)} programs'}"
        raise InputError(message, "give more programs, with similar parts")
    command = f"shapeprog library learn {' '.join(map(str, folders))} --out {out}"
    library = replace(library, source=replace(library.source, lines=(Comment(command), *library.source.lines)))
    save_library(library, out)
    terminal.say(f"wrote {out}: {len(library.functions)} functions from {len(programs)} programs")
    if sheet is not None:
        _draw(library, sheet)


def show_command(
    file: Annotated[
        Path | None, typer.Argument(metavar="LIBRARY", help="Library. Default: the one that comes with shapeprog.")
    ] = None,
    sheet: Sheet = None,
    modules: terminal.With = None,
) -> None:
    """Print a library, or draw its functions.

    Example: shapeprog library show --sheet library.png
    """
    from shapeprog.language.printer import format_source
    from shapeprog.library import load_library

    terminal.load_modules(modules)
    library = load_library(file)
    if sheet is not None:
        _draw(library, sheet)
    else:
        terminal.output().print(format_source(library.source).rstrip("\n"))


def _draw(library: Library, sheet: Path) -> None:
    """Draw a sheet of all functions, each as its typical call draws it."""
    from shapeprog.language.program import Program
    from shapeprog.view import Item, contact_sheet

    items = []
    for pattern in library.patterns:
        name = pattern.function.name
        try:
            program = Program(pattern.drawn(pattern.arguments))
        except ShapeProgError as fault:
            message = f"{name} cannot be drawn: {fault.message}"
            raise InputError(message, "show a typical call in a comment above it") from None
        used = next((line for line in library.comments[name] if line.startswith("used ")), "")
        items.append(Item(name, None, program, used.removesuffix(", such as")))
    contact_sheet(items, sheet)
    terminal.say(f"wrote {sheet}: {len(items)} functions")
