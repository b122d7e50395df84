"""The command that draws synthetic furniture, and the files that samples of any prior become."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shapeprog.cli import terminal

if TYPE_CHECKING:
    from shapeprog.language.program import Program

SHEET = 24  # shapes drawn where no number is given


Count = Annotated[int, typer.Option(metavar="N", help="Number of shapes.", min=1)]
Out = Annotated[Path | None, typer.Option(metavar="FILE", help="Contact sheet to write, such as sheet.png.")]
Folder = Annotated[Path | None, typer.Option(metavar="FOLDER", help="Folder for a .shape file of each.")]
Pack = Annotated[Path | None, typer.Option(metavar="FILE", help="Data set to write: voxels and points, .npz.")]
Points = Annotated[int, typer.Option(metavar="N", help="Surface points per shape in the data set.", min=0)]
Columns = Annotated[int, typer.Option(metavar="N", help="Shapes per row of the contact sheet.", min=1)]


def sample_command(
    prior: Annotated[str, typer.Argument(metavar="PRIOR", help="Distribution to draw from: furniture.")] = "furniture",
    count: Count = SHEET,
    seed: terminal.Seed = 0,
    out: Out = None,
    folder: Folder = None,
    pack: Pack = None,
    points: Points = 0,
    columns: Columns = 6,
    quiet: terminal.Quiet = False,
) -> None:
    """Generate synthetic furniture as a contact sheet, as programs, or as a data set.

    Example: shapeprog sample --count 24 --out sheet.png

    Without --out, --folder and --pack the programs are printed.
    """
    from shapeprog.data.synthetic import FURNITURE, furniture
    from shapeprog.errors import InputError, did_you_mean

    if prior != FURNITURE:
        raise InputError(f"unknown prior {prior!r}", did_you_mean(prior, [FURNITURE], quoted=True))
    programs = [furniture(number, seed) for number in range(count)]
    files: dict[str, Any] = {"out": out, "folder": folder, "pack": pack}
    write_samples(prior, programs, seed, **files, points=points, columns=columns, quiet=quiet)


def write_samples(
    prior: str,
    programs: list[Program],
    seed: int,
    *,
    out: Path | None = None,
    folder: Path | None = None,
    pack: Path | None = None,
    points: int = 0,
    columns: int = 6,
    quiet: bool = False,
) -> None:
    """Write programs of a prior as a sheet, a folder and a pack, as far as asked for; otherwise print them."""
    from shapeprog.data import write_pack
    from shapeprog.data.synthetic.shapes import shapes_of
    from shapeprog.files import make_folder
    from shapeprog.formats import save
    from shapeprog.view import Item, contact_sheet

    named = {f"{prior}_{number:0{len(str(len(programs) - 1))}d}": program for number, program in enumerate(programs)}
    if out is not None:
        sizes = [f"{program.size} parts, {program.blocks} drawing statements" for program in programs]
        items = [Item(name, None, named[name], size) for name, size in zip(named, sizes, strict=True)]
        contact_sheet(items, out, columns=columns, title=f"{prior}, seed {seed}")
    if folder is not None:
        for name, program in named.items():
            save(program, make_folder(folder) / f"{name}.shape")
    if pack is not None:
        write_pack(pack, shapes_of(named, points, seed))
    if not (out or folder or pack):
        for name, program in named.items():
            terminal.output().print(f"# {name}")
            terminal.print_program(terminal.output(), program)
    for path in () if quiet else (out, folder, pack):
        if path is not None:
            terminal.output().print(f"wrote {path}: {len(programs)} shapes")
