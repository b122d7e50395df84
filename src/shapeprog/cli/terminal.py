"""Output of the commands: results on the standard output, progress and messages on the standard error."""

from __future__ import annotations

import functools
import inspect
import io
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import typer

from shapeprog.errors import InputError, ShapeProgError
from shapeprog.files import output_error

if TYPE_CHECKING:
    from rich.console import Console

    from shapeprog.language.program import Program
    from shapeprog.library import Library

debugging = False  # whether errors show their traceback
WIDTH = 120  # columns of a table where the output is no terminal
FAILED, MISTAKE, INTERRUPTED = 1, 2, 130  # exit codes

Command = TypeVar("Command", bound=Callable[..., None])


def _checked_seed(seed: int) -> int:
    if seed >= 1 << 63:  # as a maximum of the option it would be printed in every help
        raise typer.BadParameter(f"{seed} is not below 2^63.")
    return seed


about_input = functools.partial(typer.Option, rich_help_panel="Input")
"""An option under this heading of the help, as the next ones."""
about_program = functools.partial(typer.Option, rich_help_panel="Program")
about_search = functools.partial(typer.Option, rich_help_panel="Search")

With = Annotated[
    list[Path] | None, about_program("--with", metavar="FILE", help="Python file with your own statements; repeatable.")
]
WithLibraries = Annotated[
    list[Path] | None,
    about_program("--with", metavar="FILE", help="Your own statements (.py) or functions (.shape); repeatable."),
]
WithLibrary = Annotated[
    bool, about_program("--library", help="Use the functions that come with shapeprog (list: library show).")
]
Changes = Annotated[
    list[str] | None,
    about_program(
        "--set", metavar="NAME=NUMBER", help="Change numbers: --set seat_height=11 'width*=1.2' (also += -= /=)."
    ),
]
Up = Annotated[
    str | None,
    about_input(metavar="AXIS", help="Axis that points up, such as +y, or auto. Default: that of the file format."),
]
Front = Annotated[str | None, about_input(metavar="AXIS", help="Axis that the front faces, such as -z.")]
Seed = Annotated[int, typer.Option(metavar="N", help="Seed of all random numbers.", min=0, callback=_checked_seed)]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]


class Interrupted(KeyboardInterrupt):
    """An interruption by the user, with a sentence on the results that are kept."""


def guarded(command: Command) -> Command:
    """The command with errors as messages instead of tracebacks, and with defined exit codes."""

    @functools.wraps(command)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
            sys.stdout.flush()
        except KeyboardInterrupt as stop:
            note = str(stop) if isinstance(stop, Interrupted) else "no file is incomplete"
            errors().print(f"Interrupted; {note}.", style="yellow", markup=False, highlight=False)
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError:
            # The reader of a pipe has gone; keep Python from complaining about it at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(0) from None
        except (ShapeProgError, ModuleNotFoundError, OSError) as error:
            if debugging:
                raise
            complain(_explained(error))
            raise typer.Exit(MISTAKE) from None

    return run  # type: ignore[return-value]


def _explained(error: Exception) -> ShapeProgError:
    """The message for an error; raises the error itself if it is a fault of the package."""
    if isinstance(error, ShapeProgError):
        return error
    if isinstance(error, OSError):
        return output_error(Path(error.filename or "the standard output"), error)
    name = (getattr(error, "name", None) or "").partition(".")[0]
    if name in ("", "shapeprog"):
        raise error
    return InputError(f"this needs the package {name}, which is not installed", f"pip install {name}")


def with_options(run: Callable[[Any], None], kind: type[Any]) -> Callable[..., None]:
    """The command that calls ``run`` with an instance of a dataclass, with an argument or option for each field."""

    @functools.wraps(run)
    def command(**values: Any) -> None:
        run(kind(**values))

    hints, keyword = get_type_hints(kind, include_extras=True), inspect.Parameter.KEYWORD_ONLY
    defaults = [(f.name, inspect.Parameter.empty if f.default is MISSING else f.default) for f in fields(kind)]
    options = [inspect.Parameter(n, keyword, default=default, annotation=hints[n]) for n, default in defaults]
    command.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]
    command.__annotations__ = {option.name: option.annotation for option in options}
    return command


