"""Commands over data sets: prepare or draw them, evaluate predictions."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shapeprog.cli import terminal
from shapeprog.errors import InputError, ShapeProgError

if TYPE_CHECKING:
    from shapeprog.evaluation.metrics import Metrics, Summary
    from shapeprog.language.program import Program

_LABELS = {
    "f1_percent": "F1@1%", "f1_percent_floor": "F1@1% of the target itself", "silhouette": "silhouette",
    "one_piece": "one piece", "part_recall": "part recall", "part_precision": "part precision", "cd": "CD",
    "cd_floor": "CD of the target itself", "numbers": "free numbers", "f1_half_percent": "F1@.5%",
    "f1_half_percent_floor": "F1@.5% of the target itself", "normals": "normals",
    "normals_floor": "normals of the target itself", "slivers": "slivers", "iou": "IoU@32", "f1_cell": "F1@1cell",
    "blocks": "drawing statements", "statements": "statements", "primitives": "parts",
}  # fmt: skip
_MAIN = tuple(_LABELS)[:9]
_FEW = 5
_SIZES = ("blocks", "statements", "primitives", "numbers")


def prepare_command(
    directory: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="ShapeNetCore v2, a folder per category, or models.")
    ],
    output: Annotated[Path, typer.Argument(metavar="OUTPUT", help="Folder for the packs.")],
    points: Annotated[int, typer.Option(metavar="N", help="Points on each surface.", min=1)] = 5000,
    seed: terminal.Seed = 0,
    up: terminal.Up = None,
    front: terminal.Front = None,
) -> None:
    """Convert a folder of models to data sets (packs) CATEGORY_SPLIT.npz of voxels and points.

    Example: shapeprog prepare ShapeNetCore.v2 packs

    Shapes with equal voxels are in the same split.
    """
    from shapeprog.data import prepare

    terminal.check_axes(up, front)
    last = None
    with terminal.progress() as begin:
        report = begin("preparing")
        try:
            for last in prepare(directory, output, points=points, seed=seed, up=up, front=front):
                report(f"{last.done} of {last.total}", last.done / max(last.total, 1))
        except KeyboardInterrupt:
            raise terminal.Interrupted(f"finished categories are kept in {output}") from None
    assert last is not None
    for path, count in last.packs:
        terminal.say(f"wrote {path}: {_shapes(count)}")
    if small := ", ".join(path.name for path, count in last.packs if count < _FEW):
        terminal.note(f"Few shapes, so scores on them say little: {small}", "yellow")
    terminal.finish([terminal.at(path, error) for path, error in last.failures])


def sample_command(
    count: Annotated[int, typer.Option(metavar="N", help="Number of shapes.", min=1)] = 24,
    seed: terminal.Seed = 0,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Contact sheet to write, such as sheet.png.")] = None,
    folder: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Folder for a .shape file of each.")] = None,
    pack: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Data set to write, .npz: voxels, and points with --points.")
    ] = None,
    points: Annotated[int, typer.Option(metavar="N", help="Surface points per shape in the data set.", min=0)] = 0,
    overwrite: terminal.Overwrite = False,
) -> None:
    """Generate synthetic furniture as a contact sheet, as programs, or as a data set.

    Example: shapeprog sample --count 24 --out sheet.png

    Without --out, --folder and --pack the programs are printed.
    """
    from shapeprog.data.synthetic import FURNITURE, furniture

    programs = [furniture(number, seed) for number in range(count)]
    write_samples(FURNITURE, programs, seed, out=out, folder=folder, pack=pack, points=points, overwrite=overwrite)


def write_samples(
    prior: str,
    programs: list[Program],
    seed: int,
    *,
    out: Path | None = None,
    folder: Path | None = None,
    pack: Path | None = None,
    points: int = 0,
    overwrite: bool = False,
) -> None:
    """Write programs of a prior as a sheet, a folder and a pack, as far as asked for; otherwise print them."""
    from shapeprog.data import write_pack
    from shapeprog.data.synthetic.shapes import shapes_of
    from shapeprog.files import make_folder
    from shapeprog.formats import save
    from shapeprog.view import Item, contact_sheet

    named = {f"{prior}_{number:0{len(str(len(programs) - 1))}d}": program for number, program in enumerate(programs)}
    texts = {name: folder / f"{name}.shape" for name in named} if folder is not None else {}
    terminal.check_free(texts.values(), overwrite)
    if out is not None:
        sizes = [f"{program.size} parts, {program.blocks} drawing statements" for program in programs]
        items = [Item(name, None, named[name], size) for name, size in zip(named, sizes, strict=True)]
        contact_sheet(items, out, columns=6, title=f"{prior}, seed {seed}")
    if folder is not None:
        make_folder(folder)
        for name, path in texts.items():
            save(named[name], path)
    if pack is not None:
        write_pack(pack, shapes_of(named, points, seed))
    files = [path for path in (out, folder, pack) if path is not None]
    for path in files:
        terminal.say(f"wrote {path}: {_shapes(len(programs))}")
    for name, program in named.items() if not files else ():
        terminal.output().print(f"# {name}")
        terminal.print_program(program)


def evaluate_command(
    predictions: Annotated[Path, typer.Argument(metavar="PREDICTIONS", help="Programs or shapes: a file or folder.")],
    targets: Annotated[list[Path], typer.Argument(metavar="TARGETS", help="Target shapes: files or folders.")],
    parts: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Part meshes of each target, in folders named like the targets."),
    ] = None,
    points: Annotated[int, typer.Option(metavar="N", help="Points on each surface for CD.", min=2)] = 5000,
    seed: terminal.Seed = 0,
    up: terminal.Up = None,
    front: terminal.Front = None,
    every: Annotated[bool, typer.Option("--all", help="Print all measures, not only the main ones.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print rows and summary as JSON.")] = False,
    modules: terminal.With = None,
) -> None:
    """Score predictions against targets of the same name.

    Example: shapeprog evaluate results originals --all

    \b
    F1@1%, F1@.5%   of 20,000 points per surface, within that share of the bounding box diagonal
    normals         mean absolute cosine between normals at nearest points
    silhouette      mean IoU of 12 outlines
    one piece       share of programs whose union is one solid
    slivers         share of primitives thinner than .4% of the longest side
    part recall,    with --parts: parts that one primitive covers with IoU >= .5, and
    part precision  primitives that cover one part
    IoU@32          of voxels that are touched; in the statements of the paper of the program rounded, for which
                    evaluate the .json of infer --paper: the .shape holds no rounded form
    CD, F1@1cell    of 5,000 points; Chamfer distance with squared distances, both directions added, diagonal 1
    ... of the      the same measure between two samplings of the target, or two halves of its points: about the
    target itself   best value that a program reaches. Halves have fewer points: CD is too high, F1 too low

    For --parts DIR, the folder DIR/Chair/bekvam holds the part meshes of the target Chair_bekvam. Parts, predicted
    meshes and predicted point clouds are in the coordinates of the target. A single prediction is compared with a
    single target whatever their names. A program is compared in the axes of the input that its file stores, unless
    --up or --front is given.
    """
    if absent := terminal.absent([predictions, *targets]):  # before imports that take a second
        raise InputError(f"there is no file or folder {absent[0]}", "check the path")
    from rich.progress import track

    from shapeprog.data.parts import part_files
    from shapeprog.evaluation import scoring
    from shapeprog.evaluation.metrics import summarise
    from shapeprog.formats.json_form import SavedResult

    terminal.load_modules(modules)
    terminal.check_axes(up, front)
    files = part_files(parts) if parts else {}
    shapes, failures = scoring.read_targets(targets, up, front, points, seed)
    listed = list(scoring.predictions(predictions, points, seed))
    rows: list[Metrics] = []
    hidden = terminal.quiet or as_json
    for path, name, prediction in track(listed, "measuring", console=terminal.errors(), transient=True, disable=hidden):
        target = next(iter(shapes.values())) if len(shapes) == len(listed) == 1 else shapes.get(name)
        program = prediction.program if isinstance(prediction, SavedResult) else None
        terminal.warn(path, *(program.source.warnings if program and program.source else ()))
        try:
            if program is not None and target is not None and not (up or front):
                target = scoring.in_pose_of(program, target, points, seed)
            rows.append(scoring.measure(prediction, target, points, seed))
            if program is not None and target is not None and target.name in files:
                rows[-1] = scoring.with_parts(rows[-1], program, target, files[target.name], seed)
        except ShapeProgError as mistake:
            failures.append(ShapeProgError(f"prediction {name}: {mistake.message}", mistake.hint))
        except Exception as unexpected:
            failures.append(terminal.fault(f"prediction {name} could not be measured", unexpected))
    if not rows:
        for error in failures:
            terminal.complain(error)
        raise InputError("no prediction could be measured", "predictions and targets are matched by name")
    if files and (bare := [name for name in shapes if name not in files]):
        terminal.note(f"No parts of {len(bare)} of {len(shapes)} targets, such as {bare[0]}, are in {parts}", "yellow")
    missing_names = [name for name in shapes if name not in {row.name for row in rows}]
    summary = summarise(rows)
    if not any(row.blocks for row in rows):
        summary = {name: value for name, value in summary.items() if name not in _SIZES}
    if as_json:
        totals = {name: _finite(value) for name, value in summary.items()}
        content = {"rows": [_finite(row) for row in rows], "summary": totals, "missing": missing_names}
        terminal.print_json({"seed": seed, **content})
    else:
        _table(summary if every else {name: summary[name] for name in _MAIN if name in summary}, len(rows), seed)
    if missing_names:
        names = ", ".join(missing_names[:_FEW]) + (", ..." if len(missing_names) > _FEW else "")
        without = f"{len(missing_names)} of {len(shapes)} targets"
        terminal.note(f"{without} have no prediction and are not counted: {names}", "none")
    terminal.finish(failures)


def _shapes(count: int) -> str:
    return f"{count} shape{'s' if count != 1 else ''}"


def _table(summary: dict[str, Summary], shapes: int, seed: int) -> None:
    from rich import box
    from rich.table import Table

    console = terminal.output()
    names = [name for name in _LABELS if name in summary and summary[name].count]
    table = Table(f"{_shapes(shapes)}, seed {seed}", box=box.SIMPLE_HEAD)
    for heading in ("mean", "standard error", "median"):
        table.add_column(heading, justify="right")
    for name in names:
        value = summary[name]
        table.add_row(_LABELS[name], *(_number(name, number) for number in (value.mean, value.error, value.median)))
    console.print(table)


def _finite(record: Metrics | Summary) -> dict[str, Any]:
    """The fields of a record that JSON can hold."""
    fields = asdict(record).items()
    return {name: value for name, value in fields if not isinstance(value, float) or math.isfinite(value)}


def _number(name: str, value: Any) -> str:
    if value != value:
        return "-"
    return f"{value:.5f}" if name in ("cd", "cd_floor") else f"{value:.4g}" if name in _SIZES else f"{value:.3f}"
