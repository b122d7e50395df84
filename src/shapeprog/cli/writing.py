"""Commands that turn programs into something to look at or to use: render, export, show, sheet, statements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shapeprog.cli import terminal
from shapeprog.cli.changes import CHANGE
from shapeprog.cli.terminal import about_input
from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.formats.format import format_of, program_suffixes, suffixes

if TYPE_CHECKING:
    from shapeprog.data.shape import Shape
    from shapeprog.language.program import Program
    from shapeprog.space import Frame

PAGES = (".html", ".htm")

ProgramFile = Annotated[Path, typer.Argument(metavar="PROGRAM", help=f"Program file: {' '.join(program_suffixes())}")]
Outputs = Annotated[
    list[Path],
    typer.Argument(metavar="OUTPUT", help=f"Files to write; the suffix selects the format: {' '.join(suffixes())}"),
]
Input = Annotated[
    Path | None,
    about_input(
        "--shape", metavar="FILE", help="Input to show beside it. Default: as named in the .json, same folder."
    ),
]


def export_command(
    program: ProgramFile,
    outputs: Outputs,
    changes: terminal.Changes = None,
    modules: terminal.With = None,
    unit: terminal.AsUnit = None,
    file_unit: terminal.FileUnit = None,
    up: Annotated[
        str, terminal.about_program("--up", metavar="AXIS", help="Axis of the file that points up: x, y or z.")
    ] = "",
    on_input: Annotated[
        bool | None,
        terminal.about_input("--on-input/--upright", help="Lie on the input. Default: .glb .obj .ply and samples."),
    ] = None,
    overwrite: terminal.Overwrite = False,
) -> None:
    """Export a program as a mesh, CAD file, voxels, points, or in another program format.

    Example: shapeprog export chair.shape tall.stl tall.scad --set leg_height=58

    .stl, .3mf, .scad, .py and .step are in millimetres, z up, on the floor; .glb is in metres, y up. If the program
    file stores its frame (all files by infer do), .glb, .obj and .ply lie on the input. --unit, --up, --on-input and
    --upright change that. A .csv is a cut list, which is printed too. --set uses the unit of the program file.
    """
    from shapeprog.formats import export
    from shapeprog.formats.cuts import listed_cuts
    from shapeprog.formats.files import written_format
    from shapeprog.language.unit import MOST_METRES
    from shapeprog.space import SPAN

    terminal.check_units(unit, file_unit)
    terminal.load_modules(modules)
    for path in outputs:
        if "=" in path.name and CHANGE.fullmatch(str(path)) and format_of(path) is None:
            raise OutputError(f"{path} is no file to write", f"changes of numbers follow --set: --set {path}")
    formats = [written_format(path) for path in outputs]
    loaded, _ = terminal.read_program_file(program, changes)
    terminal.check_free(outputs, overwrite, program)
    makers = any(file_format.maker for file_format in formats)
    has_unit = file_unit is not None or (loaded.unit is not None and loaded.unit.name)
    if loaded.frame is not None and makers and not has_unit and SPAN * loaded.frame.scale > MOST_METRES:
        terminal.note(terminal.assumed(loaded.frame))
    asked: dict[str, Any] = {"unit": unit or "", "file_unit": file_unit or "", "up": up, "on_input": on_input}
    failures: list[ShapeProgError] = []
    for path in outputs:
        try:
            export(loaded, path, **asked)
        except ShapeProgError as error:  # the other files do not depend on this one
            failures.append(error)
            continue
        terminal.say(f"wrote {path}")
        if path.suffix.lower() == ".csv":
            cuts = listed_cuts(loaded, **asked)
            terminal.say(cuts.table)
            terminal.warn(path, *cuts.warnings)
    terminal.finish(failures, terminal.FAILED if len(failures) < len(outputs) else terminal.MISTAKE)


def render_command(
    program: ProgramFile,
    output: Annotated[Path, typer.Argument(metavar="OUTPUT", help="Picture to write: .png .jpg .webp .tiff .pdf")],
    shape: Input = None,
    changes: terminal.Changes = None,
    modules: terminal.With = None,
) -> None:
    """Render a program as a picture.

    Example: shapeprog render chair.shape chair.png
    """
    _draw(program, output, shape, changes, modules)


def show_command(
    program: ProgramFile,
    output: Annotated[
        Path | None, typer.Argument(metavar="OUTPUT", help="Page to write. Default: NAME.html in the current folder.")
    ] = None,
    shape: Input = None,
    browse: Annotated[bool, typer.Option("--open", help="Open the page in a browser.")] = False,
    changes: terminal.Changes = None,
    modules: terminal.With = None,
) -> None:
    """Write an HTML page: turn the shape, see which line draws which part, drag its numbers.

    Example: shapeprog show chair.shape --open

    The page is one file and needs no network.
    """
    page = output or Path(f"{program.stem}.html")
    if page.suffix.lower() not in PAGES:
        raise OutputError(f"{page} is not an HTML file", "pages end in .html; for pictures use 'shapeprog render'")
    _draw(program, page, shape, changes, modules)
    if browse:
        import webbrowser

        webbrowser.open(page.absolute().as_uri())


def _draw(
    program: Path, output: Path, named: Path | None, changes: Sequence[str] | None, modules: Sequence[Path] | None
) -> None:
    """Write a picture or a page of a program, beside its input."""
    from shapeprog.language.reader import BEGIN
    from shapeprog.view import picture, viewer

    terminal.load_modules(modules)
    loaded, _ = terminal.read_program_file(program, changes)
    if not loaded.size and not loaded.body and loaded.scale is None:
        raise InputError(f"{program} is empty", f"{BEGIN} and a part below it, such as box(height=2)")
    if not loaded.size:
        terminal.warn(program, "nothing is drawn: write a part below the size, such as box(height=2)")
    shape, scores, lacking = _input_and_scores(program, loaded, named, changes)
    if lacking:
        terminal.note(f"The input is not shown: {lacking}. Give its file with --shape.")
    if output.suffix.lower() in PAGES:
        viewer(loaded, output, shape=shape, title=program.stem, scores=scores)
    else:
        picture(shape, loaded, output, title=program.stem, scores=scores)
    terminal.say(f"wrote {output}")


def sheet_command(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of programs, such as the results of infer.")],
    output: Annotated[Path, typer.Argument(metavar="OUTPUT", help="Picture to write, such as sheet.png.")],
    columns: Annotated[int, typer.Option(metavar="N", help="Programs per row.", min=1)] = 4,
    most: Annotated[int, typer.Option("--most", metavar="N", help="Maximum number of programs.", min=1)] = 96,
    title: Annotated[str, typer.Option(metavar="TEXT", help="Title of the picture.")] = "",
    shape: Annotated[
        Path | None,
        about_input("--shape", metavar="FOLDER", help="Folder of the inputs. Default: that of the programs."),
    ] = None,
    modules: terminal.With = None,
) -> None:
    """Draw a contact sheet of a folder of programs, each beside its input.

    Example: shapeprog sheet results sheet.png --shape originals

    Inputs are found by the name in the .json file, in the folder of the programs or in that of --shape and below.
    """
    from shapeprog.formats.files import program_files
    from shapeprog.view import Item, contact_sheet
    from shapeprog.view.page import scores_text

    if shape is not None and not shape.is_dir():
        raise InputError(f"there is no folder {shape}", "--shape takes the folder of the inputs")
    terminal.load_modules(modules)
    items: list[Item] = []
    missing: dict[str, str] = {}
    failures: list[ShapeProgError] = []
    for path in program_files(folder)[:most]:
        try:
            loaded, _ = terminal.read_program_file(path)
        except ShapeProgError as error:
            failures.append(error)
            continue
        input_shape, scores, lacking = _input_and_scores(path, loaded, shape)
        if input_shape is None:
            missing[path.stem] = lacking or "none is named in a .json"
        items.append(Item(path.stem, input_shape, loaded, scores_text(scores, loaded)[0]))
    if not items:
        terminal.finish(failures, terminal.MISTAKE)
    contact_sheet(items, output, columns=columns, title=title)
    terminal.say(f"wrote {output}: {len(items)} programs")
    if missing and (shape is not None or len(missing) < len(items)):
        causes, cure = "; ".join(dict.fromkeys(missing.values())), "--shape takes the folder of the inputs"
        some = f"{len(missing)} of {len(items)} programs are shown without their input, such as {next(iter(missing))}"
        terminal.note(f"{some}: {causes}. {cure}.", "yellow")
    terminal.finish(failures)


def statements_command(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="NAME", help="Statements, loops or roles. Default: a list of all.")
    ] = None,
    modules: terminal.With = None,
) -> None:
    """Print the manual of the language, or of some statements.

    Example: shapeprog statements box row leg
    """
    from shapeprog.view.manual import manual

    terminal.load_modules(modules)
    pages = [manual(name) for name in names] if names else [manual()]
    terminal.output().print("\n".join(pages).rstrip("\n"))


def _input_and_scores(
    path: Path, program: Program, named: Path | None, changes: Sequence[str] | None = None
) -> tuple[Shape | None, Mapping[str, float], str]:
    """The input of a program and the scores in its .json file, unless ``--set`` changes it; and why an input that is
    named or recorded is not shown: a picture without the input is better than none.

    The input is the file that the user names, or the one that the .json file names.  The latter is opened only beside
    the program, or in the folder that the user names and deeper: a program from elsewhere may name any file.
    """
    from shapeprog.formats.json_form import SavedResult, read_result

    is_json = not changes and path.suffix.lower() == ".json"
    result = read_result(path) if is_json else SavedResult(program)
    if named is not None and not named.is_dir():
        return _as_inferred(named, program.frame), result.scores, ""
    if named is not None and not is_json:  # the text may have been edited, so that the scores are of another program
        with suppress(ShapeProgError):
            result = SavedResult(program, source=read_result(path.with_suffix(".json")).source)
    if not result.source:
        return None, result.scores, "" if named is None else "no .json of its name beside the program names one"
    file_name, mark, member = result.source.partition("#")
    recorded = Path(file_name)
    files = path.parent.iterdir() if named is None else named.rglob("*")
    candidates = sorted(
        file for file in files if file.name == recorded.name and file.is_file() and not file.is_symlink()
    )
    agreement = [_agreeing_parts(file, recorded) for file in candidates]  # others are inputs of other programs
    if agreement.count(max(agreement, default=0)) > 1:
        return None, result.scores, "several files have its name, and none fits its path in the .json best"
    try:
        best = candidates[agreement.index(max(agreement))]
        return _as_inferred(f"{best}{mark}{member}", program.frame), result.scores, ""
    except (ValueError, ShapeProgError):
        return None, result.scores, "it was not found, or cannot be read"


def _agreeing_parts(file: Path, source: Path) -> int:
    """How many folders and names at the end of two paths are the same."""
    same = [first == second for first, second in zip(file.absolute().parts[::-1], source.parts[::-1], strict=False)]
    return [*same, False].index(False)


def _as_inferred(path: Path | str, frame: Frame | None) -> Shape:
    """A shape as it was seen when it was inferred, perhaps with --up or --front."""
    import numpy as np

    from shapeprog.data.loading import load_in_axes
    from shapeprog.space import HALF

    shape = load_in_axes(path, frame)
    if frame is None:
        return shape
    if np.abs(frame.to_grid(shape.frame.centre)).max() > HALF or not 0.4 < shape.frame.scale / frame.scale < 2.5:
        return shape  # it has another unit, or lies in another place

    def seen(positions: Any) -> Any:
        return None if positions is None else frame.to_grid(shape.frame.to_world(positions)).astype(np.float32)

    return replace(shape, vertices=seen(shape.vertices), points=seen(shape.points))
