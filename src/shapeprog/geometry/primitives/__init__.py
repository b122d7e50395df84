"""The built-in primitives, one file each: declaration, functions in torch, and their twins for kernels.

A file that is put here is a built-in primitive: it declares one ``PRIMITIVE`` with kernels.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from shapeprog.geometry.primitive import Primitive
from shapeprog.geometry.primitive import primitives as primitives

BUILT_IN: tuple[Primitive, ...] = tuple(
    primitives.register(import_module(f"{__name__}.{module.name}").PRIMITIVE) for module in iter_modules(__path__)
)
"""All of them; kernels number them in this order."""


def built_in_names() -> dict[str, int]:
    """Kinds of the built-in primitives by name, as every language begins with them."""
    return {primitive.name: primitives.number(primitive) for primitive in BUILT_IN}
