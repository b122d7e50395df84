"""``shapeprog infer``: a program from each shape; broken inputs do not stop the others."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shapeprog.cli import terminal
from shapeprog.cli.terminal import about_program, about_search
from shapeprog.cli.units import AsUnit, FileUnit, asked_unit, check_units
from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.inference.budget import BUDGET, Progress

if TYPE_CHECKING:
    from shapeprog.data.shape import Shape
    from shapeprog.language.program import Program
    from shapeprog.library import Library

FOLDER = Path("shapeprog-out")

LARGE = 10.0
"""Metres from which furniture is more likely to be in another unit."""

TIPPED = (".stl", ".ply", ".off", ".xyz")
"""Formats that do not store the up axis."""

_SUFFIXES = (".json", ".shape", ".glb", ".png")
_LONGEST = 120


@dataclass(frozen=True)
class Found:
    """A program for one shape.  Its files leave the seconds out: the same seed writes the same bytes."""

    program: Program
    snapped: Program | None
    scores: dict[str, float]
    reason: str
    seconds: float


Inference = Callable[["Shape", int, float, int, Progress], Found]
Finish = Callable[["Program", "Shape"], "Program"]


def infer_command(
    inputs: Annotated[
        list[Path],
        typer.Argument(metavar="INPUT", help="Meshes, point clouds, voxel grids, or folders of them."),
    ],
    up: terminal.Up = None,
    front: terminal.Front = None,
    file_unit: FileUnit = None,
    blocks: Annotated[int, about_program(metavar="N", help="Maximum number of drawing statements.", min=1)] = 10,
    detail: Annotated[
        float, about_program(metavar="FACTOR", help="Higher: longer program, closer fit.", min=0.01, max=100)
    ] = 1.0,
    unit: AsUnit = None,
    no_ties: Annotated[bool, about_program("--no-ties", help="Plain numbers, no names and expressions.")] = False,
    library: terminal.WithLibrary = False,
    modules: terminal.WithLibraries = None,
    paper: Annotated[
        bool, about_program("--paper", help="Only the statements of Liang (2022), on a 32^3 grid.")
    ] = False,
    seed: terminal.Seed = 0,
    rounds: Annotated[
        int | None, about_search(metavar="N", help="Maximum number of search rounds; fewer are faster.", min=0)
    ] = None,
    budget: Annotated[float, about_search(metavar="SECONDS", help="Time limit per shape.", min=0.1)] = BUDGET,
    baseline: Annotated[bool, about_search("--baseline", help="Greedy boxes instead of the search.")] = False,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FOLDER", help="Folder for the results.")] = FOLDER,
    no_picture: Annotated[bool, typer.Option("--no-picture", help="Do not write the PNG.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one line of JSON per shape.")] = False,
    quiet: terminal.Quiet = False,
) -> None:
    """Infer a program from each shape; write it as .shape and .json, with a .glb and a .png.

    Example: shapeprog infer chair.glb --unit cm --out results

    The program keeps the position of the input, so later exports lie on it. The same seed gives the same files.
    An input that cannot be read is reported at the end; the others are processed.
    """
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from shapeprog.data import load_all
    from shapeprog.files import make_folder

    terminal.check_axes(up, front)
    check_units(unit, file_unit)
    _prepare(picture=not no_picture, talk=not (quiet or as_json))
    libraries = terminal.load_libraries(modules, library)
    finished = partial(_in_unit, unit=unit, file_unit=file_unit)
    infer_one = (
        partial(_baseline, finished) if baseline else _chosen(finished, rounds, paper, detail, not no_ties, libraries)
    )
    folder = make_folder(out)
    failures: list[tuple[Path, ShapeProgError]] = []
    stopped: OutputError | None = None
    written, stems = 0, set[str]()
    talk = not (quiet or as_json)
    console = terminal.output()
    columns = (
        SpinnerColumn("line"),
        TextColumn("{task.description}", markup=False),
        BarColumn(24),
        TimeElapsedColumn(),
    )
    bar = Progress(*columns, console=terminal.errors(), transient=True) if talk else None
    with bar or nullcontext():
        task = bar.add_task("reading", total=1.0) if bar else None
        shapes = iter(load_all(inputs, up=up, front=front, seed=seed))
        try:
            for path, shape in shapes:
                if isinstance(shape, ShapeProgError):
                    failures.append((path, shape))
                    continue
                if bar and task is not None:
                    bar.reset(task, description=shape.name, total=1.0)

                def progress(stage: str, share: float, name: str = shape.name) -> None:
                    if bar and task is not None:
                        bar.update(task, completed=share, description=f"{name}: {stage}")

                try:
                    result = infer_one(shape, blocks, budget, seed, progress)
                    stem = _free_stem(shape, stems, folder)
                    names = _write(result, shape, folder, stem, not no_picture)
                except OutputError as error:
                    stopped = error  # a disk that took nothing now takes nothing later
                    break
                except ShapeProgError as error:
                    failures.append((path, error))
                    continue
                except Exception as error:
                    failures.append((path, terminal.fault("no program was inferred", error)))
                    continue
                written += 1
                if as_json:
                    report = {"name": shape.name, "folder": str(folder), "seconds": result.seconds}
                    terminal.print_json(report | json.loads(_document(result, shape)))
                elif talk:
                    _report(console, result, shape, folder, names, file_unit, up, written == 1)
        except KeyboardInterrupt:
            raise terminal.Interrupted(_kept(written, folder)) from None
    for path, problem in failures:
        if as_json:
            report = {"name": path.name, "source": str(path), "error": problem.message, "hint": problem.hint}
            terminal.print_json(report)
        terminal.complain(terminal.at(path, problem))
    if len(failures) + written > 1 and failures and not quiet:
        terminal.errors().print(f"{len(failures)} of {len(failures) + written} inputs failed.", markup=False)
    if stopped:
        raise OutputError(stopped.message, f"{stopped.hint}; {_kept(written, folder)}")
    if failures:
        raise typer.Exit(1 if written else terminal.MISTAKE)
    if not written:
        raise InputError("no shapes to infer from", "give files or folders with meshes, point clouds or voxels")


def _prepare(picture: bool, talk: bool) -> None:
    """Prepare the kernels of inference, with a message if they must be compiled."""
    from shapeprog.kernels.compile import prepare
    from shapeprog.kernels.modules import INFERENCE, PICTURES, READING

    def report(sentence: str) -> None:
        terminal.errors().print(f"{sentence.capitalize()}.", style="dim", markup=False)

    prepare([*INFERENCE, *READING, *(PICTURES if picture else ())], report if talk else None)


def _in_unit(program: Program, shape: Shape, unit: str | None, file_unit: str | None) -> Program:
    if unit is None:
        return program
    from shapeprog.inference.readable import in_readable_unit

    return in_readable_unit(program, asked_unit(None, shape.frame, shape.name, unit, file_unit))


def _chosen(
    finished: Finish,
    rounds: int | None,
    paper: bool,
    detail: float,
    ties: bool,
    libraries: Sequence[Library],
) -> Inference:
    """Inference with the options of the command, which are checked before the first shape is read."""
    from shapeprog.inference import Settings, infer

    settings = None if rounds is None else Settings(rounds=rounds)

    def infer_one(shape: Shape, blocks: int, budget: float, seed: int, progress: Progress) -> Found:
        result = infer(
            shape, blocks=blocks, budget=budget, seed=seed, settings=settings,
            statements="paper" if paper else "all", detail=detail, ties=ties, libraries=libraries, progress=progress,
        )  # fmt: skip
        program = finished(result.program, shape)
        scores = _scores(program, result.snapped, shape, result.scores, seed)
        return Found(program, result.snapped, scores, result.reason, result.seconds)

    return infer_one


def _baseline(finished: Finish, shape: Shape, blocks: int, budget: float, seed: int, progress: Progress) -> Found:
    import time

    from shapeprog.inference import greedy_boxes

    started = time.monotonic()
    snapped: Program = greedy_boxes(shape.voxels, blocks).snap()
    seconds = time.monotonic() - started
    reason = "Greedy boxes: one box per drawing statement, without search."
    program = finished(snapped, shape)
    return Found(program, snapped, _scores(program, snapped, shape, {}, seed), reason, seconds)


def _scores(
    program: Program, snapped: Program | None, shape: Shape, given_scores: dict[str, float], seed: int
) -> dict[str, float]:
    """The scores of inference, the distance to the input, and the size of the program."""
    from shapeprog.evaluation.metrics import evaluate_program

    measured = evaluate_program(program, shape, snapped, seed=seed, iou=given_scores.get("iou"))
    fit = {"iou": measured.iou, "cd": measured.cd, "noise_floor": measured.noise_floor, "f1": measured.f1}
    sizes = {"blocks": measured.blocks, "statements": measured.statements, "primitives": measured.primitives}
    return terminal.plain({**given_scores, **fit, **sizes})


def _document(result: Found, shape: Shape) -> str:
    from shapeprog.formats.json_form import program_to_json, result_json

    rounded = {} if result.snapped is None else {"snapped": json.loads(program_to_json(result.snapped))["program"]}
    return result_json(
        result.program, shape.frame, scores=result.scores, reason=result.reason, source=_source(shape), **rounded
    )


def _write(result: Found, shape: Shape, folder: Path, stem: str, picture: bool) -> list[str]:
    from shapeprog.files import write_text
    from shapeprog.formats import export

    write_text(folder / f"{stem}.json", _document(result, shape))
    names = [f"{stem}.json", f"{stem}.shape"]
    export(result.program, folder / f"{stem}.shape", shape.frame)
    if result.program.size:
        export(result.program, folder / f"{stem}.glb", shape.frame)
        names.append(f"{stem}.glb")
    if picture:
        from shapeprog.view import picture as draw

        draw(shape, result.program, folder / f"{stem}.png", scores=result.scores)
        names.append(f"{stem}.png")
    return names


def _kept(written: int, folder: Path) -> str:
    return f"finished results are kept: {written} program{'s' if written != 1 else ''} in {folder}"


def _free_stem(shape: Shape, stems: set[str], folder: Path) -> str:
    """A file name that neither another shape, of this run or an earlier one, nor another file has.

    The same input may replace its own results.
    """
    base = re.sub(r"[^\w.\-]+", "_", shape.name).strip("._")[:_LONGEST] or "shape"
    stem, number = base, 1
    while stem in stems or not _replaceable(shape, folder, stem):
        number += 1
        stem = f"{base}_{number}"
    stems.add(stem)
    return stem


def _replaceable(shape: Shape, folder: Path, stem: str) -> bool:
    """Whether there are no files of that name, or only earlier results of the same shape."""
    from shapeprog.formats.json_form import read_result

    if shape.source is not None and shape.source.resolve() == (folder / f"{stem}{shape.source.suffix}").resolve():
        return False
    if not any((folder / f"{stem}{suffix}").exists() for suffix in _SUFFIXES):
        return True
    try:
        return read_result(folder / f"{stem}.json").source == _source(shape)
    except ShapeProgError:
        return False


def _source(shape: Shape) -> str | None:
    """The file, and in a file of many the name of the shape, as :func:`shapeprog.data.load` finds it again."""
    from shapeprog.data.loading import ARRAY_SUFFIXES

    if shape.source is None:
        return None
    path = str(shape.source.absolute())
    if shape.source.suffix.lower() not in ARRAY_SUFFIXES or shape.name == shape.source.stem:
        return path
    return f"{path}#{shape.name.removeprefix(f'{shape.source.stem}#')}"


def _report(
    console: Any,
    result: Found,
    shape: Shape,
    folder: Path,
    names: list[str],
    file_unit: str | None,
    up: str | None,
    first: bool,
) -> None:
    from shapeprog.data.orientation import default_axes
    from shapeprog.data.placement import SCAN
    from shapeprog.space import SPAN
    from shapeprog.view.page import scores_text

    console.print(shape.name, style="bold")
    if shape.kind != "mesh":
        kind = f"a point cloud; normals are estimated from up to {SCAN:,} points"
        console.print(f"Read as {'voxels' if shape.points is None else kind}.", style="dim")
    if up is None and shape.source is not None and shape.source.suffix.lower() in TIPPED:
        note = f"The format does not store the up axis: {default_axes(shape.source)[0]} is assumed."
        console.print(f"{note} Another axis: --up +y, or --up auto", style="dim")
    terminal.print_program(console, result.program)
    side = SPAN * shape.frame.scale
    if result.program.unit and file_unit is None and (first or side > LARGE):
        note = f"The unit of the file is assumed to be m, so that the longest side is {side:.3g} m."
        console.print(f"{note} Another unit: --file-unit mm", style="dim")
    for line in scores_text(result.scores | {"seconds": result.seconds}, result.program):
        console.print(line, style="dim")
    console.print(result.reason, style="dim")
    console.print(f"Wrote {', '.join(names)} in {folder}; the files keep every digit.", style="dim")
    console.print()
