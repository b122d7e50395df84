"""Rows of shapes as a table of the paper: mean, its standard error and the median; several seeds as mean and spread."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from benchmarks.experiment.measuring import REFINED_BEST, WIDE, WITH_GENERATOR
from benchmarks.experiment.recipes import RECIPES
from benchmarks.reconstruction import GREEDY, REFINED, SEARCH

Row = dict[str, Any]

COLUMNS: dict[str, tuple[str, float, int]] = {
    "cd": ("CD x 1000", 1000, 2),
    "iou": ("IoU@32", 1, 3),
    "rounded_iou": ("IoU@32, rounded", 1, 3),
    "f1": ("F1", 1, 3),
    "blocks": ("blocks", 1, 1),
    "statements": ("statements", 1, 1),
    "primitives": ("primitives", 1, 1),
    "seconds": ("ms per shape", 1000, 0),
}
"""Measures by name: heading, factor and decimals."""

PUBLISHED = {
    "bench": {"no adaptation": 13.5, "guided": 7.8, "direct": 3.5},
    "cabinet": {"no adaptation": 10.4, "guided": 9.2, "direct": 4.3},
}
"""CD x 1000 of the paper (Liang 2022, table 1), on its own choice of shapes."""

ORDER = [
    GREEDY, REFINED, SEARCH, WITH_GENERATOR,
    *(each.row for each in RECIPES.values() if each.command == "pretrain"), WIDE,
    *(each.row for each in RECIPES.values() if each.command == "adapt"), REFINED_BEST,
]  # fmt: skip
"""Rows from top to bottom."""


def cell(rows: Sequence[Row], measure: str) -> str:
    """One measure of a row of the table.

    One seed gives mean ± standard error over shapes; several the mean of their means ± the standard deviation of these.
    The median over all shapes is in brackets.  A measure that no shape has is a dash.
    """
    _, factor, digits = COLUMNS[measure]
    seeds: dict[int, list[float]] = {}
    for row in rows:
        value = row.get(measure, float("nan"))
        if np.isfinite(value):
            seeds.setdefault(row["seed"], []).append(value * factor)
    if not seeds:
        return "-"
    values = np.concatenate([np.asarray(each) for each in seeds.values()])
    means = np.array([np.mean(each) for each in seeds.values()])
    among = means if len(means) > 1 else values
    spread = among.std(ddof=1) / (1 if len(means) > 1 else np.sqrt(len(among))) if len(among) > 1 else 0.0
    return f"{means.mean():.{digits}f} ± {spread:.{digits}f} ({np.median(values):.{digits}f})"


def table(rows: Iterable[Row], pack: str) -> str:
    """The table of one pack as markdown, with the noise floor and the paper's figures below it."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        if row["pack"] == pack:
            groups.setdefault(row["method"], []).append(row)
    if not groups:
        return ""
    names = [name for name in ORDER if name in groups] + sorted(set(groups) - set(ORDER))
    headings = [heading for heading, _, _ in COLUMNS.values()]
    lines = ["| | " + " | ".join(headings) + " |", "|---|" + "---|" * len(headings)]
    for name in names:
        seeds = {row["seed"] for row in groups[name]}
        told = f"{name}, {len(seeds)} seeds" if len(seeds) > 1 else name
        lines.append(f"| {told} | " + " | ".join(cell(groups[name], each) for each in COLUMNS) + " |")
    shapes = {row["name"]: row["noise_floor"] for row in groups[names[0]]}
    floor = 1000 * np.mean([each for each in shapes.values() if np.isfinite(each)] or [np.nan])
    paper = ", ".join(f"{name} {value}" for name, value in PUBLISHED.get(pack.split("_")[0], {}).items())
    lines += ["", f"{len(shapes)} shapes; noise floor of CD x 1000: {floor:.2f}; the paper's CD x 1000: {paper}."]
    return "\n".join(lines)


def mean_of(rows: Iterable[Row], pack: str, method: str, measure: str) -> float:
    """Mean of a measure over seeds and shapes; not a number where there is no row."""
    found = [row[measure] for row in rows if row["pack"] == pack and row["method"] == method]
    return float(np.mean(found)) if found else float("nan")
