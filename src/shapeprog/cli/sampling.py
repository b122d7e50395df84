"""The command that draws synthetic furniture, and the files that samples of any prior become."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shapeprog.cli import terminal

if TYPE_CHECKING:
    from shapeprog.language.program import Program


def sample_command(
    count: Annotated[int, typer.Option(metavar="N", help="Number of shapes.", min=1)] = 24,
    seed: terminal.Seed = 0,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Contact sheet to write, such as sheet.png.")] = None,
    folder: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Folder for a .shape file of each.")] = None,
    pack: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Data set to write: voxels and points, .npz.")
    ] = None,
    points: Annotated[int, typer.Option(metavar="N", help="Surface points per shape in the data set.", min=0)] = 0,
) -> None:
    """Generate synthetic furniture as a contact sheet, as programs, or as a data set.

    Example: shapeprog sample --count 24 --out sheet.png

    Without --out, --folder and --pack the programs are printed.
    """
    from shapeprog.data.synthetic import FURNITURE, furniture

    programs = [furniture(number, seed) for number in range(count)]
    write_samples(FURNITURE, programs, seed, out=out, folder=folder, pack=pack, points=points)


def write_samples(
    prior: str,
    programs: list[Program],
    seed: int,
    *,
    out: Path | None = None,
    folder: Path | None = None,
    pack: Path | None = None,
    points: int = 0,
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
        contact_sheet(items, out, columns=6, title=f"{prior}, seed {seed}")
    if folder is not None:
        for name, program in named.items():
            save(program, make_folder(folder) / f"{name}.shape")
    if pack is not None:
        write_pack(pack, shapes_of(named, points, seed))
    files = [path for path in (out, folder, pack) if path is not None]
    for path in files:
        terminal.say(f"wrote {path}: {len(programs)} shapes")
    for name, program in named.items() if not files else ():
        terminal.output().print(f"# {name}")
        terminal.print_program(program)
