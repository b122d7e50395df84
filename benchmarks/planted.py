"""Planted furniture: programs whose parts are known, and how many of them inference finds again.

    python -m benchmarks.planted --out planted.jsonl
    python -m benchmarks.planted --table planted.jsonl
    python -m benchmarks.planted --out cones.jsonl --sets cones hinted_cones --kinds parts fused

=============  ========================================================================================================
set            what is planted
=============  ========================================================================================================
furniture      programs of the prior ``furniture``
cones          tables on three or four ``cone_leg``, the statement of ``examples/statements``, without its hint
hinted_cones   the same with its hint
=============  ========================================================================================================

Each is given as its parts (``parts``), as one smooth mesh in which they have grown together (``fused``), and as 32^3
cells alone (``cells``).  A part is found where a primitive of its own has IoU >= .5 with it: with its oriented box, as
``shapeprog evaluate --parts`` does (``part_recall``, ``part_precision``; the planted program itself is beside it as the
ceiling), and with the solid itself (``solid_recall``, ``solid_precision``).  ``cells_ceiling`` is how many parts would
be found in cells by one who is told which of them each part touches, and how thick parts of one or two cells are on
average.  Of those found by the solid, ``roles`` and ``labels`` are the shares whose role is the planted one, or has its
label.
"""

from __future__ import annotations

import argparse
import runpy
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.rows import measure_all, read_rows
from benchmarks.structure import fused, whole

SETS = ("furniture", "cones", "hinted_cones")
KINDS = ("parts", "fused", "cells")

COLUMNS = (
    "part_recall", "part_precision", "ceiling_recall", "ceiling_precision", "cells_ceiling", "solid_recall",
    "solid_precision", "roles", "labels", "found", "planted", "primitives", "planted_numbers", "numbers", "seconds",
)  # fmt: skip

THICKNESS = (0.6, 0.8)
"""How thick parts of the prior are that touch one cell or two along an axis, by which most are found."""

EXAMPLE = Path(__file__).parents[1] / "examples" / "statements" / "cone_leg.py"

POINTS = 20_000
"""Points drawn in the box of each part."""


@dataclass(frozen=True)
class Task:
    """One planted program and how it is given."""

    set: str
    kind: str
    number: int
    seed: int


def measure(task: Task) -> dict[str, Any]:
    """The row of one planted program."""
    import torch

    from shapeprog.data.placement import shape_from_mesh
    from shapeprog.data.synthetic.furniture import furniture
    from shapeprog.evaluation.likeness import Triangles
    from shapeprog.evaluation.parts import part_scores
    from shapeprog.formats.parts import parts
    from shapeprog.inference import infer
    from shapeprog.language.parser import parse
    from shapeprog.language.printer import format_program, numbers_written
    from shapeprog.language.unroll import unroll

    torch.set_num_threads(1)
    if task.set == "furniture":
        planted = furniture(task.number, task.seed)
    else:
        declare(hinted=task.set == "hinted_cones")
        planted = parse(cone_table(np.random.default_rng((task.seed, task.number))))
    drawn = parts(planted)
    mesh = whole(drawn)
    given = mesh.values() if task.kind == "parts" else fused(**mesh)
    shape = shape_from_mesh(*given, name=str(task.number), axes=np.eye(3), seed=task.seed)
    if task.kind == "cells":
        shape = replace(shape, points=None, vertices=None, faces=None)
    started = time.process_time()
    found = infer(shape, seed=task.seed).program
    seconds = time.process_time() - started
    scene, frame = unroll(found), shape.frame
    drawing = in_frame(unroll(planted), frame)
    placed = [Triangles(frame.to_grid(part.vertices), part.faces) for part in drawn]
    ceiling = part_scores(placed, drawing)
    return vars(task) | part_scores(placed, scene)._asdict() | {
        "ceiling_recall": ceiling.part_recall, "ceiling_precision": ceiling.part_precision,
        "cells_ceiling": float(np.mean([likeness_of_cells(each.vertices) >= 0.5 for each in placed])),
        **solid_scores(planted, drawing, found, scene),
        "planted": planted.size, "primitives": found.size,
        "planted_numbers": sum(map(numbers_written, planted.walk())),
        "numbers": sum(map(numbers_written, found.walk())),
        "seconds": seconds, "text": format_program(found),
    }  # fmt: skip


def in_frame(scene: Any, frame: Any) -> Any:
    """A scene of the world in the grid of a frame with the axes of the world."""
    import torch

    centre = torch.from_numpy(frame.to_grid(scene.centre.numpy())).to(scene.centre)
    return replace(scene, size=scene.size / frame.scale, centre=centre)


def solid_scores(planted: Any, drawing: Any, found: Any, scene: Any) -> dict[str, float]:
    """How many planted solids are found, and how many of these have their role, its label and their statement."""
    from shapeprog.evaluation.parts import best_pairs
    from shapeprog.language.statement import Role, language

    pairs = best_pairs(solid_overlaps(drawing, scene))
    known = language()

    def told(program: Any, of: Any) -> list[tuple[str, str, str]]:
        parts = []
        draws = [chain[-1] for chain in program.chains]
        for block in of.block[of.mask].tolist():
            called = known.called(draws[block].word)
            parts.append((called.name, called.label if isinstance(called, Role) else "", draws[block].name))
        return parts

    there, here = told(planted, drawing), told(found, scene)
    same = np.array([[a == b for a, b in zip(there[row], here[column], strict=True)] for row, column in pairs])
    roles, labels, statements = same.mean(0) if len(pairs) else (0.0, 0.0, 0.0)
    legs = {row for row, each in enumerate(there) if each[2] == "cone_leg"}
    return {
        "solid_recall": len(pairs) / len(there), "solid_precision": len(pairs) / max(len(here), 1),
        "roles": float(roles), "labels": float(labels), "statements": float(statements),
        "found": float(bool(legs) and legs <= {row for row, column in pairs if here[column][2] == "cone_leg"}),
    }  # fmt: skip


