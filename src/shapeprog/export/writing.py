"""The door of the room: a program to a file, in the format that the suffix names."""

from __future__ import annotations

import difflib
import importlib
import os
from pathlib import Path

from shapeprog.errors import OutputError
from shapeprog.export.frames import upright
from shapeprog.files import output_error
from shapeprog.language.program import Program
from shapeprog.space import Frame

_WRITERS = {
    ".shape": ("text", "write_shape"),
    ".json": ("text", "write_json"),
    ".glb": ("meshes", "write_glb"),
    ".obj": ("meshes", "write_obj"),
    ".ply": ("meshes", "write_ply"),
    ".stl": ("meshes", "write_stl"),
    ".scad": ("openscad", "write_scad"),
    ".py": ("build123d", "write_script"),
    ".step": ("build123d", "write_step"),
    ".stp": ("build123d", "write_step"),
    ".binvox": ("grids", "write_cells"),
    ".npz": ("grids", "write_arrays"),
}


def suffixes() -> tuple[str, ...]:
    """The suffixes that :func:`export` knows."""
    return tuple(_WRITERS)


def export(program: Program, path: str | os.PathLike[str], frame: Frame | None = None) -> Path:
    """Write a program in the format that the suffix of ``path`` names, whole or not at all, and return the path.

    ============  ====================================================================================
    suffix        what is written
    ============  ====================================================================================
    .shape .json  the program itself, with its frame where one is given
    .glb          one named node per part, coloured by statement
    .obj          one object per part, colours in an .mtl file beside it
    .ply          all parts in one mesh, colours at the vertices
    .stl          the union of all parts: one watertight solid
    .scad         OpenSCAD: loops as loops, numbers as named variables at the top
    .py           the same as a build123d script, which writes a STEP file when run
    .step         named, coloured solids through build123d (``pip install 'shapeprog[step]'``)
    .binvox .npz  the 32^3 cells; the NPZ also holds points, ids, parameters and the frame
    ============  ====================================================================================

    Parameters
    ----------
    program
        What to write.
    path
        Where to; the folder must exist.
    frame
        The way from the grid to the world of the input, so that the export lies on it; without it the shape stands
        upright as the format wants it, one cell one unit (:mod:`shapeprog.export.frames`).

    Raises
    ------
    OutputError
        If the suffix is unknown, the program has nothing that the format can hold, or the file cannot be written.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in _WRITERS:
        near = difflib.get_close_matches(suffix, _WRITERS, 2, 0.5)
        raise OutputError(
            f"no export ends in {suffix!r}" if suffix else f"{target} has no suffix, so its format is unknown",
            (f"did you mean {' or '.join(near)}? " if near else "") + f"known are {' '.join(_WRITERS)}",
        )
    module, function = _WRITERS[suffix]
    write = getattr(importlib.import_module(f"shapeprog.export.{module}"), function)
    placed = upright(suffix) if frame is None and suffix not in (".shape", ".json") else frame
    try:
        write(program, target, placed)
    except OSError as error:
        raise output_error(target, error) from error
    return target
