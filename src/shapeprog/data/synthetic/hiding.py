"""Blocks that cannot be seen: those whose cells other blocks draw as well."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Bool, Int
from torch import Tensor

from shapeprog.data.synthetic import hiding_kernels as kernels
from shapeprog.geometry.arrays import over_threads, twin_of
from shapeprog.geometry.cells import Cells, cells_of, preceding, words_of


def _by_kernel(blocks: Int[Tensor, "B K 32 32"]) -> tuple[Bool[Tensor, "B K"], Cells]:
    words = words_of(blocks).reshape(*blocks.shape[:2], -1)
    keep, union = np.empty(words.shape[:2], np.bool_), np.zeros((len(words), words.shape[2]), np.uint32)
    over_threads(lambda first, last: kernels.unhide(words, keep, union, first, last), len(words), least=64)
    return torch.from_numpy(keep), cells_of(union).unflatten(-1, tuple(blocks.shape[2:]))


@twin_of(_by_kernel)
def with_own_cells(blocks: Int[Tensor, "B K 32 32"]) -> tuple[Bool[Tensor, "B K"], Cells]:
    """Which blocks to keep so that each has cells of its own and the shape stays the same, and that shape (B, 32, 32).

    Of blocks that hide one another the earlier stay.
    """
    before, union = preceding(blocks), torch.zeros_like(blocks[:, 0])
    keep = torch.zeros_like(blocks[..., 0, 0], dtype=torch.bool)
    for k in reversed(range(blocks.shape[1])):
        keep[:, k] = (blocks[:, k] & ~(before[:, k] | union)).flatten(1).any(-1)
        union = union | blocks[:, k] * keep[:, k, None, None]
    return keep, union
