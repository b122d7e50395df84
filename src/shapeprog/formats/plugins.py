"""User statements: a module loaded by path; all its declarations or none."""

from __future__ import annotations

import os
import runpy
import traceback
from copy import copy
from pathlib import Path
from typing import NamedTuple
from weakref import WeakKeyDictionary

from shapeprog.errors import DeclarationError, InputError, ShapeProgError
from shapeprog.language.statement import Language, Statement, language


class _Module(NamedTuple):
    """A file that was loaded: its content then, and what it declared."""

    content: bytes
    declared: tuple[Statement, ...]
    roles: tuple[str, ...]


_loaded: WeakKeyDictionary[Language, dict[Path, _Module]] = WeakKeyDictionary()


def load_statements(path: str | os.PathLike[str]) -> tuple[Statement, ...]:
    """Run a module of declarations and return the statements and loops that it declares.

    The module is trusted: it is executed as Python.  If it fails, none of its declarations remain.  Loading a file
    again in the same language has no effect, unless it was edited: its declarations are then replaced.

    Raises
    ------
    InputError
        If there is no such file.
    DeclarationError
        If the module fails or declares nothing, with the cause and its line.
    """
    file = Path(path).resolve()
    loaded = _loaded.setdefault(language(), {})
    if not file.is_file():
        result = "a folder" if file.is_dir() else "no file"
        raise InputError(f"{path} is {result}", "give the path of a Python file that declares statements")
    content, old = file.read_bytes(), loaded.get(file)
    if old is not None and old.content == content:
        return old.declared
    registry = vars(language())
    before = {table: copy(entries) for table, entries in registry.items()}
    for declaration in old.declared if old else ():
        language().forget(declaration.name)
    for role in old.roles if old else ():
        del language().roles[role]
    known, roles = set(language().names), {*language().roles}
    try:
        runpy.run_path(str(file), run_name=f"shapeprog_statements_{len(loaded)}_{file.stem}")
        declared = tuple(declaration for declaration in language() if declaration.name not in known)
        own = tuple(role for role in language().roles if role not in roles)
        if not declared and not own:
            raise DeclarationError(f"{path} declares no statement", "decorate a function with @statement or @loop")
    except BaseException as cause:
        registry.update(before)
        if isinstance(cause, (Exception, SystemExit)):
            raise _in_words(path, file, cause) from cause
        raise
    loaded[file] = _Module(content, declared, own)
    return declared


def _in_words(path: str | os.PathLike[str], file: Path, cause: BaseException) -> DeclarationError:
    lines = [frame.lineno for frame in traceback.extract_tb(cause.__traceback__) if frame.filename == str(file)]
    line = cause.lineno if isinstance(cause, SyntaxError) else (lines[-1] if lines else None)
    location = f"{path}, line {line}" if line else f"{path}"
    if isinstance(cause, ShapeProgError):
        return DeclarationError(f"{location}: {cause.message}", cause.hint)
    reason = str(cause).split("\n")[0]
    kind = type(cause).__name__
    return DeclarationError(f"{location}: {kind}: {reason}" if reason else f"{location}: {kind}", "correct the module")
