"""``docs/experiments.md``: how each table and plot is made, with its command, and what came out; from the results."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from benchmarks.experiment import efficiency, tables
from benchmarks.experiment.measuring import baselines_file, rows_file
from benchmarks.experiment.recipes import CATEGORIES, DESIGNS
from benchmarks.experiment.stages import Experiment, runs
from benchmarks.rows import read_rows
from shapeprog.models.checkpoint import read_card
from shapeprog.training.folder import WEIGHTS

INTRODUCTION = """\
# The experiment

What the paper (Liang, *Learning to Infer 3D Shape Programs with Differentiable Renderer*, 2022) measures, measured
again, and what was added.  Benches and cabinets are those of ShapeNetCore v2, in packs made with `shapeprog prepare`;
`PACKS` holds `bench_train.npz`, `bench_val.npz`, `bench_test.npz`, and the same of `cabinet`; `RESULTS` is any folder.
Everything is one resumable driver that calls the commands of the package: what is made already is skipped, what was
stopped goes on.  Settings were chosen on val; the test packs are looked at by the table alone.

```
make experiment-table PACKS=... RESULTS=...           # trains what is missing, measures, prints the tables
make experiment-efficiency PACKS=... RESULTS=...      # docs/adaptation_efficiency.png
make experiment-extrapolation PACKS=... RESULTS=...   # docs/extrapolation.png
make experiment-figure PACKS=... RESULTS=...          # docs/figure.png
python -m benchmarks.experiment document PACKS RESULTS    # this page
```

One run alone: `python -m benchmarks.experiment train PACKS RESULTS --only guided --category bench --seed 1`."""

TABLE = """\
## The table

`python -m benchmarks.experiment table PACKS RESULTS`

Mean over all test shapes ± standard error (median).  With several seeds: mean of their means ± standard deviation of
these.  CD and F1 are of the program as it is; IoU of the program snapped to whole numbers, by at most one cell in each
parameter, and *as drawn* on the canvas of the generator, which is one such snapping.
Times are of one core, of a batch of 32 for single passes and shape by shape for the rest."""

DESIGNED = """\
## Designs at equal training time

`python -m benchmarks.experiment train PACKS RESULTS --only {names}`

Wide prior, one thread, five minutes of a core each (shapes a second measured on a quiet machine times 300), the same
recipe but for what its line below says.  Synthetic: 512 shapes of the prior; real: val, single pass by drawing
(`tian2019`, whose memory has to see every block it writes, too).  Five minutes is early: `swift` learns faster at
first, and after 36 minutes of a core (310,000 shapes) `chained` is ahead of what `swift` is after 45 (420,000):
synthetic IoU by arg-max .782 and .770, parameters .37 and .49 cells off (LOG.md).  So `chained` is the default."""

EFFICIENCY = """\
## Sample efficiency

![CD against the shapes seen in adaptation](adaptation_efficiency.png)

CD on val against the shapes seen in adaptation, the same one counted each time; thin lines are seeds, thick ones their
mean.  `make experiment-efficiency`."""

EXTRAPOLATION = """\
## Extrapolation

![IoU with the exact cells against how far a number is beyond its range](extrapolation.png)

Single blocks of the narrow prior, of which one number is moved beyond the largest or smallest value that the prior
ever writes for it, within the grid; IoU with the cells that whole numbers draw.  `make experiment-extrapolation`."""

FIGURE = """\
## Programs, voxels and points

![Targets, programs, hard voxels and surface points](figure.png)

