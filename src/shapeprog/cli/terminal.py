"""What commands say: results on the standard output, progress and errors beside it."""

from __future__ import annotations

import functools
import io
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from shapeprog.cli import interruption
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.files import output_error

if TYPE_CHECKING:
    from rich.console import Console

    from shapeprog.language.program import Program
    from shapeprog.library import Library

debugging = False
"""Whether errors show their traceback."""

WIDTH = 120
"""Columns of a table where the output is no terminal."""

MISTAKE = 2

Command = TypeVar("Command", bound=Callable[..., None])

With = Annotated[
    list[Path] | None,
    typer.Option("--with", help="A Python module that declares statements of your own; may be given again."),
]

WithLibraries = Annotated[
    list[Path] | None,
    typer.Option(
        "--with",
        help="A Python module that declares statements of your own, or a .shape file of functions to write programs "
        "with; may be given again.",
    ),
]

WithLibrary = Annotated[
    bool, typer.Option("--library", help="Write the program with the functions that ship: see 'library show'.")
]

Changes = Annotated[
    list[str] | None,
    typer.Option("--set", help="A name of the program and its number: seat=11 or 'width*=1.2'; several may follow."),
]

Seed = Annotated[int, typer.Option(help="Seed of everything random.", min=0, max=2**63 - 1)]
Up = Annotated[
    str | None,
    typer.Option(help="World axis that points up, such as +y; auto: how it stands best; by default the format's."),
]
Front = Annotated[str | None, typer.Option(help="World axis that the front faces, such as -z.")]


class Interrupted(KeyboardInterrupt):
    """An interruption by the user, with a sentence on what was kept."""


def guarded(command: Command) -> Command:
    """The command with every mistake told in words: no traceback, and an exit code that scripts can rely on."""

    @functools.wraps(command)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            with interruption.tidied():
                command(*args, **kwargs)
                sys.stdout.flush()
        except ShapeProgError as error:
            if debugging:
                raise
            complain(error)
            raise typer.Exit(MISTAKE) from None
        except KeyboardInterrupt as stop:
            kept = str(stop) if isinstance(stop, Interrupted) else "nothing was left half written"
            errors().print(f"Interrupted; {kept}.", style="yellow", markup=False, highlight=False)
            raise typer.Exit(interruption.INTERRUPTED) from None
        except BrokenPipeError:
            # The reader of a pipe has gone; keep Python from complaining about it at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(0) from None
        except OSError as error:
            if debugging:
                raise
            complain(output_error(Path(error.filename or "the standard output"), error))
            raise typer.Exit(MISTAKE) from None

    return run  # type: ignore[return-value]


def write_anything() -> None:
    """Let both outputs show letters that the terminal does not know as escapes, such as ``\\xb7``, not as an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def output() -> Console:
    """The standard output; lines are not wrapped where it is a file or a pipe."""
    from rich.console import Console

    return Console(highlight=False, markup=False, soft_wrap=True, width=None if sys.stdout.isatty() else WIDTH)


def errors() -> Console:
    """The standard error, for progress and complaints."""
    from rich.console import Console

    return Console(stderr=True, highlight=False, soft_wrap=True)


def complain(error: ShapeProgError) -> None:
    """Print an error: the cause in red, the cure below it."""
    text = str(error)
    if error.hint:
        text = text.removesuffix(f"\n  hint: {error.hint}")
    console = errors()
    console.print("error: ", style="bold red", end="")
    console.print(text, style="red", markup=False)
    if error.hint:
        console.print(f"hint: {error.hint}", markup=False)


def at(path: Path, error: ShapeProgError) -> ShapeProgError:
    """The error with the file that it is about in front, unless it names it already."""
    named = str(path) in error.message or path.name in error.message
    return error if named else ShapeProgError(f"{path}: {error.message}", error.hint)


def fault(what: str, error: Exception) -> ShapeProgError:
    """The error for what the user cannot mend, so that a command goes on with the next file; --debug stops at it.

    Raises
    ------
    Exception
        ``error`` itself, where errors are to show their traceback.
    """
    if debugging:
        raise error
    return ShapeProgError(f"{what}: a fault of shapeprog, not of the file", "run it again with --debug and report it")


def check_axes(up: str | None, front: str | None) -> None:
    """Refuse axes that are none before the first file is read.

    Raises
    ------
    InputError
        If a name is not an axis, or both lie on one line.
    """
    from shapeprog.data.orientation import axes_of

    axes_of(Path("--up and --front"), up, front)


def load_modules(modules: list[Path] | None) -> None:
    """Declare the statements of a user's modules."""
    if not modules:
        return
    from shapeprog.formats.plugins import load_statements

    for module in modules:
        load_statements(module)


def load_libraries(files: list[Path] | None, shipped: bool) -> list[Library]:
    """The libraries among what was given with ``--with``, then the one that ships; modules are loaded as well."""
    from shapeprog.library import load_library

    given = files or []
    load_modules([file for file in given if file.suffix.lower() != ".shape"])
    return [*(load_library(f) for f in given if f.suffix.lower() == ".shape"), *([load_library()] if shipped else [])]


def read_program_file(path: Path, changes: Sequence[str] | None = None) -> tuple[Program, Any]:
    """The program and frame of a file, with other numbers for its names as ``--set`` has them.

    Raises
    ------
    InputError
        Where the file holds a shape instead, with the command that makes a program of it.
    """
    from shapeprog.cli.changes import changed, vanished
    from shapeprog.formats import load_with_frame, program_suffixes

    try:
        program, frame = load_with_frame(path)
        if not changes:
            return program, frame
        other = changed(program, changes)
        if lost := vanished(program, other):
            said = f"With these numbers parts have no volume and are left out: {', '.join(dict.fromkeys(lost))}."
            errors().print(said, style="yellow", markup=False)
        return other, frame
    except InputError as error:
        if path.is_file() and path.suffix.lower() not in program_suffixes():
            raise InputError(error.message, f"make a program of it first: shapeprog infer {path}") from None
        raise


def print_program(console: Console, program: Program) -> None:
    """Print a program with each statement in its colour, numbers rounded for reading."""
    from rich.text import Text

    from shapeprog.formats.colours import hexadecimal
    from shapeprog.view.listing import listing, parted

    for line in listing(program):
        before, word, after = parted(line)
        style = "dim" if line.statement is None else f"bold {hexadecimal(line.statement)}"
        console.print(Text.assemble((before, "dim"), (word, style), after))


def plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers fit for JSON: those that are not finite are left out."""
    import math

    return {key: value for key, value in values.items() if not isinstance(value, float) or math.isfinite(value)}


def print_json(content: Any) -> None:
    """Print one JSON value on one line."""
    print(json.dumps(content, allow_nan=False), flush=True)
