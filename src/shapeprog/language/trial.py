"""The trial of a declaration by a user: it draws or moves once, so that a mistake is refused now and not amid a run."""

from __future__ import annotations

from itertools import zip_longest
from typing import Any, TypeVar

import numpy as np

from shapeprog.errors import DeclarationError
from shapeprog.geometry.batch import Solids
from shapeprog.geometry.primitive import SIZES
from shapeprog.language.declaration import Motion, Statement
from shapeprog.language.hints import Box
from shapeprog.lazy_torch import Tensor, torch

T = TypeVar("T")
_TORCH_ALONE = "use every parameter, and compute with torch alone: NumPy, float(), item() and detach() end the gradient"


def check_declaration(declared: Statement) -> None:
    """Draw or move once with mid-range parameters.

    A ``DeclarationError`` if that fails, returns something of another kind or shape, a number that is not finite, or if
    a number has no gradient.
    """
    middle = [(quantity.low + quantity.high) / 2 for quantity in declared.quantities]
    values = torch.tensor(middle).repeat(2, 1).requires_grad_()
    parts: list[tuple[Tensor | None, tuple[int, ...]]] = []  # with their shapes
    try:
        with torch.enable_grad():
            named = declared.split(values)
            if declared.move is not None:
                motion = _checked(declared.move(torch.arange(2.0), torch.zeros(2, dtype=torch.bool), **named), Motion)
                parts += [(motion.turn, (2,)), (motion.rotation, (2, 3, 3))]
                parts += [(part, (2, 3)) for part in (motion.pivot, motion.shift, motion.signs)]
                what = f"loop {declared.name!r} returns a motion"
                requirement = "a turn must be (...), a rotation (..., 3, 3), a pivot, a shift and signs (..., 3)"
            else:
                assert declared.draw is not None
                for numbers, lead in ((named, (2,)), (declared.split(values[0]), ())):
                    result = declared.draw(**numbers)
                    for drawn in [result] if isinstance(result, Solids | None) else list(result):
                        solids = _checked(drawn, Solids)
                        parts += [(solids.size, (*lead, SIZES)), (solids.centre, (*lead, 3))]
                        parts.append((solids.rotation, (*lead, 3, 3)))
                if parts and declared.pivot is not None:
                    parts.append((declared.pivot(**named), (2, 3)))
                what = f"statement {declared.name!r} returns solids"
                requirement = "sizes must be (..., 4), centres and a pivot (..., 3), rotations (..., 3, 3)"
        shapes = [part if part is None else tuple(part.shape) for part, _ in parts]
    except Exception as cause:
        message = f"statement {declared.name!r} cannot be {'moved' if declared.is_loop else 'drawn'}: {cause}"
        hint = "its function gets one tensor (...) or (..., width) per parameter, with any leading dimensions or none"
        hint = _TORCH_ALONE if "requires grad" in str(cause) else hint  # the words of torch for NumPy within
        raise DeclarationError(message, hint) from cause
    if not parts or any(shape not in (None, right) for shape, (_, right) in zip(shapes, parts, strict=True)):
        requirement += " with the leading dimensions of the parameters"
        raise DeclarationError(f"{what} of shapes {shapes}", requirement)
    if not all(bool(part.isfinite().all()) for part, _ in parts if part is not None):
        cure = f"it is tried with {', '.join(f'{number:g}' for number in middle)}: compute finite numbers from them"
        raise DeclarationError(f"{what} with numbers that are not finite", cure)
    continuous = [parameter.name for parameter in declared.parameters if not parameter.quantity.discrete]
    recorded = [part.sum() for part, _ in parts if part is not None and part.requires_grad]
    reached = [named[word] for word in continuous]
    slopes = torch.autograd.grad(torch.stack(recorded).sum(), reached, allow_unused=True) if recorded else ()
    if missing := [word for word, slope in zip_longest(continuous, slopes) if slope is None]:
        raise DeclarationError(f"{what} without a gradient to {', '.join(missing)}", _TORCH_ALONE)
    what, box = f"the hint of statement {declared.name!r}", Box(np.zeros(3), np.eye(3), np.array([6.0, 1.0, 1.0]))
    try:
        counts = {len(start) for start in declared.hint(box)} - {declared.size} if declared.hint else set()
    except Exception as cause:
        raise DeclarationError(f"{what} fails: {cause}", "it gets a box and returns lists of numbers") from cause
    if counts:
        raise DeclarationError(f"{what} yields {min(counts)} numbers", f"yield {declared.size}, one for each parameter")


def _checked(result: Any, kind: type[T]) -> T:
    if not isinstance(result, kind):
        raise TypeError(f"it returns {'nothing' if result is None else type(result).__name__}, not {kind.__name__}")
    return result
