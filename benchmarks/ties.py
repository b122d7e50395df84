"""Ties: which relations between the numbers of a program are found again, and which are found that there are not.

    python -m benchmarks.ties --out ties.jsonl
    python -m benchmarks.ties DATA/partnet_chairs --sets chairs --objects 80 --out chairs_val.jsonl
    python -m benchmarks.ties --table ties.jsonl

=========  ============================================================================================================
set        what is tied
=========  ============================================================================================================
fitted     programs of the prior ``furniture`` with normal noise of .05 cells on every number (angles: as much as moves
           a surface so far), and as evidence the points of the planted solids: how inference ties
alone      the same programs without any evidence: how ``shapeprog tidy`` ties
chairs     what inference finds for PartNet chairs, of which it is known which parts are copies of each other
=========  ============================================================================================================

*Planted.*  A furniture is designed by relations: drawn again with other measures and otherwise alike, what is related
still is.  Relations are those that people write: equal or opposite lengths, radii, angles, shifts; sides and middles of
parts that are flush, in the middle, or mirror each other.  One is planted where it holds in every redrawing, up to the
rounding of lengths.  Relations follow from each other, so they are counted as a space of rows has dimensions:
``recall`` is the share of the dimensions of the planted relations that hold in the tied program.  Of the dimensions of
what the tied program holds to, as many as may be are taken from planted relations, then from those that the planted
furniture happens to hold to within twice the noise (``chance``), and all others are ``false``.

*Chairs.*  Two primitives that stand for two parts (IoU >= .5, each its own) share their numbers where their sizes stay
the same whatever the free numbers of the program: a loop repeats them, or the same names and expressions give them.
``recall`` is, of the pairs of parts that are copies of each other, the share that do; ``false`` is, of the pairs that
do, the share whose parts differ in some extent by more than .1 cells and 5 %.  The columns ``plain`` say the same of
the program without its names, where only loops share numbers.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.rows import measure_all, read_rows

SETS = ("fitted", "alone", "chairs")

COLUMNS = {
    "fitted": ("recall", "false", "chance", "planted", "found", "numbers", "free", "seconds"),
    "chairs": ("recall", "false", "plain_recall", "plain_false", "copies", "shared", "parts", "matched", "free"),
}
COLUMNS["alone"] = COLUMNS["fitted"]

NOISE = 0.05
"""Standard deviation of the noise, in cells."""

ROUNDING = 1e-5
"""What rounding to single precision may add to that, in cells."""

VARIANTS = 40
"""Redrawings of one piece of furniture."""

ROUNDED = 0.02
"""Cells by which what holds may be off: lengths are rounded to two decimals."""

ALIKE, FINE = 0.05, 0.1
"""By what the extents of parts that are alike differ at most: a share of the longer, or so many cells."""

SHAKEN = 0.1
"""Share of itself by which every free number is changed, at most, to see which sizes stay the same."""


@dataclass(frozen=True)
class Task:
    """One program to be tied; ``pack`` is the file with the chairs."""

    set: str
    number: int
    seed: int
    pack: Path | None = None


def measure(task: Task) -> dict[str, Any]:
    """The row of one program."""
    import torch

    torch.set_num_threads(1)
    found = of_chair(task) if task.set == "chairs" else of_furniture(task)
    return {"set": task.set, "number": task.number, "seed": task.seed, **found}


def of_furniture(task: Task) -> dict[str, Any]:
    """How many ties of a planted program are found again."""
    from shapeprog.data.synthetic.furniture import furniture
    from shapeprog.inference.evidence import evidence_of_program
    from shapeprog.inference.ties.leaning import between_ends
    from shapeprog.inference.ties.tying import tie
    from shapeprog.language.printer import format_program

    planted = between_ends(furniture(task.number, task.seed))
    noisy = with_noise(planted, np.random.default_rng((task.seed, task.number)))
    evidence = evidence_of_program(planted if task.set == "fitted" else noisy, task.seed)
    started = time.process_time()
    tied = tie(noisy, evidence, known=task.set == "alone", seed=task.seed)
    seconds = time.process_time() - started
    drawn, ways = redrawn(task.number, task.seed), ways_of(tied.program, planted)
    written = relations_written(planted)
    off = np.abs(written @ drawn.T)
    holding = np.abs(written @ ways).max(1, initial=0) < 1e-6
    designed, happening = off.max(1) <= ROUNDED, off[:, 0] <= 2 * NOISE + ROUNDING
    wanted, found = rank(written[designed]), len(ways) - rank(ways)
    kept, likely = rank(written[designed & holding]), rank(written[(designed | happening) & holding])
    return {
        "planted": wanted, "found": found, "kept": kept, "recall": kept / max(wanted, 1),
        "chance": (likely - kept) / max(found, 1), "false": (found - likely) / max(found, 1),
        "numbers": len(ways), "free": tied.free, "seconds": seconds,
        "planted_text": format_program(planted), "text": format_program(tied.program),
    }  # fmt: skip


def redrawn(number: int, seed: int) -> Any:
    """The numbers that may move (K, F) of furniture that is designed as that of a number is, which comes first."""
    from shapeprog.data.synthetic.furniture import furniture
    from shapeprog.inference.ties.leaning import between_ends
    from shapeprog.inference.tunable import Tunable

    tunable = Tunable(between_ends(furniture(number, seed)))
    moving = set(tunable.moving)

    def design(program: Any) -> list[Any]:
        """All but the numbers that may move."""
        return [
            (node.name, [(n, slot) in moving or value for slot, value in enumerate(node.values)])
            for n, node in enumerate(program.walk())
        ]

    programs = (tunable.program, *(between_ends(furniture(number, seed, measures)) for measures in range(VARIANTS)))
    alike = (list(each.walk()) for each in programs if design(each) == design(tunable.program))
    return np.array([[nodes[n].values[slot] for n, slot in tunable.moving] for nodes in alike])


def with_noise(program: Any, random: np.random.Generator) -> Any:
    """The plain program with noise on every number that may move."""
    import torch

    from shapeprog.inference.tunable import Tunable

    tunable = Tunable(program)
    angles = tunable.are("angle").numpy()
    noise = NOISE * random.normal(size=len(angles)) / np.where(angles, tunable.scale.numpy(), 1.0)
    low = np.minimum(tunable.values.numpy(), np.maximum(tunable.low.numpy(), -1e9))
    return tunable.settled(torch.from_numpy(np.maximum(tunable.values.numpy() + noise, low)))


def relations_written(program: Any) -> Any:
    """Relations (M, F) that people write between the numbers of a program, whether they hold or not."""
    from shapeprog.inference.ties.features import features
    from shapeprog.inference.tunable import Tunable

    tunable = Tunable(program)
    count = len(tunable.values)
    known = [each for each in features(tunable, tunable.poses(tunable.values)) if each.kind != "extent"]
    rows: list[Any] = []
    for axis in range(3):
        for kinds in (("low", "high", "place"), ("middle",)):
            group = [each.row[:count] for each in known if each.kind in kinds and each.axis == axis]
            rows += [*group, *(one + sign * two for one, two in combinations(group, 2) for sign in (1, -1))]
    for kind in ("length", "radius", "shift", "angle"):
        group = [each.row[:count] for each in known if each.kind == kind]
        rows += [one + sign * two for one, two in combinations(group, 2) for sign in (1, -1)]
    return np.array([row for row in rows if row.any()]).reshape(-1, count)


def ways_of(program: Any, planted: Any) -> Any:
    """What each number of a program follows from, by how much: the free numbers (F, Z); of those numbers (F) that may
    move in what was planted, since what is zero now may not."""
    from shapeprog.inference.tunable import Tunable
    from shapeprog.language.evaluate import symbolic
    from shapeprog.language.expression import Linear
    from shapeprog.language.named import names
    from shapeprog.language.printer import source_of

    free = {each.name: Linear.of(each.name) for each in names(program) if each.free and not each.whole}
    nodes = [node for each in symbolic(source_of(program), free) for node in walked(each)]
    rows = []
    for number, (n, slot) in enumerate(Tunable(planted).moving):
        value = nodes[n].values[slot]
        form = value if isinstance(value, Linear) else Linear(value)
        rows.append(dict(form.factors) | ({number: 1.0} if form.constant else {}))  # a plain number is free too
    columns = {key: place for place, key in enumerate(dict.fromkeys(key for row in rows for key in row))}
    ways = np.zeros((len(rows), len(columns)))
    for row, factors in zip(ways, rows, strict=True):
        for key, factor in factors.items():
            row[columns[key]] = factor
    return ways


def walked(node: Any) -> Iterator[Any]:
    """A statement, or a loop and all that is in it, in the order of the text."""
    yield node
    for inner in getattr(node, "body", ()):
        yield from walked(inner)


def rank(rows: Any) -> int:
    """How many rows are independent."""
    return int(np.linalg.matrix_rank(rows, 1e-6)) if rows.size else 0


def of_chair(task: Task) -> dict[str, Any]:
    """Which copies of parts of a chair share their numbers in what is inferred for it."""
    from shapeprog.data import read_pack
    from shapeprog.evaluation.parts import best_pairs, overlaps
    from shapeprog.inference import infer
    from shapeprog.language.named import inline
    from shapeprog.language.printer import format_program
    from shapeprog.language.unroll import unroll

    assert task.pack is not None
    boxes, group = boxes_of(task.pack, task.number)
    program = infer(read_pack(task.pack)[task.number], seed=task.seed).program
    pairs = best_pairs(overlaps(boxes, unroll(program), task.seed))
    extents = np.array([np.sort(2 * box.half) for box in boxes])
    row: dict[str, Any] = {"parts": len(boxes), "matched": len(pairs), "text": format_program(program)}
    for kind, each in (("", program), ("plain_", inline(program))):
        free, sizes = shaken(each)
        copies, shared = [], []
        for (one, here), (two, there) in combinations(sorted(pairs), 2):
            same = bool(np.allclose(sizes[:, here], sizes[:, there], rtol=1e-3, atol=1e-4))
            least = np.maximum(ALIKE * np.maximum(extents[one], extents[two]), FINE)
            alike = bool((np.abs(extents[one] - extents[two]) <= least).all())
            copies += [same] if group[one] == group[two] else []
            shared += [alike] if same else []
        row |= {kind + "copies": copies, kind + "shared": shared, kind + "free": free}
    return row


def boxes_of(pack: Path, number: int) -> tuple[list[Any], Any]:
    """The boxes of the parts of a chair in the grid, and the group of copies (B,) that each is of."""
    from shapeprog.evaluation.parts import Box
    from shapeprog.space import Frame

    with np.load(pack.with_name(f"{pack.stem}_boxes.npz")) as data:
        rows = slice(data["start"][number], data["start"][number + 1])
        centre, extents, axes = np.split(data["boxes"][rows].astype(np.float64), [3, 6], 1)
        group = data["group"][rows]
    axes = axes.reshape(-1, 2, 3)
    axes = np.concatenate([axes, np.cross(axes[:, :1], axes[:, 1:])], 1)  # directions as rows
    reach = (np.abs(axes) * extents[:, :, None] / 2).sum(1)
    low, high = (centre - reach).min(0), (centre + reach).max(0)
    frame = Frame.around(low, high, [(0, 0, -1), (1, 0, 0), (0, -1, 0)])  # x, y, z are -left-right, up, -depth
    turned = np.asarray(frame.axes)
    return [
        Box(frame.to_grid(at), (each @ turned).T, np.maximum(size / 2 / frame.scale, 0.05))
        for at, size, each in zip(centre, extents, axes, strict=True)
    ], group


def shaken(program: Any) -> tuple[int, Any]:
    """The number of free numbers; and the sizes of the boxes of all primitives (K, N, 3), smallest first, as they are
    and where all free numbers are others."""
    from shapeprog.inference.tunable import bounds
    from shapeprog.language.free import free_numbers, multiplied
    from shapeprog.language.unroll import unroll

    free = free_numbers(program)
    changed = program
    for place, factor in enumerate(np.random.default_rng(0).uniform(1 - SHAKEN, 1 + SHAKEN, free)):
        changed = multiplied(changed, place, factor)
    scenes = [unroll(each) for each in (program, changed)]
    return free, np.array([np.sort(bounds(scene)[scene.mask].numpy(), 1) for scene in scenes])


def tasks(args: argparse.Namespace) -> Iterator[Task]:
    """All that is asked for."""
    for which in args.sets:
        pack = Path(args.data) / f"chair_{args.split}.npz" if which == "chairs" else None
        for number in range(args.first, args.first + args.objects):
            yield Task(which, number, args.seed, pack)


def run(args: argparse.Namespace) -> None:
    """Measure what is not in the output yet, program after program, in several processes."""
    out = Path(args.out)
    done = {(row["set"], row["number"], row["seed"]) for row in read_rows(out)}
    measure_all(
        out, [task for task in tasks(args) if (task.set, task.number, task.seed) not in done], measure, args.workers
    )


def table(path: Path) -> str:
    """Markdown: the mean of every measure over programs; of chairs, shares of all pairs."""
    lines, every = [], read_rows(path)
    for which in SETS:
        rows = [row for row in every if row["set"] == which]
        if not rows:
            continue
        head = f"| {which}, {len(rows)} programs | " + " | ".join(COLUMNS[which]) + " |"
        means = of_pairs(rows) if which == "chairs" else {}
        cells = [
            means[column] if column in means else np.mean([row[column] for row in rows]) for column in COLUMNS[which]
        ]
        written = (f"{mean:.1f}" if mean > 2 else f"{mean:.3f}" for mean in cells)
        lines += [head, "|" + "---|" * (len(COLUMNS[which]) + 1), "| mean | " + " | ".join(written) + " |", ""]
    return "\n".join(lines)


def of_pairs(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Recall and false ones of all pairs of all chairs, and how many pairs a chair has."""
    found = {}
    for kind in ("", "plain_"):
        for column, name in (("copies", "recall"), ("shared", "false")):
            each = [pair for row in rows for pair in row[kind + column]]
            found[kind + name] = abs(float(np.mean(each or [np.nan])) - (name == "false"))
            found[kind + column] = len(each) / len(rows)
    return found


def main() -> None:
    """Run, or print the table of a run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="?", help="the folder of the chairs, chair_val.npz and chair_val_boxes.npz")
    parser.add_argument("--sets", nargs="*", default=["fitted", "alone"], choices=SETS)
    parser.add_argument("--split", default="val", choices=("val", "test"))
    parser.add_argument("--objects", type=int, default=200, help="so many of each set")
    parser.add_argument(
        "--first", type=int, default=0, help="the number of the first; tune furniture on 1000 and above"
    )
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="ties.jsonl", help="rows, one line of JSON each; appended to")
    parser.add_argument("--table", default=None, help="print the table of these rows and do nothing else")
    args = parser.parse_args()
    if args.table is None:
        if "chairs" in args.sets and args.data is None:
            parser.error("name the folder of the chairs")
        run(args)
    print(table(Path(args.table or args.out)))


if __name__ == "__main__":
    main()