def solid_overlaps(planted: Any, found: Any) -> Any:
    """IoU (planted, found) of the primitives of two scenes, by sampling a ball around each that is planted."""
    import torch

    from shapeprog.geometry.distance import each_distance
    from shapeprog.geometry.primitives import primitives

    drawn = np.random.default_rng(0).uniform(-1, 1, (POINTS, 3))
    own, other = (replace(each, size=each.size.double()).volumes[each.mask].numpy() for each in (planted, found))
    table = np.zeros((len(own), len(other)))
    for row, slot in enumerate(planted.mask.nonzero()[:, 0].tolist()):
        half = primitives[int(planted.kind[slot])].bound(planted.size[slot])
        points = planted.centre[slot] + torch.from_numpy(drawn).to(half) * half @ planted.rotation[slot].T
        inside = points[each_distance(planted, points)[:, slot] <= 0]
        shared = own[row] * (each_distance(found, inside)[:, found.mask] <= 0).double().mean(0).numpy()
        table[row] = shared / np.maximum(own[row] + other - shared, 1e-9)
    return table


def likeness_of_cells(vertices: Any) -> float:
    """IoU of the box of a part with what the cells tell of it that it touches, along the axes of the grid."""
    low, high = vertices.min(0), vertices.max(0)
    first, last = np.floor(low), np.ceil(high)
    wide = last - first
    half = np.select([wide <= 1, wide <= 2], [each / 2 for each in THICKNESS], (wide - 1) / 2)
    middle = (first + last) / 2
    shared = np.prod(np.clip(np.minimum(high, middle + half) - np.maximum(low, middle - half), 0, None))
    return float(shared / (np.prod(high - low) + np.prod(2 * half) - shared))


def declare(hinted: bool) -> None:
    """Bring in the example, once in a process; without what it says of starts unless it is ``hinted``."""
    from shapeprog.language.statement import language

    if "cone_leg" in language():
        language().forget("cone_leg")
    example = runpy.run_path(str(EXAMPLE))["cone_leg"]
    if not hinted:
        language().forget("cone_leg")
        language().register(replace(example, hint=None))


def cone_table(random: np.random.Generator) -> str:
    """The text of a table: a round or rectangular top on three or four upright cone legs of one size."""
    up, depth, side = random.uniform([10, 12, 14], 24)
    legs, thickness = int(random.integers(3, 5)), random.uniform(0.8, 2)
    bottom = random.uniform(0.3, 0.9)
    radii = random.permutation([bottom, bottom * random.uniform(1.4, 2.6)])
    widest, height = radii.max(), up - thickness
    if random.random() < 0.5:
        radius = min(depth, side) / 2
        top = f"cylinder(at=({height}, 0, 0), height={thickness}, radius={radius})"
        angle = (np.arange(legs) + 0.5) * 2 * np.pi / legs
        away = radius * random.uniform(0.6, 0.8) - 0.3 * widest
        places = away * np.stack([np.cos(angle), np.sin(angle)], 1)
    else:
        top = f"box(at=({height}, {-depth / 2}, {-side / 2}), size=({thickness}, {depth}, {side}))"
        d, s = np.array([depth, side]) / 2 - widest - random.uniform(0, 1.5, 2)
        places = np.array([(-d, -s), (-d, s), (d, -s), (d, s)] if legs == 4 else [(-d, -s), (-d, s), (d, 0)])
    lines = [f"cone_leg(at=(0, {d}, {s}), height={height}, bottom={radii[0]}, top={radii[1]})" for d, s in places]
    return "\n".join([top, *lines]) + "\n"


def tasks(args: argparse.Namespace) -> Iterator[Task]:
    """All that is asked for."""
    for which in args.sets:
        for kind in args.kinds:
            for number in range(args.first, args.first + args.programs):
                yield Task(which, kind, number, args.seed)


def run(args: argparse.Namespace) -> None:
    """Measure what is not in the output yet, program after program, in several processes."""
    out = Path(args.out)
    done = {Task(row["set"], row["kind"], row["number"], row["seed"]) for row in read_rows(out)}
    todo = [task for task in tasks(args) if task not in done]
    measure_all(out, todo, measure, args.workers)


def table(path: Path) -> str:
    """Markdown: the mean of every measure."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in read_rows(path):
        groups.setdefault((row["set"], row["kind"]), []).append(row)
    lines = ["| set, programs | " + " | ".join(COLUMNS) + " |", "|" + "---|" * (len(COLUMNS) + 1)]
    for (which, kind), rows in sorted(groups.items()):
        means = [np.mean([row.get(column, np.nan) for row in rows]) for column in COLUMNS]
        cells = [f"{mean:.1f}" if mean > 2 else f"{mean:.3f}" for mean in means]
        lines.append("| " + " | ".join([f"{which}, {kind}, {len(rows)}", *cells]) + " |")
    return "\n".join(lines)


def main() -> None:
    """Run, or print the table of a run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", nargs="*", default=["furniture"], choices=SETS)
    parser.add_argument("--kinds", nargs="*", default=["fused", "cells"], choices=KINDS)
    parser.add_argument("--programs", type=int, default=200, help="so many of each set")
    parser.add_argument("--first", type=int, default=0, help="the number of the first; tune on 1000 and above")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="planted.jsonl", help="rows, one line of JSON each; appended to")
    parser.add_argument("--table", default=None, help="print the table of these rows and do nothing else")
    args = parser.parse_args()
    if args.table is None:
        run(args)
    print(table(Path(args.table or args.out)))


if __name__ == "__main__":
    main()
