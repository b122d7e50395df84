"""Plot the sample efficiency of adaptation from finished runs, and the extrapolation of renderer and neural executor.

shapeprog paper table PACKS --results RESULTS --seeds 3
python -m benchmarks.plot_adaptation PACKS RESULTS docs
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import torch
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from torch.nn.functional import one_hot

from shapeprog.geometry.cells import iou, pack, rasterise
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks, unroll
from shapeprog.liang2022.evaluate import scores_on_packs
from shapeprog.liang2022.experiment import CATEGORIES, ROWS
from shapeprog.liang2022.generator import IDS, vocabulary
from shapeprog.liang2022.loop import read_log
from shapeprog.liang2022.prior import PRIORS
from shapeprog.liang2022.settings import LOG, AdaptSettings
from shapeprog.liang2022.weights import load_executor, load_generator

CURVES = {"tian2019-guided": "C1.-", "tian2019-direct": "C0.-"}
"""Rows whose adaptation is plotted, with matplotlib's format of their curves."""


def plot_efficiency(packs: Path, results: Path, out: Path) -> None:
    """CD of validation shapes against presentations of training shapes, a curve for each seed."""
    figure = Figure((4.5 * len(CATEGORIES), 3.6), layout="constrained")
    curves: dict[str, Line2D] = {}
    for axis, category in zip(figure.subplots(1, len(CATEGORIES)), CATEGORIES, strict=True):
        packed, cd = packs / f"{category}_val.npz", f"val_{category}_val_cd"
        for row, style in CURVES.items():
            decoder = ROWS[row].options.get("decoder", AdaptSettings.decoder)
            start = scores_on_packs(load_generator(ROWS[row].initial), [packed], decoder)
            first = {"samples_seen": 0, cd: start[cd.removeprefix("val_")]}
            for folder in sorted(results.glob(f"runs/{row}-{category}-*")):
                records = [record for record in (first, *read_log(folder / LOG)) if cd in record]
                shapes = [record["samples_seen"] for record in records]
                curves[row], *_ = axis.plot(shapes, [1000 * record[cd] for record in records], style)
        axis.set(title=category, xlabel="presentations", ylabel="CD x 1000", ylim=(0, None))
    figure.legend(curves.values(), curves.keys(), loc="outside lower center", ncols=len(curves))
    figure.savefig(out, dpi=120)


def extrapolation(count: int = 400, seed: int = 0) -> list[tuple[int, float, float]]:
    """Cells that a number of a block is moved beyond its synthetic range, and mean IoU with the exact cells.

    The IoU of the renderer's continuous primitives comes first, then that of the neural executor.
    """
    code = PRIORS["narrow"].sample(20 * count, seed).code
    ids, numbers = code.ids.flatten(0, 1), code.parameters.flatten(0, 1)
    ids, numbers = ids[ids[:, 0] > 0], numbers[ids[:, 0] > 0]
    table, executor, rng = vocabulary(), load_executor(), torch.Generator().manual_seed(seed)
    row, rows = torch.arange(count), []
    for beyond in (0, 1, 2, 3, 4, 6, 8):
        some = torch.randperm(len(ids), generator=rng)[:count]
        block, moved = ids[some], numbers[some].clone()
        step = (block > 0).sum(-1) - 1
        drawing = block[row, step]
        free = [each.nonzero()[:, 0] for each in (table.used & ~table.discrete)[drawing]]
        slot = torch.stack([each[torch.randint(len(each), (), generator=rng)] for each in free])
        if beyond:
            largest = torch.stack([numbers[ids == each, at].max() for each, at in zip(drawing, slot, strict=True)])
            moved[row, step, slot] = torch.minimum(largest + beyond, table.high[drawing, slot])
        exact = draw_blocks(Code(block[:, None], moved[:, None]))[:, 0]
        rendered = rasterise(unroll(Code(block[:, None], moved[:, None] + 1e-3)))  # whole numbers keep their cells
        with torch.no_grad():
            neural = pack((executor(one_hot(block, IDS).float(), moved) > 0).to(torch.uint8))
        nonempty = exact.flatten(1).any(-1)
        renderer_iou, neural_iou = (float(iou(cells, exact)[nonempty].mean()) for cells in (rendered, neural))
        rows.append((beyond, renderer_iou, neural_iou))
    return rows


def plot_extrapolation(rows: Sequence[tuple[int, float, float]], out: Path) -> None:
    """IoU against cells beyond the range, of the rows of :func:`extrapolation`."""
    figure = Figure((4.5, 3.2), layout="tight")
    axis = figure.subplots()
    axis.plot([row[0] for row in rows], [row[1:] for row in rows], label=["renderer", "neural executor"])
    axis.set(xlabel="cells beyond the synthetic range", ylabel="IoU with the exact cells", ylim=(0, 1.02))
    axis.legend()
    figure.savefig(out, dpi=120)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("packs", type=Path, help="folder of the packs")
    parser.add_argument("results", type=Path, help="folder of the runs")
    parser.add_argument("out", type=Path, help="folder for both plots")
    args = parser.parse_args()
    plot_extrapolation(extrapolation(), args.out / "extrapolation.png")
    plot_efficiency(args.packs, args.results, args.out / "adaptation_efficiency.png")
