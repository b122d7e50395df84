"""What is done with a case of each kind: every way that a command or a caller would take with such a file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from . import faults

Use = tuple[str, Callable[[], object]]
"""What is done, and the call that does it: it returns, or raises an error in words."""


def uses(path: Path, out: Path) -> Iterator[Use]:
    """The ways of using a file, by its suffix; what is written goes into ``out``."""
    from shapeprog.formats.format import program_suffixes

    if path.suffix == ".fault":
        yield "fault", lambda: faults.commit(path)
    elif path.suffix in program_suffixes():
        yield from _program_file(path, out)
    else:
        yield from _shape_file(path)


def _shape_file(path: Path) -> Iterator[Use]:
    """Every reader of shapes that would open a file of this suffix."""
    from shapeprog.data import load_all, read_pack

    yield "load_all", lambda: _shapes(found for _, found in load_all([path]))
    if path.suffix == ".npz":
        yield "read_pack", lambda: _shapes(read_pack(path))


def _program_file(path: Path, out: Path) -> Iterator[Use]:
    """Read, unroll, draw, export and show a program; nothing follows where it cannot be read."""
    import shapeprog as sp
    from shapeprog.cli import terminal
    from shapeprog.cli.writing import show_command
    from shapeprog.formats.format import suffixes
    from shapeprog.geometry.mesh import part_meshes, union_mesh

    program = sp.load(path)
    yield "text", lambda: _same(sp.parse(sp.format_program(program)), program)
    yield "JSON", lambda: _same(sp.program_from_json(sp.program_to_json(program)), program)
    yield "unroll", lambda: sp.unroll(program)
    yield "encode", lambda: sp.unroll(sp.encode(program))
    yield "sample", lambda: _finite(sp.unroll(program).sample(200))
    yield "distance", lambda: sp.unroll(program).distance(sp.unroll(program).sample(20))
    yield "voxels", lambda: sp.unroll(program).voxels()
    yield "voxels, snapped", lambda: sp.unroll(program.snap()).voxels()
    yield "part_meshes", lambda: part_meshes(sp.unroll(program))
    yield "union_mesh", lambda: union_mesh(sp.unroll(program))
    for suffix in suffixes():
        if suffix not in (".step", ".stp"):  # through build123d, a second for each part
            yield f"export {suffix}", lambda: sp.export(program, out / f"program{suffix}")  # noqa: B023
    terminal.quiet = True
    yield "show", lambda: show_command(path, out / "page.html")


def _raised(found: Iterable[Any]) -> None:
    for each in found:
        if isinstance(each, Exception):
            raise each


def _shapes(found: Iterable[Any]) -> None:
    """A shape is usable: it has cells, finite points, and a finite way back to its file."""
    for shape in found:
        _raised([shape])
        assert shape.voxels.any(), "a shape without a cell"
        _finite(shape.frame.to_world([[-12.0] * 3, [12.0] * 3]))
        assert np.ptp(shape.frame.to_world([[-12.0] * 3, [12.0] * 3])) > 0, "a shape without extent"
        if shape.points is not None:
            assert len(shape.points), "a shape without points"
            _finite(shape.points)


def _finite(numbers: Any) -> None:
    assert np.isfinite(np.asarray(numbers)).all(), "numbers that are not finite"


def _same(one: object, other: object) -> None:
    assert one == other, "a program that does not come back as it was"
