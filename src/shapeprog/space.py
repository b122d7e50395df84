"""Where things are: the only home of the grid, its axes, and the way back to the world.

Grid frame
    A cube of 32 x 32 x 32 cells.  Coordinates are in cells with the origin at the centre of the
    cube, so cell ``k`` of an axis covers ``[k - 16, k - 15)`` and its centre is ``k - 15.5``.
    Axis 0 is up, axis 1 is depth (positive = rear), axis 2 is left-right (positive =
    left, seen from the front).  A shape is placed with the centre of its bounding box at the
    origin and its longest side 24 cells long.

World frame
    Whatever the input file uses.  A :class:`Frame` leads from one to the other and back.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapeprog.arguments import check_number
from shapeprog.errors import ShapeProgError

RESOLUTION = 32  # cells along each side of the grid
HALF = RESOLUTION // 2  # distance in cells from the centre of the grid to its sides
SPAN = 24  # cells along the longest side of a shape that is in the grid frame
LEAST_SIDE, MOST_SIDE = 1e-30, 1e30  # longest sides of shapes, in world units, that all exports can hold
UP, DEPTH, SIDE = 0, 1, 2  # grid axes
AXES = ("up", "depth", "side")  # their names in programs

Array = npt.NDArray[Any]
FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


def cells_at(points: FloatArray, side: int) -> IntArray:
    """The cells (P, 3) of points (P, 3), or the nearest, where the grid has so many along each side."""
    return np.clip(((points + HALF) * (side / RESOLUTION)).astype(np.int64), 0, side - 1)


def grid_axes(up: str, front: str) -> FloatArray:
    """World directions of the three grid axes, as the columns of a proper rotation (3, 3).

    ``up`` and ``front`` are signed axis names such as ``"+y"``, ``"-z"`` or ``"x"``.  Depth points away from ``front``;
    left-right completes a right-handed frame, so nothing is mirrored.  A ``ValueError`` if they are no two axes.
    """
    rise, rear = axis_direction(up), -axis_direction(front)
    if abs(rise @ rear) > 0:
        raise ValueError(f"up {up!r} and front {front!r} lie on the same line; they must be perpendicular")
    return np.stack([rise, rear, np.cross(rise, rear)], axis=1)


def axis_direction(name: str) -> FloatArray:
    """The direction (3,) of a signed axis name; a ``ValueError`` if it is none."""
    found = re.fullmatch("([+-]?)([xyz])", name.strip().lower())
    if found is None:
        raise ValueError(f"{name!r} is not an axis; use x, y or z with an optional sign, as in +y or -z")
    return (-1.0 if found[1] == "-" else 1.0) * np.eye(3)["xyz".index(found[2])]


def axis_name(direction: FloatArray) -> str:
    """The signed name, such as ``+y``, of the axis that a direction (3,) lies along."""
    axis = int(np.abs(direction).argmax())
    return ("-" if direction[axis] < 0 else "+") + "xyz"[axis]


def is_rotation(axes: FloatArray) -> bool:
    """Whether the columns of a matrix (3, 3) are perpendicular unit directions, right-handed."""
    return axes.shape == (3, 3) and bool(np.allclose(axes.T @ axes, np.eye(3), atol=1e-6) and np.linalg.det(axes) > 0)


@dataclass(frozen=True)
class Frame:
    """The similarity that leads from the grid to the world: ``world = centre + axes @ (scale * grid)``.

    ``scale`` is in world units per cell; ``centre`` is the world position of the grid's origin; the columns of the
    rotation ``axes`` (3, 3) are the world directions of up, depth and left-right.  Others are a ``ShapeProgError``.
    """

    scale: float = 1.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axes: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def __post_init__(self) -> None:
        check_number("scale", self.scale, 0, above=True)
        centre, axes = np.asarray(self.centre), np.asarray(self.axes)
        if centre.shape != (3,) or not np.isfinite(centre).all() or not is_rotation(axes):
            raise ShapeProgError(f"{self} is no frame", "its centre must be finite and its axes a rotation")
        object.__setattr__(self, "centre", tuple(map(float, centre)))
        object.__setattr__(self, "axes", tuple(tuple(map(float, row)) for row in axes))

    @staticmethod
    def around(low: npt.ArrayLike, high: npt.ArrayLike, axes: npt.ArrayLike | None = None) -> Frame:
        """The frame that centres the world box ``[low, high]`` and makes its longest side 24 cells."""
        lowest, highest = np.asarray(low, np.float64), np.asarray(high, np.float64)
        longest = float((highest - lowest).max())
        scale = longest / SPAN if longest > 0 else 1.0
        return Frame.of(scale, (lowest + highest) / 2, np.eye(3) if axes is None else axes)

    @staticmethod
    def of(scale: float, centre: npt.ArrayLike, axes: npt.ArrayLike) -> Frame:
        """The frame of a scale, a centre (3,) and axes (3, 3)."""
        return Frame(float(scale), centre, axes)  # type: ignore[arg-type]  # arrays become tuples

    def to_world(self, points: npt.ArrayLike) -> FloatArray:
        """World positions (..., 3) of grid positions (..., 3)."""
        return np.asarray(self.centre) + self.scale * (np.asarray(points, np.float64) @ np.asarray(self.axes).T)

    def to_grid(self, points: npt.ArrayLike) -> FloatArray:
        """Grid positions (..., 3) of world positions (..., 3)."""
        return (np.asarray(points, np.float64) - np.asarray(self.centre)) @ np.asarray(self.axes) / self.scale

    def matrix(self) -> FloatArray:
        """The same map as a homogeneous matrix (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.scale * np.asarray(self.axes)
        matrix[:3, 3] = self.centre
        return matrix
