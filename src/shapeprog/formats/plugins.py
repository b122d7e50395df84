"""User statements: a module loaded by path; all its declarations or none."""

from __future__ import annotations

import importlib.util
import os
import sys
import traceback
from dataclasses import replace
from pathlib import Path

from shapeprog.errors import DeclarationError, InputError, ShapeProgError
from shapeprog.geometry.primitive import primitives
from shapeprog.language.statement import Role, Statement, language

_loaded: dict[Path, tuple[tuple[Statement, ...], tuple[Role, ...], dict[str, int]]] = {}


def load_statements(path: str | os.PathLike[str]) -> tuple[Statement, ...]:
    """Run a module of declarations and return the statements and loops that it declares.

    The module is trusted: it is executed as Python.  If it fails, none of its declarations remain.  Loading a file
    again has no effect; in another language it declares the same statements there.

    Raises
    ------
    InputError
        If there is no such file.
    DeclarationError
        If the module fails or declares nothing, with the cause and its line.
    """
    file = Path(path).resolve()
    if file in _loaded:
        return _declare_again(file)
    if not file.is_file():
        result = "a folder" if file.is_dir() else "no file"
        raise InputError(f"{path} is {result}", "give the path of a Python file that declares statements")
    before, roles, solids = set(language().names), set(language().roles), dict(primitives.names)
    module_name = f"shapeprog_statements_{len(_loaded)}_{file.stem}"
    try:
        _run(file, module_name)
        declared = tuple(declaration for declaration in language() if declaration.name not in before)
        played = tuple(role for name, role in language().roles.items() if name not in roles)
        if not declared and not played:
            raise DeclarationError(f"{path} declares no statement", "decorate a function with @statement or @loop")
    except BaseException as cause:
        for name in set(language().names) - before:
            language().forget(name)
        for name in language().roles.keys() - roles:
            del language().roles[name]
        for name in primitives.names.keys() - solids:
            del primitives.names[name]
        sys.modules.pop(module_name, None)
        if isinstance(cause, (Exception, SystemExit)):
            raise _in_words(path, file, cause) from cause
        raise
    _loaded[file] = declared, played, {name: kind for name, kind in primitives.names.items() if name not in solids}
    return declared


def _run(file: Path, module_name: str) -> None:
    spec = importlib.util.spec_from_loader(module_name, loader=None, origin=str(file))
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    module.__file__ = str(file)
    sys.modules[module_name] = module
    exec(compile(file.read_bytes(), str(file), "exec"), module.__dict__)


def _declare_again(file: Path) -> tuple[Statement, ...]:
    registry = language()
    declared = []
    statements, roles, solids = _loaded[file]
    primitives.names.update(solids)
    for declaration in statements:
        if declaration.name not in registry:
            registry.register(
                replace(declaration, id=registry.free_id()) if declaration.id in registry else declaration
            )
        declared.append(registry[declaration.name])
    for role in roles:
        if role.name not in registry.roles:
            registry.add_role(role.name, role.doc, role.label)
    return tuple(declared)


def _in_words(path: str | os.PathLike[str], file: Path, cause: BaseException) -> DeclarationError:
    lines = [frame.lineno for frame in traceback.extract_tb(cause.__traceback__) if frame.filename == str(file)]
    line = cause.lineno if isinstance(cause, SyntaxError) else (lines[-1] if lines else None)
    location = f"{path}, line {line}" if line else f"{path}"
    if isinstance(cause, ShapeProgError):
        return DeclarationError(f"{location}: {cause.message}", cause.hint)
    reason = str(cause).split("\n")[0]
    kind = type(cause).__name__
    return DeclarationError(f"{location}: {kind}: {reason}" if reason else f"{location}: {kind}", "correct the module")
