"""Checks of what a caller gives, where a public function is entered."""

from __future__ import annotations

import math
import operator
from typing import Any

from shapeprog.errors import ShapeProgError

MOST_SEED = (1 << 32) - 1  # seeds are multiplied and added in 64 bits


def number_of(value: Any, *, whole: bool = False) -> float:
    """A value as a number, not a number (NaN) if it is none; booleans and text are none."""
    is_truth = isinstance(value, bool) or str(getattr(value, "dtype", "")).endswith("bool")  # of NumPy, torch
    if is_truth or isinstance(value, str | bytes | bytearray):
        return math.nan
    try:
        return float(operator.index(value)) if whole else float(value)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        return math.nan


def check_number(
    name: str, value: Any, least: float, most: float = math.inf, *, whole: bool = False, above: bool = False,
    endless: bool = False,
) -> None:  # fmt: skip
    """Raise a ``ShapeProgError`` unless a value is a number from ``least``, or ``above`` it, to ``most``, and finite or
    ``endless``."""
    number = number_of(value, whole=whole)
    if not ((endless or math.isfinite(number)) and least <= number <= most) or (above and number == least):
        bounds = f"above {least:g}" if above else f"of {least:g} or more"
        bounds += f", at most {most:g}" if most < math.inf else ""
        raise ShapeProgError(f"{name} is {value!r}", f"give a {'whole ' if whole else ''}number {bounds}")


def check_tensor(
    name: str, value: Any, *shape: int | str, lead: bool = True, floating: bool = True, empty: bool = False
) -> None:  # fmt: skip
    """Raise a ``ShapeProgError`` unless a value is a tensor whose shape ends as given, such as ``"P", 3``.

    A word stands for any size, which is not 0 unless it may be ``empty``.  Without ``lead`` there are no dimensions
    before those.  A ``floating`` tensor holds float32 or float64.
    """
    import torch

    if not isinstance(value, torch.Tensor):
        raise ShapeProgError(f"{name} is no tensor but {type(value).__name__}", f"give torch.as_tensor({name})")
    if floating and value.dtype not in (torch.float32, torch.float64):
        raise ShapeProgError(f"{name} holds {value.dtype}", f"give float32 or float64, as {name}.float() does")
    sizes = tuple(value.shape)
    actual = sizes[max(0, len(sizes) - len(shape)) :] if lead else sizes
    matches = (
        size > 0 or empty if isinstance(wanted, str) else size == wanted
        for size, wanted in zip(actual, shape, strict=False)
    )
    if len(actual) != len(shape) or not all(matches):
        expected = " x ".join(map(str, ["...", *shape] if lead else shape))
        letters = (
            "" if empty or all(isinstance(dimension, int) for dimension in shape) else ", 1 or more of each letter"
        )
        raise ShapeProgError(f"{name} has the shape {sizes}", f"give the shape {expected}{letters}")


def check_points(name: str, value: Any) -> None:
    """Raise a ``ShapeProgError`` unless a value is a tensor of points (..., P, 3) that are finite."""
    check_tensor(name, value, "P", 3)
    if not (finite := value.detach().isfinite()).all():
        wrong = int((~finite.all(-1)).sum())
        cure = f"remove them, as {name}[{name}.isfinite().all(-1)] does for one cloud"
        raise ShapeProgError(f"{name} has {wrong} points whose coordinates are not finite", cure)
