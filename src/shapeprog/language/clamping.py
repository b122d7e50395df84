"""A clamp for lengths, in a module of its own because it needs torch to be loaded when it is imported."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor


class ClampedLengths(torch.autograd.Function):
    """Numbers clamped to at least ``least``; where one was less, its gradient is minus its magnitude.

    A straight-through clamp (Bengio et al. 2013) lets lengths run off below zero; one that passes only the gradients
    that lengthen leaves them where momentum took them.
    """

    @staticmethod
    def forward(ctx: Any, values: Tensor, least: Tensor) -> Tensor:
        """The clamped numbers."""
        ctx.save_for_backward(values < least)
        return torch.maximum(values, least)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        """The gradient of ``values``; none of ``least``."""
        (short,) = ctx.saved_tensors
        return torch.where(short, -gradient.abs(), gradient), None
