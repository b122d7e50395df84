"""Rows of shapes as a table of the paper: mean, its standard error and the median; several seeds as mean and spread."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.experiment.measuring import ARGMAX, REFINED_BEST, WIDE, WITH_GENERATOR
from benchmarks.experiment.recipes import CATEGORIES, RECIPES
from benchmarks.reconstruction import GREEDY, REFINED, SEARCH
from benchmarks.rows import Row

COLUMNS: dict[str, tuple[str, float, int]] = {
    "cd": ("CD x 1000", 1000, 2),
    "iou": ("IoU@32", 1, 3),
    "drawn_iou": ("IoU@32, as drawn", 1, 3),
    "f1": ("F1", 1, 3),
    "blocks": ("blocks", 1, 1),
    "statements": ("statements", 1, 1),
    "primitives": ("primitives", 1, 1),
    "cpu_seconds": ("ms per shape", 1000, 0),
}
"""Measures by name: heading, factor and decimals."""

SEEN: dict[str, tuple[str, float, int]] = {
    "f1_half_percent": ("F1@.5 %", 1, 3),
    "f1_percent": ("F1@1 %", 1, 3),
    "one_piece": ("one piece", 1, 2),
    "slivers": ("slivers", 1, 2),
    "numbers": ("numbers", 1, 1),
}
"""What a person sees of a program, as far as packs can tell it: normals and outlines need a mesh."""

PUBLISHED = {
    "bench": {"no adaptation": 13.5, "guided": 7.8, "direct": 3.5},
    "cabinet": {"no adaptation": 10.4, "guided": 9.2, "direct": 4.3},
}
"""CD x 1000 of the paper (Liang 2022, table 1), on its own choice of shapes."""


def both(command: str) -> Iterator[str]:
    """Names of the rows of a command's recipes."""
    for each in RECIPES.values():
        if each.command == command and each.row:
            yield from [each.row + ARGMAX] * each.as_published
            yield each.row


ORDER = [
    GREEDY, REFINED, SEARCH, WITH_GENERATOR,
    *both("pretrain"), WIDE + ARGMAX, WIDE, *both("adapt"), REFINED_BEST,
]  # fmt: skip
"""Rows from top to bottom."""


