"""The file formats: each declares its contents, suffixes and axes, and the functions that read and write it.

A new format is one entry of :data:`FORMATS` and the functions that it names; commands, errors and the manual list
formats from here.  Readers and writers are imported when they are first used.
"""

from __future__ import annotations

import inspect
import os
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from shapeprog.language.program import Program

Kind = Literal["program", "solid", "list", "sample", "shape"]

CELLS = "cells"  # the word for lengths in cells

Content = str | bytes | Mapping[str, str]  # of a file, or by their suffix of several that belong together

Axes = tuple[str, str]  # world axes that point up and that the front faces, such as ``("+y", "+z")``
Y_UP: Axes = ("+y", "+z")  # axes of glTF, and of most mesh files
Z_UP: Axes = ("+z", "-y")  # axes of CAD and of 3D printing

GRID: Axes = ("+x", "-y")
"""Axes of voxels in arrays: axis 0 is up, axis 1 is depth (positive = rear), axis 2 is left-right already."""


@dataclass(frozen=True)
class Format:
    """A file format.

    Parameters
    ----------
    name
        Name of the format.
    kind
        ``program`` can be read back as the same program; ``solid`` is its geometry, for other tools; ``list`` is a
        table of its parts; ``sample`` is its cells or points; ``shape`` is read alone, as the shape to infer a program
        from.
    suffixes
        Endings of file names, the usual one first.
    axes
        Up and front axes of a file without a frame; ``None`` for programs, which keep their frame or have none.
    doc
        Contents of such a file, in one line.
    reader, writer
        ``module:function`` of this package: ``(text, name of the file) -> program`` and ``(program) -> content``,
        perhaps with the ``frame`` from the grid to the coordinates of the file, the name of their ``unit``, the
        ``stem`` of the file, and further options.
    unit
        Unit of the coordinates of a file unless another is asked for; ``text`` for that of the program, empty for that
        of the input, or of the program if no input is known, ``cells`` for cells always.  Files in millimetres are for
        makers: the shape stands upright on the origin, whatever its input.
    """

    name: str
    kind: Kind
    suffixes: tuple[str, ...]
    axes: Axes | None
    doc: str
    reader: str = ""
    writer: str = ""
    unit: str = ""

    @property
    def maker(self) -> bool:
        """Whether the shape stands upright on the origin."""
        return self.unit == "mm"

    @property
    def rests(self) -> bool:
        """Whether the lowest point of the shape is on z = 0; scripts stand on the floor of the program, since changes
        of their numbers move that point."""
        return self.maker and self.writer.startswith("meshes:")

    @property
    def options(self) -> set[str]:
        """Further arguments of the writer."""
        return {*inspect.signature(_function(self.writer)).parameters} - {"program"}

    def read(self, text: str, name: str) -> Program:
        """The program in the text of a file, with its frame if it has one; ``name`` stands for the file in errors."""
        return _function(self.reader)(text, name)

    def content(self, program: Program, **options: Any) -> Content:
        """What a file with the program holds."""
        return _function(self.writer)(program, **options)


FORMATS = (
    Format("program text", "program", (".shape",), None, "the program, with its frame in a comment where one is known",
        reader="shape:program_in", writer="shape:program_text"),
    Format("JSON", "program", (".json",), None, "the text with a list of the solids that it draws, for other programs",
        reader="json_form:program_from_json", writer="json_form:program_to_json"),
    Format("plain text", "program", (".txt",), None, "program text under another suffix",
        reader="shape:program_in"),
    Format("GLB", "solid", (".glb",), Y_UP, "one named node per part, coloured by statement",
        writer="meshes:glb", unit="m"),
    Format("OBJ", "solid", (".obj",), Y_UP, "one object per part, colours in an .mtl file next to it",
        writer="meshes:obj"),
    Format("PLY", "solid", (".ply",), Y_UP, "all parts in one mesh, colours at the vertices",
        writer="meshes:ply"),
    Format("STL", "solid", (".stl",), Z_UP, "the union of all parts: one watertight solid",
        writer="meshes:stl", unit="mm"),
    Format("3MF", "solid", (".3mf",), Z_UP, "one named, coloured object per part, for 3D printing",
        writer="meshes:three_mf", unit="mm"),
    Format("OpenSCAD", "solid", (".scad",), Z_UP,
        "the program as a script: groups, functions, loops; its named numbers for the customizer",
        writer="openscad:scad_text", unit="mm"),
    Format("build123d", "solid", (".py",), Z_UP, "the same as a Python script, which writes a STEP file when run",
        writer="build123d:script_text", unit="mm"),
    Format("STEP", "solid", (".step", ".stp"), Z_UP,
        "named, coloured solids, through build123d (pip install build123d)",
        writer="build123d:step", unit="mm"),
    Format("cut list", "list", (".csv",), Z_UP, "count, role and size of each distinct part",
        writer="cuts:cuts_csv", unit="text"),
    Format("NPY", "sample", (".npy",), GRID, "the 32^3 cells, or those of another resolution",
        writer="samples:npy", unit=CELLS),
    Format("XYZ", "sample", (".xyz",), Z_UP, "points on the surface, one line 'x y z nx ny nz' each",
        writer="samples:xyz"),
    Format("binvox", "shape", (".binvox",), Y_UP, "cells"),
    Format("NPZ", "shape", (".npz",), GRID, "cells or points, of one shape or many"),
    Format("OFF", "shape", (".off",), Y_UP, "a mesh"),
    Format("glTF", "shape", (".gltf",), Y_UP, "a mesh and the files next to it"),
    Format("HDF5", "shape", (".h5", ".hdf5"), GRID, "many grids of cells, as published"),
)  # fmt: skip
"""Every format, found by its suffix."""

OTHER_MESHES: Axes = Y_UP  # axes of the mesh files that trimesh reads besides

_BY_SUFFIX = {suffix: entry for entry in FORMATS for suffix in entry.suffixes}


def format_of(path: str | os.PathLike[str]) -> Format | None:
    """The format of the suffix of a path, in any case."""
    return _BY_SUFFIX.get(Path(path).suffix.lower())


def suffixes(*kinds: Kind) -> tuple[str, ...]:
    """The suffixes that can be written, of the kinds given or of all."""
    return tuple(s for entry in FORMATS if entry.writer and (not kinds or entry.kind in kinds) for s in entry.suffixes)


def program_suffixes() -> tuple[str, ...]:
    """The suffixes of files that a program can be read from."""
    return tuple(suffix for entry in FORMATS if entry.reader for suffix in entry.suffixes)


def listed() -> str:
    """The formats that can be written, one line each with suffixes and contents."""
    rows = [(" ".join(entry.suffixes), entry.doc) for entry in FORMATS if entry.writer]
    width = max(len(names) for names, _ in rows)
    return "\n".join(f"{names:<{width}}  {doc}" for names, doc in rows)


def _function(location: str) -> Any:
    return pkgutil.resolve_name(f"shapeprog.formats.{location}")
