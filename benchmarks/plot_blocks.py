"""Plot IoU against the number of blocks allowed, search and greedy boxes, from rows of ``reconstruction.py``.

    python -m benchmarks.reconstruction --packs chair.npz table.npz --shapes 12 --blocks 1 2 3 4 5 6 8 10 \\
        --methods "greedy boxes" search --out blocks.jsonl
    python -m benchmarks.plot_blocks blocks.jsonl docs/iou_against_blocks.png
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import matplotlib
import numpy as np

from benchmarks.rows import read_rows

matplotlib.use("Agg")
from matplotlib import pyplot as plt

STYLES = {"search": ("-o", "#1f4e79"), "greedy boxes": ("--s", "#b0413e")}


def main(rows_path: str, picture: str) -> None:
    """One panel for each category: mean IoU with its standard error against the most blocks allowed."""
    groups: dict[tuple[str, str], dict[int, list[float]]] = defaultdict(lambda: defaultdict(list))
    for row in read_rows(Path(rows_path)):
        groups[row["pack"], row["method"]][row["allowed"]].append(row["iou"])
    packs = sorted({pack for pack, _ in groups})
    figure, axes = plt.subplots(1, len(packs), figsize=(2.6 * len(packs), 2.6), sharey=True, layout="constrained")
    for axis, pack in zip(np.atleast_1d(axes), packs, strict=True):
        for method, (style, colour) in STYLES.items():
            found = groups[pack, method]
            sizes = sorted(found)
            means = [np.mean(found[size]) for size in sizes]
            errors = [np.std(found[size], ddof=1) / np.sqrt(len(found[size])) for size in sizes]
            axis.errorbar(sizes, means, errors, fmt=style, color=colour, ms=3.5, lw=1.4, capsize=2, label=method)
        axis.set_title(f"{pack.removesuffix('_test').replace('_', ' ')} ({len(found[sizes[0]])} shapes)", fontsize=9)
        axis.set_xlabel("blocks allowed", fontsize=8)
        axis.set_xticks([1, 2, 4, 6, 8, 10])
        axis.tick_params(labelsize=8)
        axis.grid(alpha=0.3, lw=0.5)
        axis.spines[["top", "right"]].set_visible(False)
    np.atleast_1d(axes)[0].set_ylabel("IoU at 32$^3$, snapped", fontsize=8)
    np.atleast_1d(axes)[0].legend(fontsize=8, frameon=False, loc="lower right")
    figure.savefig(picture, dpi=200)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", help="rows of IoU, one line of JSON each")
    parser.add_argument("picture", help="the file to write")
    args = parser.parse_args()
    main(args.rows, args.picture)
