"""Options that commands share, and their output: results on the standard output, messages on the standard error."""

from __future__ import annotations

import errno
import functools
import io
import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from shapeprog.arguments import MOST_SEED
from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.files import output_error
from shapeprog.formats.format import CELLS, suffixes

if TYPE_CHECKING:
    from rich.console import Console

    from shapeprog.language.program import Program
    from shapeprog.library import Library
    from shapeprog.space import Frame

debugging = False  # whether errors show their traceback
quiet = False  # whether remarks, and what was written, are not printed
WIDTH = 120  # columns of a table where the output is no terminal
FAILED, MISTAKE, INTERRUPTED = 1, 2, 130  # exit codes

Command = TypeVar("Command", bound=Callable[..., None])


def _checked_seed(seed: int) -> int:
    if seed > MOST_SEED:  # as a maximum of the option it would be printed in every help
        raise typer.BadParameter(f"{seed} is not below 2^32.")
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
AsUnit = Annotated[
    str | None,
    about_program(
        "--unit", metavar="UNIT", help="mm, cm, m, in, or cells (24 = longest side). Default: of the input or format."
    ),
]
FileUnit = Annotated[
    str | None,
    about_input("--file-unit", metavar="UNIT", help="Unit of the input file: mm, cm, m or in. Default: m, up to 10 m."),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing program files.")]


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
            errors().print(f"Interrupted; {note}.", style="yellow")
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


_OF_OUTPUT = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
"""Errors of writing to a file that is open already, as the standard output is."""


def _explained(error: Exception) -> ShapeProgError:
    """The message for an error; raises the error itself if it is a fault of the package."""
    if isinstance(error, ShapeProgError):
        return error
    if isinstance(error, OSError) and error.filename is None and error.errno in _OF_OUTPUT:
        return output_error(Path("the standard output"), error)
    if isinstance(error, OSError):  # writers name their file
        subject = "the system" if error.filename is None else error.filename
        return ShapeProgError(f"{subject}: {error.strerror or error}", "check the path, its permissions and the disk")
    name = (getattr(error, "name", None) or "").partition(".")[0]
    if name in ("", "shapeprog"):
        raise error
    return InputError(f"this needs the package {name}, which is not installed", f"pip install {name}")


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

    return Console(stderr=True, highlight=False, markup=False, soft_wrap=True)


def say(text: str) -> None:
    """Print a line about a result, unless ``--quiet`` is given."""
    if not quiet:
        output().print(text)


def note(text: str, style: str = "dim") -> None:
    """Print a remark on the standard error, unless ``--quiet`` is given."""
    if not quiet:
        errors().print(text, style=style)


@contextmanager
def progress(shown: bool = True) -> Iterator[Callable[[str], Callable[[str, float], None]]]:
    """A bar for one thing after another: a function of a name, which returns one of the stage and the share done."""
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    text = TextColumn("{task.description}", markup=False)
    columns = SpinnerColumn("line"), text, BarColumn(24), TimeElapsedColumn()
    with Progress(*columns, console=errors(), transient=True, disable=quiet or not shown) as bar:
        task = bar.add_task("reading", total=1.0)

        def begin(name: str) -> Callable[[str, float], None]:
            bar.reset(task, description=name, total=1.0)
            return lambda stage, share: bar.update(task, completed=share, description=f"{name}: {stage}")

        yield begin


def complain(error: ShapeProgError) -> None:
    """Print an error: the cause in red, the cure below it."""
    console = errors()
    console.print("error: ", style="bold red", end="")
    console.print(str(error).removesuffix(f"\n  hint: {error.hint}"), style="red")
    if error.hint:
        console.print(f"hint: {error.hint}")


def finish(failures: Sequence[ShapeProgError], code: int = FAILED) -> None:
    """Print errors, and end with an exit code if there are some."""
    for error in failures:
        complain(error)
    if failures:
        raise typer.Exit(code)


def at(path: Path, error: ShapeProgError) -> ShapeProgError:
    """The error with the path of the file that it is about, in place of the name of that file or shape in front."""
    if str(path) in error.message:
        return error
    file = Path(path.name.partition("#")[0])
    name, stem = re.escape(file.name), re.escape(file.stem)
    whole = rf"{name}(#\S+?)?(?=:? )|" if file.suffix else ""  # without a suffix it may be a word, such as "a"
    named = re.match(rf"{whole}{stem}(#\S+?(?=:? )|(?=: | (is|has|holds|lies) ))", error.message)
    message = error.message[named.end() :] if named else f": {error.message}"
    return ShapeProgError(f"{path}{message}", error.hint)


def fault(what: str, error: Exception) -> ShapeProgError:
    """The message for an internal error, so that a command continues with the next file; raises it with --debug."""
    if debugging:
        raise error
    return ShapeProgError(f"{what}: internal error", "run again with --debug and report the traceback")


def absent(paths: Sequence[Path]) -> list[Path]:
    """Those of paths, such as ``file.npz#12``, at which there is no file or folder."""
    return [path for path in paths if not (os.path.exists(path) or os.path.exists(str(path).rpartition("#")[0]))]


def check_axes(up: str | None, front: str | None) -> None:
    """Refuse axes that are none before the first file is read; an ``InputError`` if a name is not an axis, or both lie
    on one line."""
    from shapeprog.data.orientation import axes_of

    axes_of(Path(), up, front)


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
    others = " or --file-unit ".join(name for name in ("mm", "cm", "in") if name != unit)
    return f"{message} {longest * metres(unit):.3g} m. Another unit: --file-unit {others}"


def check_free(paths: Iterable[Path], overwrite: bool, own: Path | None = None) -> None:
    """Refuse to replace programs other than ``own``, the one that is read, unless ``overwrite``."""
    for path in paths if not overwrite else ():
        if path.suffix.lower() in suffixes("program") and path.is_file() and not (own and path.samefile(own)):
            raise OutputError(f"{path} exists and is a program", "name another file, or replace it with --overwrite")


def load_modules(modules: Sequence[Path] | None) -> None:
    """Declare the statements of a user's modules."""
    if modules:
        from shapeprog.formats.plugins import load_statements

        for module in modules:
            load_statements(module)


def load_libraries(files: Sequence[Path] | None, shipped: bool) -> list[Library]:
    """The libraries given with ``--with``, then the built-in one if ``shipped``; modules are loaded as well."""
    from shapeprog.library import load_library

    libraries = [file for file in files or () if file.suffix.lower() == ".shape"]
    load_modules([file for file in files or () if file not in libraries])
    return [*map(load_library, libraries), *([load_library()] if shipped else [])]


def read_program_file(path: Path, changes: Sequence[str] | None = None) -> tuple[Program, Frame | None]:
    """The program of a file and its frame, with other numbers for its names as ``--set`` has them; prints warnings."""
    from shapeprog.cli.changes import changed
    from shapeprog.formats import load

    program = load(path)
    warn(path, *(program.source.warnings if program.source else ()))
    edited, doubts = changed(program, changes or ())
    warn(path, *doubts)
    return edited, edited.frame


def warn(path: Path, *warnings: str) -> None:
    """Print what is legal in a program and probably a mistake."""
    for warning in warnings:
        errors().print(f"warning: {path}, {warning}", style="yellow")


def print_program(program: Program) -> None:
    """Print a program with each statement in its colour, numbers rounded for reading."""
    from rich.text import Text

    from shapeprog.formats.colours import hexadecimal
    from shapeprog.view.listing import listing, parted

    console = output()
    for line in listing(program):
        before, word, after = parted(line)
        style = f"bold {hexadecimal(line.role)}" if line.role else "dim"
        console.print(Text.assemble((before, "dim"), (word, style), after))


def print_json(content: Any) -> None:
    """Print one JSON value on one line."""
    print(json.dumps(content, allow_nan=False), flush=True)
