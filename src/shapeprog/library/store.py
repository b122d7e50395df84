"""Files of libraries: program text of functions alone, with comments that show a typical call of each."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.files import write_text
from shapeprog.formats.files import load
from shapeprog.language.ast import Assignment, Call, Comment, Function, Line, Source
from shapeprog.language.parser import parse
from shapeprog.language.placement import BOX_IN_CELLS, SIZES
from shapeprog.language.printer import format_source, source_of
from shapeprog.language.program import Program
from shapeprog.library.matching import Pattern

DEFAULT = Path(__file__).parent / "furniture.shape"
"""The library that ships."""


@dataclass(frozen=True, repr=False)
class Library:
    """Functions that programs may call.

    Parameters
    ----------
    source
        The functions, each of which may call those before it, with comments.
    """

    source: Source

    def __str__(self) -> str:
        """Its text: each function with the comments above it."""
        return format_source(self.source).rstrip("\n")

    def __repr__(self) -> str:
        """How many functions it has, and their names, in one line."""
        return f"<Library of {len(self.functions)}: {', '.join(function.name for function in self.functions)}>"

    @property
    def functions(self) -> tuple[Function, ...]:
        """The functions, in the order of the text."""
        return tuple(self.source.functions.values())

    @cached_property
    def comments(self) -> dict[str, tuple[str, ...]]:
        """For each function the comment lines directly above it."""
        result: dict[str, tuple[str, ...]] = {}
        above: tuple[str, ...] = ()
        for line in self.source.lines:
            if isinstance(line, Function):
                result[line.name], above = above, ()
            elif isinstance(line, Comment):
                above = (*above, line.text) if line.text else ()
        return result

    @cached_property
    def examples(self) -> dict[str, Call]:
        """For each function the call in the last comment line directly above it, if there is one."""
        result = {}
        above = replace(self.source, lines=tuple(line for line in self.source.lines if not isinstance(line, Comment)))
        for function in self.source.functions.values():
            text = (self.comments[function.name] or ("",))[-1]
            try:
                shown = source_of(parse(format_source(above) + text)).lines[-1]
            except ShapeProgError:  # it is an ordinary comment
                continue
            if not isinstance(shown, Call) or shown.name != function.name:
                continue
            arguments = dict(shown.arguments)
            if not arguments.keys() >= {*SIZES} or not all(isinstance(arguments[size], float) for size in SIZES):
                continue
            low = {"bottom": 0.0, "front": -arguments["depth"] / 2, "left": -arguments["width"] / 2}
            pairs = {word: (low | arguments)[word] for word in BOX_IN_CELLS} | arguments
            result[function.name] = replace(shown, arguments=tuple(pairs.items()))
        return result

    @cached_property
    def patterns(self) -> tuple[Pattern, ...]:
        """The functions as patterns of blocks."""
        return tuple(Pattern(self.source, function, self.examples.get(function.name)) for function in self.functions)


def check_library(value: object) -> None:
    """Raise a ``ShapeProgError`` unless a value is a library."""
    if not isinstance(value, Library):
        cure = "sp.load_library reads one from a file, and sp.learn makes one from programs"
        raise ShapeProgError(f"a {type(value).__name__} is given where a library is needed", cure)


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
    """The library in a program of functions alone; an ``InputError`` for other programs."""
    source = source_of(program)
    more = next((line for line in source.lines if not isinstance(line, Comment | Function)), None)
    if isinstance(more, Assignment) and {*SIZES} == source.numbers.keys():
        more = next((line for line in source.lines if not isinstance(line, Assignment | Comment | Function)), None)
    if more is not None:
        what = "numbers of its own" if isinstance(more, Assignment) else "statements outside of functions"
        raise InputError(f"{name} is not a library: it has {what}", "a library holds only functions")
    if source.unit is not None and source.unit.name:
        message = f"{name} is not a library: its lengths are in {source.unit.name} of one object"
        raise InputError(
            message, "leave out the line '# unit:'; lengths of a library are in cells (24 = the longest side)"
        )
    if not source.functions:
        raise InputError(f"{name} holds no functions", "write def name(parameter, ...): with what it draws below")
    return Library(source)


def joined(libraries: Iterable[Library]) -> Library:
    """The functions of several libraries as one.

    Of several with one name the first counts; functions that call another one of this name are left out.
    """
    result = Source()
    if isinstance(libraries, Library | str | os.PathLike):
        raise ShapeProgError("libraries is no list", "give a list of libraries, such as [sp.load_library()]")
    for library in libraries:
        check_library(library)
        dropped: set[str] = set()
        lines: list[Line] = []
        for line in library.source.lines:
            if isinstance(line, Function):
                called = {inner.name for inner in Source(line.body).walk() if isinstance(inner, Call)}
                if line.name in result.functions or called & dropped:
                    if result.functions.get(line.name) != line:
                        dropped.add(line.name)
                    continue
            if not (result.lines and isinstance(line, Assignment)):  # they declare the size of a whole, once
                lines.append(line)
        result = replace(library.source, lines=(*result.lines, *lines))
    return Library(result)


def save_library(library: Library, path: str | os.PathLike[str]) -> Path:
    """Write a library as program text, and return the path."""
    check_library(library)
    file = Path(path)
    if not library.functions:
        raise OutputError(
            f"the library for {file} holds no functions", "learn it from more programs, with similar parts"
        )
    if file.suffix.lower() != ".shape":
        raise OutputError(f"{file} is no place for a library", "let its name end in .shape")
    write_text(file, format_source(library.source))
    return file
