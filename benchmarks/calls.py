"""Calls of functions of libraries: how many are found by moving parts to them, against recognition afterwards alone.

    python -m benchmarks.calls --out calls.jsonl
    python -m benchmarks.calls --data DATA --sets bench cabinet ikea --objects 4 --out calls.jsonl
    python -m benchmarks.calls --table calls.jsonl

The set ``planted`` needs no data: chests of drawers, chairs and tables with calls of three functions that a user might
have written.  Each is given as its parts.  A call is found where the program calls the same function, and all that it
draws has IoU >= .5 with what is drawn there.  The other sets are those of :mod:`benchmarks.structure`, val, written
with the library that ships, or with another (``--library FILE``).

==========  ============================================================================================================
method      how a program is written
==========  ============================================================================================================
plain       without a library
recognised  with functions, once it is inferred
moved       parts that are nearly a call are moved to where it draws them, too
==========  ============================================================================================================
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.planted import in_frame, solid_overlaps
from benchmarks.rows import measure_all, read_rows
from benchmarks.structure import Task as Object
from benchmarks.structure import given, objects, whole

METHODS = ("plain", "recognised", "moved")

COLUMNS = (
    "planted", "found", "statements", "parts", "f1_half_percent", "f1_percent", "silhouette", "one_piece", "numbers",
    "cpu_seconds",
)  # fmt: skip

BUDGET = 3600.0
"""Seconds that no program takes, however busy the machine: nothing is cut short."""

LIBRARY = """\
def pull_out(grip):
    drawer()
    handle(width=width / 2, z=0, height=grip, front=-grip, depth=grip)

def ladder(count, thickness, rung):
    for _ in mirror(x=0):
        post(left=0, width=thickness, front=0, depth=thickness)
    for _ in row(count, last=at(top=0)):
        rail(left=thickness, right=thickness, depth=thickness / 2, bottom=rung, height=rung)

def trumpet(thickness):
    base(height=thickness)
    pedestal(taper(bottom=thickness, radius=(width / 4, thickness)))
