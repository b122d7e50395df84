"""Libraries as they are kept: program text of functions alone, with comments that show a typical call of each."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.files import write_text
from shapeprog.formats.files import load
from shapeprog.language.program import Program
from shapeprog.language.source import Assignment, Call, Comment, Function, Source
from shapeprog.language.text import format_source, parse, source_of
from shapeprog.library.matching import Pattern

DEFAULT = Path(__file__).parent / "furniture.shape"
"""The library that ships."""


@dataclass(frozen=True)
class Library:
    """Functions that programs may call.

    Parameters
    ----------
    source
        The functions, each of which may call those before it, with comments.
    """

    source: Source

    @property
    def functions(self) -> tuple[Function, ...]:
        """The functions, in the order of the text."""
        return tuple(line for line in self.source.lines if isinstance(line, Function))

    @cached_property
    def comments(self) -> dict[str, tuple[str, ...]]:
        """For each function what stands right above it."""
        found: dict[str, tuple[str, ...]] = {}
        above: tuple[str, ...] = ()
        for line in self.source.lines:
            if isinstance(line, Function):
                found[line.name], above = above, ()
            elif isinstance(line, Comment):
                above = (*above, line.text) if line.text else ()
        return found

    @cached_property
    def examples(self) -> dict[str, Call]:
        """Calls of functions that the comment right above them shows as its last line."""
        found = {}
        for function in self.functions:
            text = (self.comments[function.name] or ("",))[-1]
            try:
                shown = source_of(parse(format_source(Source(self.functions)) + text)).lines[-1]
            except ShapeProgError:  # it is an ordinary comment
                continue
            if isinstance(shown, Call) and shown.name == function.name:
                found[function.name] = shown
        return found

    @cached_property
    def patterns(self) -> tuple[Pattern, ...]:
        """The functions as what they draw."""
        return tuple(
            Pattern(function, self.functions[:place], self.examples.get(function.name))
            for place, function in enumerate(self.functions)
        )


def load_library(path: str | os.PathLike[str] | None = None) -> Library:
    """The library in a program file that holds functions alone; without a path the one that ships.

    Raises
    ------
    InputError
        If the file cannot be read, holds no functions, or more than that.
    ProgramError
        If its text is not in the language.
    """
    file = DEFAULT if path is None else Path(path)
    return library_of(load(file), str(file))


def library_of(program: Program, name: str = "<library>") -> Library:
    """The library that is a program of functions alone; an ``InputError`` if it is none."""
    source = source_of(program)
    more = next((line for line in source.lines if not isinstance(line, Comment | Function)), None)
    if more is not None:
        what = "numbers of its own" if isinstance(more, Assignment) else "statements outside of functions"
        raise InputError(f"{name} is not a library: it has {what}", "a library holds only functions")
    if source.unit is not None:
        said = f"{name} is not a library: its lengths are in {source.unit.name} of one object"
        raise InputError(said, "write them in cells, and leave out the line '# unit:'; programs may be in any unit")
    if not source.functions:
        raise InputError(f"{name} holds no functions", "write def name(parameter, ...): with what it draws below")
    return Library(source)


def save_library(library: Library, path: str | os.PathLike[str]) -> Path:
    """Write a library as program text, and return the path."""
    file = Path(path)
    if file.suffix.lower() != ".shape":
        raise OutputError(f"{file} is no place for a library", "let its name end in .shape")
    write_text(file, format_source(library.source))
    return file
