"""``shapeprog infer``: a program from each shape; broken inputs do not stop the others."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from shapeprog.cli import terminal
from shapeprog.cli.terminal import about_program, about_search
from shapeprog.cli.units import LARGE, AsUnit, FileUnit, asked_unit, assumed, check_units
from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.inference.budget import BUDGET, Progress

if TYPE_CHECKING:
    from shapeprog.data.shape import Shape
    from shapeprog.inference import Result
    from shapeprog.language.program import Program

FOLDER = Path("shapeprog-out")

TIPPED = (".stl", ".ply", ".off", ".xyz")  # formats that do not store the up axis

_SUFFIXES = (".json", ".shape", ".glb", ".png")
_LONGEST = 120


@dataclass(frozen=True)
class InferOptions:
    """The arguments and options of the command."""

    inputs: Annotated[
        list[Path], typer.Argument(metavar="INPUT", help="Meshes, point clouds, voxel grids, or folders of them.")
    ]
    up: terminal.Up = None
    front: terminal.Front = None
    file_unit: FileUnit = None
    blocks: Annotated[int, about_program(metavar="N", help="Maximum number of drawing statements.", min=1)] = 10
    detail: Annotated[
        float, about_program(metavar="FACTOR", help="Higher: longer program, closer fit.", min=0.01, max=100)
    ] = 1.0
    unit: AsUnit = None
    no_ties: Annotated[bool, about_program("--no-ties", help="Plain numbers, no names and expressions.")] = False
    library: terminal.WithLibrary = False
    modules: terminal.WithLibraries = None
    paper: Annotated[bool, about_program("--paper", help="Only the statements of Liang (2022), on 32^3 cells.")] = False
    seed: terminal.Seed = 0
    rounds: Annotated[
        int | None, about_search(metavar="N", help="Maximum number of search rounds; fewer are faster.", min=0)
    ] = None
    budget: Annotated[float, about_search(metavar="SECONDS", help="Time limit per shape.", min=0.1)] = BUDGET
    baseline: Annotated[bool, about_search("--baseline", help="Greedy boxes instead of the search.")] = False
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FOLDER", help="Folder for the results.")] = FOLDER
    no_picture: Annotated[bool, typer.Option("--no-picture", help="Do not write the PNG.")] = False
    as_json: Annotated[bool, typer.Option("--json", help="Print one line of JSON per shape.")] = False
    quiet: terminal.Quiet = False

    @property
    def talks(self) -> bool:
        """Whether programs and progress are printed for people."""
        return not (self.quiet or self.as_json)


class Written(NamedTuple):
    """A shape, what was inferred from it, and the names of the files.

    Files leave the seconds out: the same seed writes the same bytes.
    """

    shape: Shape
    result: Result
    names: list[str]


Inference = Callable[["Shape", Progress], "Result"]


def infer_command(options: InferOptions) -> None:
    """Infer a program from each shape; write it as .shape and .json, with a .glb and a .png.

    Example: shapeprog infer chair.glb --unit cm --out results

    The program keeps the position of the input, so later exports lie on it. The same seed gives the same files.
    An input that cannot be read is reported at the end; the others are processed.
    """
    from shapeprog.files import make_folder

    terminal.check_axes(options.up, options.front)
    check_units(options.unit, options.file_unit)
    _prepare(options)
    infer_one = partial(_greedy, options) if options.baseline else _search(options)
    folder, console = make_folder(options.out), terminal.output()
    failures: list[tuple[Path, ShapeProgError]] = []
    stopped: OutputError | None = None
    written = 0
    try:
        for path, outcome in _results(options, infer_one, folder):
            if isinstance(outcome, ShapeProgError):
                failures.append((path, outcome))
                continue
            written += 1
            if options.as_json:
                report = {"name": outcome.shape.name, "folder": str(folder), "seconds": outcome.result.seconds}
                terminal.print_json(report | json.loads(_document(outcome.result, outcome.shape)))
            elif options.talks:
                _report(console, outcome, options, written == 1)
    except OutputError as error:
        stopped = error  # a disk that took nothing now takes nothing later
    except KeyboardInterrupt:
        raise terminal.Interrupted(_kept(written, folder)) from None
    for path, problem in failures:
        if options.as_json:
            report = {"name": path.name, "source": str(path), "error": problem.message, "hint": problem.hint}
            terminal.print_json(report)
        terminal.complain(terminal.at(path, problem))
    if len(failures) + written > 1 and failures and not options.quiet:
        terminal.errors().print(f"{len(failures)} of {len(failures) + written} inputs failed.", markup=False)
    if stopped:
        raise OutputError(stopped.message, f"{stopped.hint}; {_kept(written, folder)}")
    if failures:
        raise typer.Exit(1 if written else terminal.MISTAKE)
    if not written:
        raise InputError("no shapes to infer from", "give files or folders with meshes, point clouds or voxels")


def _results(
    options: InferOptions, infer_one: Inference, folder: Path
) -> Iterator[tuple[Path, Written | ShapeProgError]]:
    """Infer and write one shape after another; an ``OutputError`` where a file cannot be written."""
    from shapeprog.data import load_all

    stems = set[str]()
    with terminal.progress(options.talks) as begin:
        for path, shape in load_all(options.inputs, up=options.up, front=options.front, seed=options.seed):
            if isinstance(shape, ShapeProgError):
                yield path, shape
                continue
            try:
                result = infer_one(shape, begin(shape.name))
                names = _write(result, shape, folder, _free_stem(shape, stems, folder), not options.no_picture)
            except OutputError:
                raise
            except ShapeProgError as error:
                yield path, error
            except Exception as error:
                yield path, terminal.fault("no program was inferred", error)
            else:
                yield path, Written(shape, result, names)


def _prepare(options: InferOptions) -> None:
    """Prepare the kernels of inference, with a message if they must be compiled."""
    from shapeprog.kernels.compile import prepare
    from shapeprog.kernels.modules import INFERENCE, PICTURES, READING

    def report(sentence: str) -> None:
        terminal.errors().print(f"{sentence.capitalize()}.", style="dim", markup=False)

    prepare([*INFERENCE, *READING, *(() if options.no_picture else PICTURES)], report if options.talks else None)


def _in_unit(program: Program, shape: Shape, options: InferOptions) -> Program:
    if options.unit is None:
        return program
    from shapeprog.inference.readable import in_readable_unit

    return in_readable_unit(program, asked_unit(None, shape.frame, shape.name, options.unit, options.file_unit))


def _search(options: InferOptions) -> Inference:
    """Inference with the options of the command, which are checked before the first shape is read."""
    from shapeprog.inference import Settings, infer

    settings = None if options.rounds is None else Settings(rounds=options.rounds)
    libraries = terminal.load_libraries(options.modules, options.library)

    def infer_one(shape: Shape, progress: Progress) -> Result:
        result = infer(
            shape, blocks=options.blocks, budget=options.budget, seed=options.seed, settings=settings,
            statements="paper" if options.paper else "all", detail=options.detail, ties=not options.no_ties,
            libraries=libraries, progress=progress,
        )  # fmt: skip
        program = _in_unit(result.program, shape, options)
        scores = _scores(program, result.snapped, shape, result.scores, options.seed)
        return replace(result, program=program, scores=scores)

    return infer_one


def _greedy(options: InferOptions, shape: Shape, progress: Progress) -> Result:
    import time

    from shapeprog.inference import Result, greedy_boxes

    started = time.monotonic()
    snapped: Program = greedy_boxes(shape.voxels, options.blocks).snap()
    seconds = time.monotonic() - started
    reason = "Greedy boxes: one box per drawing statement, without search."
    program = _in_unit(snapped, shape, options)
    return Result(program, snapped, _scores(program, snapped, shape, {}, options.seed), reason, (), seconds)


def _scores(
    program: Program, snapped: Program | None, shape: Shape, given_scores: dict[str, float], seed: int
) -> dict[str, float]:
    """The scores of inference, the distance to the input, and the size of the program."""
    from shapeprog.evaluation.metrics import evaluate_program

    measured = evaluate_program(program, shape, snapped, seed=seed, iou=given_scores.get("iou"))
    fit = {"iou": measured.iou, "cd": measured.cd, "noise_floor": measured.noise_floor, "f1": measured.f1}
    sizes = {"blocks": measured.blocks, "statements": measured.statements, "primitives": measured.primitives}
    return terminal.plain({**given_scores, **fit, **sizes})


def _document(result: Result, shape: Shape) -> str:
    from shapeprog.formats.json_form import result_json
    from shapeprog.language.printer import format_program

    whole = {} if result.snapped is None else {"snapped": format_program(result.snapped)}
    return result_json(
        result.program, shape.frame, scores=result.scores, reason=result.reason, source=_source(shape), **whole
    )


def _write(result: Result, shape: Shape, folder: Path, stem: str, picture: bool) -> list[str]:
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


def _report(console: Any, written: Written, options: InferOptions, first: bool) -> None:
    from shapeprog.data.orientation import default_axes
    from shapeprog.data.placement import SCAN
    from shapeprog.space import SPAN
    from shapeprog.view.page import scores_text

    shape, result, names = written
    console.print(shape.name, style="bold")
    if shape.kind != "mesh":
        kind = f"a point cloud; normals are estimated from up to {SCAN:,} points"
        console.print(f"Read as {'voxels' if shape.points is None else kind}.", style="dim")
    if options.up is None and shape.source is not None and shape.source.suffix.lower() in TIPPED:
        note = f"The format does not store the up axis: {default_axes(shape.source)[0]} is assumed."
        console.print(f"{note} Another axis: --up +y, or --up auto", style="dim")
    terminal.print_program(console, result.program)
    side = SPAN * shape.frame.scale
    named = result.program.unit is not None and result.program.unit.name
    if named and options.file_unit is None and (first or side > LARGE):
        console.print(assumed(side), style="dim")
    for line in scores_text(result.scores | {"seconds": result.seconds}, result.program):
        console.print(line, style="dim")
    console.print(result.reason, style="dim")
    console.print(f"Wrote {', '.join(names)} in {options.out}; the files keep every digit.", style="dim")
    console.print()
