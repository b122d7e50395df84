"""What candidates do for a target that is known by its cells: which they touch, of those they should and should not.

The same bits as in :mod:`shapeprog.inference.choice.coverage`, and the same choice, whose value is then the length of a
description: share of cells that are wrong, and price of what is written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from shapeprog.data.touched import occupied
from shapeprog.geometry.cells import iou, pack
from shapeprog.inference.choice.choice import Choice, Option, choose, value
from shapeprog.inference.choice.coverage import Covers, Prices, by_word, explains, holds, nearby
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import HALF, FloatArray

TOUCHING = 0.45
"""Distance in cells from the centre of a cell within which a solid touches it; at half a cell it meets its face."""

STARTS = (1.0, 5.0)
"""Weights of an empty cell against an occupied one from which choices are made; the best is kept."""


def cost_on_cells(
    program: Program, voxels: npt.NDArray[np.bool_], detail: float = 1.0, snapped: Program | None = None
) -> float:
    """How long a description of cells (32, 32, 32) is: 1 - IoU, and the price of what is written."""
    return 1 - float(iou(occupied(program, unroll(program), snapped), pack(voxels))) + Prices().of(program) / detail


def covers_of_cells(
    candidates: Sequence[Program], voxels: npt.NDArray[np.bool_], evidence: Evidence, prices: Prices
) -> Covers:
    """What candidates cover of cells (32, 32, 32), each a program of one block; surface neither costs nor hides."""
    scene, count = unroll(candidates).detach(), len(candidates)
    near = replace(evidence, tolerance=TOUCHING)
    wanted, empty = (_in_places(np.argwhere(cells).astype(np.float64) + 0.5 - HALF) for cells in (voxels, ~voxels))
    rows = [
        explains(scene, places, np.zeros_like(places), near) | holds(scene, places, 0.0) for places in (wanted, empty)
    ]
    weights = [by_word(np.full(len(places), sign / len(wanted))) for places, sign in ((wanted, 1.0), (empty, -1.0))]
    nothing = np.zeros((count, count), np.uint64)
    return Covers(
        np.concatenate([*rows, nothing], 1), np.concatenate(weights), rows[0].shape[1], np.zeros_like(rows[0]),
        nothing[0].copy(), np.zeros(count), np.array([prices.of(each) for each in candidates]),
    )  # fmt: skip


def choose_on_cells(covers: Covers, blocks: int, *, seed: int = 0) -> Choice:
    """The best choice of several, in which empty cells weigh more or less at first.

    A body that fills all shelves is a local optimum: greed takes it at once, and no single exchange leaves it.
    """
    best: dict[int, Option] = {}
    for heavy in STARTS:
        weights = np.where(covers.weights < 0, heavy * covers.weights, covers.weights)
        for option in choose(covers._replace(weights=weights), blocks, seed=seed).options:
            found = option._replace(value=value(covers, option.chosen))
            size = len(option.chosen)
            if size not in best or found.value > best[size].value:
                best[size] = found
    options = tuple(best[size] for size in sorted(best))
    return Choice(max(options, key=lambda option: option.value), options)


def _in_places(points: FloatArray) -> FloatArray:
    """Points in an order in which neighbours share words."""
    return np.ascontiguousarray(points[np.argsort(nearby(points), kind="stable")])
