"""All rows of the table on the test packs, one line of JSON for each shape; what is there is not measured again.

Baselines are measured by ``benchmarks/reconstruction.py``, in the same columns.  A generator decodes all shapes in
batches of 32; its time is that of decoding, on one core.  Its IoU is measured twice: as drawn, which is the single
pass, and snapped as the protocol allows, by at most one cell in each parameter.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import multiprocessing
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks import reconstruction
from benchmarks.experiment.recipes import CATEGORIES
from benchmarks.experiment.stages import RESULTS, Experiment, Run, runs
from benchmarks.reconstruction import GREEDY, REFINED, SEARCH
from benchmarks.rows import Row, read_rows
from shapeprog.evaluation.generated import Written, generated
from shapeprog.evaluation.generated import measured as measures
from shapeprog.files import write_text
from shapeprog.geometry.cells import iou, pack, rasterise
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.models.decoding import Choice

BLOCKS, BATCH = 10, 32

WIDE = "no adaptation, wide prior"
REFINED_BEST = "the best on val, refined"
WITH_GENERATOR = "generator + search"
ARGMAX = ", arg-max"
"""Ends the name of a row whose programs are written by the likeliest ids; all others are written by drawing."""

AS_DRAWN_UNKNOWN = {"drawn_iou": float("nan")}
"""What is searched or refined was not drawn on a canvas block by block."""

Job = tuple[str, int, Any, str, float, int]
"""Pack, index, program, row, seconds, seed."""


@dataclass(frozen=True)
class Group:
    """All shapes of a category as one generator rebuilds them.

    Parameters
    ----------
    row
        What the row is called.
    category
        The pack they are measured on.
    seed
        Of the run that made the weights.
    source
        A file, or the name of weights that ship.
    work
        What is done with each shape, in another process: a :data:`Job` in, a row out.
    choose
        How programs are written, see :func:`shapeprog.models.decoding.decode`.
    """

    row: str
    category: str
    seed: int
    source: str
    work: Callable[[Job], Row]
    choose: Choice = "drawn"

    @property
    def key(self) -> tuple[str, str, int]:
        """What tells its rows from others."""
        return f"{self.category}_test", self.row, self.seed


def groups(experiment: Experiment) -> Iterator[Group]:
    """What can be measured with the weights that are there."""
    for category in CATEGORIES:
        yield from single_passes(WIDE, category, 0, experiment.start, True)
        for run in runs():
            recipe = run.recipe
            if recipe.row and run.category in ("", category) and experiment.finished(run):
                source = str(experiment.made(run))
                yield from single_passes(recipe.row, category, run.seed, source, recipe.as_published)
        best = experiment.best(category)
        if best is not None:
            yield Group(REFINED_BEST, category, best.seed, str(experiment.made(best)), refined)
    for category in CATEGORIES:
        yield Group(WITH_GENERATOR, category, 0, experiment.start, searched)


def single_passes(row: str, category: str, seed: int, source: str, as_published: bool) -> Iterator[Group]:
    """By drawing, and as the paper writes programs if that is wanted too."""
    if as_published:
        yield Group(row + ARGMAX, category, seed, source, measured, "argmax")
    yield Group(row, category, seed, source, measured)


def measure_baselines(experiment: Experiment, workers: int = 2) -> None:
    """Measure the baselines, as far as they are not measured yet."""
    reconstruction.run(
        argparse.Namespace(
            packs=[str(experiment.pack(category, "test")) for category in CATEGORIES], split="test",
            shapes=experiment.shapes, blocks=[BLOCKS], methods=[GREEDY, REFINED, SEARCH], workers=workers,
            seed=0, weights=experiment.start, out=str(baselines_file(experiment)),
        )
    )  # fmt: skip


def measure(experiment: Experiment, workers: int = 2) -> None:
    """Measure what generators do, as far as it is not measured yet; rows of weights that have changed are dropped."""
    from shapeprog.data import read_pack

    wanted = list(groups(experiment))
    prints = {source: fingerprint(source) for source in {group.source for group in wanted}}
    now = {group.key: prints[group.source] for group in wanted}
    out = rows_file(experiment)
    kept = [row for row in read_rows(out) if now.get((row["pack"], row["method"], row["seed"])) == row["weights"]]
    write_text(out, "".join(json.dumps(row) + "\n" for row in kept))
    known = {(row["pack"], row["method"], row["seed"], row["name"]) for row in kept}
    context = multiprocessing.get_context("spawn")
    with context.Pool(workers) as pool, out.open("a") as file:
        for group in wanted:
            pack = experiment.pack(group.category, "test")
            shapes = list(read_pack(pack))[: experiment.shapes]
            todo = [place for place, shape in enumerate(shapes) if (*group.key, shape.name) not in known]
            if not todo:
                continue
            print(f"{group.row}, {group.category}, seed {group.seed}: {len(todo)} shapes", flush=True)
            programs: list[Any] = [group.source] * len(shapes)
            seconds = 0.0
            if group.work is not searched:
                programs, seconds = decoded(group.source, shapes, group.choose)
            jobs = [(str(pack), place, programs[place], group.row, seconds, group.seed) for place in todo]
            for row in pool.imap_unordered(group.work, jobs, chunksize=2):
                file.write(json.dumps(row | {"weights": prints[group.source]}) + "\n")
                file.flush()


def fingerprint(source: str) -> str:
    """A short name for the very numbers of a set of weights."""
    from shapeprog.models.checkpoint import load_generator

    found = hashlib.sha256()
    for name, value in load_generator(source)[0].state_dict().items():
        found.update(name.encode())
        found.update(value.contiguous().numpy().tobytes())
    return found.hexdigest()[:12]


def decoded(source: str, shapes: list[Any], choose: Choice = "drawn") -> tuple[list[Any], float]:
    """The single-pass programs of shapes, and seconds of one core for each when 32 are decoded together."""
    from shapeprog.models.checkpoint import load_generator

    torch.set_num_threads(1)
    generator, _ = load_generator(source)
    generated(generator, shapes[:BATCH], BLOCKS, choose)  # kernels are compiled before anything is timed
    programs, started = [], time.process_time()
    for first in range(0, len(shapes), BATCH):
        programs += generated(generator, shapes[first : first + BATCH], BLOCKS, choose)
    return programs, (time.process_time() - started) / len(shapes)


def measured(job: Job) -> Row:
    """The measures of a program, as it was drawn and snapped."""
    from shapeprog.inference.snapping import snap

    shape, written, told = _prepared(job)
    choices = (written.whole, snap(written.program, shape.voxels))
    return _row(written, max(choices, key=lambda each: iou_of(each, shape)), shape) | told


def refined(job: Job) -> Row:
    """The measures of a program after it is snapped and refined through the renderer, as the search refines."""
    from shapeprog.inference import refine
    from shapeprog.inference.infer import outer_points
    from shapeprog.inference.refine import REACH
    from shapeprog.inference.snapping import snap

    shape, written, told = _prepared(job)
    started = time.process_time()
    snapped = snap(written.whole, shape.voxels)
    better = refine(snapped, outer_points(shape, snapped, told["seed"]), reach=REACH)
    told["cpu_seconds"] += time.process_time() - started
    return _row(Written(better, snapped), snapped, shape) | told | AS_DRAWN_UNKNOWN


def searched(job: Job) -> Row:
    """The measures of what search finds when a generator proposes programs to it."""
    from shapeprog.inference import infer

    shape, weights, told = _prepared(job)
    started = time.process_time()
    result = infer(shape, blocks=BLOCKS, budget=math.inf, generator=weights, statements="paper")
    told["cpu_seconds"] = time.process_time() - started
    return _row(Written(result.program, result.snapped), result.snapped, shape) | told | AS_DRAWN_UNKNOWN


def _row(written: Written, snapped: Program, shape: Any) -> Row:
    """The measures of a program, with the IoU of its snapped form and that of what was drawn on the canvas."""
    row = asdict(measures(written, shape, looks=True))
    return row | {"drawn_iou": row["iou"], "iou": iou_of(snapped, shape)}


def iou_of(program: Program, shape: Any) -> float:
    """IoU of the cells of a program of whole numbers."""
    return float(iou(rasterise(unroll(program)), pack(shape.voxels)))


def _prepared(job: Job) -> tuple[Any, Any, Row]:
    """The shape, the program or weights, and what the row says besides its measures."""
    torch.set_num_threads(1)
    path, place, program, row, seconds, seed = job
    shape = _shapes(path)[place]
    return (
        shape,
        program,
        {"pack": Path(path).stem, "method": row, "allowed": BLOCKS, "cpu_seconds": seconds, "seed": seed},
    )


@lru_cache(maxsize=1)
def _shapes(path: str) -> Any:
    """The shapes of a pack; jobs come pack by pack."""
    from shapeprog.data import read_pack

    return read_pack(Path(path))


def rows_file(experiment: Experiment) -> Path:
    """Where the rows of generators are."""
    return experiment.results / "rows.jsonl"


def baselines_file(experiment: Experiment) -> Path:
    """Where the rows of the baselines are."""
    return experiment.results / "baselines.jsonl"


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
