"""All rows of the table on the test packs, one line of JSON for each shape; what is there is not measured again.

Baselines are measured by ``benchmarks/reconstruction.py``, in the same columns.  A generator decodes all shapes in
batches of 32; its time is that of decoding.  Its IoU is measured twice: rounded, which is the single pass, and snapped
as the protocol allows, by at most one cell in each parameter.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks import reconstruction
from benchmarks.experiment.recipes import CATEGORIES
from benchmarks.experiment.stages import RESULTS, Experiment, Run, runs

BLOCKS, BATCH = 10, 32

WIDE = "no adaptation, wide prior"
REFINED_BEST = "the best on val, refined"
WITH_GENERATOR = "search with the generator"

Row = dict[str, Any]
Job = tuple[str, int, Any, str, float, int]
"""Pack, index, program, row, seconds, seed."""


@dataclass(frozen=True)
class Weights:
    """Weights that make a row.

    Parameters
    ----------
    row
        What the row is called.
    category
        The pack they are measured on.
    seed
        Of the run that made them.
    source
        A file, or the name of weights that ship.
    """

    row: str
    category: str
    seed: int
    source: str


def all_weights(experiment: Experiment) -> Iterator[Weights]:
    """The weights that are there, for every category."""
    for category in CATEGORIES:
        yield Weights(WIDE, category, 0, experiment.start)
        for run in runs():
            if run.recipe.row and run.category in ("", category) and experiment.finished(run):
                yield Weights(run.recipe.row, category, run.seed, str(experiment.made(run)))


def measure(experiment: Experiment, workers: int = 2) -> None:
    """Measure whatever is not measured yet."""
    from shapeprog.data import read_pack

    experiment.results.mkdir(parents=True, exist_ok=True)
    packs = [str(experiment.pack(category, "test")) for category in CATEGORIES]
    methods = [reconstruction.GREEDY, reconstruction.REFINED, reconstruction.SEARCH]
    reconstruction.run(
        argparse.Namespace(
            packs=packs, split="test", shapes=experiment.shapes, blocks=[BLOCKS], methods=methods, workers=workers,
            seed=0, budget=60.0, out=str(baselines_file(experiment)),
        )
    )  # fmt: skip
    out = rows_file(experiment)
    known = {(row["pack"], row["method"], row["seed"]) for row in read_rows(out)}
    context = multiprocessing.get_context("spawn")
    with context.Pool(workers) as pool, out.open("a") as file:

        def keep(jobs: list[Job], work: Any) -> None:
            rows = pool.map(work, jobs, chunksize=4)
            file.writelines(json.dumps(row) + "\n" for row in rows)
            file.flush()

        for weights in all_weights(experiment):
            pack = experiment.pack(weights.category, "test")
            if (pack.stem, weights.row, weights.seed) not in known:
                print(f"{weights.row}, {weights.category}, seed {weights.seed}", flush=True)
                programs, seconds = decoded(weights.source, list(read_pack(pack))[: experiment.shapes])
                told = (weights.row, seconds, weights.seed)
                keep([(str(pack), place, program, *told) for place, program in enumerate(programs)], measured)
        for category in CATEGORIES:
            pack, best = experiment.pack(category, "test"), experiment.best(category)
            few = list(read_pack(pack))[: experiment.shapes]
            if best is not None and (pack.stem, REFINED_BEST, best.seed) not in known:
                print(f"{REFINED_BEST}: {best.name}", flush=True)
                programs, seconds = decoded(str(experiment.made(best)), few)
                told = (REFINED_BEST, seconds, best.seed)
                keep([(str(pack), place, program, *told) for place, program in enumerate(programs)], refined)
            if (pack.stem, WITH_GENERATOR, 0) not in known:
                print(f"{WITH_GENERATOR}, {category}", flush=True)
                keep(
                    [(str(pack), place, experiment.start, WITH_GENERATOR, 0.0, 0) for place in range(len(few))],
                    searched,
                )


def decoded(source: str, shapes: list[Any]) -> tuple[list[Any], float]:
    """The single-pass programs of shapes, and seconds for each when 32 are decoded together."""
    from shapeprog.evaluation.generated import generated
    from shapeprog.models.checkpoint import load_generator

    generator, _ = load_generator(source)
    generated(generator, shapes[:BATCH], BLOCKS)  # kernels are compiled before anything is timed
    programs, started = [], time.monotonic()
    for first in range(0, len(shapes), BATCH):
        programs += generated(generator, shapes[first : first + BATCH], BLOCKS)
    return programs, (time.monotonic() - started) / len(shapes)


def measured(job: Job) -> Row:
    """The measures of a program, rounded and snapped."""
    from shapeprog.evaluation.generated import measured as measures
    from shapeprog.geometry.occupancy import pack as packed
    from shapeprog.geometry.occupancy import packed_iou, packed_rows
    from shapeprog.inference.snapping import snap
    from shapeprog.language.unroll import unroll

    shape, program, told = _prepared(job)
    row = asdict(measures(program, shape))
    snapped = packed_rows(unroll(snap(program, shape.voxels)))
    return row | told | {"rounded_iou": row["iou"], "iou": float(packed_iou(snapped, packed(shape.voxels)))}


def refined(job: Job) -> Row:
    """The measures of a program after it is snapped and refined through the renderer, as the search refines."""
    from shapeprog.evaluation.metrics import evaluate_program
    from shapeprog.inference import refine
    from shapeprog.inference.refine import REACH
    from shapeprog.inference.snapping import snap

    shape, program, told = _prepared(job)
    started = time.monotonic()
    snapped = snap(program, shape.voxels)
    better = refine(snapped, outer_points(shape, snapped), reach=REACH)
    told["seconds"] += time.monotonic() - started
    return asdict(evaluate_program(better, shape, snapped)) | told


def outer_points(shape: Any, snapped: Any) -> torch.Tensor:
    """The points of a shape that the surface of a program can meet, as the search chooses them."""
    from shapeprog.geometry.distance import union_distance
    from shapeprog.inference.infer import DEEP
    from shapeprog.language.unroll import unroll

    points = torch.from_numpy(np.asarray(shape.points, np.float32))
    outer = points[union_distance(unroll(snapped), points) > -DEEP] if snapped.size else points
    return outer if len(outer) else points


def searched(job: Job) -> Row:
    """The measures of what search finds when a generator proposes programs to it."""
    from shapeprog.evaluation.metrics import evaluate_program
    from shapeprog.inference import infer

    shape, weights, told = _prepared(job)
    result = infer(shape, blocks=BLOCKS, budget=60.0, generator=weights)
    told["seconds"] = result.scores["seconds"]
    return asdict(evaluate_program(result.program, shape, result.snapped)) | told


def _prepared(job: Job) -> tuple[Any, Any, Row]:
    """The shape, the program or weights, and what the row says besides its measures."""
    from shapeprog.data import read_pack

    torch.set_num_threads(1)
    pack, place, program, row, seconds, seed = job
    shape = read_pack(Path(pack))[place]
    return shape, program, {"pack": Path(pack).stem, "method": row, "allowed": BLOCKS, "seconds": seconds, "seed": seed}


def rows_file(experiment: Experiment) -> Path:
    """Where the rows of generators are."""
    return experiment.results / "rows.jsonl"


def baselines_file(experiment: Experiment) -> Path:
    """Where the rows of the baselines are."""
    return experiment.results / "baselines.jsonl"


def read_rows(path: Path) -> list[Row]:
    """All rows of a file; none where there is no file."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def start_on_val(experiment: Experiment, run: Run) -> float:
    """CD on val of what a run began from, measured once and kept."""
    from shapeprog.data import read_pack
    from shapeprog.evaluation.generated import evaluate_generator
    from shapeprog.evaluation.metrics import summarise
    from shapeprog.models.checkpoint import load_generator

    words = experiment.words(run)
    source = words[words.index("--from") + 1]
    note = experiment.results / "starts.json"
    known: dict[str, float] = json.loads(note.read_text()) if note.exists() else {}
    key = f"{source.replace(str(experiment.results), RESULTS)}, {run.category}"
    if key not in known:
        shapes = list(read_pack(experiment.pack(run.category, "val")))
        rows = evaluate_generator(load_generator(source)[0], shapes, BLOCKS)
        known[key] = float(np.float64(summarise(rows)["cd"].mean))
        note.write_text(json.dumps(known, indent=1) + "\n")
    return known[key]
