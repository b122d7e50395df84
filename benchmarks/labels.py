"""Do inferred programs say what each place of a chair is?  Labelled points of PartNet chairs against words of parts.

    python -m benchmarks.labels DATA/partnet_chairs/chair_val.npz --objects 40 --out labels_val.jsonl
    python -m benchmarks.labels --table labels_val.jsonl

One line of JSON for every chair and method: for each block its word, and how many points of each label are nearest to
it.  The table then says what share of the points gets the right label, and the IoU of points by label:

=========  ============================================================================================================
declared   by the labels that roles declare
fitted     by the best fixed table from words to labels, fitted to these very programs
ceiling    with the best label for each block
=========  ============================================================================================================

Methods are ``all`` statements, and those of the ``paper`` alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.rows import measure_all, read_rows

METHODS = ("all", "paper")

Counted = list[tuple[str, list[int]]]
"""For every block its word, and how many points of each label are nearest to it."""


def measure(task: tuple[Path, int, str, int]) -> dict[str, Any]:
    """The row of one chair: path of the pack, number, method, seed."""
    import torch

    from shapeprog.data import read_pack
    from shapeprog.geometry.distance import nearest_primitive
    from shapeprog.inference import infer
    from shapeprog.language.printer import format_program
    from shapeprog.language.unroll import unroll

    path, number, method, seed = task
    torch.set_num_threads(1)
    shape = read_pack(path)[number]
    with np.load(path) as pack:
        labels, names = pack["label"][number], pack["label_names"].tolist()
    program = infer(shape, seed=seed, statements=method).program  # type: ignore[arg-type]
    scene = unroll(program)
    block = scene.block[nearest_primitive(scene, torch.from_numpy(shape.points))[0]].numpy()
    counted = [
        (draw.word, np.bincount(labels[block == index], minlength=len(names)).tolist())
        for index, draw in enumerate(program.draws)
    ]
    return {
        "name": shape.name, "number": number, "method": method, "seed": seed, "labels": names, "counted": counted,
        "text": format_program(program),
    }  # fmt: skip


Way = Callable[[str, list[int]], int]
"""The label of a block, by its word and its points; one more than there are where it has none."""


def scores(rows: Sequence[dict[str, Any]], label_of: Way) -> tuple[float, float]:
    """Mean share of the points with the right label, and mean part IoU over the labels there are, of some chairs."""
    right, overlap = [], []
    for row in rows:
        confusion = np.zeros((len(row["labels"]) + 1, len(row["labels"])))  # the last is for words without a label
        for word, counts in row["counted"]:
            confusion[label_of(word, counts)] += counts
        here = np.flatnonzero(confusion.sum(0))
        hit = np.diag(confusion[:-1])
        union = confusion[:-1].sum(1) + confusion.sum(0) - hit
        right.append(hit.sum() / confusion.sum())
        overlap.append((hit[here] / union[here]).mean())
    return float(np.mean(right)), float(np.mean(overlap))


def ways(rows: Sequence[dict[str, Any]]) -> list[Way]:
    """Labels as declared, as fitted to these very programs, and as they are best."""
    from shapeprog.language.statement import Role, language

    names, total = rows[0]["labels"], dict[str, Any]()
    for word, counts in [each for row in rows for each in row["counted"]]:
        total[word] = total.get(word, 0) + np.array(counts)
    known = {word: language().called(word) for word in total}
    declared = {word: each.label if isinstance(each, Role) else "" for word, each in known.items()}
    number = {word: names.index(label) if label in names else len(names) for word, label in declared.items()}
    return [
        lambda word, _: number[word],
        lambda word, _: int(total[word].argmax()),
        lambda _, counts: int(np.argmax(counts)),
    ]


def table(path: Path) -> str:
    """Markdown: accuracy and mean part IoU of every method, by the three ways to label."""
    lines = ["| method, chairs | declared | fitted | ceiling |", "|---|---|---|---|"]
    every = read_rows(path)
    for method in METHODS:
        if rows := [row for row in every if row["method"] == method]:
            cells = ["{:.3f} / {:.3f}".format(*scores(rows, way)) for way in ways(rows)]
            lines.append(f"| {method}, {len(rows)} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def run(args: argparse.Namespace) -> None:
    """Measure what is not in the output yet, chair after chair, in several processes."""
    out = Path(args.out)
    done = {(row["number"], row["method"], row["seed"]) for row in read_rows(out)}
    todo = [
        (Path(args.pack), number, method, args.seed)
        for number in range(args.objects)
        for method in args.methods
        if (number, method, args.seed) not in done
    ]
    measure_all(out, todo, measure, args.workers)


def main() -> None:
    """Run, or print the table of a run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pack", nargs="?", help="a pack of chairs with labelled points")
    parser.add_argument("--objects", type=int, default=40, help="so many chairs, the first")
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=METHODS)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="labels.jsonl", help="rows, one line of JSON each; appended to")
    parser.add_argument("--table", default=None, help="print the table of these rows and do nothing else")
    args = parser.parse_args()
    if args.table is None:
        if args.pack is None:
            parser.error("name the pack of the chairs")
        run(args)
    print(table(Path(args.table or args.out)))


if __name__ == "__main__":
    main()
