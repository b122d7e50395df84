"""Editing of programs of blocks: remove blocks, insert better ones, keep changes that raise the objective."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.cells import pack, words_of
from shapeprog.inference.cells.block_layout import BACK, DISC, EXTENT, FIRST, FORM, RADIUS, TILT, WIDTH
from shapeprog.inference.cells.descent_kernels import MOST_MOVES, descend, statements
from shapeprog.inference.cells.drawing import Rows, Whole, cells_shared, draw_all, draw_each
from shapeprog.inference.cells.families import families
from shapeprog.inference.cells.fold_kernels import VOLUMES
from shapeprog.inference.cells.proposal_kernels import propose
from shapeprog.inference.cells.raster_kernels import ROWS
from shapeprog.inference.cells.settings import Settings
from shapeprog.space import RESOLUTION, FloatArray


@dataclass(frozen=True)
class Target:
    """Target and objective of a search.

    Parameters
    ----------
    occupied
        The solid as rows of bits (1024).
    low, high
        Bounding box of its cells, in cells of the grid from 0.
    table
        The ways of repeating a box.
    cells
        Number of occupied cells.
    settings
        Limits and prices.
    """

    occupied: Rows
    low: Whole
    high: Whole
    table: Whole
    cells: int
    settings: Settings

    @classmethod
    def of(cls, voxels: npt.NDArray[np.bool_], settings: Settings) -> Target:
        """The target for a solid of cells (32, 32, 32)."""
        cells = np.argwhere(voxels)
        low, high = cells.min(0), cells.max(0) + 1
        table = families((high - low).tolist(), settings.planes, settings.copies)
        return cls(words_of(pack(voxels)).reshape(-1), low, high, table, len(cells), settings)

    @property
    def statement(self) -> float:
        """Price of a statement in cells."""
        return self.settings.price * self.cells


def value_of(blocks: FloatArray, target: Target) -> float:
    """IoU minus price x statements."""
    return iou(blocks, target) - target.settings.price * int(statements(blocks.T).sum())


def iou(blocks: FloatArray, target: Target) -> float:
    """IoU of the cells that blocks draw with those of the target."""
    return _iou(draw_all(blocks), target)


def _iou(rows: Rows, target: Target) -> float:
    """IoU of rows (1024) with the target."""
    inter, beyond = cells_shared(rows[None], target.occupied, ~target.occupied)[0].tolist()
    return float(inter / (target.cells + beyond))


def improve_block(block: FloatArray, occupied: Rows, covered: Rows, price: float, far: int) -> tuple[FloatArray, float]:
    """A block after descent on IoU minus price x statements, the other blocks fixed, and the value reached.

    Parameters
    ----------
    occupied, covered
        The solid, and the cells of the other blocks, as rows (1024).
    price
        Price of a statement in IoU.
    far
        Largest step of one move in cells.
    """
    better, rows, around = block.copy(), np.empty((3, ROWS), np.uint32), np.empty((MOST_MOVES, WIDTH))
    words = rows.view(np.uint64)
    value = descend(better, occupied.view(np.uint64), covered.view(np.uint64), price, far, rows, words, around)
    return better, value


def polish(blocks: FloatArray, target: Target, far: int, sweeps: int) -> FloatArray:
    """Blocks after descent, one after another until nothing changes; a block that no longer pays is dropped.

    Parameters
    ----------
    far
        Largest step of one move in cells.
    sweeps
        Most passes over all blocks.
    """
    blocks = blocks.copy()
    rows = draw_each(blocks)
    settled = np.zeros(len(blocks), np.bool_)
    for _ in range(sweeps):
        changed = False
        for k in range(len(blocks)):
            if settled[k]:
                continue
            better, _value = improve_block(blocks[k], target.occupied, _union(rows, k), target.settings.price, far)
            settled[k] = True
            if not np.array_equal(better, blocks[k]):
                changed = True
                settled[:] = False
                settled[k] = True
                blocks[k] = better
                rows[k] = draw_all(better[None])
        if not changed:
            break
    k, current = 0, _iou(_union(rows, len(rows)), target)
    while k < len(blocks):
        without = _iou(_union(rows, k), target)
        if without >= current - target.settings.price * statements(blocks[k]):
            blocks, rows, current = np.delete(blocks, k, 0), np.delete(rows, k, 0), without
        else:
            k += 1
    return blocks


def _union(rows: Rows, left_out: int) -> Rows:
    """Rows of all blocks but one."""
    before = np.bitwise_or.reduce(rows[:left_out], axis=0)
    return np.asarray(before | np.bitwise_or.reduce(rows[left_out + 1 :], axis=0))


def propose_form(form: int, covered: Rows, waste: float, box: FloatArray, target: Target) -> tuple[float, FloatArray]:
    """A disc or a sheared back in place of a box, improved by descent: its gain on uncovered cells, and the block.

    Parameters
    ----------
    form
        ``DISC`` or ``BACK``.
    waste
        Weight of an empty cell against an occupied one.
    box
        The box that was proposed for these cells; without cells there is nothing in its place.
    """
    if not box[EXTENT]:
        return 0.0, box
    gained, wasted = target.occupied & ~covered, ~target.occupied & ~covered
    rough = _discs(box) if form == DISC else _backs(box)
    best = rough[int(_nets(rough, gained, wasted, waste).argmax())]
    block, _value = improve_block(best, target.occupied, covered, target.settings.price, 2)
    return float(_nets(block[None], gained, wasted, waste)[0] - target.statement * statements(block)), block


def _discs(box: FloatArray) -> FloatArray:
    """The upright cylinder (1, 16) in the middle of a box, as wide as that on average."""
    disc, across = box.copy(), box[EXTENT + 1 : EXTENT + 3]
    disc[FORM], disc[RADIUS], disc[RADIUS + 1] = DISC, max(1, np.rint(across.sum() / 4)), 0
    disc[FIRST + 1 : FIRST + 3] = np.rint(box[FIRST + 1 : FIRST + 3] + across / 2)
    return disc[None]


def _backs(box: FloatArray) -> FloatArray:
    """A box sheared by up to five cells (P, 16): as deep as it is, and so much thinner that it stays within."""
    tilts = np.delete(np.arange(-5, 6), 5)
    deep = np.repeat(box[None], len(tilts), 0)
    deep[:, FORM], deep[:, TILT] = BACK, tilts
    thin = deep.copy()
    thin[:, EXTENT + 1] -= np.abs(tilts)
    thin[:, FIRST + 1] -= np.minimum(tilts, 0)
    return np.concatenate([deep, thin[thin[:, EXTENT + 1] > 0]])


def _nets(blocks: FloatArray, gained: Rows, wasted: Rows, waste: float) -> FloatArray:
    """Cells of ``gained`` that each block covers, minus ``waste`` times those of ``wasted``."""
    counts = cells_shared(draw_each(blocks), gained, wasted)
    return counts[:, 0] - waste * counts[:, 1]


def best_box(covered: Rows, waste: float, picks: Whole, target: Target) -> tuple[float, FloatArray]:
    """The repeated box with the largest gain on uncovered cells, and its gain in cells; zero when none gains.

    Parameters
    ----------
    waste
        Weight of an empty cell against an occupied one.
    picks
        Indices of the families to try.
    """
    block, volumes = np.zeros(WIDTH), np.empty((VOLUMES, RESOLUTION**3), np.float32)
    gain = propose(
        target.occupied, covered, waste, target.low, target.high, target.table, picks, target.statement,
        volumes, block,
    )  # fmt: skip
    return gain, block
