"""What kernels ask of any primitive: a helper for each question, which passes it on to that of the row's primitive."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from shapeprog.geometry.primitives import BUILT_IN
from shapeprog.kernels.compile import helper
from shapeprog.kernels.table import KIND


def _by_kind(question: str, arguments: str) -> Callable[..., Any]:
    """The helper for one of the functions of ``Kernels``.

    It is written out as text, a branch for each primitive: the compiler puts all of them in place, which it cannot do
    with a table of functions.
    """
    answers = {primitive.name: getattr(primitive.kernels, question) for primitive in BUILT_IN}
    lines = [f"def {question}(table, row{arguments}):"]
    for number, name in enumerate(answers):
        condition = f"if table[row, {KIND}] == {number}: " if number < len(answers) - 1 else ""
        lines.append(f"    {condition}return {name}(table, row{arguments})")
    made: dict[str, Any] = {"__name__": __name__, **answers}
    exec("\n".join(lines), made)
    return helper(made[question])


distance = _by_kind("distance", ", a, b, c")
slopes = _by_kind("slopes", ", a, b, c, out")
bound = _by_kind("bound", "")
excess = _by_kind("excess", ", a, b, c")
sample = _by_kind("sample", ", face, one, two, three")
place = _by_kind("place", ", u, v, w")
normal = _by_kind("normal", ", face, u, v, w")
pull = _by_kind("pull", ", u, v, w, da, db, dc, out")
cells = _by_kind("cells", ", square, planes, plane, low, high")
