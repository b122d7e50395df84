"""The primitives, one file each; a file that is put here declares one ``PRIMITIVE``."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from shapeprog.geometry.primitive import Primitive

primitives: tuple[Primitive, ...] = tuple(
    import_module(f"{__name__}.{module.name}").PRIMITIVE for module in iter_modules(__path__)
)
"""All of them; the kind of a primitive is its place here."""

KINDS: dict[str, int] = {primitive.name: kind for kind, primitive in enumerate(primitives)}
"""Kinds by name."""
