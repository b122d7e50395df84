"""Structure search: voxels to blocks of whole numbers that maximise IoU minus price x statements.

Blocks are first added one by one, each the repeated box that gains most on what is still uncovered; then rounds of
ruin and recreate take some out and put others in, discs, sheared backs, bars, stars and crosses among them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.occupancy import pack
from shapeprog.inference.block_layout import WIDTH
from shapeprog.inference.families import families
from shapeprog.space import FloatArray

PLANES = 3
"""Mirror planes nearest the middle that may pair a second loop with a first."""

MOST_COPIES = 8
"""Most copies of one loop that the search proposes; descent may add more."""


STARTS = (0.9, 2.0, 5.0)
"""Weights of an empty cell against an occupied one, from which greedy starts are made; the best start is kept.

A light weight finds solid bodies, a heavy one the boards of a shelf that a single filled box would swallow."""


@dataclass(frozen=True)
class Settings:
    """What the structure search may spend and what it must gain; chosen on val.

    Parameters
    ----------
    blocks
        Most blocks.
    price
        IoU that one more statement has to earn.
    rounds
        Rounds of ruin and recreate.
    chunk
        Rounds between two looks at the clock.
    families
        Ways of repeating a box that one round tries, drawn at random.
    forms
        Share of proposals that also try a form other than a box.
    heat
        Largest loss of the objective that a first round may accept; it cools linearly.
    """

    blocks: int = 10
    price: float = 0.001
    rounds: int = 200
    chunk: int = 20
    families: int = 200
    forms: float = 0.3
    heat: float = 0.004


@dataclass(frozen=True)
class Structure:
    """Blocks (K, 20), their IoU, and why the search stopped."""

    blocks: FloatArray
    iou: float
    reason: str


def search_structure(
    voxels: npt.NDArray[np.bool_],
    settings: Settings,
    *,
    seed: int = 0,
    deadline: float = float("inf"),
    progress: Callable[[str, float], None] | None = None,
) -> Structure:
    """Blocks for a solid of cells (32, 32, 32); the same for the same seed unless the deadline cuts it short.

    Parameters
    ----------
    deadline
        Value of ``time.monotonic()`` after which no further round starts.
    progress
        Called with what is being done and the share done.
    """
    from shapeprog.inference import editing
    from shapeprog.inference.proposal_kernels import propose
    from shapeprog.inference.raster_kernels import draw_all, iou_rows

    cells = np.argwhere(voxels)
    low, high = cells.min(0), cells.max(0) + 1
    table = families((high - low).tolist(), PLANES, MOST_COPIES)
    target = editing.Target(pack(voxels).reshape(-1), low, high, table, settings.price, len(cells))
    everything = np.arange(len(table))
    best, best_value = np.zeros((0, WIDTH)), -np.inf
    for waste in STARTS:
        blocks = np.zeros((0, WIDTH))
        while len(blocks) < settings.blocks:
            gain, block = propose(
                target.occupied, draw_all(blocks), float(np.float32(waste)), low, high, table, everything,
                target.price * target.cells,
            )  # fmt: skip
            if gain <= 0:
                break
            blocks = np.concatenate([blocks, block[None]])
        blocks = editing.polish(blocks, target, 1, 3)
        value = editing.value_of(blocks, target)
        if value > best_value:
            best, best_value = blocks, value
    done, reason = 0, f"all {settings.rounds} rounds of editing were done"
    while done < settings.rounds:
        if time.monotonic() > deadline:
            reason = f"the time budget ran out after {done} of {settings.rounds} rounds of editing"
            break
        rounds = min(settings.chunk, settings.rounds - done)
        heat = settings.heat * (1 - done / settings.rounds)
        plan = editing.Plan(settings.blocks, min(settings.families, len(table)), settings.forms, heat)
        blocks, value = editing.rebuild(best, target, plan, rounds, seed + done)
        if value >= best_value:
            best, best_value = blocks, value
        done += rounds
        if progress:
            progress("searching structure", done / settings.rounds)
    found = editing.polish(best, target, 3, 5)
    return Structure(found, float(iou_rows(draw_all(found), target.occupied)), reason)
