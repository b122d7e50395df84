"""A shape: touched cells, surface points and the frame of its file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from shapeprog.data.meshes import check_faces
from shapeprog.errors import InputError
from shapeprog.formats.format import CELLS
from shapeprog.language.program import Program
from shapeprog.language.unit import MOST_METRES, Unit, assumed_unit, metres
from shapeprog.space import RESOLUTION, SPAN, Array, FloatArray, Frame

IN_METRES, IN_MILLIMETRES = (".glb", ".gltf"), (".stl", ".3mf")
"""Suffixes of formats whose unit is the metre by definition, and the millimetre by convention."""

_CURE = "make the shape with sp.shape_from_mesh, sp.shape_from_points or sp.shape_from_voxels"


@dataclass(frozen=True, repr=False, eq=False)
class Shape:
    """A shape in the grid frame: centred, its longest side 24 cells, axes up, depth and left-right.

    :func:`shapeprog.load_shape` makes it from a file, :func:`shapeprog.shape_from_mesh` and its neighbours from arrays
    in any coordinates.  Arrays are cast to the precision below; one of another shape or kind, or with numbers that are
    not finite, is an ``InputError``.

    Parameters
    ----------
    name
        Its name: the stem of its file, or its id in a pack.
    voxels
        Cells (32, 32, 32) that its surface touches or its solid contains.
    points
        Points (P, 3) in cells, float32, uniform by area on its surface; None when it came as voxels.
    scan
        More of the points that a cloud came as, up to 20,000 of them in any order, where it had more than ``points``.
    frame
        The map from the grid to the world of the file.
    vertices, faces
        The mesh, (V, 3) in cells and (F, 3), where there is one; inference reads its surface.
    source
        The file it was read from.
    kind
        Kind of the file.
    split
        train, val or test, if its pack has splits.
    note
        Sentences on the up axis, if it was estimated, and on a shape that lies in one plane.
    unit
        Unit of its file where somebody has named it: ``mm``, ``cm``, ``m`` or ``in``; else empty.
    """

    name: str
    voxels: npt.NDArray[np.bool_]
    points: npt.NDArray[np.float32] | None = None
    scan: npt.NDArray[np.float32] | None = field(default=None, kw_only=True)
    frame: Frame = field(default_factory=Frame)
    vertices: npt.NDArray[np.float32] | None = None
    faces: npt.NDArray[np.int32] | None = None
    source: Path | None = None
    kind: Literal["mesh", "points", "voxels"] = "voxels"
    split: str = ""
    note: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        kinds: dict[str, Any] = {"points": np.float32, "scan": np.float32, "vertices": np.float32, "faces": np.int32}
        object.__setattr__(self, "voxels", _checked("voxels", self.voxels, np.bool_, (RESOLUTION,) * 3))
        for name, kind in kinds.items():
            if (array := getattr(self, name)) is not None:
                object.__setattr__(self, name, _checked(name, array, kind, (*np.shape(array)[:1], 3)))
        if (self.vertices is None) != (self.faces is None):
            raise InputError("a mesh has both vertices and faces, or neither", _CURE)
        if self.vertices is not None and self.faces is not None:
            check_faces(self.name, self.faces, len(self.vertices), "indices count from 0")

    def __repr__(self) -> str:
        """Its name and kind, how much it holds, and its longest side in the world, in one line."""
        counts = {"points": self.points, "faces": self.faces}
        held = [f"{len(array):,} {name}" for name, array in counts.items() if array is not None]
        size = f"longest side {SPAN * self.frame.scale:.4g} {self.file_unit if self.states_unit else ''}".rstrip()
        return f"<Shape {self.name!r}: {', '.join([self.kind, *held, f'{self.voxels.sum():,} cells', size])}>"

    @property
    def extents(self) -> FloatArray:
        """Size (3,) in cells of the box around its mesh, else around its points, else around its cells; zeros if it is
        empty."""
        for positions in (self.vertices, self.points):
            if positions is not None and len(positions):
                return np.ptp(positions.astype(np.float64), axis=0)
        occupied = np.argwhere(self.voxels)
        return np.ptp(occupied, axis=0) + 1.0 if len(occupied) else np.zeros(3)

    @property
    def file_unit(self) -> str:
        """The unit of its file that was named, that of the format, or one assumed where the shape would be more than
        10 m long in metres; empty if it is not known."""
        if self.unit:
            return self.unit
        if (longest := SPAN * self.frame.scale) > MOST_METRES:
            return "mm" if self._suffix in IN_MILLIMETRES else assumed_unit(longest)
        return "m" if self._suffix in IN_METRES else ""

    @property
    def states_unit(self) -> bool:
        """Whether that unit is neither assumed nor unknown."""
        return bool(self.unit) or (self._suffix in IN_METRES and self.file_unit == "m")

    @property
    def _suffix(self) -> str:
        return "" if self.source is None else self.source.suffix.lower()


def check_unit(name: str) -> None:
    """Raise a ``ShapeProgError`` unless a name is empty, ``cells``, or that of a unit."""
    if name not in ("", CELLS):
        metres(name)


def unit_of_result(shape: Shape, program: Program, name: str = "") -> Unit | None:
    """The unit in which a program that was inferred from a shape is written, by its name, or ``cells``.

    Without a name it is that of the file, which may have none.  Voxels are then left in cells unless somebody has named
    the unit of the file.  Statements in cells have no unit.
    """
    plain_voxels = shape.kind == "voxels" and not (name or shape.unit)
    if name == CELLS or plain_voxels or program.scale is None:
        return None
    return Unit.of(shape.frame, name, shape.file_unit) if name else Unit(shape.file_unit, shape.frame.scale)


def _checked(name: str, array: Array, kind: type[np.generic], shape: tuple[int, ...]) -> Array:
    """A finite array of a shape in a type of numbers; an ``InputError`` for another one, or another kind of type."""
    if not isinstance(array, np.ndarray):
        raise InputError(f"{name} of a shape is no array of NumPy but {type(array).__name__}", _CURE)
    if not np.can_cast(array.dtype, kind, "same_kind") or array.shape != shape:
        wanted = f"{kind.__name__} of the shape {'(..., 3)' if len(shape) == 2 else shape}"
        raise InputError(f"{name} of a shape is {array.dtype} of the shape {array.shape}", f"give {wanted}, or {_CURE}")
    if not np.isfinite(array).all():
        raise InputError(f"{name} of a shape holds numbers that are not finite", "remove or mend them")
    return array.astype(kind, copy=False)
