"""The axes of a file: those of its format, unless the user gives others.

The axes of every format stand with its declaration (:mod:`shapeprog.formats.format`): mesh files are mostly +y up with
the front towards +z, STL and XYZ +z up with the front towards -y, and voxels in arrays lie in the grid already; points
in arrays are like mesh files.  Files in the layout of ShapeNet, ``synset/id/models/file``, are +y up with the front
towards -z.
"""

from __future__ import annotations

import re
from pathlib import Path

from shapeprog.errors import InputError
from shapeprog.formats.format import GRID, OTHER_MESHES, Axes, format_of
from shapeprog.space import Array, grid_axes

SHAPENET: Axes = ("+y", "-z")
"""Axes of the files of ShapeNet, whatever their format."""

AUTO = "auto"
"""Given as up: the axis that the shape seems to stand along, see :mod:`shapeprog.data.uprightness`."""

_SYNSET = re.compile(r"\d{8}")


def default_axes(path: Path, cloud: bool = False) -> Axes:
    """The usual (up, front) of a file: those of its layout, else of its format.

    A ``cloud`` of points in an array is somebody's own, in the axes of most meshes: no file that this package writes
    has points in the axes of the grid, except packs, which are read without axes.
    """
    if in_shapenet_layout(path):
        return SHAPENET
    declared = format_of(path)
    axes = None if declared is None or (cloud and declared.axes == GRID) else declared.axes
    return axes or OTHER_MESHES


def in_shapenet_layout(path: Path) -> bool:
    """Whether the path ends as ShapeNetCore v2 is distributed: ``<synset>/<id>/models/<file>``."""
    parts = path.absolute().parts
    return len(parts) >= 4 and parts[-2] == "models" and _SYNSET.fullmatch(parts[-4]) is not None


def axes_of(path: Path, up: str | None, front: str | None, cloud: bool = False) -> Array:
    """World directions of the grid axes, columns (3, 3), with the file's defaults for missing axes.

    Where one axis is given and lies on the line of the other's default, the shape is taken to be tipped over: the
    default pair is turned together until the given axis fits.  ``auto`` counts as not given, ``cloud`` is that of
    :func:`default_axes`.

    Raises
    ------
    InputError
        If a name is not an axis or the two lie on one line.
    """
    usual_up, usual_front = default_axes(path, cloud)
    up = None if up is None or str(up) == AUTO else str(up)
    front = None if front is None else str(front)
    rise, face = up or usual_up, front or usual_front
    if up and not front and up.strip()[-1:].lower() == usual_front[-1]:
        face = _opposite(usual_up) if _same(up, usual_front) else usual_up
    if front and not up and front.strip()[-1:].lower() == usual_up[-1]:
        rise = _opposite(usual_front) if _same(front, usual_up) else usual_front
    try:
        return grid_axes(rise, face)
    except ValueError as error:
        cure = "up and front, on the command line --up and --front, are two different axes, such as +y and -z"
        raise InputError(str(error), cure) from None


def _opposite(axis: str) -> str:
    return ("+" if axis.startswith("-") else "-") + axis[-1]


def _same(axis: str, other: str) -> bool:
    return axis.strip().startswith("-") == other.startswith("-")