def cell(rows: Sequence[Row], measure: str) -> str:
    """One measure of a row of the table.

    One seed gives mean ± standard error over shapes; several the mean of their means ± the standard deviation of these.
    The median over all shapes is in brackets.  A measure that no shape has is a dash.
    """
    _, factor, digits = (COLUMNS | SEEN)[measure]
    seeds: dict[int, list[float]] = {}
    for row in rows:
        value = row.get(measure, float("nan"))
        if measure == "cpu_seconds" and not np.isfinite(value):
            value = row.get("seconds", float("nan"))  # the boxes, which one core makes
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
    """The tables of one pack as markdown, with noise floors and the paper's figures below them."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        if row["pack"] == pack:
            groups.setdefault(row["method"], []).append(row)
    if not groups:
        return ""
    names = [name for name in ORDER if name in groups] + sorted(set(groups) - set(ORDER))
    ordered = {name: groups[name] for name in names}
    shapes = {row["name"]: row for row in groups[names[0]]}
    floor = 1000 * _mean_floor(shapes.values(), "noise_floor")
    paper = ", ".join(f"{name} {value}" for name, value in PUBLISHED.get(pack.split("_")[0], {}).items())
    below = f"{len(shapes)} shapes; noise floor of CD x 1000: {floor:.2f}; the paper's CD x 1000: {paper}."
    lines = [*_grid(ordered, COLUMNS), "", below]
    if any(SEEN.keys() & row.keys() for row in groups[names[0]]):
        half, whole = (_mean_floor(shapes.values(), f"{each}_floor") for each in ("f1_half_percent", "f1_percent"))
        lines += ["", *_grid(ordered, SEEN), "", f"Floors of F1: {half:.3f} at .5 %, {whole:.3f} at 1 %."]
    return "\n".join(lines)


def _grid(groups: Mapping[str, Sequence[Row]], columns: Mapping[str, tuple[str, float, int]]) -> list[str]:
    """The lines of a table: a row for each group."""
    lines = ["| | " + " | ".join(heading for heading, _, _ in columns.values()) + " |", "|---|" + "---|" * len(columns)]
    for name, rows in groups.items():
        seeds = {row["seed"] for row in rows}
        told = f"{name}, {len(seeds)} seeds" if len(seeds) > 1 else name
        lines.append(f"| {told} | " + " | ".join(cell(rows, each) for each in columns) + " |")
    return lines


def _mean_floor(rows: Iterable[Row], floor: str) -> float:
    return float(np.mean([row[floor] for row in rows if np.isfinite(row.get(floor, np.nan))] or [np.nan]))


class Wanted(NamedTuple):
    """What a row must reach: a measure of it, and its bound for each category.

    Parameters
    ----------
    row
        The row; empty for the best on val.
    most
        Whether the bound is the most that the measure may be, or the least.
    over
        A row that the measure is divided by; none by default.
    """

    what: str
    row: str
    measure: str
    bounds: tuple[float, float]
    most: bool = True
    over: str = ""


GUIDED, DIRECT = RECIPES["guided"].row, RECIPES["direct"].row

WANTED = [
    Wanted("no adaptation, CD: the paper's", WIDE + ARGMAX, "cd", (0.0135, 0.0104)),
    Wanted("guided, CD: the paper's", GUIDED + ARGMAX, "cd", (0.0078, 0.0092)),
    Wanted("direct (chamfer), CD: half of the paper's", DIRECT, "cd", (0.0018, 0.0022)),
    Wanted("direct (chamfer), CD over guided, by arg-max", DIRECT + ARGMAX, "cd", (0.5, 0.5),
           over=GUIDED + ARGMAX),
    Wanted("the same, by drawing", DIRECT, "cd", (0.5, 0.5), over=GUIDED),
    Wanted("the same, over guided that learns offsets alone", DIRECT, "cd", (0.5, 0.5),
           over=RECIPES["guided-offsets"].row),
    Wanted("best single pass, CD", "", "cd", (0.0014, 0.0019)),
    Wanted("best single pass, IoU", "", "iou", (0.72, 0.85), most=False),
    Wanted("best single pass, ms per shape", "", "cpu_seconds", (1 / 45, 1 / 45)),
]  # fmt: skip
"""What the project asked for; figures of the paper are those of its table 1."""


def reached(rows: Sequence[Row], best: Mapping[str, tuple[str, int]]) -> str:
    """What was to be reached beside what was, as markdown.

    Parameters
    ----------
    best
        For each category the row, and the seed, of what is best on val.
    """
    lines = ["| | " + " | ".join(f"{each}: wanted | reached" for each in CATEGORIES) + " |", "|---|" + "---|" * 4]
    for wanted in WANTED:
        cells = []
        factor, digits = (1.0, 2) if wanted.over else COLUMNS[wanted.measure][1:]
        for category, bound in zip(CATEGORIES, wanted.bounds, strict=True):
            pack = f"{category}_test"
            row, seed = (wanted.row, None) if wanted.row else best.get(category, ("", None))
            value = mean_of(rows, pack, row, wanted.measure, seed)
            if wanted.over:
                value /= mean_of(rows, pack, wanted.over, wanted.measure)
            mark = "" if math.isnan(value) or (value <= bound) == wanted.most else " (missed)"
            cells += [f"{'<=' if wanted.most else '>='} {bound * factor:.{digits}f}"]
            cells += ["-" if math.isnan(value) else f"{value * factor:.{digits}f}{mark}"]
        unit = " x 1000" if wanted.measure == "cd" and not wanted.over else ""
        lines.append(f"| {wanted.what}{unit} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def mean_of(rows: Iterable[Row], pack: str, method: str, measure: str, seed: int | None = None) -> float:
    """Mean of a measure over shapes, and over seeds unless one is named; not a number where there is no row."""
    few = [row for row in rows if (row["pack"], row["method"]) == (pack, method) and seed in (None, row["seed"])]
    return float(np.mean([row[measure] for row in few])) if few else float("nan")
