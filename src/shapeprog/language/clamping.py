"""A clamp for lengths, in a separate module because importing it loads torch."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor


class ClampedLengths(torch.autograd.Function):
    """Numbers clamped to at least ``bound``; where one was less, its gradient is minus its magnitude.

    A straight-through clamp (Bengio et al. 2013) lets lengths run off below zero; one that passes only the gradients
    that lengthen leaves them where momentum took them.
    """

    @staticmethod
    def forward(ctx: Any, values: Tensor, bound: Tensor) -> Tensor:
        """The clamped numbers."""
        ctx.save_for_backward(values < bound)
        return torch.maximum(values, bound)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        """The gradient of ``values``; none of ``bound``."""
        (short,) = ctx.saved_tensors
        return torch.where(short, -gradient.abs(), gradient), None
