"""Program text: reading, canonical printing, and ``.shape`` files.

Every float32 survives: ``parse(format_program(program)) == program`` for all finite numbers, negative zero and
negative lengths included (which draw nothing); counts and turns are whole.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from shapeprog.errors import InputError, ShapeProgError
from shapeprog.files import write_text
from shapeprog.language.program import Loop, Node, Program
from shapeprog.language.statement import language
from shapeprog.language.syntax import DEEPEST, read
from shapeprog.language.values import written

INDENT = "    "
"""One level of indentation."""

_LETTERS = "ijklmnopqrstuvwxyz"


def parse(text: str, name: str = "<program>") -> Program:
    """The program of a text.

    Parameters
    ----------
    text
        A strict subset of Python: calls of drawing statements with literal numbers, and ``for`` loops over calls of
        loops.  Comments are allowed and forgotten.  Numbers are rounded to float32.
    name
        What error messages call the text, a path for instance.

    Raises
    ------
    ProgramError
        At the first mistake, with line, column, the nearest name or the legal range.
    """
    return Program(read(text, name))


def format_program(program: Program) -> str:
    """The canonical text of a program: parameters by name in declared order, the fewest digits, loops i, j, k...

    Raises
    ------
    ShapeProgError
        If a number is not finite, a statement is not declared, or loops nest deeper than text can.
    """
    return "".join(f"{line}\n" for node in program.body for line in _lines(node, 0))


def load(path: str | os.PathLike[str]) -> Program:
    """The program in a ``.shape`` file.

    Raises
    ------
    InputError
        If the file cannot be read or is not UTF-8.
    ProgramError
        If its text is not in the language.
    """
    return parse(read_text(path), str(path))


def save(program: Program, path: str | os.PathLike[str]) -> None:
    """Write a program to a ``.shape`` file, whole or not at all.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    write_text(path, format_program(program))


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of a UTF-8 file, with or without a byte order mark.

    Raises
    ------
    InputError
        If the file cannot be read or is not UTF-8.
    """
    try:
        return Path(path).read_bytes().decode("utf-8-sig")
    except FileNotFoundError as error:
        raise InputError(f"there is no file {path}", "check the path") from error
    except IsADirectoryError as error:
        raise InputError(f"{path} is a folder, not a file", "name a file in it") from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not text: byte {error.start} is not UTF-8", "save it as UTF-8, or check that it is a program"
        ) from error
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {path}: {error}", "check the path and its permissions") from error


def call_text(node: Node, name: str) -> str:
    """The call that a statement or loop of the text is, without what is around it.

    Raises
    ------
    ShapeProgError
        If the statement is not declared or has another number of values.
    """
    known = language()
    if name not in known:
        raise ShapeProgError(f"no statement is called {name!r}", "load the module that declares it")
    declared = known[name]
    if len(node.values) != declared.size:
        raise ShapeProgError(f"{name} has {len(node.values)} numbers instead of {declared.size}", "mend the program")
    words: list[str] = []
    for parameter in declared.parameters:
        numbers = [written(parameter.quantity, value) for value in node.values[parameter.slots]]
        group = numbers[0] if len(numbers) == 1 else f"({', '.join(numbers)})"
        bare = declared.is_loop and not words
        words.append(group if bare else f"{parameter.name}={group}")
    return f"{name}({', '.join(words)})"


def _lines(node: Node, depth: int) -> Iterator[str]:
    indent = INDENT * depth
    if not isinstance(node, Loop):
        yield f"{indent}{call_text(node, node.name)}"
        return
    if depth >= DEEPEST:
        raise ShapeProgError(f"loops are nested more than {DEEPEST} deep", "put some of them side by side")
    yield f"{indent}for {variable(depth)} in {call_text(node, node.name)}:"
    if not node.body:
        yield f"{indent}{INDENT}pass"
    for inner in node.body:
        yield from _lines(inner, depth + 1)


def variable(depth: int) -> str:
    """The name of the variable of a loop inside ``depth`` others: i, j, k and so on."""
    return _LETTERS[depth] if depth < len(_LETTERS) else f"i{depth}"
