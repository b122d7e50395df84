"""The trial of a declaration by a user: it draws or moves once, so that a mistake is refused now and not amid a run."""

from __future__ import annotations

import numpy as np

from shapeprog.errors import DeclarationError
from shapeprog.geometry.primitive import SIZES
from shapeprog.language.declaration import Statement
from shapeprog.language.hints import Box
from shapeprog.lazy_torch import Tensor, torch


def check_declaration(declared: Statement) -> None:
    """Draw or move once with mid-range parameters; a ``DeclarationError`` if that fails or has a wrong shape."""
    values = torch.tensor([(quantity.low + quantity.high) / 2 for quantity in declared.quantities]).repeat(2, 1)
    parts: list[tuple[Tensor | None, tuple[int, ...]]] = []  # with their shapes
    try:
        if declared.move is not None:
            motion = declared.move(torch.arange(2.0), torch.zeros(2, dtype=torch.bool), **declared.split(values))
            parts += [(motion.turn, (2,)), (motion.rotation, (2, 3, 3))]
            parts += [(part, (2, 3)) for part in (motion.pivot, motion.shift, motion.signs)]
            what = f"loop {declared.name!r} returns a motion"
            requirement = "a turn must be (...), a rotation (..., 3, 3), a pivot, a shift and signs (..., 3)"
        else:
            for numbers, lead in ((values, (2,)), (values[0], ())):
                for solids in declared.solids(numbers):
                    parts += [(solids.size, (*lead, SIZES)), (solids.centre, (*lead, 3))]
            if parts and declared.pivot is not None:
                parts.append((declared.pivot(**declared.split(values)), (2, 3)))
            what = f"statement {declared.name!r} returns solids"
            requirement = "sizes must be (..., 4), centres and a pivot (..., 3)"
        shapes = [part if part is None else tuple(part.shape) for part, _ in parts]
    except Exception as cause:
        message = f"statement {declared.name!r} cannot be {'moved' if declared.is_loop else 'drawn'}: {cause}"
        hint = "its function gets one tensor (...) or (..., width) per parameter, with any leading dimensions or none"
        raise DeclarationError(message, hint) from cause
    if not parts or any(shape not in (None, right) for shape, (_, right) in zip(shapes, parts, strict=True)):
        requirement += " with the leading dimensions of the parameters"
        raise DeclarationError(f"{what} of shapes {shapes}", requirement)
    what, box = f"the hint of statement {declared.name!r}", Box(np.zeros(3), np.eye(3), np.array([6.0, 1.0, 1.0]))
    try:
        counts = {len(start) for start in declared.hint(box)} - {declared.size} if declared.hint else set()
    except Exception as cause:
        raise DeclarationError(f"{what} fails: {cause}", "it gets a box and returns lists of numbers") from cause
    if counts:
        raise DeclarationError(f"{what} yields {min(counts)} numbers", f"yield {declared.size}, one for each parameter")
