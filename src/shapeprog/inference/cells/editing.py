"""Editing of programs of blocks: remove blocks, insert better ones, keep changes that raise the objective."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.cells import pack, words_of
from shapeprog.inference.cells.block_kernels import (
    BACK,
    DISC,
    EXTENT,
    FIRST,
    FORM,
    RADIUS,
    TILT,
    WIDTH,
    Rows,
    cells_of,
    descend,
    draw_all,
    draw_each,
    statements,
)
from shapeprog.inference.cells.proposal_kernels import families, propose
from shapeprog.inference.cells.settings import Settings
from shapeprog.space import HALF, FloatArray

Whole = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Target:
    """Target and objective of a search.

    Parameters
    ----------
    occupied, cells
        The solid as rows of bits (1024), and the number of its cells.
    low, high
        Bounding box of its cells, in cells of the grid from 0.
    table
        The ways of repeating a box: rows of ``families``.
    settings
        Limits and prices.
    """

    occupied: Rows
    cells: int
    low: Whole
    high: Whole
    table: Whole
    settings: Settings

    @classmethod
    def of(cls, voxels: npt.NDArray[np.bool_], settings: Settings) -> Target:
        """The target for a solid of cells (32, 32, 32)."""
        cells = np.argwhere(voxels)
        low, high = cells.min(0), cells.max(0) + 1
        table = families((high - low).tolist(), settings.copies)
        return cls(words_of(pack(voxels)).reshape(-1), len(cells), low, high, table, settings)

    @property
    def statement(self) -> float:
        """Price of a statement in cells."""
        return self.settings.price * self.cells


def value_of(blocks: FloatArray, target: Target) -> float:
    """IoU minus price x statements."""
    return iou(draw_all(blocks), target) - target.settings.price * int(statements(blocks.T).sum())


def iou(rows: Rows, target: Target) -> float:
    """IoU of rows (1024) with the target."""
    return float(_shared(rows, target.occupied) / np.bitwise_count(rows | target.occupied).sum())


def _shared(rows: Rows, cells: Rows) -> Whole:
    """Number of cells that sets of rows (P, 1024), or one (1024), share with another set (1024)."""
    return np.asarray(np.bitwise_count(rows & cells).sum(-1, dtype=np.int64))


def improve_block(block: FloatArray, covered: Rows, target: Target) -> FloatArray:
    """A block after descent on IoU minus price x statements, the other blocks fixed, whose cells are rows (1024)."""
    better = block.copy()
    descend(better, target.occupied.view(np.uint64), covered.view(np.uint64), target.settings.price)
    return better


def polish(blocks: FloatArray, target: Target) -> FloatArray:
    """Blocks after descent, three times one after another; a block that no longer pays is dropped."""
    blocks, rows = blocks.copy(), draw_each(blocks)
    settled = np.zeros(len(blocks), np.bool_)
    for k in [*range(len(blocks))] * 3:
        if settled[k]:
            continue
        better = improve_block(blocks[k], _union_without(rows, k), target)
        if not np.array_equal(better, blocks[k]):
            settled[:] = False
            blocks[k], rows[k] = better, draw_all(better[None])
        settled[k] = True
    k, current = 0, iou(np.bitwise_or.reduce(rows), target)
    while k < len(blocks):
        without = iou(_union_without(rows, k), target)
        if without >= current - target.settings.price * statements(blocks[k]):
            blocks, rows, current = np.delete(blocks, k, 0), np.delete(rows, k, 0), without
        else:
            k += 1
    return blocks


def _union_without(rows: Rows, k: int) -> Rows:
    """Rows of all blocks but one."""
    return np.asarray(np.bitwise_or.reduce(np.delete(rows, k, 0)))


def best_box(covered: Rows, waste: float, table: Whole, target: Target) -> tuple[float, FloatArray]:
    """The repeated box with the largest gain on uncovered cells, and its gain in cells; zero when none gains.

    Parameters
    ----------
    waste
        Weight of an empty cell against an occupied one.
    table
        The ways of repeating a box to try.
    """
    block, inside = np.zeros(WIDTH), tuple(map(slice, target.low, target.high))
    occupied, done = cells_of(target.occupied)[inside], cells_of(covered)[inside]
    weights = np.where(done, 0, np.where(occupied, 1, -waste)).astype(np.float32)
    gain = propose(weights, table, target.statement, block)
    block[FIRST:EXTENT] += target.low - HALF
    return gain, block


def best_form(covered: Rows, waste: float, box: FloatArray, target: Target) -> tuple[float, FloatArray]:
    """The disc or sheared back with the largest gain in place of a box, after descent, and its gain in cells."""
    rough = _best(np.concatenate([_disc(box)[None], _backs(box)]), covered, waste, target)[1]
    return _best(improve_block(rough, covered, target)[None], covered, waste, target)


def _best(blocks: FloatArray, covered: Rows, waste: float, target: Target) -> tuple[float, FloatArray]:
    """The block with the largest gain on uncovered cells, and its gain in cells."""
    rows = draw_each(blocks)
    gained, wasted = _shared(rows, target.occupied & ~covered), _shared(rows, ~target.occupied & ~covered)
    gains = gained - waste * wasted - target.statement * statements(blocks.T)
    best = int(gains.argmax())
    return float(gains[best]), blocks[best]


def _disc(box: FloatArray) -> FloatArray:
    """The upright cylinder (16) in the middle of a box, as wide as that on average."""
    disc, across = box.copy(), box[EXTENT + 1 : EXTENT + 3]
    disc[FORM], disc[RADIUS], disc[RADIUS + 1] = DISC, max(1, np.rint(across.sum() / 4)), 0
    disc[FIRST + 1 : FIRST + 3] = np.rint(box[FIRST + 1 : FIRST + 3] + across / 2)
    return disc


def _backs(box: FloatArray) -> FloatArray:
    """A box sheared by up to five cells to either side (10, 16)."""
    backs = np.repeat(box[None], 10, 0)
    backs[:, FORM], backs[:, TILT] = BACK, [-5, -4, -3, -2, -1, 1, 2, 3, 4, 5]
    return backs
