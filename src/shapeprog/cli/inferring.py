"""``shapeprog infer``: a program from each shape; broken inputs do not stop the others."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shapeprog.cli import terminal
from shapeprog.cli.terminal import about_program, about_search
from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.formats.format import CELLS
from shapeprog.inference.budget import BUDGET

if TYPE_CHECKING:
    from shapeprog.data.shape import Shape
    from shapeprog.inference import Result

FOLDER = Path("shapeprog-out")

TIPPED = (".stl", ".ply", ".off", ".xyz")  # formats that do not store the up axis
ARRAYS = (".npy", ".npz")  # nor do these for points; voxels lie in the grid


def infer_command(
    inputs: Annotated[
        list[Path], typer.Argument(metavar="INPUT", help="Meshes, point clouds, voxel grids, or folders of them.")
    ],
    up: terminal.Up = None,
    front: terminal.Front = None,
    file_unit: terminal.FileUnit = None,
    blocks: Annotated[int, about_program(metavar="N", help="Maximum number of drawing statements.", min=1)] = 10,
    detail: Annotated[
        float, about_program(metavar="FACTOR", help="Higher: longer program, closer fit.", min=0.01, max=100)
    ] = 1.0,
    unit: terminal.AsUnit = None,
    no_ties: Annotated[bool, about_program("--no-ties", help="Plain numbers, no names and expressions.")] = False,
    library: terminal.WithLibrary = False,
    modules: terminal.WithLibraries = None,
    paper: Annotated[
        bool, about_program("--paper", help="Only the statements of Liang (2022), on 32^3 cells.")
    ] = False,
    seed: terminal.Seed = 0,
    rounds: Annotated[int | None, about_search(metavar="N", help="Maximum rounds of the search on cells.", min=0)] = (
        None
    ),
    budget: Annotated[float, about_search(metavar="SECONDS", help="Time limit per shape.", min=0.1)] = BUDGET,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FOLDER", help="Folder for the results.")] = FOLDER,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace .shape files that may have been edited.")
    ] = False,
    no_picture: Annotated[bool, typer.Option("--no-picture", help="Do not write the PNG.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one line of JSON per shape.")] = False,
) -> None:
    """Infer a program from each shape; write it as .shape and .json, with a .glb and a .png.

    Example: shapeprog infer chair.glb --unit cm --out results

    The program keeps the position of the input, so later exports lie on it. The same seed gives the same files.
    An input that cannot be read is reported at the end; the others are processed. A second run replaces the results of
    the first, unless a .shape file was edited. Results in a folder of inputs are no inputs.
    """
    if terminal.absent(inputs) == inputs:  # before imports that take seconds
        _complain([(path, InputError(f"there is no file {path}", "check the path")) for path in inputs], 0, as_json)
        raise typer.Exit(terminal.MISTAKE)
    from shapeprog.cli.results import document, free_stem, measured, write
    from shapeprog.data import load_all
    from shapeprog.files import make_folder
    from shapeprog.inference import Settings, infer
    from shapeprog.inference.infer import SURFACE_PATHS
    from shapeprog.kernels.compile import modules_of, prepare
    from shapeprog.view import picture

    terminal.check_axes(up, front)
    terminal.check_units(unit, file_unit)
    if paper and unit not in (None, CELLS):
        raise InputError(f"--unit {unit} has no effect on --paper", "its statements are in cells; leave one out")
    report = None if as_json else lambda sentence: terminal.note(f"{sentence.capitalize()}.")
    others = ["geometry/voxelise", "evaluation/", *([] if no_picture else ["view/"])]
    prepare(modules_of(*SURFACE_PATHS, *others), report)
    inference = partial(
        infer, blocks=blocks, budget=budget, seed=seed, settings=None if rounds is None else Settings(rounds=rounds),
        statements="paper" if paper else "all", detail=detail, ties=not no_ties,
        libraries=terminal.load_libraries(modules, library), unit=unit or "",
    )  # fmt: skip
    folder, stems, reported = make_folder(out), set[str](), set[str]()

    def inferred(shape: Shape, progress: Callable[[str, float], None]) -> tuple[Result, list[str]]:
        """What was inferred from a shape, and the names of the files."""
        free_stem(shape, set(stems), folder, overwrite)  # refuses edited files before the search starts
        result = measured(inference(shape, progress=progress), shape, seed)
        stem = free_stem(shape, stems, folder, overwrite)  # again: files may have been written or edited meanwhile
        names = write(result, shape, folder, stem)
        if not no_picture:
            picture(shape, result.program, folder / f"{stem}.png", scores=result.scores)
            names.append(f"{stem}.png")
        return result, names

    failures: list[tuple[Path, ShapeProgError]] = []
    count = 0
    try:
        with terminal.progress(not as_json) as begin:
            for path, shape in load_all(inputs, up=up, front=front, seed=seed):
                try:
                    if isinstance(shape, ShapeProgError):
                        raise shape
                    shape = replace(shape, unit=file_unit or "")
                    result, names = inferred(shape, begin(shape.name))
                except OutputError:  # a disk that took nothing now takes nothing later
                    raise
                except ShapeProgError as error:
                    failures.append((path, error))
                    continue
                except Exception as error:
                    failures.append((path, terminal.fault("no program was inferred", error)))
                    continue
                count += 1
                assumptions = _assumptions(shape, result, up is None)
                if as_json:
                    about = {"name": shape.name, "folder": str(folder), "seconds": result.seconds}
                    about["notes"] = [*assumptions.values()]
                    terminal.print_json(about | json.loads(document(result, shape)))
                elif not terminal.quiet:
                    new = [sentence for assumption, sentence in assumptions.items() if assumption not in reported]
                    reported |= assumptions.keys()
                    _report(path, shape, result, names, folder, new)
    except OutputError as error:
        raise OutputError(error.message, f"{error.hint}; {_kept(count, folder)}") from None
    except KeyboardInterrupt:
        raise terminal.Interrupted(_kept(count, folder)) from None
    finally:
        _complain(failures, count, as_json)
    if failures:
        raise typer.Exit(1 if count else terminal.MISTAKE)
    if not count:
        raise InputError("no shapes to infer from", "give files or folders with meshes, point clouds or voxels")


def _complain(failures: Sequence[tuple[Path, ShapeProgError]], count: int, as_json: bool) -> None:
    """Print what went wrong beside ``count`` results."""
    for path, problem in failures:
        if as_json:
            about = {"name": path.name, "source": str(path), "error": problem.message, "hint": problem.hint}
            terminal.print_json(about)
        terminal.complain(terminal.at(path, problem))
    if failures and len(failures) + count > 1:
        terminal.note(f"{len(failures)} of {len(failures) + count} inputs failed.", "none")


def _kept(count: int, folder: Path) -> str:
    return f"finished results are kept: {count} program{'s' if count != 1 else ''} in {folder}"


def _assumptions(shape: Shape, result: Result, default_up: bool) -> dict[str, str]:
    """Sentences on the up axis and the unit that are assumed of a file, by what is assumed, which is reported once."""
    from shapeprog.data.orientation import default_axes

    sentences = {}
    cloud, suffix = shape.kind == "points", "" if shape.source is None else shape.source.suffix.lower()
    if default_up and shape.source is not None and suffix in (*TIPPED, *(ARRAYS if cloud else ())):
        usual = default_axes(shape.source, cloud)[0]
        others = ", ".join(f"{sign}{axis}" for axis in "xyz" for sign in "+-" if f"{sign}{axis}" != usual)
        note = f"The format does not store the up axis: {usual} is assumed."
        sentences[usual] = f"{note} Another axis: --up with one of {others}; --up auto estimates it"
    unit = shape.file_unit or "m"
    if result.program.unit and result.program.unit.name and not shape.states_unit:
        sentences[unit] = terminal.assumed(shape.frame, unit)
    return sentences


def _report(path: Path, shape: Shape, result: Result, names: list[str], folder: Path, assumed: list[str]) -> None:
    """Print a result, and what is assumed of its file."""
    from shapeprog.data.placement import SCAN
    from shapeprog.view.page import scores_text

    console = terminal.output()
    named = shape.name.partition("#")[0] == Path(path.name.partition("#")[0]).stem
    console.print(f"{path}" if named else f"{path}: {shape.name}", style="bold")
    if shape.kind != "mesh":
        kind = f"a point cloud; normals are estimated from up to {SCAN:,} points"
        console.print(f"Read as {'voxels' if shape.points is None else kind}.", style="dim")
    terminal.print_program(result.program)
    lines = [*assumed, *scores_text(result.scores | {"seconds": result.seconds}, result.program), result.reason]
    for line in (*lines, f"Wrote {', '.join(names)} in {folder}", ""):
        console.print(line, style="dim")
