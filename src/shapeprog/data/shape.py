"""A shape: touched cells, surface points and the frame of its file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from shapeprog.language.unit import MOST_METRES, assumed_unit
from shapeprog.space import SPAN, Frame

IN_METRES, IN_MILLIMETRES = (".glb", ".gltf"), (".stl", ".3mf")
"""Suffixes of formats whose unit is the metre by definition, and the millimetre by convention."""


@dataclass(frozen=True)
class Shape:
    """A shape in the grid frame: centred, its longest side 24 cells, axes up, depth and left-right.

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
