"""The command that draws synthetic furniture."""

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


def sample_command(
    prior_name: Annotated[
        str, typer.Argument(metavar="PRIOR", help="Where they come from: narrow, wide or furniture.")
    ],
    count: Annotated[int, typer.Option(help="How many shapes.", min=1)] = SHEET,
    seed: terminal.Seed = 0,
    out: Annotated[Path | None, typer.Option(help="A contact sheet of them, such as sheet.png.")] = None,
    folder: Annotated[Path | None, typer.Option(help="A folder for a .shape file of each.")] = None,
    pack: Annotated[Path | None, typer.Option(help="A pack of their cells and surface points, .npz.")] = None,
    programs: Annotated[Path | None, typer.Option(help="A data set of their programs, .npz: much smaller.")] = None,
    points: Annotated[int, typer.Option(help="Surface points of each shape in the pack.", min=0)] = 0,
    columns: Annotated[int, typer.Option(help="Pictures in a row of the sheet.", min=1)] = 6,
    modules: terminal.With = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Draw synthetic furniture: as a contact sheet, as programs, or as a data set.

    Without an output the programs are printed.
    """
    import torch

    from shapeprog.data import synthetic

    terminal.load_modules(modules)
    found = synthetic.programs(prior_name, count, seed)
    if programs is not None:  # before anything is written: only what generators can learn from is kept as tensors
        code = synthetic.prior(prior_name)(count, torch.Generator().manual_seed(seed))
    names = [f"{prior_name}_{number:0{len(str(count - 1))}d}" for number in range(count)]
    written: list[Path] = []
    if out is not None:
        written.append(_write_sheet(names, found, out, columns, f"{prior_name}, seed {seed}"))
    if folder is not None:
        written.append(_write_folder(names, found, folder))
    if pack is not None:
        from shapeprog.data import write_pack

        write_pack(pack, _shapes(names, found, points, seed))
        written.append(pack)
    if programs is not None:
        synthetic.write_programs(programs, code)
        written.append(programs)
    if not written:
        for name, program in zip(names, found, strict=True):
            terminal.output().print(f"# {name}")
            terminal.print_program(terminal.output(), program)
    if not quiet:
        for path in written:
            terminal.output().print(f"wrote {path}: {count} shapes")


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