def write_anything() -> None:
    """Let both outputs print letters that the terminal cannot encode as escapes, such as ``\\xb7``, not as an error."""
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


@contextmanager
def progress(shown: bool) -> Iterator[Callable[[str], Callable[[str, float], None]]]:
    """A bar for one thing after another: a function of a name, which returns one of the stage and the share done."""
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    text = TextColumn("{task.description}", markup=False)
    columns = SpinnerColumn("line"), text, BarColumn(24), TimeElapsedColumn()
    with Progress(*columns, console=errors(), transient=True, disable=not shown) as bar:
        task = bar.add_task("reading", total=1.0)

        def begin(name: str) -> Callable[[str, float], None]:
            bar.reset(task, description=name, total=1.0)
            return lambda stage, share: bar.update(task, completed=share, description=f"{name}: {stage}")

        yield begin


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


def finish(failures: Sequence[ShapeProgError]) -> None:
    """Print errors, and end with the exit code of a failure if there are some."""
    for error in failures:
        complain(error)
    if failures:
        raise typer.Exit(FAILED)


def at(path: Path, error: ShapeProgError) -> ShapeProgError:
    """The error with the file that it is about in front, unless it names it already."""
    named = str(path) in error.message or path.name in error.message
    return error if named else ShapeProgError(f"{path}: {error.message}", error.hint)


def fault(what: str, error: Exception) -> ShapeProgError:
    """The message for an internal error, so that a command continues with the next file; --debug stops at it.

    Raises
    ------
    Exception
        ``error`` itself, where errors are to show their traceback.
    """
    if debugging:
        raise error
    return ShapeProgError(f"{what}: internal error", "run again with --debug and report the traceback")


def check_axes(up: str | None, front: str | None) -> None:
    """Refuse axes that are none before the first file is read; an ``InputError`` if a name is not an axis, or both lie
    on one line."""
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
    """The libraries given with ``--with``, then the built-in one if ``shipped``; modules are loaded as well."""
    from shapeprog.library import load_library

    paths = files or []
    load_modules([file for file in paths if file.suffix.lower() != ".shape"])
    return [*(load_library(f) for f in paths if f.suffix.lower() == ".shape"), *([load_library()] if shipped else [])]


def read_program_file(path: Path, changes: Sequence[str] | None = None) -> tuple[Program, Any]:
    """The program and frame of a file, with other numbers for its names as ``--set`` has them; prints its warnings.

    Raises
    ------
    InputError
        Where the file holds a shape instead, with the command that makes a program of it.
    """
    from shapeprog.cli.changes import changed
    from shapeprog.formats import load_with_frame, program_suffixes

    try:
        program, frame = load_with_frame(path)
        warn(path, program)
        return changed(program, changes or ()), frame
    except InputError as error:
        if path.is_file() and path.suffix.lower() not in program_suffixes():
            raise InputError(error.message, f"infer a program first: shapeprog infer {path}") from None
        raise


def warn(path: Path, program: Program) -> None:
    """Print what is legal in the program of a file and probably a mistake."""
    for warning in program.source.warnings if program.source else ():
        errors().print(f"warning: {path}, {warning}", style="yellow", markup=False)


def print_program(console: Console, program: Program) -> None:
    """Print a program with each statement in its colour, numbers rounded for reading."""
    from rich.text import Text

    from shapeprog.formats.colours import hexadecimal
    from shapeprog.view.listing import listing, parted

    for line in listing(program):
        before, word, after = parted(line)
        style = f"bold {hexadecimal(line.role)}" if line.role else "dim"
        console.print(Text.assemble((before, "dim"), (word, style), after))


def plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers fit for JSON: those that are not finite are left out."""
    import math

    return {key: value for key, value in values.items() if not isinstance(value, float) or math.isfinite(value)}


def print_json(content: Any) -> None:
    """Print one JSON value on one line."""
    print(json.dumps(content, allow_nan=False), flush=True)
