"""What is trained, and how: every run of the experiment as a line of a table.

The options are those of the ``shapeprog`` command that makes the run.  ``{name}`` stands for what another run made:
that of the same category and seed where there is one, else the first.  Methods bring the settings that are theirs
(``shapeprog adapt --help``); what is not said here is as they have it.  Settings were chosen on val.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

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
    as_published
        Whether its row is one of the paper's, which are measured by arg-max too, as the paper writes programs.
    """

    command: str
    options: Mapping[str, Option] = field(default_factory=dict)
    seeds: tuple[int, ...] = (0,)
    per_category: bool = False
    row: str = ""
    as_published: bool = False


def adapting(row: str, start: str, method: str, **options: Option) -> Recipe:
    """An adaptation to each category."""
    given = {"from": start, "method": method} | options
    return Recipe("adapt", {name.replace("_", "-"): value for name, value in given.items()}, per_category=True, row=row)


def published(recipe: Recipe) -> Recipe:
    """The same with three seeds, as a row of the paper."""
    return replace(recipe, seeds=(0, 1, 2), as_published=True)


START = "default"
"""What adaptation begins from: the weights that ship, which have seen synthetic furniture alone."""

BEST_LOSS = "chamfer=1,surface=1,excess=1"

STEPS: dict[str, Option] = {"visits": 4000, "validate_every": 500, "warm_up": 320}
OFFSETS: dict[str, Option] = STEPS | {"learn": "offsets", "rate": 1e-3}
GUIDED: dict[str, Option] = STEPS | {"executor": "{executor}", "precision": "bf16"}
IDS: dict[str, Option] = STEPS | {"visits": 2000, "learn": "all", "rate": 5e-5, "cost": "iou"}
LONGER: dict[str, Option] = OFFSETS | {"visits": 12_000, "validate_every": 1000}
DISTILL: dict[str, Option] = {
    "labels": "{labels}", "batch": 48, "taught": 48, "rows": 3, "rate": 6e-4, "visits": 12_000, "validate_every": 2000,
}  # fmt: skip

EXECUTOR: dict[str, Option] = {"visits": 150_000, "validate-every": 25_000}

DESIGNS: dict[str, dict[str, Option]] = {
    "tian2019": {"visits": 3_700, "rows": 0, "rate": 1e-3, "warm-up": 480},
    "swift": {"visits": 46_000},
    "chained": {"visits": 43_000},
}
"""As many shapes as a core takes in 300 s: 12.2, 155 and 143 a second.  The first is taught on all blocks, as its
memory reads all canvases anyway, at its published rate."""

RECIPES: dict[str, Recipe] = {
    "narrow": published(
        Recipe(
            "pretrain", {"prior": "narrow", "visits": 96_000, "validate-every": 24_000},
            row="no adaptation, narrow prior",
        )
    ),
    "executor": Recipe("train-executor", EXECUTOR),
    "executor-unwidened": Recipe("train-executor", EXECUTOR | {"widened": 0.0}),
    **{
        f"design-{design}": Recipe("pretrain", {"design": design, "validate-every": 1_000_000} | options)
        for design, options in DESIGNS.items()
    },
    "labels": Recipe("label", per_category=True),
    "guided": published(adapting("guided", START, "guided", **GUIDED)),
    "guided-offsets": adapting(
        "guided, offsets alone", START, "guided", **GUIDED | OFFSETS, schedule="cosine"
    ),
    "direct": published(adapting("direct (chamfer)", START, "direct", **OFFSETS)),
    "best-loss": adapting("direct (best loss)", START, "direct", loss=BEST_LOSS, **OFFSETS),
    "ids-nvil": adapting("direct with ids, NVIL", START, "direct", ids="nvil", **IDS),
    "ids-rloo": adapting("direct with ids, leave one out", START, "direct", ids="rloo", **IDS),
    "ids-expected": adapting("direct with ids, expected", START, "direct", ids="expected", **IDS),
    "ids-direct": adapting("direct with ids, expected, then offsets", "{ids-expected}", "direct", **OFFSETS),
    "hybrid": adapting("hybrid", START, "hybrid", executor="{executor}", **OFFSETS),
    "distill": adapting("distilled", START, "distill", **DISTILL),
    "distill-direct": adapting("distilled, then direct", "{distill}", "direct", **LONGER),
}  # fmt: skip
"""All runs, each after those that it needs."""

ADAPTED = [name for name, recipe in RECIPES.items() if recipe.command == "adapt"]
"""Runs among which the best is chosen on val."""
