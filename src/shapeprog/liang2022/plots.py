"""Plots of the experiment: sample efficiency of adaptation, and extrapolation of both executors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn.functional import one_hot

from shapeprog.geometry.cells import iou, pack, rasterise
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks, unroll
from shapeprog.liang2022.evaluate import scores_on_packs
from shapeprog.liang2022.experiment import CATEGORIES, ROWS
from shapeprog.liang2022.generator import IDS, vocabulary
from shapeprog.liang2022.loop import read_log
from shapeprog.liang2022.prior import prior
from shapeprog.liang2022.weights import load_executor, load_generator

BEYOND = (0, 1, 2, 3, 4, 6, 8)
"""Cells that a number is moved beyond its range in the synthetic data."""

HALF_OPEN = 1e-3
"""Numbers are made larger by this before their cells are drawn continuously, so that whole numbers keep their cells."""


def plot_efficiency(packs: Path, results: Path, out: Path) -> None:
    """CD of validation shapes against shapes seen in adaptation, for guided and direct rows of both priors."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, len(CATEGORIES), figsize=(4.5 * len(CATEGORIES), 3.2))
    for axis, category in zip(axes, CATEGORIES, strict=True):
        pack = packs / f"{category}_val.npz"
        for (name, start), style in zip(
            (("", "none"), ("wide-", "wide-none")), ({"linestyle": "-"}, {"linestyle": "--"}), strict=True
        ):
            initial = scores_on_packs(load_generator(ROWS[start].initial), [pack], "novel")[f"{pack.stem}_cd"]
            for method, colour in (("guided", "tab:orange"), ("direct", "tab:blue")):
                for folder in sorted(results.glob(f"runs/{name}{method}-{category}-*")):
                    scores = [(r["samples_seen"], r.get(f"val_{pack.stem}_cd")) for r in read_log(folder)]
                    seen, cd = zip((0, initial), *[(x, y) for x, y in scores if y is not None], strict=True)
                    axis.plot(seen, 1000 * np.array(cd), color=colour, label=name + method, marker=".", **style)
        axis.set(title=category, xlabel="shapes seen", ylabel="CD x 1000", ylim=(0, None))
        axis.legend()
    figure.tight_layout()
    figure.savefig(out, dpi=120)
    pyplot.close(figure)


def extrapolation(count: int = 400, seed: int = 0) -> list[tuple[int, float, float]]:
    """IoU with the exact cells of blocks one of whose numbers is moved beyond its synthetic range.

    Returns
    -------
    Cells beyond the range, mean IoU of the renderer's continuous primitives, mean IoU of the neural executor.
    """
    code, _ = prior("narrow").sample(20 * count, seed)
    ids, numbers = code.ids.flatten(0, 1), code.parameters.flatten(0, 1)
    ids, numbers = ids[ids[:, 0] > 0], numbers[ids[:, 0] > 0]
    executor, rng = load_executor(), torch.Generator().manual_seed(seed)
    rows: list[tuple[int, float, float]] = []
    for beyond in BEYOND:
        some = torch.randperm(len(ids), generator=rng)[:count]
        moved = _moved(ids, numbers, some, beyond, rng)
        block = Code(ids[some][:, None], moved[:, None])
        exact = draw_blocks(block)[:, 0]
        rendered = rasterise(unroll(Code(block.ids, block.parameters + HALF_OPEN)))
        with torch.no_grad():
            executor_cells = pack((executor(one_hot(ids[some], IDS).float(), moved) > 0).to(torch.uint8))
        nonempty = exact.flatten(1).any(-1)
        renderer, neural = (float(iou(cells, exact)[nonempty].mean()) for cells in (rendered, executor_cells))
        rows.append((beyond, renderer, neural))
    return rows


def _moved(
    ids: Int[Tensor, "N J"], numbers: Float[Tensor, "N J 7"], some: Int[Tensor, " M"], beyond: int, rng: torch.Generator
) -> Float[Tensor, "M J 7"]:
    """Blocks with one continuous number of the drawing statement set beyond the largest of its id and slot."""
    table, moved = vocabulary(), numbers[some].clone()
    for row, block in enumerate(some.tolist()):
        step = int((ids[block] > 0).sum()) - 1
        statement = int(ids[block, step])
        free = (table.used[statement] & ~table.discrete[statement]).nonzero()[:, 0]
        slot = int(free[torch.randint(len(free), (), generator=rng)])
        if beyond:
            largest = numbers[ids == statement][:, slot].max()
            moved[row, step, slot] = torch.minimum(largest + beyond, table.high[statement, slot])
    return moved


def plot_extrapolation(rows: Sequence[tuple[int, float, float]], out: Path) -> None:
    """IoU against cells beyond the range."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axis = pyplot.subplots(figsize=(4.5, 3.2))
    beyond, renderer, executor = np.array(rows).T
    axis.plot(beyond, renderer, label="renderer", color="tab:blue")
    axis.plot(beyond, executor, label="neural executor", color="tab:orange")
    axis.set(xlabel="cells beyond the synthetic range", ylabel="IoU with the exact cells", ylim=(0, 1.02))
    axis.legend()
    figure.tight_layout()
    figure.savefig(out, dpi=120)
    pyplot.close(figure)
