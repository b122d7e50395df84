"""What a person sees of inferred programs: meshes, objects in physical parts, and scans made of these.

    python -m benchmarks.structure DATA --split val --out structure_val.jsonl
    python -m benchmarks.structure --table structure_val.jsonl
    python -m benchmarks.structure DATA --sets ikea --methods all paper --blocks 1 2 4 8 --out sweep.jsonl
    python -m benchmarks.structure DATA --sets ikea --methods untied --out prices.jsonl
    python -m benchmarks.structure DATA --sets ikea --methods tied --prices 0.1 1 10 --out prices.jsonl

DATA holds ``shapenet_meshes/{bench,cabinet}_{val,test}/ID.ply`` (+Y up, front -Z) and
``ikea_parts/CLASS/OBJECT/NN.ply`` (+Y up; in the order of their names every second object is test, the others val).
One line of JSON is kept for every object; a run that was stopped goes on where it was.

=======  ==============================================================================================================
set      what inference is given
=======  ==============================================================================================================
bench    the mesh
cabinet  the mesh
ikea     the union of the part meshes
fused    that union filled at 256 cells along its longest side, as one smooth mesh by marching cubes (scikit-image)
noisy    20,000 points of that union, each coordinate with normal noise of .5 % of the diagonal of its box
open     20,000 points of that union without the fifth that lies farthest to one side
=======  ==============================================================================================================

======  ===============================================================================================================
method  what infers
======  ===============================================================================================================
all     ``shapeprog infer``
untied  the same without ties between numbers
tied    the ties alone, on the programs that ``untied`` wrote into the same file: what ``all`` gives, in less time
paper   the search on cells with the statements of the paper, the baseline
======  ===============================================================================================================

All are measured against the whole mesh, as ``shapeprog evaluate --parts`` does; ``all`` and ``tied`` also by what is
left of contacts, symmetry and one piece when each free number is edited, and by the share of names that may be .7 and
1.4 of their value.  The table tells how many programs are one piece among objects that are one themselves: gaps of up
to 1 % of the longest side are none.  A price is what a number is worth to ``tied``, times the usual; at others than 1
nothing is edited.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from benchmarks.rows import measure_all, read_rows

SETS = ("bench", "cabinet", "ikea", "fused", "noisy", "open")

Method = Literal["all", "untied", "tied", "paper"]

COLUMNS = (
    "f1_half_percent", "f1_percent", "normals", "silhouette", "one_piece", "slivers", "part_recall", "part_precision",
    "iou", "cd", "blocks", "statements", "primitives", "numbers", "lines", "edited_contacts",
    "edited_symmetry", "edited_one_piece", "edited_names", "seconds", "cpu_seconds",
)  # fmt: skip

FLOORS = {"f1_half_percent": "f1_half_percent_floor", "f1_percent": "f1_percent_floor", "normals": "normals_floor"}

SCANNED = 20_000
"""Points of a scan."""

NOISE = 0.005
"""Standard deviation of the noise of a scan, as a share of the diagonal of the box of the object."""

CELLS, MARGIN, SMOOTHING = 256, 4, 1.0
"""Of a fused mesh: cells along the longest side, free cells around, standard deviation in cells of the smoothing."""

PIECES = 4
"""Cells of a grid for each of the usual ones, in which an object in one piece is connected."""

MISSING = 0.2
"""Share of the points of a scan that its missing side held."""


@dataclass(frozen=True)
class Task:
    """One object of one set, as files, and how it is inferred; ``tied`` needs a program in cells without ties."""

    set: str
    name: str
    files: tuple[Path, ...]
    blocks: int = 10
    seed: int = 0
    method: Method = "all"
    program: str = ""
    price: float = 1.0


def objects(data: Path, which: str, split: str) -> Iterator[tuple[str, tuple[Path, ...]]]:
    """Names and mesh files of the objects of a set."""
    from shapeprog.data.parts import part_files

    if which in ("bench", "cabinet"):
        for file in sorted((data / "shapenet_meshes" / f"{which}_{split}").glob("*.ply")):
            yield file.stem, (file,)
        return
    known = part_files(data / "ikea_parts")
    for name in list(known)[split == "test" :: 2]:
        yield name, tuple(known[name])


def measure(task: Task) -> dict[str, Any]:
    """The row of one object."""
    import torch

    from benchmarks.editing import edit_scores
    from shapeprog.evaluation.likeness import Triangles
    from shapeprog.evaluation.metrics import evaluate_program
    from shapeprog.evaluation.parts import part_scores
    from shapeprog.language.printer import format_program
    from shapeprog.language.program import Program
    from shapeprog.language.unroll import unroll

    torch.set_num_threads(1)
    started, cpu = time.perf_counter(), time.process_time()
    parts, shape = given(task)
    program, snapped = inferred(task, shape)
    seconds, cpu_seconds = time.perf_counter() - started, time.process_time() - cpu
    placed = [Triangles(shape.frame.to_grid(vertices), faces) for vertices, faces in parts]
    target = replace(shape, points=None, **whole(placed))
    row = evaluate_program(program, target, snapped, seed=task.seed, looks=True)
    if len(parts) > 1:
        row = replace(row, **part_scores(placed, unroll(program), task.seed)._asdict())
    text = format_program(program)
    edited = edit_scores(program)._asdict() if task.method in ("all", "tied") and task.price == 1 else {}
    return asdict(row) | {
        "set": task.set, "seconds": seconds, "cpu_seconds": cpu_seconds, "allowed": task.blocks, "seed": task.seed,
        "method": task.method, "price": task.price, "lines": len(text.splitlines()), "program": text,
        "object_in_one_piece": in_one_piece(target.vertices, target.faces),
        "in_cells": format_program(Program(program.body)),  # the text does not tell where its whole is in the grid
        **{f"edited_{name}": share for name, share in edited.items()},
    }  # fmt: skip


def inferred(task: Task, shape: Any) -> tuple[Any, Any]:
    """The program of an object, and its whole-numbered form where it has one."""
    from shapeprog.inference import infer
    from shapeprog.inference.candidates.drawings import between_ends
    from shapeprog.inference.surface.evidence import evidence_of
    from shapeprog.inference.ties.tying import tie
    from shapeprog.language.merging import merged
    from shapeprog.language.parser import parse

    if task.method == "tied":
        evidence = evidence_of(shape, task.seed)
        floor = float(evidence.surface[:, 0].min())
        tied = tie(between_ends(parse(task.program)), evidence, price=task.price, floor=floor, seed=task.seed)
        return merged(tied), None
    statements: Literal["all", "paper"] = "paper" if task.method == "paper" else "all"
    ties = task.method != "untied"
    result = infer(shape, blocks=task.blocks, seed=task.seed, statements=statements, ties=ties)
    return result.program, result.snapped


def given(task: Task) -> tuple[list[Any], Any]:
    """The meshes of the parts of an object in their own frame, and the shape that inference is given."""
    from shapeprog.data.orientation import axes_of
    from shapeprog.data.parts import read_parts
    from shapeprog.data.placement import shape_from_mesh, shape_from_points
    from shapeprog.data.sampling import sample_surface
    from shapeprog.evaluation.likeness import Triangles

    parts = read_parts(list(task.files))
    mesh = whole([Triangles(*part) for part in parts])
    axes = axes_of(task.files[0], "+y", "-z" if task.set in ("bench", "cabinet") else None)
    if task.set in ("noisy", "open"):
        cloud = scanned(sample_surface(mesh["vertices"], mesh["faces"], SCANNED, task.seed).astype(np.float64), task)
        return parts, shape_from_points(cloud, name=task.name, axes=axes, seed=task.seed)
    surface = fused(**mesh) if task.set == "fused" else mesh.values()
    return parts, shape_from_mesh(*surface, name=task.name, axes=axes, seed=task.seed)


def whole(parts: Sequence[Any]) -> dict[str, Any]:
    """The vertices and faces of all parts as one mesh."""
    from shapeprog.geometry.mesh import joined

    return dict(zip(("vertices", "faces"), joined([(part.vertices, part.faces) for part in parts]), strict=True))


def scanned(points: Any, task: Task) -> Any:
    """The points of a scan: with noise, or without those of one side."""
    random = np.random.default_rng((task.seed, *task.name.encode()))
    if task.set == "noisy":
        return points + random.normal(0, NOISE * np.linalg.norm(np.ptp(points, axis=0)), points.shape)
    angle = random.uniform(0, 2 * np.pi)
    side = points @ [np.cos(angle), 0, np.sin(angle)]
    return points[side <= np.quantile(side, 1 - MISSING)]


def fused(vertices: Any, faces: Any) -> tuple[Any, Any]:
    """One closed mesh without inner faces, as scanning and image-to-3D models give: parts have grown together."""
    from scipy.ndimage import gaussian_filter
    from skimage.measure import marching_cubes

    from shapeprog.geometry.voxelise import voxelise_mesh

    low, high = vertices.min(0), vertices.max(0)
    scale, middle = CELLS / (high - low).max(), (low + high) / 2
    cells = voxelise_mesh((vertices - middle) * scale, faces, resolution=CELLS + 2 * MARGIN)
    corners, triangles, *_ = marching_cubes(gaussian_filter(cells.astype(np.float32), SMOOTHING), 0.5)
    return (corners + 0.5 - CELLS / 2 - MARGIN) / scale + middle, triangles.astype(np.int64)


def in_one_piece(vertices: Any, faces: Any) -> bool:
    """Whether a mesh in the grid frame is one piece, but for gaps that are narrower than 1 % of its longest side."""
    from scipy.ndimage import label

    from shapeprog.geometry.voxelise import voxelise_mesh

    cells = voxelise_mesh(np.asarray(vertices, np.float64) * PIECES, faces, resolution=32 * PIECES)
    return bool(label(cells, np.ones((3, 3, 3)))[1] == 1)


def run(args: argparse.Namespace) -> None:
    """Measure what is not in the output yet, object after object, in several processes."""
    out = Path(args.out)
    done = {(row["set"], row["name"], row["allowed"], row["method"], row["price"]): row for row in read_rows(out)}
    todo = [
        Task(which, name, files, blocks, args.seed, method, price=price)
        for which in args.sets
        for name, files in list(objects(Path(args.data), which, args.split))[: args.objects]
        for blocks in args.blocks
        for method in args.methods
        for price in (args.prices if method == "tied" else [1.0])
        if (which, name, blocks, method, price) not in done
    ]
    if "tied" in args.methods:
        before = {key[:3]: row.get("in_cells", "") for key, row in done.items() if key[3] == "untied"}
        todo = [
            replace(task, program=before.get((task.set, task.name, task.blocks), "")) if task.method == "tied" else task
            for task in todo
        ]
        if any(task.method == "tied" and not task.program for task in todo):
            raise SystemExit(f"{out} lacks programs in cells to tie: measure --methods untied first, in a new file")
    measure_all(out, todo, measure, args.workers)


def table(path: Path) -> str:
    """Markdown: the mean of every measure, with that of the target itself in brackets where it is measured."""
    groups: dict[tuple[int, str, str, float], list[dict[str, Any]]] = {}
    for row in read_rows(path):
        groups.setdefault((row["allowed"], row["set"], row["method"], row["price"]), []).append(row)
    lines = ["| set, objects | " + " | ".join(COLUMNS) + " |", "|" + "---|" * (len(COLUMNS) + 1)]
    for (allowed, name, method, price), rows in sorted(
        groups.items(), key=lambda item: (item[0][0], SETS.index(item[0][1]), *item[0][2:])
    ):
        at = f" at {price:g}" if price != 1 else ""
        cells = [f"{name}, {len(rows)}, {method}{at}, <= {allowed} blocks"]
        for column in COLUMNS:
            known = [row for row in rows if row.get("object_in_one_piece", True)] if column == "one_piece" else rows
            mean, floor = (_mean(known, each) for each in (column, FLOORS.get(column, "")))
            digits = 5 if column == "cd" else 1 if column in ("blocks", "statements", "primitives", "numbers") else 3
            floored = "" if np.isnan(floor) else f" ({floor:.3f})"
            cells.append("-" if np.isnan(mean) else f"{mean:.{digits}f}{floored}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _mean(rows: list[dict[str, Any]], column: str) -> float:
    values = np.array([row.get(column, np.nan) for row in rows], np.float64)
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def main() -> None:
    """Run, or print the table of a run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="?", help="the folder described above")
    parser.add_argument("--split", default="val", choices=("val", "test"))
    parser.add_argument("--sets", nargs="*", default=list(SETS), choices=SETS)
    parser.add_argument("--objects", type=int, default=None, help="only the first so many of each set")
    parser.add_argument("--blocks", type=int, nargs="*", default=[10], help="most blocks, one run for each")
    parser.add_argument("--methods", nargs="*", default=["all"], choices=get_args(Method), help="one run for each")
    parser.add_argument("--prices", type=float, nargs="*", default=[1.0], help="of tied, one run for each")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="structure.jsonl", help="rows, one line of JSON each; appended to")
    parser.add_argument("--table", default=None, help="print the table of these rows and do nothing else")
    parser.add_argument("--programs", type=Path, help="a folder for the program of each object, that of its last row")
    args = parser.parse_args()
    if args.table is None:
        if args.data is None:
            parser.error("name the folder of the data")
        run(args)
    rows = Path(args.table or args.out)
    print(table(rows))
    if args.programs is not None:
        args.programs.mkdir(parents=True, exist_ok=True)
        for row in read_rows(rows):
            (args.programs / f"{row['set']}_{row['name']}.shape").write_text(row["program"], encoding="utf-8")


if __name__ == "__main__":
    main()
