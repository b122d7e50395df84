"""The command that draws synthetic furniture, and the files that samples of any prior become."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    write_samples(
        prior, [furniture(number, seed) for number in range(count)],
        seed=seed, out=out, folder=folder, pack=pack, points=points, columns=columns, quiet=quiet,
    )  # fmt: skip


def write_samples(
    prior: str,
    programs: list[Program],
    *,
    seed: int,
    out: Path | None,
    folder: Path | None,
    pack: Path | None,
    points: int,
    columns: int,
    quiet: bool,
) -> None:
    """Write programs of a prior as a sheet, a folder and a pack, as far as asked for; otherwise print them."""
    names = [f"{prior}_{number:0{len(str(len(programs) - 1))}d}" for number in range(len(programs))]
    written: list[Path] = []
    if out is not None:
        written.append(_write_sheet(names, programs, out, columns, f"{prior}, seed {seed}"))
    if folder is not None:
        written.append(_write_folder(names, programs, folder))
    if pack is not None:
        from shapeprog.data import write_pack
        from shapeprog.data.synthetic.shapes import shapes_of

        write_pack(pack, shapes_of(dict(zip(names, programs, strict=True)), points, seed))
        written.append(pack)
    if not written:
        for name, program in zip(names, programs, strict=True):
            terminal.output().print(f"# {name}")
            terminal.print_program(terminal.output(), program)
    if not quiet:
        for path in written:
            terminal.output().print(f"wrote {path}: {len(programs)} shapes")


def _write_sheet(names: list[str], programs: list[Program], path: Path, columns: int, title: str) -> Path:
    from shapeprog.view import Item, contact_sheet

    items = [
        Item(name, None, program, f"{program.size} parts, {program.blocks} drawing statements")
        for name, program in zip(names, programs, strict=True)
    ]
    contact_sheet(items, path, columns=columns, title=title)
    return path


def _write_folder(names: list[str], programs: list[Program], folder: Path) -> Path:
    from shapeprog.files import make_folder
    from shapeprog.formats import save

    made = make_folder(folder)
    for name, program in zip(names, programs, strict=True):
        save(program, made / f"{name}.shape")
    return made