"""
"""What a user might have written: a drawer with a handle, the back of a chair, the foot of a table."""


@dataclass(frozen=True)
class Task:
    """A planted program, or an object of val; and how it is written."""

    set: str
    name: str
    files: tuple[Path, ...]
    method: str
    library: Path | None = None
    seed: int = 0


def planted(number: int) -> str:
    """The text of a chest of drawers, a chair or a table that calls the function it is for."""
    random = np.random.default_rng(number)

    def some(low: float, high: float) -> float:
        return round(float(random.uniform(low, high)), 2)

    wide, deep, thick = some(14, 22), some(10, 14), some(0.6, 1.4)
    if number % 3 == 0:
        count, high = int(random.integers(2, 5)), some(16, 22)
        front, grip, step = some(0.6, 1.2), some(0.5, 0.9), high / count
        lines = ["body()"]
        lines += [
            f"pull_out(width={wide - 1:.2f}, front={-front}, depth={front}, bottom={step * k + 0.4:.2f}, "
            f"height={step - 0.8:.2f}, grip={grip})"
            for k in range(count)
        ]
    elif number % 3 == 1:
        seat, tall, wide = some(8, 11), some(8, 12), some(10, 14)
        high = seat + thick + tall
        lines = [
            f"seat(bottom={seat}, height={thick})",
            "for _ in mirror(x=0, y=0):",
            f"    leg(left=0, width=1.2, front=0, depth={some(0.8, 1.2)}, height={seat})",
            f"ladder(rear=0, depth=1.2, bottom={seat + thick:.2f}, count={int(random.integers(3, 6))}, thickness=1.2, "
            f"rung={some(0.7, 1.3)})",
        ]
    else:
        tall, foot = some(10, 16), some(7, 12)
        high = tall + thick
        lines = [
            f"trumpet(width={foot}, depth={foot}, top={thick}, thickness={thick})",
            f"top(top=0, height={thick})",
        ]
    lines.insert(0, f"width, depth, height = {wide}, {deep}, {high:.2f}\n{LIBRARY}")
    return "\n".join(lines) + "\n"


def measure(task: Task) -> dict[str, Any]:
    """The row of one program."""
    import torch

    from shapeprog.evaluation.likeness import Triangles
    from shapeprog.evaluation.metrics import evaluate_program
    from shapeprog.inference import infer
    from shapeprog.language.parser import parse
    from shapeprog.language.printer import format_program
    from shapeprog.library import library_of, load_library, with_library
    from shapeprog.library.length import statements

    torch.set_num_threads(1)
    own = task.set == "planted"
    text = planted(int(task.name)) if own else ""
    library = library_of(parse(f"width, depth, height = 1, 1, 1\n{LIBRARY}")) if own else load_library(task.library)
    parts, shape = _apart(text) if own else given(Object(task.set, task.name, task.files, seed=task.seed))
    cpu = time.process_time()
    offered = [library] if task.method == "moved" else []
    program = infer(shape, libraries=offered, seed=task.seed, budget=BUDGET).program
    if task.method == "recognised":
        program = with_library(program, library)
    seconds = time.process_time() - cpu
    placed = [Triangles(shape.frame.to_grid(vertices), faces) for vertices, faces in parts]
    target = replace(shape, points=None, **whole(placed))
    row = evaluate_program(program, target, seed=task.seed, looks=True)
    there = [each for each in called(parse(text)) if each[0]] if own else []
    found = sum(_found(each, called(program), shape.frame) for each in there)
    return vars(row) | {
        "set": task.set, "name": task.name, "method": task.method, "seed": task.seed, "cpu_seconds": seconds,
        "planted": len(there), "found": found, "statements": statements(program), "parts": len(called(program)),
        "program": format_program(program),
    }  # fmt: skip


def _apart(text: str) -> tuple[list[Any], Any]:
    """The parts of a program, and the shape that they make together."""
    from shapeprog.data.placement import shape_from_mesh
    from shapeprog.formats.parts import parts
    from shapeprog.language.parser import parse

    drawn = parts(parse(text))
    shape = shape_from_mesh(**whole(drawn), name="planted", axes=np.eye(3))
    return [(part.vertices, part.faces) for part in drawn], shape


def called(program: Any) -> list[tuple[str, Any]]:
    """The parts of a program as it is written: which function is called, if any, and the scene of what is drawn."""
    from shapeprog.language.ast import Assignment, Call, Comment, Function, Line, body_of
    from shapeprog.language.evaluate import expanded
    from shapeprog.language.printer import source_of
    from shapeprog.language.program import Program
    from shapeprog.language.unroll import unroll

    source = source_of(program)
    lines = source.lines
    named = tuple(line for line in lines if isinstance(line, Assignment | Function))
    found = []
    for line in lines:
        if not isinstance(line, Assignment | Function | Comment):
            inner: Line = line
            while len(body_of(inner)) == 1:
                (inner,) = body_of(inner)
            found.append(
                (
                    inner.name if isinstance(inner, Call) else "",
                    unroll(Program(expanded(replace(source, lines=(*named, line))))),
                )
            )
    return found


def _found(planted: tuple[str, Any], parts: list[tuple[str, Any]], frame: Any) -> bool:
    """Whether a planted call is among the parts of a program in the frame of the grid."""
    name, scene = planted
    overlaps = (solid_overlaps(in_frame(scene, frame), other) for word, other in parts if word == name)
    return any((each.max(1) >= 0.5).all() for each in overlaps)


def tasks(args: argparse.Namespace) -> Iterator[Task]:
    """All that is asked for."""
    for method in args.methods:
        for number in range(args.programs):
            yield Task("planted", str(number), (), method)
        for which in args.sets if args.data else ():
            for name, files in list(objects(args.data, which, "val"))[: args.objects]:
                yield Task(which, name, files, method, args.library)


def table(path: Path) -> str:
    """Markdown: sums of calls, means of all else."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in read_rows(path):
        groups.setdefault((row["set"], row["method"]), []).append(row)
    lines = ["| set, method, programs | " + " | ".join(COLUMNS) + " |", "|" + "---|" * (len(COLUMNS) + 1)]
    for (which, method), rows in sorted(groups.items()):
        figures = [
            (np.sum if column in ("planted", "found") else np.mean)([row[column] for row in rows]) for column in COLUMNS
        ]
        lines.append(
            "| " + " | ".join([f"{which}, {method}, {len(rows)}", *(f"{each:.4g}" for each in figures)]) + " |"
        )
    return "\n".join(lines)


def main() -> None:
    """Run, or print the table of a run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--data", type=Path, default=None, help="see benchmarks.structure; without it planted ones alone"
    )
    parser.add_argument("--sets", nargs="*", default=["bench", "cabinet", "ikea"])
    parser.add_argument("--objects", type=int, default=4, help="so many of each set")
    parser.add_argument("--library", type=Path, default=None, help="functions for --data; without it those that ship")
    parser.add_argument("--programs", type=int, default=20, help="so many planted ones")
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=METHODS)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--out", type=Path, default=Path("calls.jsonl"), help="rows, one line of JSON each; appended to"
    )
    parser.add_argument("--table", type=Path, default=None, help="print the table of these rows and do nothing else")
    args = parser.parse_args()
    if args.table is None:
        done = {(row["set"], row["name"], row["method"]) for row in read_rows(args.out)}
        measure_all(
            args.out,
            [each for each in tasks(args) if (each.set, each.name, each.method) not in done],
            measure,
            args.workers,
        )
    print(table(args.table or args.out))


if __name__ == "__main__":
    main()
