"""Commands that turn programs into something to look at or to use: render, export, show, sheet, statements."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shapeprog.cli import terminal
from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.formats.format import format_of, program_suffixes, suffixes

if TYPE_CHECKING:
    from shapeprog.data.shape import Shape

_SAMPLES = " ".join(suffixes("sample"))

ProgramFile = Annotated[Path, typer.Argument(help=f"A program: {' '.join(program_suffixes())}.")]
Outputs = Annotated[
    list[Path], typer.Argument(help=f"Files to write; the suffix of each names its format: {' '.join(suffixes())}.")
]
Input = Annotated[
    Path | None, typer.Option("--shape", help="The input to show beside it; by default the one a .json file names.")
]


def export_command(
    program: ProgramFile,
    outputs: Outputs,
    modules: terminal.With = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Write a program for other tools: as a mesh, for CAD, as cells or points, or in another form of program.

    Where the program file keeps its frame (every .json and .shape written by infer does), the export lies on the
    input. A .shape file without one is exported upright, one cell one unit; to place it, put the comment
    '# frame: {"scale": ..., "centre": [...], "axes": [[...], [...], [...]]}' at its top.
    """
    from shapeprog.formats import export

    terminal.load_modules(modules)
    found, frame = terminal.read_program_file(program)
    for path in outputs:
        export(found, path, frame)
        if not quiet:
            terminal.output().print(f"wrote {path}")


def render_command(
    program: ProgramFile,
    output: Annotated[Path, typer.Argument(help=f"A picture (.png .jpg .pdf), or cells or points ({_SAMPLES}).")],
    shape: Input = None,
    resolution: Annotated[int, typer.Option(help="Cells along each side, for .npy.", min=1, max=512)] = 32,
    points: Annotated[int, typer.Option(help="How many points, for .xyz.", min=1)] = 5000,
    seed: terminal.Seed = 0,
    modules: terminal.With = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Draw a program: as a picture, as hard voxels, or as points on its surface.

    Cells are those of the program snapped to whole numbers. Points come as lines 'x y z nx ny nz' in the world of the
    input, or as a .xyz file is read, z up, where no frame is known.
    """
    from shapeprog.formats import export
    from shapeprog.view.page import SUFFIXES, picture

    terminal.load_modules(modules)
    found, frame = terminal.read_program_file(program)
    suffix, chosen = output.suffix.lower(), format_of(output)
    if suffix in SUFFIXES:
        scores = _kept(program).get("scores")
        beside = _input_of(program, shape)
        picture(beside, found, output, title=program.stem, scores=scores if isinstance(scores, dict) else None)
    elif chosen is not None and chosen.kind == "sample":
        given = {"resolution": resolution, "points": points, "seed": seed}
        export(found, output, frame, **{name: given[name] for name in chosen.options})
    else:
        known = " ".join((*SUFFIXES, *suffixes("sample")))
        raise OutputError(f"nothing is rendered to {suffix or 'a file without a suffix'}", f"known are {known}")
    if not quiet:
        terminal.output().print(f"wrote {output}")


def show_command(
    program: ProgramFile,
    output: Annotated[Path | None, typer.Argument(help="The page; by default NAME.html in this folder.")] = None,
    shape: Input = None,
    browse: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
    modules: terminal.With = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Write one HTML page to turn the shape and see which line draws which part; it needs no network."""
    from shapeprog.view import viewer

    terminal.load_modules(modules)
    found, _ = terminal.read_program_file(program)
    page = output or Path(f"{program.stem}.html")
    if page.suffix.lower() not in (".html", ".htm"):
        raise OutputError(f"{page} is no page", "pages end in .html; pictures are made by 'shapeprog render'")
    viewer(found, page, shape=_input_of(program, shape), title=program.stem, scores=_kept(program).get("scores"))
    if not quiet:
        terminal.output().print(f"wrote {page}")
    if browse:
        import webbrowser

        webbrowser.open(page.absolute().as_uri())


def sheet_command(
    folder: Annotated[Path, typer.Argument(help="A folder with programs, such as infer writes.")],
    output: Annotated[Path, typer.Argument(help="The picture, such as sheet.png.")],
    columns: Annotated[int, typer.Option(help="Pairs in a row.", min=1)] = 4,
    most: Annotated[int, typer.Option("--most", help="Most programs to show.", min=1)] = 96,
    title: Annotated[str, typer.Option(help="Stands above it.")] = "",
    modules: terminal.With = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Draw a contact sheet of a folder of programs, each beside the input that its .json file names."""
    from shapeprog.view import Item, contact_sheet
    from shapeprog.view.page import scores_text

    terminal.load_modules(modules)
    items: list[Item] = []
    failures: list[ShapeProgError] = []
    for path in program_files(folder):
        if len(items) == most:
            break
        try:
            found, _ = terminal.read_program_file(path)
        except ShapeProgError as error:
            failures.append(error)
            continue
        scores = _kept(path).get("scores")
        note = scores_text(scores if isinstance(scores, dict) else None, found)[0]
        items.append(Item(path.stem, _input_of(path, None), found, note))
    contact_sheet(items, output, columns=columns, title=title)
    if not quiet:
        terminal.output().print(f"wrote {output}: {len(items)} programs")
    for problem in failures:
        terminal.complain(problem)
    if failures:
        raise typer.Exit(1)


def statements_command(
    name: Annotated[str | None, typer.Argument(help="A statement or loop; without it all are listed.")] = None,
    modules: terminal.With = None,
) -> None:
    """Print the manual of the language, or of one statement, drawn from the declarations."""
    from shapeprog.view.manual import manual

    terminal.load_modules(modules)
    terminal.output().print(manual(name).rstrip("\n"))


def program_files(folder: Path) -> list[Path]:
    """The programs in a folder in the order of their names; NAME.json, which keeps most, stands for all of that name.

    Raises
    ------
    InputError
        If there is no such folder, or it holds no programs.
    """
    cure = f"give a folder that holds {' or '.join(suffixes('program'))} files"
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}", cure)
    json_last = sorted(suffixes("program"), key=".json".__eq__)
    found = {path.with_suffix(""): path for suffix in json_last for path in folder.glob(f"*{suffix}")}
    if not found:
        raise InputError(f"the folder {folder} holds no programs", cure)
    return [found[key] for key in sorted(found)]


def _kept(path: Path) -> dict[str, Any]:
    """Everything a .json result keeps beside the program."""
    if path.suffix.lower() != ".json":
        return {}
    content = json.loads(path.read_text(encoding="utf-8-sig"))
    return content if isinstance(content, dict) else {}


def _input_of(program: Path, shape: Path | None) -> Shape | None:
    """The shape a program was inferred from: the one given, or the one its file names if it is still there."""
    from dataclasses import replace

    from shapeprog.data import load

    if shape is not None:
        return load(shape)
    content = _kept(program)
    source = content.get("source")
    if not isinstance(source, str) or not Path(source.split("#")[0]).exists():
        return None
    try:
        found = load(source)
    except ShapeProgError:
        return None  # a picture without the input is better than none
    frame = terminal.read_program_file(program)[1]
    if frame is None or found.vertices is None or frame.axes == found.frame.axes:
        return found
    # It was inferred with --up or --front: show it as it was seen then.
    return replace(found, vertices=frame.to_grid(found.frame.to_world(found.vertices)))
