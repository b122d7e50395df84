"""Priors over programs: mixtures of templates without hidden blocks, as samples and as endless streams."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Bool, Int, UInt8
from torch import Tensor
from torch.nn.functional import pad

from shapeprog.errors import InputError, did_you_mean
from shapeprog.geometry.cells import Cells, preceding, union, unpack
from shapeprog.kernels.bits import FIRST, GOLDEN
from shapeprog.language.program import PUBLISHED_DEPTH, Program
from shapeprog.language.statement import SLOTS
from shapeprog.language.tensors import Code, decode
from shapeprog.language.unroll import draw_blocks
from shapeprog.liang2022 import narrow, wide
from shapeprog.liang2022.draft import Draft, Rng, Template

AT_ONCE = 256
"""Programs that are drawn together, so that their cells stay in the cache."""

Rows = list[list[int]]
"""The blocks of one program: the ids of the steps of each, then their parameters."""


@dataclass(frozen=True)
class Prior:
    """A distribution over programs of at most ``blocks`` blocks: a mixture of templates with their weights.

    A share ``off_centre`` is moved by up to a cell along each axis; a share ``details`` gets small parts beyond its
    template.
    """

    name: str
    blocks: int
    templates: dict[Template, float] = field(repr=False)
    off_centre: float = 0.0
    details: float = 0.0

    def sample(self, count: int, seed: int) -> tuple[Code, Cells]:
        """Programs (count, blocks, 3) and their packed cells (count, 32, 32), the same for the same seed.

        Every block draws cells that no other does; blocks without a statement come last.
        """
        rng, ids, parameters, cells = Rng(seed), [], [], []
        for start in range(0, count, AT_ONCE):
            code, cells_of_blocks = self._cleaned(
                [self._draft(rng) for _ in range(start, min(start + AT_ONCE, count))], rng
            )
            ids.append(code.ids)
            parameters.append(code.parameters)
            cells.append(cells_of_blocks)
        return Code(torch.cat(ids), torch.cat(parameters)), torch.cat(cells)

    def _draft(self, rng: Rng) -> Rows:
        moved = rng.chance(self.off_centre)
        draft = Draft((rng.whole(-1, 1), rng.whole(-1, 1), rng.whole(-1, 1)) if moved else (0, 0, 0))
        rng.pick(self.templates)(rng, draft)
        if rng.chance(self.details):
            wide.details(rng, draft)
        return draft.rows

    def _cleaned(self, programs: list[Rows], rng: Rng) -> tuple[Code, Cells]:
        """Programs without hidden blocks, cut after ``blocks``; others replace those that draw nothing."""
        code = _code(programs)
        cells = draw_blocks(code)
        keep = own_cells(cells)
        keep &= keep.cumsum(-1) <= self.blocks
        if not keep.any(-1).all():
            draws = zip(programs, keep.any(-1).tolist(), strict=True)
            return self._cleaned(
                [rows if cells_of_blocks else self._draft(rng) for rows, cells_of_blocks in draws], rng
            )
        order = torch.argsort((~keep).byte(), dim=-1, stable=True)[:, : self.blocks]
        code = Code(code.ids * keep[..., None], code.parameters * keep[..., None, None])
        row = torch.arange(len(order))[:, None]
        code = _padded(Code(code.ids[row, order], code.parameters[row, order]), self.blocks)
        return code, union(cells * keep[..., None, None])


PRIORS = {
    "narrow": Prior("narrow", 8, narrow.TEMPLATES),
    "wide": Prior("wide", 10, wide.TEMPLATES, off_centre=0.05, details=0.6),
}
"""The mix of the published synthetic data, and furniture of many kinds."""


def prior(name: str) -> Prior:
    """The prior of a name; an ``InputError`` with the nearest name if there is none."""
    if name not in PRIORS:
        raise InputError(f"there is no prior {name!r}", did_you_mean(name, list(PRIORS), quoted=True))
    return PRIORS[name]


def programs(name: str, count: int, seed: int = 0) -> list[Program]:
    """Programs of the prior of a name, the same for the same seed."""
    return decode(prior(name).sample(count, seed)[0])


@dataclass(frozen=True)
class SyntheticBatch:
    """Programs in whole numbers, and the cells that they draw."""

    code: Code
    voxels: UInt8[Tensor, "B 32 32 32"]


class SyntheticStream:
    """Batches of shapes, padded to ``blocks`` blocks; one depends on the prior, the seed and its index alone."""

    def __init__(self, prior: Prior, batch_size: int, seed: int = 0, blocks: int = 10) -> None:
        if batch_size < 1:
            raise InputError(f"a batch of {batch_size} shapes is empty", "ask for at least one shape")
        if blocks < prior.blocks:
            remedy = f"allow {prior.blocks} blocks or more"
            raise InputError(f"{blocks} blocks do not hold the programs of {prior.name}", remedy)
        self.prior, self.batch_size, self.seed, self.blocks = prior, batch_size, seed, blocks

    def __getitem__(self, index: int) -> SyntheticBatch:
        """The batch of an index, 0 or more."""
        if index < 0:
            raise IndexError(f"batch {index}: batches are counted from 0")
        code, cells = self.prior.sample(self.batch_size, (self.seed * GOLDEN + index * FIRST + 1) % 2**63)
        return SyntheticBatch(_padded(code, self.blocks), unpack(cells))


def own_cells(blocks: Int[Tensor, "B K 32 32"]) -> Bool[Tensor, "B K"]:
    """Which blocks to keep so that all have cells of their own and the shape stays; the earlier of equal ones do."""
    before, after = preceding(blocks), torch.zeros_like(blocks[:, 0])
    keep = torch.zeros(blocks.shape[:2], dtype=torch.bool)
    for k in reversed(range(blocks.shape[1])):
        keep[:, k] = (blocks[:, k] & ~(before[:, k] | after)).flatten(1).any(-1)
        after |= blocks[:, k] * keep[:, k, None, None]
    return keep


def _code(programs: list[Rows]) -> Code:
    lengths = np.array([len(rows) for rows in programs])
    table = np.zeros((len(programs), lengths.max(), PUBLISHED_DEPTH * (1 + SLOTS)), np.int64)
    table[np.arange(lengths.max()) < lengths[:, None]] = [row for rows in programs for row in rows]
    ids, parameters = torch.from_numpy(table).split([PUBLISHED_DEPTH, PUBLISHED_DEPTH * SLOTS], -1)
    return Code(ids.contiguous(), parameters.unflatten(-1, (PUBLISHED_DEPTH, SLOTS)).float())


def _padded(code: Code, blocks: int) -> Code:
    missing = blocks - code.ids.shape[1]
    return Code(pad(code.ids, (0, 0, 0, missing)), pad(code.parameters, (0, 0, 0, 0, 0, missing)))
