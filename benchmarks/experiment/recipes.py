"""What is trained, and how: every run of the experiment as a line of a table.

The options are those of the ``shapeprog`` command that makes the run.  ``{name}`` stands for what another run made:
that of the same category and seed where there is one, else the first.  Methods bring the settings that are theirs
(``shapeprog adapt --help``); what is not said here is as they have it.  Settings were chosen on val.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

CATEGORIES = ("bench", "cabinet")
"""Packs are called CATEGORY_SPLIT.npz."""

Option = str | int | float


@dataclass(frozen=True)
class Recipe:
    """One kind of run.

    Parameters
    ----------
    command
        The command of ``shapeprog`` that makes it.
    options
        Its options.
    seeds
        One run for each.
    per_category
        Whether there is one run for each category, on its packs.
    row
        What the row of the table is called; none without.
    """

    command: str
    options: Mapping[str, Option] = field(default_factory=dict)
    seeds: tuple[int, ...] = (0,)
    per_category: bool = False
    row: str = ""


def adapting(row: str, *, seeds: tuple[int, ...] = (0,), **options: Option) -> Recipe:
    """An adaptation to each category."""
    return Recipe("adapt", options, seeds, per_category=True, row=row)


THREE = (0, 1, 2)
START = "default"
"""What adaptation begins from: the weights that ship, which have seen synthetic furniture alone."""

GUIDED = {"visits": 4000, "validate-every": 500, "rate": 1e-4}
DIRECT = {"visits": 4000, "validate-every": 500, "rate": 2e-4}
BEST_LOSS = "chamfer=1,occupancy=1"

RECIPES: dict[str, Recipe] = {
    "narrow": Recipe(
        "pretrain", {"prior": "narrow", "visits": 48_000, "validate-every": 12_000}, seeds=THREE,
        row="no adaptation, narrow prior",
    ),
    "executor": Recipe("train-executor", {"visits": 150_000, "validate-every": 25_000}),
    "executor-published": Recipe("train-executor", {"visits": 150_000, "validate-every": 25_000, "widened": 0.0}),
    "labels": Recipe("label", {}, per_category=True),
    "guided": adapting(
        "guided", seeds=THREE, method="guided", **{"from": START, "executor": "{executor}"}, **GUIDED
    ),
    "direct": adapting("direct (chamfer)", seeds=THREE, method="direct", **{"from": START}, **DIRECT),
    "best-loss": adapting("direct (best loss)", method="direct", loss=BEST_LOSS, **{"from": START}, **DIRECT),
    "ids": adapting(
        "direct with ids", method="direct", loss=BEST_LOSS, ids="expected", **{"from": START}, **DIRECT
    ),
    "hybrid": adapting("hybrid", method="hybrid", **{"from": START, "executor": "{executor}"}, **DIRECT),
    "distill": adapting(
        "distilled", method="distill", labels="{labels}", visits=8000, **{"from": START, "validate-every": 2000}
    ),
    "distill-direct": adapting(
        "distilled, then direct (best loss)", method="direct", loss=BEST_LOSS, **{"from": "{distill}"}, **DIRECT
    ),
}  # fmt: skip
"""All runs, each after those that it needs."""

ADAPTED = [name for name, recipe in RECIPES.items() if recipe.command == "adapt"]
"""Runs among which the best is chosen on val."""
