"""User statements: a module loaded by path; all its declarations or none."""

from __future__ import annotations

import importlib.util
import os
import sys
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
    before, roles = set(language().names), set(language().roles)
    module_name = f"shapeprog_statements_{len(loaded)}_{file.stem}"
    try:
        _run(file, module_name)
        declared = tuple(declaration for declaration in language() if declaration.name not in before)
        if not declared and not language().roles.keys() - roles:
            raise DeclarationError(f"{path} declares no statement", "decorate a function with @statement or @loop")
    except BaseException as cause:
        for name in set(language().names) - before:
            language().forget(name)
        for name in language().roles.keys() - roles:
            del language().roles[name]
        sys.modules.pop(module_name, None)
        if isinstance(cause, (Exception, SystemExit)):
            raise _in_words(path, file, cause) from cause
        raise
    loaded[file] = declared
    return declared


def _run(file: Path, module_name: str) -> None:
    spec = importlib.util.spec_from_loader(module_name, loader=None, origin=str(file))
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    module.__file__ = str(file)
    sys.modules[module_name] = module
    exec(compile(file.read_bytes(), str(file), "exec"), module.__dict__)


def _in_words(path: str | os.PathLike[str], file: Path, cause: BaseException) -> DeclarationError:
    lines = [frame.lineno for frame in traceback.extract_tb(cause.__traceback__) if frame.filename == str(file)]
    line = cause.lineno if isinstance(cause, SyntaxError) else (lines[-1] if lines else None)
    location = f"{path}, line {line}" if line else f"{path}"
    if isinstance(cause, ShapeProgError):
        return DeclarationError(f"{location}: {cause.message}", cause.hint)
    reason = str(cause).split("\n")[0]
    kind = type(cause).__name__
    return DeclarationError(f"{location}: {kind}: {reason}" if reason else f"{location}: {kind}", "correct the module")
