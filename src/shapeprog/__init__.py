"""Furniture as a mesh, point cloud or voxels in; a short program that a person can read, edit and run out.

Names are resolved when they are first used, so ``import shapeprog`` loads nothing heavy.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from shapeprog.data import load as load_shape  # noqa: F401
    from shapeprog.data.shape import Shape as Shape
    from shapeprog.errors import InputError as InputError
    from shapeprog.errors import OutputError as OutputError
    from shapeprog.errors import ProgramError as ProgramError
    from shapeprog.errors import ShapeProgError as ShapeProgError
    from shapeprog.geometry.losses import chamfer as chamfer
    from shapeprog.geometry.scene import Scene as Scene
    from shapeprog.inference import infer as infer
    from shapeprog.inference import refine as refine
    from shapeprog.language.json_form import program_from_json as program_from_json
    from shapeprog.language.json_form import program_to_json as program_to_json
    from shapeprog.language.notation import format_notation as format_notation
    from shapeprog.language.notation import parse_notation as parse_notation
    from shapeprog.language.plugins import load_statements as load_statements
    from shapeprog.language.program import Draw as Draw
    from shapeprog.language.program import Loop as Loop
    from shapeprog.language.program import Program as Program
    from shapeprog.language.sampling import random_program as random_program
    from shapeprog.language.statement import loop as loop
    from shapeprog.language.statement import statement as statement
    from shapeprog.language.statement import using as using
    from shapeprog.language.tensors import Code as Code
    from shapeprog.language.tensors import decode as decode
    from shapeprog.language.tensors import encode as encode
    from shapeprog.language.text import format_program as format_program
    from shapeprog.language.text import load as load
    from shapeprog.language.text import parse as parse
    from shapeprog.language.text import save as save
    from shapeprog.language.unroll import unroll as unroll
    from shapeprog.space import Frame as Frame

_HOMES = {
    "Code": "language.tensors",
    "Draw": "language.program",
    "Frame": "space",
    "InputError": "errors",
    "Loop": "language.program",
    "OutputError": "errors",
    "Program": "language.program",
    "ProgramError": "errors",
    "Scene": "geometry.scene",
    "Shape": "data.shape",
    "ShapeProgError": "errors",
    "chamfer": "geometry.losses",
    "decode": "language.tensors",
    "encode": "language.tensors",
    "export": "export",
    "format_notation": "language.notation",
    "format_program": "language.text",
    "infer": "inference",
    "load": "language.text",
    "load_shape": "data",
    "load_statements": "language.plugins",
    "loop": "language.statement",
    "parse": "language.text",
    "parse_notation": "language.notation",
    "program_from_json": "language.json_form",
    "program_to_json": "language.json_form",
    "random_program": "language.sampling",
    "refine": "inference",
    "save": "language.text",
    "statement": "language.statement",
    "unroll": "language.unroll",
    "using": "language.statement",
}
_OTHER_NAMES = {"load_shape": "load"}

__all__ = sorted([*_HOMES, "__version__"])


def _resolve(name: str) -> Any:
    module = importlib.import_module(f"shapeprog.{_HOMES[name]}")
    return getattr(module, _OTHER_NAMES.get(name, name))


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'shapeprog' has no attribute {name!r}")
    found = globals()[name] = _resolve(name)
    return found


def __dir__() -> list[str]:
    return __all__


class _Package(ModuleType):
    """Keeps ``shapeprog.export`` the function although a room of that name is imported as well."""

    @property
    def export(self) -> Any:
        """Write a program to a file whose suffix names the format."""
        return _resolve("export")

    @export.setter
    def export(self, room: ModuleType) -> None:
        """Importing the room would put it in the function's place."""


sys.modules[__name__].__class__ = _Package
