"""Measures of generators on packs of real shapes; the conventions are those of :mod:`shapeprog.evaluation.metrics`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from shapeprog.data import Shape, read_pack
from shapeprog.evaluation.metrics import Metrics, evaluate_program, summarise, target_samples, world_scale
from shapeprog.language import Program
from shapeprog.liang2022.decode import decode
from shapeprog.liang2022.generator import Generator
from shapeprog.liang2022.settings import Decoder

BATCH_SIZE = 64


def decode_all(generator: Generator, shapes: Sequence[Shape], decoder: Decoder) -> tuple[list[Program], list[Program]]:
    """Programs with numbers to a hundredth of a cell, and with whole numbers as drawn on the canvas."""
    target = torch.from_numpy(np.stack([shape.voxels for shape in shapes])).to(generator.used.device, torch.uint8)
    parts = [decode(generator, part, decoder=decoder) for part in target.split(BATCH_SIZE)]
    fine, on_canvas = ([program for part in parts for program in part.programs(flag)] for flag in (False, True))
    return fine, on_canvas


def measure(program: Program, on_canvas: Program, shape: Shape, seed: int = 0) -> Metrics:
    """Measures of a program, IoU as drawn on the canvas; one that draws nothing counts as a point in the centre."""
    row = evaluate_program(program, shape, on_canvas, seed=seed)
    if np.isfinite(row.cd) or (samples := target_samples(shape, 5000, seed)) is None:
        return row
    squared = (samples[0] ** 2).sum(-1) * world_scale(shape) ** 2
    to_target, from_target = float(squared.min()), float(squared.mean())
    return replace(row, cd=to_target + from_target, to_target=to_target, from_target=from_target)


def scores_on_packs(generator: Generator, packs: Sequence[str | Path], decoder: Decoder) -> dict[str, Any]:
    """Mean IoU and CD, median CD and mean number of blocks of the shapes of each pack."""
    scores: dict[str, float] = {}
    for path in map(Path, packs):
        shapes = list(read_pack(path))
        summary = summarise(list(map(measure, *decode_all(generator, shapes, decoder), shapes)))
        scores |= {f"{path.stem}_{key}": summary[key].mean for key in ("iou", "cd", "blocks")}
        scores[f"{path.stem}_cd_median"] = summary["cd"].median
    return scores
