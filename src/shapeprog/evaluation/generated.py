"""How well a generator rebuilds shapes in a single pass, as it comes: IoU of all, CD and F1 where points are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from shapeprog.evaluation.metrics import Metrics, Target, evaluate_program, summarise, target_samples, world_scale
from shapeprog.geometry.cells import iou, pack, union
from shapeprog.language.program import Program
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks
from shapeprog.models.decoding import Choice, decode, programs, whole_programs
from shapeprog.models.generator import Generator

AT_ONCE = 64
"""Shapes that are decoded together."""


class Written(NamedTuple):
    """A program of a generator, and the same in whole numbers as it was drawn on the canvas."""

    program: Program
    whole: Program


def single_pass(
    generator: Generator, cells: UInt8[Tensor, "B 32 32 32"], blocks: int = 10, choose: Choice = "drawn"
) -> tuple[Code, Code]:
    """Programs (B, K, J) of targets in a single pass, and the same as drawn; see :class:`Decoded`."""
    with torch.no_grad():
        parts = [decode(generator, part, blocks=blocks, choose=choose) for part in cells.split(AT_ONCE)]
    return _joined([part.code for part in parts]), _joined([part.drawn for part in parts])


def _joined(parts: Sequence[Code]) -> Code:
    return Code(torch.cat([part.ids for part in parts]), torch.cat([part.parameters for part in parts]))


def code_iou(code: Code, cells: UInt8[Tensor, "B 32 32 32"]) -> Float[Tensor, " B"]:
    """IoU (B,) at 32^3 of programs, rounded to whole numbers, with targets."""
    return iou(union(draw_blocks(code)), pack(cells)).cpu()


def generated(
    generator: Generator, targets: Sequence[Target], blocks: int = 10, choose: Choice = "drawn"
) -> list[Written]:
    """The program of each target in a single pass."""
    if not targets:
        return []
    device = next(generator.parameters()).device
    cells = torch.from_numpy(np.stack([target.voxels for target in targets])).to(device, torch.uint8)
    code, drawn = single_pass(generator, cells, blocks, choose)
    return [Written(*each) for each in zip(programs(code), whole_programs(drawn), strict=True)]


def evaluate_generator(
    generator: Generator,
    targets: Sequence[Target],
    blocks: int = 10,
    points: int = 5000,
    seed: int = 0,
    snapping: bool = False,
    choose: Choice = "drawn",
) -> list[Metrics]:
    """The measures of the program of each target in a single pass.

    Parameters
    ----------
    choose
        How blocks are chosen, see :func:`shapeprog.models.decoding.decode`.
    snapping
        Whether whole numbers within one of the rounded parameters may be searched for the IoU; else it is that of the
        program as it was drawn.
    """
    written = generated(generator, targets, blocks, choose)
    with torch.autocast(next(generator.parameters()).device.type, enabled=False):
        return [measured(each, target, points, seed, snapping) for each, target in zip(written, targets, strict=True)]


def scores_on_packs(generator: Generator, packs: Mapping[str, Sequence[Target]], blocks: int = 10) -> dict[str, float]:
    """Means over the shapes of each pack: ``PACK_iou``, ``PACK_cd``, ``PACK_cd_median`` and ``PACK_blocks``."""
    scores: dict[str, float] = {}
    for name, shapes in packs.items():
        summary = summarise(evaluate_generator(generator, shapes, blocks))
        scores |= {f"{name}_{each}": summary[each].mean for each in ("iou", "cd", "blocks")}
        scores[f"{name}_cd_median"] = summary["cd"].median
    return scores


def measured(
    written: Written,
    target: Target,
    points: int = 5000,
    seed: int = 0,
    snapping: bool = False,
    *,
    looks: bool = False,
) -> Metrics:
    """The measures of a program; one that draws nothing counts as a single point in the centre of the grid.

    An infinite distance would make every mean infinite for the sake of one shape.  The arguments are those of
    :func:`evaluate_generator` and :func:`shapeprog.evaluation.metrics.evaluate_program`.
    """
    from shapeprog.inference.snapping import snap

    snapped = snap(written.program, target.voxels) if snapping else written.whole
    row = evaluate_program(written.program, target, snapped, points, seed, looks=looks)
    samples = None if np.isfinite(row.cd) else target_samples(target, points, seed)
    if samples is None:
        return row
    squared = (samples[0] ** 2).sum(-1) * world_scale(target) ** 2
    there, back = float(squared.min()), float(squared.mean())
    return replace(row, cd=there + back, to_target=there, from_target=back)
