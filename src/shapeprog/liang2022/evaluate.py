"""Measures of generators on packs of real shapes; the conventions are those of :mod:`shapeprog.evaluation.metrics`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from shapeprog.data.packs import read_pack
from shapeprog.data.shape import Shape
from shapeprog.evaluation.metrics import Metrics, evaluate_program, summarise, target_samples, world_scale
from shapeprog.language.program import Program
from shapeprog.liang2022.decode import Decoder, decode_all
from shapeprog.liang2022.generator import Generator


def evaluate(generator: Generator, shapes: Sequence[Shape], decoder: Decoder, seed: int = 0) -> list[Metrics]:
    """Measures of single-pass programs; IoU is of the canvas.

    Parameters
    ----------
    decoder
        How programs are written.
    seed
        Seed of the samples of surfaces.
    """
    decoded = decode_all(generator, grids(shapes).to(next(generator.parameters()).device), decoder=decoder)
    rows = zip(decoded.programs(), decoded.programs(whole=True), shapes, strict=True)
    return [measure(program, whole, shape, seed) for program, whole, shape in rows]


def grids(shapes: Sequence[Shape]) -> UInt8[Tensor, "B 32 32 32"]:
    """Cells of shapes."""
    return torch.from_numpy(np.stack([shape.voxels for shape in shapes]).astype(np.uint8))


def measure(program: Program, whole: Program, shape: Shape, seed: int = 0) -> Metrics:
    """Measures of a program; one that draws nothing counts as a point in the centre of the grid."""
    row = evaluate_program(program, shape, whole, seed=seed)
    samples = None if np.isfinite(row.cd) else target_samples(shape, 5000, seed)
    if samples is None:
        return row
    squared = (samples[0] ** 2).sum(-1) * world_scale(shape) ** 2
    forward, back = float(squared.min()), float(squared.mean())
    return replace(row, cd=forward + back, to_target=forward, from_target=back)


def scores_on_packs(generator: Generator, packs: Sequence[str | Path], decoder: Decoder) -> dict[str, Any]:
    """Mean IoU and CD, median CD and mean number of blocks of the shapes of each pack."""
    scores: dict[str, float] = {}
    for path in packs:
        summary = summarise(evaluate(generator, list(read_pack(path)), decoder))
        name = Path(path).stem
        scores |= {f"{name}_{key}": summary[key].mean for key in ("iou", "cd", "blocks")}
        scores[f"{name}_cd_median"] = summary["cd"].median
    return scores
