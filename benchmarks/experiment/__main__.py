"""The experiment of the paper as one resumable driver.

    python -m benchmarks.experiment list PACKS RESULTS            # what is made and what is not
    python -m benchmarks.experiment train PACKS RESULTS           # every run that is missing, or some of them:
    python -m benchmarks.experiment train PACKS RESULTS --only guided direct --category bench --seed 1
    python -m benchmarks.experiment baselines PACKS RESULTS       # measures boxes and search, which need no training
    python -m benchmarks.experiment table PACKS RESULTS           # measures what is missing on test, prints tables
    python -m benchmarks.experiment efficiency PACKS RESULTS      # docs/adaptation_efficiency.png
    python -m benchmarks.experiment extrapolation PACKS RESULTS   # docs/extrapolation.png
    python -m benchmarks.experiment figure PACKS RESULTS          # docs/figure.png
    python -m benchmarks.experiment document PACKS RESULTS        # docs/experiments.md

PACKS holds CATEGORY_train.npz, CATEGORY_val.npz and CATEGORY_test.npz of bench and cabinet; RESULTS gets everything.
Recipes stand in ``recipes.py``.  A rehearsal: ``--share 0.01 --shapes 8`` with a RESULTS of its own.
"""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # before torch: its idle workers would spin

from benchmarks.experiment import document, efficiency, extrapolation, figure, measuring, tables
from benchmarks.experiment.recipes import CATEGORIES, RECIPES, START
from benchmarks.experiment.stages import Experiment, Run, runs
from benchmarks.rows import read_rows
from shapeprog.models.checkpoint import load_executor, load_generator, read_card, save_checkpoint

EXECUTORS = {"executor-unwidened": "neural executor", "executor": "neural executor, trained on widened blocks"}
"""Runs whose executors extrapolate, and what the plot calls them."""


def main() -> None:
    """Do one thing."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.experiment",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("what", choices=list(WORK))
    parser.add_argument("packs", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("--only", nargs="*", choices=list(RECIPES), help="runs of these recipes")
    parser.add_argument("--category", choices=CATEGORIES, help="runs of this category, and those that have none")
    parser.add_argument("--seed", type=int, help="runs of this seed")
    parser.add_argument("--start", default=START, help="weights that adaptation begins from")
    parser.add_argument("--share", type=float, default=1.0, help="share of the visits, for a rehearsal")
    parser.add_argument("--shapes", type=int, help="test shapes of each category; all by default")
    parser.add_argument("--workers", type=int, default=2, help="processes that measure")
    parser.add_argument("--docs", type=Path, default=Path("docs"), help="folder of pictures and pages")
    parser.add_argument("--extra", nargs=argparse.REMAINDER, default=[], help="the rest goes to every training command")
    args = parser.parse_args()
    experiment = Experiment(args.packs, args.results, args.start, args.share, args.shapes)
    WORK[args.what](experiment, args)


def _selected(args: argparse.Namespace) -> list[Run]:
    return runs(args.only, args.category, args.seed)


def _list(experiment: Experiment, args: argparse.Namespace) -> None:
    for run in _selected(args):
        log = experiment.log(run)
        told = "made" if experiment.finished(run) else f"at {log[-1]['visits']:,.0f} visits" if log else "-"
        if experiment.made(run).exists() and run.recipe.command != "label":
            scores = read_card(experiment.made(run)).card.scores
            told += "; " + ", ".join(f"{name} {value:.4g}" for name, value in scores.items() if name != "score")
        print(f"{run.name:28} {told}")


def _train(experiment: Experiment, args: argparse.Namespace) -> None:
    for run in _selected(args):
        if not experiment.finished(run):
            experiment.make(run, *args.extra)


def _baselines(experiment: Experiment, args: argparse.Namespace) -> None:
    measuring.measure_baselines(experiment, args.workers)


def _table(experiment: Experiment, args: argparse.Namespace) -> None:
    measuring.measure_baselines(experiment, args.workers)
    measuring.measure(experiment, args.workers)
    for category in CATEGORIES:
        rows = read_rows(measuring.baselines_file(experiment))
        rows += read_rows(measuring.rows_file(experiment))
        print(f"\n### {category}\n\n{tables.table(rows, f'{category}_test')}")
        best = experiment.best(category)
        if best is not None:
            generator, card = load_generator(experiment.made(best))
            card = replace(card, command=experiment.command(best))  # names both folders, wherever they are here
            kept = args.docs / "results" / f"{category}.safetensors"
            kept.parent.mkdir(parents=True, exist_ok=True)
            save_checkpoint(kept, generator, card, half=True)
            print(f"\nThe best on val is {best.name}; kept as {kept}.")


def _efficiency(experiment: Experiment, args: argparse.Namespace) -> None:
    if not efficiency.plot(experiment, args.docs / "adaptation_efficiency.png"):
        raise SystemExit(f"there is no log of {' or '.join(efficiency.SHOWN)} in {experiment.results}: train first")
    print("\n".join(efficiency.summary(experiment)))


def _extrapolation(experiment: Experiment, args: argparse.Namespace) -> None:
    out = document.extrapolation_file(experiment)
    if not out.exists():
        made = {run.stage: experiment.made(run) for run in runs(list(EXECUTORS))}
        found = {EXECUTORS[stage]: load_executor(made[stage])[0] for stage in EXECUTORS if made[stage].exists()}
        if not found:
            raise SystemExit("there is no executor yet: train with --only " + " ".join(EXECUTORS))
        extrapolation.run(found, out)
    extrapolation.plot(json.loads(out.read_text()), args.docs / "extrapolation.png")


def _figure(experiment: Experiment, args: argparse.Namespace) -> None:
    figure.draw(experiment, args.docs / "figure.png")


def _document(experiment: Experiment, args: argparse.Namespace) -> None:
    document.write(experiment, args.docs)


WORK = {
    "list": _list,
    "train": _train,
    "baselines": _baselines,
    "table": _table,
    "efficiency": _efficiency,
    "extrapolation": _extrapolation,
    "figure": _figure,
    "document": _document,
}

if __name__ == "__main__":
    main()
