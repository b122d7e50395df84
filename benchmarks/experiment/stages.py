"""Runs of the experiment: each is one ``shapeprog`` command, made if it is not there yet, resumed if it was stopped."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.experiment.recipes import ADAPTED, CATEGORIES, RECIPES, START, Option, Recipe
from shapeprog.models.checkpoint import read_card
from shapeprog.training.folder import BEST, Record, read_log

SCALED = ("visits", "validate-every")
"""Options that a rehearsal makes smaller."""

PACKS, RESULTS = "PACKS", "RESULTS"
"""What the two folders are called where commands are kept and shown."""


@dataclass(frozen=True)
class Run:
    """One run of a recipe.

    Parameters
    ----------
    stage
        Name of the recipe.
    category
        What it adapts to; empty for runs that have none.
    seed
        Its seed.
    """

    stage: str
    category: str
    seed: int

    @property
    def recipe(self) -> Recipe:
        """How it is made."""
        return RECIPES[self.stage]

    @property
    def name(self) -> str:
        """What its folder is called."""
        seed = f"{self.seed}" if len(self.recipe.seeds) > 1 else ""
        return "-".join(part for part in (self.stage, self.category, seed) if part)


def runs(stages: list[str] | None = None, category: str | None = None, seed: int | None = None) -> list[Run]:
    """The runs of all recipes, or of some, in an order in which each follows what it needs."""
    found = []
    for stage, recipe in RECIPES.items():
        for each in recipe.seeds:
            for kind in CATEGORIES if recipe.per_category else ("",):
                if (not stages or stage in stages) and category in (None, kind or category) and seed in (None, each):
                    found.append(Run(stage, kind, each))
    return found


@dataclass(frozen=True)
class Experiment:
    """Where the experiment reads and writes.

    Parameters
    ----------
    packs
        Folder of the packs CATEGORY_SPLIT.npz.
    results
        Folder of everything that comes of it.
    start
        Weights that adaptation begins from, where a recipe says ``default``.
    share
        Share of the visits that is really made; less than 1 in a rehearsal.
    shapes
        How many shapes of each test pack are measured; all by default.
    """

    packs: Path
    results: Path
    start: str = START
    share: float = 1.0
    shapes: int | None = None

    def folder(self, run: Run) -> Path:
        """The folder of a run."""
        return self.results / "runs" / run.name

    def pack(self, category: str, split: str) -> Path:
        """A pack."""
        return self.packs / f"{category}_{split}.npz"

    def made(self, run: Run) -> Path:
        """What a run makes: the best weights on val, or labels."""
        if run.recipe.command == "label":
            return self.folder(run) / "labels.jsonl"
        return self.folder(run) / BEST

    def words(self, run: Run) -> list[str]:
        """The command of a run."""
        recipe, folder = run.recipe, self.folder(run)
        if recipe.command == "label":
            words = ["label", str(self.pack(run.category, "train")), "--out", str(self.made(run))]
        else:
            words = [recipe.command, str(folder)]
            if recipe.command == "adapt":
                words += ["--pack", str(self.pack(run.category, "train"))]
        for name, value in recipe.options.items():
            words += [f"--{name}", self._told(run, name, value)]
        words += ["--seed", str(run.seed)]
        if recipe.command in ("adapt", "pretrain"):
            for category in [run.category] if run.category else CATEGORIES:
                words += ["--val", str(self.pack(category, "val"))]
        return words

    def command(self, run: Run) -> str:
        """The command of a run as a person would write it, with the two folders by their names."""
        words = [START if word == self.start else word for word in self.words(run)]
        told = shlex.join(["shapeprog", *words])
        return told.replace(str(self.results), RESULTS).replace(str(self.packs), PACKS)

    def finished(self, run: Run) -> bool:
        """Whether a run was made by the very command that is asked for now."""
        note = self.folder(run) / "finished.json"
        return note.exists() and json.loads(note.read_text())["command"] == self.command(run)

    def make(self, run: Run, *extra: str) -> None:
        """Make a run, or what is missing of it."""
        for needed in self.needs(run):
            if not self.made(needed).exists():
                raise SystemExit(f"{run.name} needs {needed.name}, which is not made: run it first")
        folder = self.folder(run)
        folder.mkdir(parents=True, exist_ok=True)
        print(f"\n$ {self.command(run)}", flush=True)
        subprocess.run([sys.executable, "-m", "shapeprog", *self.words(run), *extra], check=True)
        (folder / "finished.json").write_text(json.dumps({"command": self.command(run)}) + "\n")

    def needs(self, run: Run) -> Iterator[Run]:
        """The runs whose results a run begins from."""
        for value in run.recipe.options.values():
            if isinstance(value, str) and value.startswith("{"):
                yield self._other(run, value)

    def log(self, run: Run) -> list[Record]:
        """The records of a run."""
        return read_log(self.folder(run))

    def validations(self, run: Run, measure: str = "cd") -> list[tuple[float, float]]:
        """Visits, and a measure on the category's val pack, of each validation of a run."""
        name = f"val_{run.category}_val_{measure}"
        return [(record["visits"], record[name]) for record in self.log(run) if name in record]

    def best(self, category: str) -> Run | None:
        """The adapted run with the lowest CD on val."""
        made = [run for run in runs(ADAPTED, category) if self.made(run).exists()]
        scores = {run: read_card(self.made(run)).card.scores.get(f"{category}_val_cd", float("inf")) for run in made}
        return min(made, key=lambda run: scores[run], default=None)

    def _told(self, run: Run, name: str, value: Option) -> str:
        if isinstance(value, str) and value.startswith("{"):
            return str(self.made(self._other(run, value)))
        if (name, value) == ("from", START):
            return self.start
        return str(max(1, round(value * self.share))) if name in SCALED and not isinstance(value, str) else str(value)

    def _other(self, run: Run, reference: str) -> Run:
        """The run that an option refers to."""
        stage = reference.strip("{}")
        recipe = RECIPES[stage]
        seed = run.seed if run.seed in recipe.seeds else recipe.seeds[0]
        return Run(stage, run.category if recipe.per_category else "", seed)
