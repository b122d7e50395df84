"""Rows gathered from a table, with a backward pass that adds them up in one sweep."""

from __future__ import annotations

from jaxtyping import Float, Int
from torch import Tensor


def take(table: Float[Tensor, "B N F"], index: Int[Tensor, "B P"]) -> Float[Tensor, "B P F"]:
    """Row ``index[b, p]`` of ``table[b]``, with gradient to the table."""
    return table.gather(1, index[..., None].expand(*index.shape, table.shape[-1]))
