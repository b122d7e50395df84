"""Reconstruction on packs of shapes: search and its baselines, the same shapes in the same run.

    python -m benchmarks.reconstruction --packs bench_test.npz cabinet_test.npz --out results/shapenet.jsonl
    python -m benchmarks.reconstruction --packs chair.npz table.npz --split test --out results/modelnet.jsonl
    python -m benchmarks.reconstruction --table results/shapenet.jsonl

One line of JSON is kept for every shape, method and number of blocks; a run that was stopped goes on where it was.
Packs with points give the methods ``search`` (mesh points given) and ``search, voxels alone``; packs without give
``search``.  ``greedy boxes`` and ``greedy boxes, refined`` are the baselines of the measuring protocol.  ``search`` is
what ``shapeprog infer --paper`` does, ``all statements`` what ``shapeprog infer --no-ties`` does.  What has no points
to work with is left out.  There is no time budget: the seed alone decides.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch

from benchmarks.rows import measure_all, read_rows

Task = tuple[str, int, int, tuple[str, ...], int]
"""Pack, index, most blocks, methods, seed."""

GREEDY, REFINED, SEARCH, ALONE = "greedy boxes", "greedy boxes, refined", "search", "search, voxels alone"
EVERY = "all statements"

COLUMNS = (
    "iou", "cd", "f1_cell", "cd_floor", "f1_half_percent", "f1_percent", "one_piece", "slivers", "blocks", "statements",
    "primitives", "numbers", "seconds", "cpu_seconds",
)  # fmt: skip
"""Measures in the order of the table; normals and outlines need a mesh, which packs do not hold."""


def measure(task: Task) -> list[dict[str, Any]]:
    """Rows of one shape for all methods that were asked for."""
    from shapeprog.data import read_pack
    from shapeprog.data.cells import points_of_cells
    from shapeprog.evaluation.metrics import evaluate_program
    from shapeprog.inference import greedy_boxes, infer
    from shapeprog.inference.cells.reconstruct import refined
    from shapeprog.inference.infer import prepare_kernels

    torch.set_num_threads(1)
    prepare_kernels(cells=True)
    pack, index, blocks, methods, seed = task
    shape = read_pack(Path(pack))[index]
    rows = []

    def keep(method: str, program: Any, snapped: Any, seconds: float, cpu_seconds: float = float("nan")) -> None:
        row = asdict(evaluate_program(program, shape, snapped, seed=seed, looks=True))
        row |= {"pack": Path(pack).stem, "method": method, "allowed": blocks, "seconds": seconds, "seed": seed}
        row["cpu_seconds"] = cpu_seconds
        rows.append(row)

    started = time.monotonic()
    boxes = greedy_boxes(shape.voxels, blocks)
    if GREEDY in methods:
        keep(GREEDY, boxes, boxes, time.monotonic() - started)
    if REFINED in methods and shape.points is not None:
        started = time.monotonic()
        fine = refined(boxes, torch.from_numpy(np.asarray(shape.points)), seed=seed)
        keep(REFINED, fine, boxes, time.monotonic() - started)
    settings: list[tuple[str, Literal["paper", "all"]]] = [(SEARCH, "paper"), (EVERY, "all")]
    for method, statements in settings:
        if method not in methods:
            continue
        before = time.thread_time()
        result = infer(shape, blocks=blocks, seed=seed, budget=math.inf, statements=statements, ties=False)
        keep(method, result.program, result.snapped, result.seconds, time.thread_time() - before)
        if method == SEARCH and ALONE in methods and shape.points is not None and result.snapped is not None:
            # The same structure.
            alone = refined(result.snapped, torch.from_numpy(points_of_cells(shape.voxels)), seed=seed)
            keep(ALONE, alone, result.snapped, result.seconds)
    return rows


def tasks(args: argparse.Namespace, done: set[tuple[str, str, int]]) -> Iterator[Task]:
    """What is still to do: every shape of the split, for every number of blocks."""
    from shapeprog.data import read_pack

    for pack in args.packs:
        shapes = read_pack(Path(pack))
        chosen = [i for i in range(len(shapes)) if shapes.split is None or shapes.split[i] == args.split]
        for index in chosen[: args.shapes]:
            for blocks in args.blocks:
                if (Path(pack).stem, str(shapes.ids[index]), blocks) not in done:
                    yield pack, index, blocks, tuple(args.methods), args.seed


def run(args: argparse.Namespace) -> None:
    """Measure what is not in the output yet, shape after shape, in several processes."""
    out = Path(args.out)
    done = {(row["pack"], row["name"], row["allowed"]) for row in read_rows(out)}
    measure_all(out, list(tasks(args, done)), measure, args.workers)


def table(paths: list[str]) -> str:
    """Markdown: mean, its standard error and the median of every measure, for each pack, method and size."""
    groups: dict[tuple[str, int, str], list[dict[str, Any]]] = {}
    for row in [row for path in paths for row in read_rows(Path(path))]:
        groups.setdefault((row["pack"], row["allowed"], row["method"]), []).append(row)
    lines = ["| pack | shapes | method | " + " | ".join(COLUMNS) + " |", "|" + "---|" * (len(COLUMNS) + 3)]
    for (pack, allowed, method), rows in sorted(groups.items()):
        cells = [f"{pack}, <= {allowed}", str(len(rows)), method]
        for column in COLUMNS:
            values = np.array([row.get(column, np.nan) for row in rows], np.float64)
            values = values[np.isfinite(values)]
            if not len(values):
                cells.append("-")
                continue
            digits = 5 if column in ("cd", "cd_floor") else 3 if column.startswith(("iou", "f1")) else 2
            error = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else 0.0
            cells.append(f"{values.mean():.{digits}f} ± {error:.{digits}f} ({np.median(values):.{digits}f})")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Run, or print the table of runs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--packs", nargs="*", default=[], help="packs in the format of shapeprog prepare")
    parser.add_argument("--split", default="test", help="split to use of packs that name one")
    parser.add_argument("--shapes", type=int, default=None, help="only the first so many of each pack")
    parser.add_argument("--blocks", type=int, nargs="*", default=[10], help="most blocks, one run for each")
    every = [GREEDY, REFINED, SEARCH, ALONE, EVERY]
    parser.add_argument("--methods", nargs="*", default=every, choices=every)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="reconstruction.jsonl", help="rows, one line of JSON each; appended to")
    parser.add_argument("--table", nargs="*", default=None, help="print the table of these rows and do nothing else")
    args = parser.parse_args()
    if args.table is None:
        run(args)
    print(table(args.table or [args.out]))


if __name__ == "__main__":
    main()
