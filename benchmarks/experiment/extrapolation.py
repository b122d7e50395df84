"""Extrapolation: blocks with numbers beyond all that training shows, drawn by the renderer and by neural executors.

The paper claims that an analytic renderer is more faithful than a learned one "particularly in extrapolation".  Here
one number of a block of the narrow prior (a length, a position, or the copies of a loop) is moved a given number of
cells beyond the largest or smallest value that the prior ever writes for it; blocks that leave the grid are drawn anew.
The truth is the cells of the whole-numbered block, as every executor of whole numbers draws it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from shapeprog.data.synthetic import prior
from shapeprog.geometry.cells import iou, pack, voxels
from shapeprog.geometry.occupancy import soft_occupancy
from shapeprog.geometry.primitive import primitives
from shapeprog.geometry.scene import Scene
from shapeprog.language.statement import SLOTS, language
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks, unroll
from shapeprog.models.executor import NeuralExecutor
from shapeprog.space import HALF

KINDS: dict[str, tuple[str, ...]] = {
    "a length": ("length",),
    "a position or a step": ("position", "shift"),
    "the copies of a loop": ("count",),
}
"""What is moved beyond its range, and the kinds of quantity that this means."""

BEYOND = (0, 1, 2, 3, 4, 6, 8)
"""How far, in cells or copies; 0 leaves the block as the prior wrote it."""

KNOWN = 20_000
"""Programs from which the ranges of the prior are read."""

FRACTION = 0.25
"""How far, at most, the numbers of the fractional blocks are from whole ones, in cells."""

TOGETHER = 64
MOST_ROUNDS = 200


class Ranges(NamedTuple):
    """Least and greatest value of each slot of each statement that a prior writes; infinite where there is none."""

    low: Float[Tensor, "V 7"]
    high: Float[Tensor, "V 7"]


def blocks_of(name: str, programs: int, seed: int) -> Code:
    """All blocks (N, J) of programs of a prior."""
    code = prior(name)(programs, torch.Generator().manual_seed(seed))
    drawn = (code.ids > 0).any(-1)
    return Code(code.ids[drawn], code.parameters[drawn])


def ranges_of(blocks: Code) -> Ranges:
    """The ranges of the numbers of blocks (N, J)."""
    size = max(each.id for each in language()) + 1
    low, high = torch.full((size, SLOTS), torch.inf), torch.full((size, SLOTS), -torch.inf)
    ids = blocks.ids.flatten()[:, None].expand(-1, SLOTS)
    values = blocks.parameters.reshape(-1, SLOTS)
    return Ranges(low.scatter_reduce(0, ids, values, "amin"), high.scatter_reduce(0, ids, values, "amax"))


def slots_of(kinds: tuple[str, ...]) -> Bool[Tensor, "V 7"]:
    """The slots of each statement that are of one of the kinds."""
    table = torch.zeros(max(each.id for each in language()) + 1, SLOTS, dtype=torch.bool)
    for each in language():
        if not each.taught:
            continue
        for slot, quantity in enumerate(each.quantities):
            table[each.id, slot] = quantity.kind in kinds
    return table


def moved_beyond(
    blocks: Code, ranges: Ranges, kinds: tuple[str, ...], distance: int, random: torch.Generator
) -> tuple[Code, Bool[Tensor, " N"]]:
    """Blocks (N, J) with one number of the kinds moved ``distance`` beyond its range, and which blocks have one.

    Lengths and counts grow; positions and steps leave their range at either end.  A loop with more copies spreads
    them over the span it had, so that they stay in the grid.
    """
    free = slots_of(kinds)[blocks.ids].flatten(1)
    there = free.any(-1)
    if not distance:
        return blocks, there
    chosen = torch.multinomial(free.float() + 1e-9 * ~there[:, None], 1, generator=random)
    low, high = (each[blocks.ids].flatten(1).gather(1, chosen) for each in ranges)
    down = (torch.rand(len(chosen), 1, generator=random) < 0.5) & torch.tensor("position" in kinds)
    values = blocks.parameters.flatten(1).scatter(1, chosen, torch.where(down, low - distance, high + distance))
    parameters = values.unflatten(1, blocks.parameters.shape[1:])
    if "count" in kinds:
        counts = slots_of(("count",))[blocks.ids] & there[:, None, None]
        before, after = ((each * counts).sum(-1, keepdim=True) for each in (blocks.parameters, parameters))
        closer = ((before - 1) / (after - 1).clamp(min=1)).where(after > before, torch.ones(()))
        steps = slots_of(("shift",))[blocks.ids] & counts.any(-1, keepdim=True)
        parameters = torch.where(steps, (parameters * closer).round(), parameters)
    return Code(blocks.ids, parameters), there


def in_grid(scene: Scene) -> Bool[Tensor, " N"]:
    """Which scenes lie in the grid with all their primitives."""
    bounds = torch.zeros_like(scene.centre)
    for kind in torch.unique(scene.kind).tolist():
        bounds = torch.where((scene.kind == kind)[..., None], primitives[kind].bound(scene.size), bounds)
    reach = (scene.rotation.abs() @ bounds[..., None])[..., 0]
    outside = ((scene.centre.abs() + reach) > HALF + 1e-3).any(-1) & scene.mask
    return ~outside.any(-1)


def sample(
    name: str, ranges: Ranges, kinds: tuple[str, ...], distance: int, count: int, seed: int
) -> tuple[Int[Tensor, "N J"], Float[Tensor, "N J 7"]]:
    """Up to ``count`` blocks with a number that far beyond its range, within the grid, that draw something."""
    random = torch.Generator().manual_seed(seed)
    ids, parameters = [], []
    for round_ in range(MOST_ROUNDS):
        blocks, there = moved_beyond(blocks_of(name, 4 * count, seed + 1 + round_), ranges, kinds, distance, random)
        one = Code(blocks.ids[:, None], blocks.parameters[:, None])
        kept = there & in_grid(unroll(one)) & (draw_blocks(one) != 0).flatten(1).any(-1)
        ids.append(blocks.ids[kept])
        parameters.append(blocks.parameters[kept])
        if sum(map(len, ids)) >= count:
            break
    return torch.cat(ids)[:count], torch.cat(parameters)[:count]


def compared(
    ids: Int[Tensor, "N J"],
    parameters: Float[Tensor, "N J 7"],
    executors: dict[str, NeuralExecutor],
    random: torch.Generator,
) -> dict[str, np.ndarray]:
    """IoU (N,) with the exact cells, by who drew."""
    one = Code(ids[:, None], parameters[:, None])
    exact = draw_blocks(one)[:, 0]
    free = slots_of(("length", "position"))[ids]  # a step's fraction would add up over copies
    off = (2 * torch.rand(parameters.shape, generator=random) - 1) * FRACTION * free
    found = {
        "renderer, soft cells": pack(torch.cat([soft_occupancy(unroll(Code(*each))) > 0.5 for each in _parts(one)])),
        "renderer, hard cells of fractional numbers": pack(
            voxels(unroll(Code(one.ids, one.parameters + off[:, None])))
        ),
    }
    for name, executor in executors.items():
        soft = torch.nn.functional.one_hot(ids, executor.vocabulary.size).float()
        with torch.no_grad():
            logits = [executor(*each) for each in zip(*(t.split(TOGETHER) for t in (soft, parameters)), strict=True)]
        found[name] = pack(torch.cat(logits) > 0)
    return {name: iou(cells, exact).numpy() for name, cells in found.items()}


def run(executors: dict[str, NeuralExecutor], out: Path, *, name: str = "narrow", count: int = 256) -> None:
    """Compare on all kinds and distances, and write the figures as JSON."""
    ranges = ranges_of(blocks_of(name, KNOWN, 0))
    rows: list[dict[str, Any]] = []
    for title, kinds in KINDS.items():
        for distance in BEYOND:
            blocks = sample(name, ranges, kinds, distance, count, 1000 * distance + 1)
            found = compared(*blocks, executors, torch.Generator().manual_seed(distance))
            for who, ious in found.items():
                error = float(ious.std(ddof=1) / np.sqrt(len(ious)))
                told = {"beyond": distance, "drawn by": who, "iou": float(ious.mean()), "error": error}
                rows.append({"moved": title, **told, "blocks": len(ious)})
            print(title, distance, {who: round(float(ious.mean()), 3) for who, ious in found.items()}, flush=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(rows, indent=1) + "\n")


def plot(rows: list[dict[str, Any]], picture: Path) -> None:
    """A panel for each kind: IoU with the exact cells against how far the number is beyond its range."""
    from benchmarks.experiment.plotting import figure_of, tidy

    styles = [("-o", "#1f4e79"), ("--^", "#5b9bd5"), ("-s", "#b0413e"), ("--D", "#e0a458")]
    names = list(dict.fromkeys(row["drawn by"] for row in rows))
    titles = list(dict.fromkeys(row["moved"] for row in rows))
    figure, axes = figure_of(len(titles))
    for axis, title in zip(axes, titles, strict=True):
        for (style, colour), who in zip(styles, names, strict=False):
            few = [row for row in rows if row["moved"] == title and row["drawn by"] == who]
            places, ious, errors = ([row[key] for row in few] for key in ("beyond", "iou", "error"))
            axis.errorbar(places, ious, errors, fmt=style, color=colour, ms=3.5, lw=1.4, capsize=2, label=who)
        places = sorted({row["beyond"] for row in rows if row["moved"] == title})
        axis.set_xticks(places, ["inside" if not place else str(place) for place in places])
        axis.set_ylim(0, 1.03)
        unit = "copies" if "copies" in title else "cells"
        tidy(axis, title, f"{unit} beyond the range of the prior")
    axes[0].set_ylabel("IoU with the exact cells, 32$^3$", fontsize=8)
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize=8, frameon=False, loc="outside lower center", ncols=4)
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=200)


def _parts(code: Code) -> list[tuple[Tensor, Tensor]]:
    return list(zip(code.ids.split(TOGETHER), code.parameters.split(TOGETHER), strict=True))
