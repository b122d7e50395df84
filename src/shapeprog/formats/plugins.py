"""User statements: a module loaded by path; all its declarations or none."""

from __future__ import annotations

import os
import runpy
import traceback
from pathlib import Path
from weakref import WeakKeyDictionary

from shapeprog.errors import DeclarationError, InputError, ShapeProgError
from shapeprog.language.statement import Language, Statement, language

_loaded: WeakKeyDictionary[Language, dict[Path, tuple[Statement, ...]]] = WeakKeyDictionary()


def load_statements(path: str | os.PathLike[str]) -> tuple[Statement, ...]:
    """Run a module of declarations and return the statements and loops that it declares.

    The module is trusted: it is executed as Python.  If it fails, none of its declarations remain.  Loading a file
    again in the same language has no effect.

    Raises
    ------
    InputError
        If there is no such file.
    DeclarationError
        If the module fails or declares nothing, with the cause and its line.
    """
    file = Path(path).resolve()
    loaded = _loaded.setdefault(language(), {})
    if file in loaded:
        return loaded[file]
    if not file.is_file():
        result = "a folder" if file.is_dir() else "no file"
        raise InputError(f"{path} is {result}", "give the path of a Python file that declares statements")
    registry = vars(language())
    before = {table: dict(entries) for table, entries in registry.items()}
    known, roles = set(language().names), len(language().roles)
    try:
        runpy.run_path(str(file), run_name=f"shapeprog_statements_{len(loaded)}_{file.stem}")
        declared = tuple(declaration for declaration in language() if declaration.name not in known)
        if not declared and len(language().roles) == roles:
            raise DeclarationError(f"{path} declares no statement", "decorate a function with @statement or @loop")
    except BaseException as cause:
        registry.update(before)
        if isinstance(cause, (Exception, SystemExit)):
            raise _in_words(path, file, cause) from cause
        raise
    loaded[file] = declared
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
