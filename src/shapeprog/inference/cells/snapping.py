"""Snapping to the grid: whole numbers within one step of the rounded ones that raise the IoU; no statement changes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.geometry.cells import Cells, iou, pack, rasterise
from shapeprog.language.program import Program
from shapeprog.language.statement import language
from shapeprog.language.tensors import Code, decode, encode
from shapeprog.language.unroll import unroll

SWEEPS = 6
"""Most passes over all parameters."""


def snap(program: Program, voxels: npt.NDArray[np.bool_]) -> Program:
    """The program with every parameter a whole number, each within one of its rounded value.

    Starts from rounding half to even and descends one parameter after another on the IoU with ``voxels``
    (32, 32, 32); all steps of one block are drawn in one batch.  Works for every statement.
    """
    if not program.size:
        return program.snap()
    start = encode(program.flat())
    rounded = start.parameters.round()
    target = pack(voxels)
    best = rounded.clone()
    best_iou = _ious(Code(start.ids[None], best[None]), target)[0]
    for _ in range(SWEEPS):
        before = best_iou
        for block in range(start.ids.shape[0]):
            trials = [best]
            for step, number in enumerate(start.ids[block].tolist()):
                if number not in language():
                    continue
                for slot, quantity in enumerate(language()[number].quantities):
                    if quantity.discrete:
                        continue
                    for value in (-1.0, 0.0, 1.0):
                        wanted = rounded[block, step, slot] + value
                        if wanted != best[block, step, slot]:
                            trial = best.clone()
                            trial[block, step, slot] = wanted
                            trials.append(trial)
            ious = _ious(Code(start.ids.expand(len(trials), -1, -1), torch.stack(trials)), target)
            chosen = int(ious.argmax())
            if ious[chosen] > best_iou:
                best, best_iou = trials[chosen], ious[chosen]
        if best_iou <= before:
            break
    return decode(start.having(best))[0]


def snapped_from(program: Program, snapped: Program) -> bool:
    """Whether ``snapped`` is whole-numbered, has the same statements, and is within one of the rounded parameters."""
    mine, theirs = encode(program.flat()), encode(snapped.flat())
    if mine.ids.shape != theirs.ids.shape or bool((mine.ids != theirs.ids).any()):
        return False
    whole = bool((theirs.parameters == theirs.parameters.round()).all())
    return whole and bool(((theirs.parameters - mine.parameters.round()).abs() <= 1).all())


def _ious(code: Code, target: Cells) -> Float[Tensor, " B"]:
    return iou(rasterise(unroll(code)), target)
