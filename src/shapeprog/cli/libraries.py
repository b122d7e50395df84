"""``shapeprog library``: functions learned from many programs, shown and drawn."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shapeprog.cli import terminal
from shapeprog.errors import InputError, ShapeProgError

if TYPE_CHECKING:
    from shapeprog.library import Library
    from shapeprog.view import Item

Sheet = Annotated[Path | None, typer.Option(help="A picture of its functions, such as library.png.")]


def learn_command(
    folders: Annotated[list[Path], typer.Argument(help="Folders of programs, best with ties; or program files.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Where to write the library.")] = Path("library.shape"),
    most: Annotated[int, typer.Option(help="Most functions.", min=1, max=100)] = 12,
    sheet: Sheet = None,
    modules: terminal.With = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Learn the functions that shorten many programs most, with parameters named by what they measure.

    A comment above each tells how often it is used, and shows a typical call. Programs are written with a library by
    infer and tidy: --library for the one that ships, --with library.shape for your own.
    """
    from dataclasses import replace

    from shapeprog.language.source import Comment, Source
    from shapeprog.library import learn, save_library

    terminal.load_modules(modules)
    paths = [path for folder in folders for path in _files(folder)]
    programs = [terminal.read_program_file(path)[0] for path in paths]
    library = learn(programs, most)
    if not library.functions:
        said = f"no function is worth its lines in {len(programs)} {'program' if len(programs) == 1 else 'programs'}"
        raise InputError(said, "give more programs, of furniture that is alike in some part")
    command = f"shapeprog library learn {' '.join(map(str, folders))} --out {out}"
    library = replace(library, source=Source((Comment(command), *library.source.lines)))
    save_library(library, out)
    _draw(library, sheet)
    if not quiet:
        for path in (out, *([sheet] if sheet else [])):
            terminal.output().print(f"wrote {path}: {len(library.functions)} functions from {len(programs)} programs")


def show_command(
    file: Annotated[Path | None, typer.Argument(help="A library; without it the one that ships.")] = None,
    sheet: Sheet = None,
    modules: terminal.With = None,
) -> None:
    """Print a library, or draw a picture of it."""
    from shapeprog.language.text import format_source
    from shapeprog.library import load_library

    terminal.load_modules(modules)
    library = load_library(file)
    _draw(library, sheet)
    if sheet:
        terminal.output().print(f"wrote {sheet}: {len(library.functions)} functions")
    else:
        terminal.output().print(format_source(library.source).rstrip("\n"))


def _files(folder: Path) -> list[Path]:
    from shapeprog.cli.writing import program_files

    return [folder] if folder.is_file() else program_files(folder)


def _draw(library: Library, sheet: Path | None) -> None:
    from shapeprog.view import contact_sheet

    if sheet is not None:
        contact_sheet(list(_items(library)), sheet)


def _items(library: Library) -> Iterator[Item]:
    """Each function as its typical call draws it."""
    from shapeprog.language.evaluation import evaluated
    from shapeprog.language.source import Call, Source
    from shapeprog.view import Item

    for pattern in library.patterns:
        function = pattern.function
        spare = Call(function.name, tuple((name, pattern.arguments[name]) for name, _ in function.parameters))
        try:
            program = evaluated(Source((*pattern.others, function, pattern.example or spare)))
        except ShapeProgError as fault:
            raise InputError(
                f"{function.name} cannot be drawn: {fault.message}", "show a typical call in a comment above it"
            ) from None
        used = next((line for line in library.comments[function.name] if line.startswith("used ")), "")
        yield Item(function.name, None, program, used.removesuffix(", such as"))
