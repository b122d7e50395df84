"""The command that draws synthetic furniture, and the files that samples of any prior become."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shapeprog.cli import terminal

if TYPE_CHECKING:
    from shapeprog.data.shape import Shape
    from shapeprog.language.program import Program

SHEET = 24
"""Shapes drawn where no number is given."""


Count = Annotated[int, typer.Option(help="How many shapes.", min=1)]
Out = Annotated[Path | None, typer.Option(help="A contact sheet of them, such as sheet.png.")]
Folder = Annotated[Path | None, typer.Option(help="A folder for a .shape file of each.")]
Pack = Annotated[Path | None, typer.Option(help="A pack of their cells and surface points, .npz.")]
Points = Annotated[int, typer.Option(help="Surface points of each shape in the pack.", min=0)]
Columns = Annotated[int, typer.Option(help="Pictures in a row of the sheet.", min=1)]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]


def sample_command(
    prior: Annotated[str, typer.Argument(metavar="PRIOR", help="Where they come from: furniture.")] = "furniture",
    count: Count = SHEET,
    seed: terminal.Seed = 0,
    out: Out = None,
    folder: Folder = None,
    pack: Pack = None,
    points: Points = 0,
    columns: Columns = 6,
    quiet: Quiet = False,
) -> None:
    """Draw synthetic furniture: as a contact sheet, as programs, or as a pack.

    Without an output the programs are printed.
    """
    from shapeprog.data.synthetic import FURNITURE, furniture
    from shapeprog.errors import InputError, did_you_mean

    if prior != FURNITURE:
        raise InputError(f"there is no prior {prior!r}", did_you_mean(prior, [FURNITURE], quoted=True))
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

        write_pack(pack, _shapes(names, programs, points, seed))
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
        Item(name, None, program, f"{program.blocks} blocks, {program.size} parts")
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


def _shapes(names: list[str], programs: list[Program], points: int, seed: int) -> list[Shape]:
    import numpy as np
    import torch

    from shapeprog.data.shape import Shape
    from shapeprog.geometry.cells import voxels
    from shapeprog.geometry.surface import sample_surface
    from shapeprog.language.unroll import unroll

    scene = unroll(programs)
    cells = voxels(scene).numpy().astype(np.bool_)
    if not points:
        return [Shape(name, cells[number]) for number, name in enumerate(names)]
    places = sample_surface(scene, points, torch.Generator().manual_seed(seed)).points.numpy().astype(np.float32)
    return [Shape(name, cells[number], places[number]) for number, name in enumerate(names)]
