"""What kernels ask of any primitive: a helper for each question, which passes it on to that of the row's primitive."""

from __future__ import annotations

from inspect import signature
from typing import Any

from shapeprog.geometry.primitive import Helper
from shapeprog.geometry.primitives import primitives
from shapeprog.kernels.compile import helper
from shapeprog.kernels.table import KIND


def _by_kind(question: str) -> Helper:
    """The helper for one of the helpers of every primitive, with a branch for each.

    It is written out as text: the compiler puts all of them in place, which it cannot do with a table of functions.
    """
    answers = {primitive.name: primitive.kernels[question] for primitive in primitives}
    arguments = ", ".join(signature(answers[primitives[0].name]).parameters)
    lines = [f"def {question}({arguments}):"]
    for number, name in enumerate(answers):
        condition = f"if table[row, {KIND}] == {number}: " if number < len(answers) - 1 else ""
        lines.append(f"    {condition}return {name}({arguments})")
    made: dict[str, Any] = {"__name__": __name__, **answers}
    exec("\n".join(lines), made)
    return helper(made[question], forceinline=True)


distance, slopes, bound, excess = map(_by_kind, ("distance", "slopes", "bound", "excess"))
sample, place, normal, pull = map(_by_kind, ("sample", "place", "normal", "pull"))
cells = _by_kind("cells")
