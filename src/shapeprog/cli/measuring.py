"""Commands over whole collections: prepare packs, evaluate predictions."""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shapeprog.cli import terminal
from shapeprog.errors import InputError, ShapeProgError

if TYPE_CHECKING:
    from shapeprog.data.shape import Shape
    from shapeprog.evaluation.metrics import Metrics, Summary

_LABELS = {
    "f1_half_percent": "F1@.5%", "f1_half_percent_floor": "F1@.5% floor", "f1_percent": "F1@1%",
    "f1_percent_floor": "F1@1% floor", "normals": "normals", "normals_floor": "normals floor",
    "silhouette": "silhouette", "one_piece": "one piece", "slivers": "slivers",
    "part_recall": "part recall", "part_precision": "part precision",
    "iou": "IoU@32", "cd": "CD", "noise_floor": "CD noise floor", "f1": "F1@1cell",
    "blocks": "blocks", "statements": "statements", "primitives": "primitives", "numbers": "numbers",
}  # fmt: skip
_FEW = 5
_SIZES = ("blocks", "statements", "primitives", "numbers")


def prepare_command(
    directory: Annotated[Path, typer.Argument(help="ShapeNetCore v2 as distributed, or a folder per category.")],
    output: Annotated[Path, typer.Argument(help="Folder for the packs; made if missing.")],
    points: Annotated[int, typer.Option(help="Points on each surface.", min=1)] = 5000,
    seed: terminal.Seed = 0,
    up: terminal.Up = None,
    front: terminal.Front = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Turn a directory of models into packs CATEGORY_SPLIT.npz; equal shapes never straddle a split."""
    from rich.progress import Progress

    from shapeprog.data import prepare

    terminal.check_axes(up, front)
    last = None
    bar = None if quiet else Progress(console=terminal.errors(), transient=True)
    with bar or nullcontext():
        task = bar.add_task("preparing", total=None) if bar else None
        try:
            for last in prepare(directory, output, points=points, seed=seed, up=up, front=front):
                if bar and task is not None:
                    bar.update(task, completed=last.done, total=last.total)
        except KeyboardInterrupt:
            raise terminal.Interrupted(f"categories that were finished are kept in {output}") from None
    assert last is not None
    for path, error in last.failures:
        terminal.complain(terminal.at(path, error))
    if not quiet:
        for path, count in last.packs:
            terminal.output().print(f"wrote {path}: {count} shapes")
    if last.failures:
        raise typer.Exit(1)


def evaluate_command(
    predictions: Annotated[Path, typer.Argument(help="Programs, meshes, clouds or voxels: a file, pack or folder.")],
    targets: Annotated[list[Path], typer.Argument(help="Targets of any kind: files, packs or folders.")],
    parts: Annotated[
        Path | None, typer.Option(help="A folder with a folder of part meshes for each target, named as it is.")
    ] = None,
    points: Annotated[int, typer.Option(help="Points on each surface, for CD.", min=2)] = 5000,
    seed: terminal.Seed = 0,
    up: terminal.Up = None,
    front: terminal.Front = None,
    each: Annotated[bool, typer.Option("--each", help="A row for every shape as well.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print rows and summary as JSON.")] = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print a row per shape as CSV.")] = False,
    modules: terminal.With = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress.")] = False,
) -> None:
    """Measure predictions against targets of the same name: what a person sees, IoU at 32^3, CD, and size.

    F1@.5% and F1@1% are of 20,000 points on each surface, at those shares of the diagonal of the target's box; normals
    the mean absolute cosine at nearest points; silhouette the mean IoU of 12 outlines; one piece the share of programs
    whose union is one solid; slivers that of primitives thinner than .4% of the longest side. Floors are those of the
    target sampled twice. With --parts DIR, where DIR/Chair/bekvam holds the part meshes of the target Chair_bekvam in
    its world, part recall and precision tell how many parts have a primitive of their own (IoU >= .5).

    IoU is of the program snapped to the grid (the 'snapped' form of a .json result, else rounded); CD and F1 of the
    program as it is, 5,000 points each, bounding box of the target scaled to diagonal 1, squared distances, both
    directions added. The noise floor is the CD between two samplings of the target itself. Predicted meshes and
    clouds must lie in the world of their target. One prediction and one target need not have the same name.
    """
    from rich.progress import track

    from shapeprog.cli import scoring
    from shapeprog.data import load_all
    from shapeprog.data.parts import part_files
    from shapeprog.evaluation.metrics import summarise

    terminal.load_modules(modules)
    terminal.check_axes(up, front)
    missing = [path for path in [predictions, *targets] if not Path(str(path).split("#")[0]).exists()]
    if missing:
        raise InputError(f"there is no file or folder {missing[0]}", "check the path")
    files = part_files(parts) if parts else {}
    failures: list[ShapeProgError] = []
    shapes: dict[str, Shape] = {}
    for path, shape in load_all(targets, up=up, front=front, points=2 * points, seed=seed):
        if isinstance(shape, ShapeProgError):
            failures.append(ShapeProgError(f"target {path}: {shape.message}", shape.hint))
        elif shape.name in shapes:
            both = " and ".join(str(each) for each in (shapes[shape.name].source, shape.source) if each is not None)
            cure = "name one of them, or give them different names; until then the first is the target"
            failures.append(ShapeProgError(f"two targets are called {shape.name}: {both or path}", cure))
        else:
            shapes[shape.name] = shape
    found = list(scoring.predictions(predictions))
    rows: list[Metrics] = []
    console = terminal.errors()
    silent = quiet or as_json or as_csv
    for name, prediction in track(found, "measuring", console=console, transient=True, disable=silent):
        target = next(iter(shapes.values())) if len(shapes) == len(found) == 1 else shapes.get(name)
        if isinstance(prediction, ShapeProgError):
            failures.append(ShapeProgError(f"prediction {name}: {prediction.message}", prediction.hint))
        elif target is None:
            failures.append(ShapeProgError(f"prediction {name} has no target of that name", "rename one of them"))
        else:
            try:
                row = scoring.measure(prediction, target, points, seed)
            except ShapeProgError as refused:
                failures.append(ShapeProgError(f"prediction {name}: {refused.message}", refused.hint))
                continue
            except Exception as fault:
                failures.append(terminal.fault(f"prediction {name} could not be measured", fault))
                continue
            try:
                of_target = files.get(target.name)
                rows.append(scoring.with_parts(row, prediction, target, of_target, seed) if of_target else row)
            except InputError as mistake:
                failures.append(ShapeProgError(f"parts of {name}: {mistake.message}", mistake.hint))
                rows.append(row)
    used = {row.name for row in rows}
    missing_names = [name for name in shapes if name not in used]
    if not rows:
        for error in failures:
            terminal.complain(error)
        raise InputError("no prediction could be measured", "predictions and targets are matched by name")
    summary = summarise(rows)
    if not any(row.blocks for row in rows):
        summary = {name: value for name, value in summary.items() if name not in _SIZES}
    if as_json:
        totals = {name: terminal.plain(asdict(value)) for name, value in summary.items()}
        shown = [terminal.plain(asdict(row)) for row in rows]
        terminal.print_json({"seed": seed, "rows": shown, "summary": totals, "missing": missing_names})
    elif as_csv:
        writer = csv.DictWriter(sys.stdout, asdict(rows[0]).keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    else:
        _table(rows, summary, each, seed)
    if missing_names:
        told = ", ".join(missing_names[:_FEW]) + (", ..." if len(missing_names) > _FEW else "")
        terminal.errors().print(
            f"{len(missing_names)} of {len(shapes)} targets have no prediction and count nowhere: {told}", markup=False
        )
    for error in failures:
        terminal.complain(error)
    if failures:
        raise typer.Exit(1)


def _table(rows: Sequence[Metrics], summary: dict[str, Summary], each: bool, seed: int) -> None:
    from rich import box
    from rich.table import Table

    console = terminal.output()
    names = [name for name in _LABELS if name in summary and summary[name].count]
    if each:
        table = Table("shape", box=box.SIMPLE_HEAD)
        shown = [name for name in names if not name.endswith("floor")]
        for name in shown:
            table.add_column(_LABELS[name], justify="right")
        for row in rows:
            table.add_row(row.name, *(_number(name, getattr(row, name)) for name in shown))
        console.print(table)
    table = Table(f"{len(rows)} shapes, seed {seed}", box=box.SIMPLE_HEAD)
    for heading in ("mean", "standard error", "median"):
        table.add_column(heading, justify="right")
    for name in names:
        value = summary[name]
        table.add_row(_LABELS[name], *(_number(name, each) for each in (value.mean, value.error, value.median)))
    console.print(table)


def _number(name: str, value: Any) -> str:
    if value != value:
        return "-"
    return f"{value:.5f}" if name in ("cd", "noise_floor") else f"{value:.4g}" if name in _SIZES else f"{value:.3f}"
