"""Sample efficiency: CD on val against the shapes seen in adaptation, guided beside direct."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.experiment.measuring import start_on_val
from benchmarks.experiment.recipes import CATEGORIES
from benchmarks.experiment.stages import Experiment, runs

GUIDED, OFFSETS, DIRECT = "guided", "guided-offsets", "direct"
SHOWN = {
    GUIDED: "guided, all weights",
    OFFSETS: "guided, offsets alone",
    DIRECT: "direct (chamfer)",
}
"""Stages that are compared, and what the plot calls them."""

COLOURS = {GUIDED: "#b0413e", OFFSETS: "#e0a458", DIRECT: "#1f4e79"}


class Curve(NamedTuple):
    """CD on val (T,) after so many shape visits (T,), of one run."""

    visits: np.ndarray
    cd: np.ndarray


def curves(experiment: Experiment, stage: str, category: str) -> list[Curve]:
    """One curve for each seed, from before the first step."""
    found = []
    for run in runs([stage], category):
        scores = experiment.validations(run)
        if scores:
            visits, cd = zip((0.0, start_on_val(experiment, run)), *scores, strict=True)
            found.append(Curve(np.array(visits), np.array(cd)))
    return found


def mean_curve(many: list[Curve]) -> Curve:
    """The mean of curves, as far as all of them go."""
    length = min(len(each.visits) for each in many)
    return Curve(many[0].visits[:length], np.mean([each.cd[:length] for each in many], 0))


def visits_to_reach(curve: Curve, cd: float) -> float:
    """Shape visits after which a curve first falls to a CD, along straight lines; infinite if it never does."""
    below = np.flatnonzero(curve.cd <= cd)
    if not len(below):
        return float("inf")
    last = int(below[0])
    if last == 0:
        return float(curve.visits[0])
    (from_, to), (high, low) = curve.visits[last - 1 : last + 1], curve.cd[last - 1 : last + 1]
    return float(from_ + (to - from_) * (high - cd) / (high - low))


def summary(experiment: Experiment) -> list[str]:
    """A sentence for each category: how soon direct adaptation has what guided adaptation ends with."""
    lines = []
    for category in CATEGORIES:
        each = {stage: curves(experiment, stage, category) for stage in SHOWN}
        if not all(each.values()):
            continue
        guided, direct = mean_curve(each[GUIDED]), mean_curve(each[DIRECT])
        best = int(guided.cd.argmin())
        needed = visits_to_reach(direct, float(guided.cd[best]))
        told = f"{category}: guided adaptation is best after {guided.visits[best]:,.0f} visits"
        if best == 0:
            told = f"{category}: guided adaptation never gets below what it began with"
        told += f" (CD {guided.cd[best]:.5f})"
        if best > 0 and np.isfinite(needed):
            told += f"; direct adaptation is as good after {needed:,.0f}"
            told += f", {guided.visits[best] / needed:.0f} times sooner" if 0 < needed < guided.visits[best] else ""
        last = int(direct.cd.argmin())
        lines.append(f"{told}; direct adaptation is best after {direct.visits[last]:,.0f} (CD {direct.cd[last]:.5f}).")
    return lines


def plot(experiment: Experiment, picture: Path) -> bool:
    """A panel for each category, a thin line for each seed and a thick one for their mean; whether there is any."""
    from benchmarks.experiment.plotting import figure_of, tidy

    if not any(curves(experiment, stage, category) for stage in SHOWN for category in CATEGORIES):
        return False
    figure, axes = figure_of(len(CATEGORIES))
    for axis, category in zip(axes, CATEGORIES, strict=True):
        for stage, label in SHOWN.items():
            many, colour = curves(experiment, stage, category), COLOURS[stage]
            for curve in many:
                axis.plot(curve.visits / 1000, curve.cd * 1000, color=colour, lw=0.7, alpha=0.5)
            if many:
                mean = mean_curve(many)
                name = f"{label}, {len(many)} seeds" if len(many) > 1 else label
                axis.plot(mean.visits / 1000, mean.cd * 1000, "-o", color=colour, lw=1.8, ms=3, label=name)
        axis.set_yscale("log")
        _plain_ticks(axis)
        tidy(axis, category, "shapes seen in adaptation, thousands")
    axes[0].set_ylabel("CD on val $\\times$ 1000", fontsize=8)
    handles = {label: handle for axis in axes for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(
        handles.values(), handles.keys(), fontsize=8, frameon=False, loc="outside lower center", ncols=len(SHOWN)
    )
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=200)
    return True


def _plain_ticks(axis: object) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    vertical = axis.yaxis  # type: ignore[attr-defined]
    vertical.set_major_locator(LogLocator(subs=(1, 1.5, 2, 3, 4, 5, 7)))
    vertical.set_major_formatter(ScalarFormatter())
    vertical.set_minor_formatter(NullFormatter())
