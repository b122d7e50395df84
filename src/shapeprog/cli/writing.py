"""Commands that turn programs into something to look at or to use: render, export, show, sheet, statements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shapeprog.cli import terminal
from shapeprog.cli.units import AsUnit, FileUnit, asked_unit, check_units
from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.formats.format import format_of, program_suffixes, suffixes

if TYPE_CHECKING:
    from shapeprog.data.shape import Shape
    from shapeprog.formats.json_form import Result

_SAMPLES = " ".join(suffixes("sample"))

ProgramFile = Annotated[Path, typer.Argument(help=f"A program: {' '.join(program_suffixes())}.")]
Outputs = Annotated[
    list[Path], typer.Argument(help=f"Files to write; the suffix of each names its format: {' '.join(suffixes())}.")
]
Input = Annotated[
    Path | None,
    typer.Option("--shape", help="The input to show beside it; by default what a .json file names in its own folder."),
]


def export_command(
    program: ProgramFile,
    outputs: Outputs,
    changes: terminal.Changes = None,
    modules: terminal.With = None,
    unit: AsUnit = None,
    file_unit: FileUnit = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace other programs.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Write a program for other tools: as a mesh, for CAD, as cells or points, or in another form of program.

    Where the program file keeps its frame (every .json and .shape written by infer does), the export lies on the
    input. A .shape file without one is exported upright, one cell one unit; to place it, put the comment
    '# frame: {"scale": ..., "centre": [...], "axes": [[...], [...], [...]]}' at its top, with the scale in units of the
    input per cell. --unit is for .shape, .json, .scad and .py; --set counts in the unit of the program as it was.
    """
    from shapeprog.formats import export

    check_units(unit, file_unit)
    terminal.load_modules(modules)
    if not overwrite:
        _refuse_programs(program, outputs)
    found, frame = terminal.read_program_file(program, changes)
    if unit is not None:
        from shapeprog.inference.readable import in_readable_unit

        found = in_readable_unit(found, asked_unit(found.unit, frame, program, unit, file_unit))
    for path in outputs:
        export(found, path, frame)
        if not quiet:
            terminal.output().print(f"wrote {path}")


def _refuse_programs(program: Path, outputs: Sequence[Path]) -> None:
    """Refuse to replace another program with the same suffix as the one that is read: ``*.json`` may have named both.

    Raises
    ------
    OutputError
        If one of the files to write is another program.
    """
    for path in outputs:
        same = path.suffix.lower() == program.suffix.lower() and path.suffix.lower() in program_suffixes()
        if same and path.is_file() and not path.samefile(program) and path.read_bytes() != program.read_bytes():
            raise OutputError(
                f"{path} is there already, and export would replace it by {program}",
                "export takes one program, then the files to write; say --overwrite if it is to be replaced",
            )


def render_command(
    program: ProgramFile,
    output: Annotated[Path, typer.Argument(help=f"A picture (.png .jpg .pdf), or cells or points ({_SAMPLES}).")],
    shape: Input = None,
    resolution: Annotated[int, typer.Option(help="Cells along each side, for .npy.", min=1, max=512)] = 32,
    points: Annotated[int, typer.Option(help="How many points, for .xyz.", min=1)] = 5000,
    seed: terminal.Seed = 0,
    changes: terminal.Changes = None,
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
    found, frame = terminal.read_program_file(program, changes)
    suffix, chosen = output.suffix.lower(), format_of(output)
    if suffix in SUFFIXES:
        result = _result(program, changes)
        beside = _input_of(result, shape)
        _tell_hidden([result], [beside], quiet)
        picture(beside, found, output, title=program.stem, scores=result.scores)
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
    changes: terminal.Changes = None,
    modules: terminal.With = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Write one HTML page to turn the shape and see which line draws which part; it needs no network."""
    from shapeprog.view import viewer

    terminal.load_modules(modules)
    found, _ = terminal.read_program_file(program, changes)
    page = output or Path(f"{program.stem}.html")
    if page.suffix.lower() not in (".html", ".htm"):
        raise OutputError(f"{page} is no page", "pages end in .html; pictures are made by 'shapeprog render'")
    result = _result(program, changes)
    beside = _input_of(result, shape)
    _tell_hidden([result], [beside], quiet)
    viewer(found, page, shape=beside, title=program.stem, scores=result.scores)
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
    shape: Annotated[
        Path | None, typer.Option("--shape", help="The folder of the inputs; by default that of the programs.")
    ] = None,
    modules: terminal.With = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Draw a contact sheet of a folder of programs, each beside the input that its .json file names.

    Inputs are looked for in the folder of the programs, or in the one that is given and deeper; nothing else is opened.
    """
    from shapeprog.view import Item, contact_sheet
    from shapeprog.view.page import scores_text

    terminal.load_modules(modules)
    items: list[Item] = []
    results: list[Result] = []
    failures: list[ShapeProgError] = []
    for path in program_files(folder):
        if len(items) == most:
            break
        try:
            found, _ = terminal.read_program_file(path)
        except ShapeProgError as error:
            failures.append(error)
            continue
        results.append(_result(path))
        note = scores_text(results[-1].scores, found)[0]
        items.append(Item(path.stem, _input_of(results[-1], shape), found, note))
    _tell_hidden(results, [item.shape for item in items], quiet)
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


def _result(path: Path, changes: Sequence[str] | None = None) -> Result:
    """What a .json file says beside its program; other programs say nothing, nor do those that are changed."""
    from shapeprog.formats.json_form import Result, read_result

    return Result(str(path), {}) if changes or path.suffix.lower() != ".json" else read_result(path)


def _input_of(result: Result, named: Path | None) -> Shape | None:
    """The shape that a program was inferred from: the file that the user names, or the one that its own file names.

    The latter is opened only beside the program, or in the folder that the user names and deeper: a program from
    elsewhere may name any file.
    """
    from dataclasses import replace

    from shapeprog.data import load

    if named is not None and not named.is_dir():
        return load(named)
    if result.source is None:
        return None
    place, mark, member = result.source.partition("#")
    try:
        home = (Path(result.name).parent if named is None else named).resolve()
        source = (home / place).resolve()
        inside = source.parent == home or (named is not None and source.is_relative_to(home))
        if not inside or not source.exists():
            return None
    except (OSError, ValueError, RuntimeError):
        return None  # no file can have such a name
    try:
        found = load(f"{source}{mark}{member}")
    except ShapeProgError:
        return None  # a picture without the input is better than none
    if result.frame is None or found.vertices is None or result.frame.axes == found.frame.axes:
        return found
    # It was inferred with --up or --front: show it as it was seen then.
    seen = result.frame.to_grid(found.frame.to_world(found.vertices))
    return replace(found, vertices=seen.astype(found.vertices.dtype))


def _tell_hidden(results: list[Result], shapes: list[Shape | None], quiet: bool) -> None:
    """Say that inputs are not shown, where programs name some and none was found."""
    if any(result.source for result in results) and not any(shapes) and not quiet:
        said = "Inputs are not shown: none lies beside its program, or can be read; name them with --shape."
        terminal.errors().print(said, style="dim", markup=False)
