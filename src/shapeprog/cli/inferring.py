"""``shapeprog infer``: a program from each shape; broken inputs do not stop the others."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from shapeprog.cli import terminal
from shapeprog.cli.terminal import about_program, about_search
from shapeprog.cli.units import AsUnit, FileUnit, assumed, check_units
from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.inference.budget import BUDGET, Progress

if TYPE_CHECKING:
    from shapeprog.data.shape import Shape
    from shapeprog.inference import Result

FOLDER = Path("shapeprog-out")

TIPPED = (".stl", ".ply", ".off", ".xyz")  # formats that do not store the up axis


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
    rounds: Annotated[int | None, about_search(metavar="N", help="Maximum rounds of the search on cells.", min=0)] = (
        None
    )
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
    """A shape, what was inferred from it, and the names of the files."""

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
    from shapeprog.inference.results import document

    terminal.check_axes(options.up, options.front)
    check_units(options.unit, options.file_unit, needed=False)
    _prepare(options)
    infer_one = _inference(options)
    folder, console = make_folder(options.out), terminal.output()
    failures: list[tuple[Path, ShapeProgError]] = []
    stopped: OutputError | None = None
    written, units = 0, set[str]()
    try:
        for path, outcome in _results(options, infer_one, folder):
            if isinstance(outcome, ShapeProgError):
                failures.append((path, outcome))
                continue
            written += 1
            if options.as_json:
                report = {"name": outcome.shape.name, "folder": str(folder), "seconds": outcome.result.seconds}
                terminal.print_json(report | json.loads(document(outcome.result, outcome.shape)))
            elif options.talks:
                _report(console, outcome, options, units)
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
    from shapeprog.inference import results
    from shapeprog.view import picture

    stems = set[str]()
    with terminal.progress(options.talks) as begin:
        for path, shape in load_all(options.inputs, up=options.up, front=options.front, seed=options.seed):
            if isinstance(shape, ShapeProgError):
                yield path, shape
                continue
            try:
                shape = replace(shape, unit=options.file_unit or "")
                result = infer_one(shape, begin(shape.name))
                stem = results.free_stem(shape, stems, folder)
                names = results.write(result, shape, folder, stem)
                if not options.no_picture:
                    picture(shape, result.program, folder / f"{stem}.png", scores=result.scores)
                    names.append(f"{stem}.png")
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
    from shapeprog.kernels.compile import modules_of, prepare

    def report(sentence: str) -> None:
        terminal.errors().print(f"{sentence.capitalize()}.", style="dim", markup=False)

    pictures = () if options.no_picture else ("view",)
    prepare(modules_of("data", "geometry", "inference", *pictures), report if options.talks else None)


def _inference(options: InferOptions) -> Inference:
    """Inference with the options of the command, which are checked before the first shape is read."""
    from shapeprog.inference import Result, Settings, greedy_boxes, infer
    from shapeprog.inference.readable import in_readable_unit, unit_of_result
    from shapeprog.inference.results import measured
    from shapeprog.language.convert import placed_if_possible

    settings = None if options.rounds is None else Settings(rounds=options.rounds)
    libraries = terminal.load_libraries(options.modules, options.library)

    def infer_one(shape: Shape, progress: Progress) -> Result:
        if options.baseline:
            started = time.monotonic()
            boxes = greedy_boxes(shape.voxels, options.blocks).snap()
            reason = "Greedy boxes: one box per drawing statement, without search."
            program = placed_if_possible(boxes)
            program = in_readable_unit(program, unit_of_result(shape, program, options.unit or ""), options.seed)
            result = Result(program, boxes, {}, reason, (), time.monotonic() - started)
        else:
            result = infer(
                shape, blocks=options.blocks, budget=options.budget, seed=options.seed, settings=settings,
                statements="paper" if options.paper else "all", detail=options.detail, ties=not options.no_ties,
                libraries=libraries, unit=options.unit or "", progress=progress,
            )  # fmt: skip
        return measured(result, shape, options.seed)

    return infer_one


def _kept(written: int, folder: Path) -> str:
    return f"finished results are kept: {written} program{'s' if written != 1 else ''} in {folder}"


def _report(console: Any, written: Written, options: InferOptions, units: set[str]) -> None:
    """Print a result; ``units`` are those that have been assumed, each of which is reported once."""
    from shapeprog.data.orientation import default_axes
    from shapeprog.data.placement import SCAN
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
    unit = shape.file_unit or "m"
    if result.program.unit and result.program.unit.name and not shape.states_unit and unit not in units:
        units.add(unit)
        console.print(assumed(shape.frame, unit), style="dim")
    for line in scores_text(result.scores | {"seconds": result.seconds}, result.program):
        console.print(line, style="dim")
    console.print(result.reason, style="dim")
    console.print(f"Wrote {', '.join(names)} in {options.out}; the files keep every digit.", style="dim")
    console.print()
