"""Priors over programs: mixtures of templates without hidden blocks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Int, UInt8
from torch import Tensor

from shapeprog.errors import InputError, did_you_mean
from shapeprog.geometry.cells import unpack
from shapeprog.kernels.bits import FIRST, GOLDEN
from shapeprog.language import Code, Program, decode, encode
from shapeprog.language.unroll import draw_blocks
from shapeprog.liang2022 import narrow, wide
from shapeprog.liang2022.draft import Draft, Rng, Template
from shapeprog.liang2022.generator import preceding, take, union

BLOCKS = 10  # largest number of blocks K of a program


class SyntheticBatch(NamedTuple):
    """Programs (B, K, 3) in whole numbers, and the cells that they draw."""

    code: Code
    voxels: UInt8[Tensor, "B 32 32 32"]


@dataclass(frozen=True)
class Prior:
    """A distribution over programs: a mixture of templates with their weights."""

    templates: dict[Template, float]
    off_centre: float = 0.0  # share that is moved by up to a cell along each axis
    details: float = 0.0  # share that gets small parts beyond its template

    def sample(self, count: int, seed: int) -> SyntheticBatch:
        """So many programs, the same for the same seed; every block draws cells of its own, empty ones come last."""
        rng = Rng(seed)
        code = encode([self._program(rng) for _ in range(count)], blocks=BLOCKS)
        cells = draw_blocks(code)
        keep = own_cells(cells)
        order = torch.argsort(~keep, stable=True)
        voxels = unpack(union(cells * keep[..., None, None]))
        return SyntheticBatch(take(code, order, keep.gather(1, order)), voxels)

    def batch(self, count: int, seed: int, index: int) -> SyntheticBatch:
        """The batch of an index, 0 or more, of the endless stream of a seed."""
        return self.sample(count, (seed * GOLDEN + index * FIRST + 1) % 2**63)

    def _program(self, rng: Rng) -> Program:
        moved = rng.chance(self.off_centre)
        draft = Draft((rng.whole(-1, 1), rng.whole(-1, 1), rng.whole(-1, 1)) if moved else (0, 0, 0))
        rng.pick(self.templates)(rng, draft)
        if rng.chance(self.details) and draft.boxes:
            wide.details(rng, draft)
        return Program(tuple(draft.nodes[:BLOCKS]))


PRIORS = {"narrow": Prior(narrow.TEMPLATES), "wide": Prior(wide.TEMPLATES, off_centre=0.05, details=0.6)}


def programs(name: str, count: int, seed: int = 0) -> list[Program]:
    """Programs of a prior, the same for the same seed; an ``InputError`` with the nearest name if there is none."""
    if name not in PRIORS:
        raise InputError(f"there is no prior {name!r}", did_you_mean(name, list(PRIORS), quoted=True))
    return decode(PRIORS[name].sample(count, seed).code)


def scramble(*numbers: int) -> int:
    """One seed of 63 bits from several numbers, unrelated for nearby ones."""
    words = np.random.SeedSequence([number % 2**63 for number in numbers]).generate_state(1, np.uint64)
    return int(words[0] >> np.uint64(1))


def own_cells(blocks: Int[Tensor, "B K 32 32"]) -> Bool[Tensor, "B K"]:
    """Which blocks to keep so that all have cells of their own and the shape stays; the earlier of equal ones do."""
    before, after = preceding(blocks), torch.zeros_like(blocks[:, 0])
    keep = torch.zeros(blocks.shape[:2], dtype=torch.bool)
    for k in reversed(range(blocks.shape[1])):
        keep[:, k] = (blocks[:, k] & ~(before[:, k] | after)).flatten(1).any(-1)
        after |= blocks[:, k] * keep[:, k, None, None]
    return keep
