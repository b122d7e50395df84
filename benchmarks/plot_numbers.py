"""Plot likeness against the free numbers of programs, from rows of ``benchmarks/structure.py``.

    python -m benchmarks.structure DATA --sets bench cabinet ikea --objects 12 --methods paper all \\
        --blocks 1 2 3 4 6 8 10 --out sweep.jsonl
    python -m benchmarks.plot_numbers sweep.jsonl docs/silhouette_against_numbers.png

    python -m benchmarks.structure DATA --sets bench cabinet ikea --objects 6 --methods untied --out prices.jsonl
    python -m benchmarks.structure DATA --sets bench cabinet ikea --objects 6 --methods tied \\
        --prices 0.03 0.3 1 3 10 --out prices.jsonl
    python -m benchmarks.plot_numbers prices.jsonl docs/accuracy_against_numbers.png f1_percent price
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from benchmarks.rows import read_rows

matplotlib.use("Agg")
from matplotlib import pyplot as plt

STYLES = {
    "all": ("-o", "#1f4e79", "all statements"), "paper": ("--s", "#b0413e", "the paper's, on cells"),
    "tied": ("-o", "#1f4e79", "tied, a number worth so much"), "untied": ("s", "#b0413e", "plain numbers"),
}  # fmt: skip

WORDS = {"f1_half_percent": "F1@.5 %", "f1_percent": "F1@1 %"}


def main(rows_path: str, picture: str, measure: str = "silhouette", over: str = "allowed") -> None:
    """One panel for each set: the mean of the measure with its standard error against the mean of free numbers, for
    each number of blocks that were allowed, or each price of a number."""
    groups: dict[tuple[str, str], dict[float, list[dict[str, float]]]] = defaultdict(lambda: defaultdict(list))
    for row in read_rows(Path(rows_path)):
        groups[row["set"], row["method"]][row[over]].append(row)
    sets = sorted({which for which, _ in groups})
    figure, axes = plt.subplots(
        1, len(sets), figsize=(3.4 * len(sets), 2.8), sharey=over == "allowed", layout="constrained"
    )
    for axis, which in zip(np.atleast_1d(axes), sets, strict=True):
        for method, (style, colour, label) in STYLES.items():
            if (which, method) not in groups:
                continue
            sizes = sorted(found := groups[which, method])
            values = [np.array([row[measure] for row in found[size]]) for size in sizes]
            numbers = [np.mean([row["numbers"] for row in found[size]]) for size in sizes]
            errors = [each.std(ddof=1) / np.sqrt(len(each)) for each in values]
            means = [each.mean() for each in values]
            bars: dict[str, Any] = {
                "fmt": style,
                "color": colour,
                "ms": 3.5,
                "lw": 1.4,
                "elinewidth": 0.6,
                "capsize": 2,
            }
            axis.errorbar(numbers, means, errors, label=label, **bars)
            for size, number, mean in zip(sizes, numbers, means, strict=True):
                if over == "price" and len(sizes) > 1:
                    axis.annotate(
                        f"{size:g}", (number, mean), (1, 4), textcoords="offset points", fontsize=6, rotation=60
                    )
        if over == "price":  # a few points lie close together, the plain numbers far away
            axis.set_xscale("log")
            axis.set_xticks([10, 15, 20, 30, 50], ["10", "15", "20", "30", "50"])
            axis.minorticks_off()
        axis.set_title(f"{which} ({len(values[0])} objects)", fontsize=9)
        axis.set_xlabel("free numbers", fontsize=8)
        axis.tick_params(labelsize=8)
        axis.grid(alpha=0.3, lw=0.5)
        axis.spines[["top", "right"]].set_visible(False)
    swept = f", at most {', '.join(map(str, sizes))} blocks" if over == "allowed" else ""
    np.atleast_1d(axes)[0].set_ylabel(f"{WORDS.get(measure, measure)}{swept}", fontsize=7 if swept else 8)
    np.atleast_1d(axes)[-1].legend(fontsize=8, frameon=False, loc="lower right")
    figure.savefig(picture, dpi=200)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", help="rows of the measure, one line of JSON each")
    parser.add_argument("picture", help="the file to write")
    parser.add_argument("measure", nargs="?", default="silhouette", help="the measure to plot [%(default)s]")
    parser.add_argument("over", nargs="?", default="allowed", help="allowed (blocks), or price [%(default)s]")
    args = parser.parse_args()
    main(args.rows, args.picture, args.measure, args.over)