Single-pass programs of the best generator (chosen on val) for test shapes at the {quantiles} quantiles of CD: nobody
picked them.  `make experiment-figure`."""


def write(experiment: Experiment, docs: Path) -> None:
    """Write the page with a section for everything that has results."""
    docs.mkdir(parents=True, exist_ok=True)
    (docs / "experiments.md").write_text("\n\n".join(_sections(experiment, docs)) + "\n", encoding="utf-8")


def _sections(experiment: Experiment, docs: Path) -> Iterator[str]:
    yield INTRODUCTION
    rows = read_rows(baselines_file(experiment)) + read_rows(rows_file(experiment))
    if rows:
        yield TABLE
    for category in CATEGORIES:
        found = tables.table(rows, f"{category}_test")
        if found:
            yield f"### {category}\n\n{found}"
            chosen = experiment.best(category)
            if chosen is not None:
                kept = f"results/{category}.safetensors"
                told = f"; its weights, which saw research data and so are not in the wheel: [{kept}]({kept})"
                told = told if (docs / kept).exists() else ""
                yield f"The best on val is *{chosen.recipe.row}*, seed {chosen.seed}{told}."
    if rows:
        best = {category: experiment.best(category) for category in CATEGORIES}
        known = {category: (run.recipe.row, run.seed) for category, run in best.items() if run is not None}
        yield f"### What was to be reached\n\n{tables.reached(rows, known)}"
    compared = list(_designs(experiment))
    if compared:
        yield DESIGNED.format(names=" ".join(f"design-{name}" for name in DESIGNS))
        yield "\n".join([*DESIGN_HEAD, *compared])
    told = efficiency.summary(experiment)
    if told and (docs / "adaptation_efficiency.png").exists():
        yield "\n".join([EFFICIENCY, "", *(f"- {line}" for line in told)])
    moved = extrapolation_file(experiment)
    if moved.exists():
        yield f"{EXTRAPOLATION}\n\n{extrapolation_table(json.loads(moved.read_text()))}"
    if (docs / "figure.png").exists():
        from benchmarks.experiment.figure import QUANTILES

        yield FIGURE.format(quantiles=", ".join(str(each) for each in QUANTILES))
    made = list(_runs(experiment))
    if made:
        yield "\n".join(["## Every run", "", "| command | shapes seen | minutes |", "|---|---|---|", *made])


DESIGN_HEAD = [
    "| design | shapes seen | ids right | parameters off, cells | IoU, synthetic | "
    + " | ".join(f"{category}: IoU | CD x 1000 (median)" for category in CATEGORIES) + " |",
    "|---|" + "---|" * (4 + 2 * len(CATEGORIES)),
]  # fmt: skip


def _designs(experiment: Experiment) -> Iterator[str]:
    """A row for each design that was trained for the comparison."""
    for name in DESIGNS:
        (run,) = runs([f"design-{name}"])
        if experiment.finished(run):
            card = read_card(experiment.folder(run) / WEIGHTS).card
            each = card.scores
            real = " | ".join(
                f"{each[f'{pack}_iou']:.3f} | {1000 * each[f'{pack}_cd']:.2f} ({1000 * each[f'{pack}_cd_median']:.2f})"
                for pack in (f"{category}_val" for category in CATEGORIES)
            )
            yield (
                f"| `{name}` | {card.visits:,} | {each['ids']:.3f} | {each['parameters']:.2f} | {each['iou']:.3f} | "
                f"{real} |"
            )


def _runs(experiment: Experiment) -> Iterator[str]:
    """A row for each run that was made: its command, and what it cost."""
    for run in runs():
        if experiment.finished(run):
            log = experiment.log(run)
            visits = f"{log[-1]['visits']:,.0f}" if log else "-"
            minutes = f"{sum(record['seconds'] for record in log) / 60:.0f}" if log else "-"
            yield f"| `{experiment.command(run)}` | {visits} | {minutes} |"


def extrapolation_file(experiment: Experiment) -> Path:
    """Where the figures of extrapolation are."""
    return experiment.results / "extrapolation.json"


def extrapolation_table(rows: list[dict[str, object]]) -> str:
    """IoU by what is moved, who draws, and how far, as markdown."""
    places = sorted({int(str(row["beyond"])) for row in rows})
    lines = ["| moved | drawn by | " + " | ".join(f"+{place}" if place else "inside" for place in places) + " |"]
    lines.append("|---|---|" + "---|" * len(places))
    for moved in dict.fromkeys(row["moved"] for row in rows):
        for who in dict.fromkeys(row["drawn by"] for row in rows):
            few = {row["beyond"]: row["iou"] for row in rows if (row["moved"], row["drawn by"]) == (moved, who)}
            cells = [f"{few[place]:.3f}" if place in few else "-" for place in places]
            lines.append(f"| {moved} | {who} | " + " | ".join(cells) + " |")
    return "\n".join(lines)
