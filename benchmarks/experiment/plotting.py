"""How all plots of the experiment look."""

from __future__ import annotations

from typing import Any


def figure_of(panels: int) -> tuple[Any, list[Any]]:
    """A figure with a row of panels that share their vertical axis."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(
        1, panels, figsize=(3.1 * panels, 2.9), sharey=True, layout="constrained", squeeze=False
    )
    return figure, list(axes[0])


def tidy(axis: Any, title: str, below: str) -> None:
    """Small type, a light grid, no box."""
    axis.set_title(title, fontsize=9)
    axis.set_xlabel(below, fontsize=8)
    axis.tick_params(labelsize=8)
    axis.grid(alpha=0.3, lw=0.5)
    axis.spines[["top", "right"]].set_visible(False)
