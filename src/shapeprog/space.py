"""Where things are: the only home of the grid, its axes, and the way back to the world.

Grid frame
    A cube of 32 x 32 x 32 cells.  Coordinates are in cells with the origin at the centre of the
    cube, so cell ``k`` of an axis covers ``[k - 16, k - 15)`` and its centre is ``k - 15.5``.
    Axis 0 is up, axis 1 is depth (positive = rear), axis 2 is left-right.  A shape is placed with
    the centre of its bounding box at the origin and its longest side 24 cells long.

World frame
    Whatever the input file uses.  A :class:`Frame` leads from one to the other and back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

RESOLUTION = 32
"""Cells along each side of the grid."""

HALF = RESOLUTION // 2
"""Distance in cells from the centre of the grid to its sides."""

SPAN = 24
"""Cells along the longest side of a shape that is in the grid frame."""

UP, DEPTH, SIDE = 0, 1, 2
"""Grid axes: up, depth (positive = rear), left-right."""

Array = npt.NDArray[Any]
"""An array of any numbers."""

FloatArray = npt.NDArray[np.float64]
"""An array of float64."""

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def axis_vector(name: str) -> FloatArray:
    """Unit vector of a signed axis name such as ``"+y"``, ``"-z"`` or ``"x"``.

    Raises
    ------
    ValueError
        If the name is not one of x, y, z with an optional sign.
    """
    text = name.strip().lower()
    sign = -1.0 if text.startswith("-") else 1.0
    letter = text.lstrip("+-")
    if letter not in _AXES or len(text) - len(letter) > 1:
        raise ValueError(f"{name!r} is not an axis; use x, y or z with an optional sign, as in +y or -z")
    return sign * np.array(_AXES[letter])


def grid_axes(up: str, front: str) -> FloatArray:
    """World directions of the three grid axes, as the columns of a proper rotation (3, 3).

    Depth points away from ``front``; left-right completes a right-handed frame, so nothing is mirrored.

    Raises
    ------
    ValueError
        If a name is not an axis or the two lie on one line.
    """
    rise, rear = axis_vector(up), -axis_vector(front)
    if abs(rise @ rear) > 0:
        raise ValueError(f"up {up!r} and front {front!r} lie on the same line; they must be perpendicular")
    return np.stack([rise, rear, np.cross(rise, rear)], axis=1)


@dataclass(frozen=True)
class Frame:
    """The similarity that leads from the grid to the world: ``world = centre + axes @ (scale * grid)``.

    Parameters
    ----------
    scale
        World units per cell.
    centre
        World position of the grid's origin, three numbers.
    axes
        World directions of up, depth and left-right: the columns of a rotation (3, 3).
    """

    scale: float = 1.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axes: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    @staticmethod
    def around(low: npt.ArrayLike, high: npt.ArrayLike, axes: npt.ArrayLike | None = None) -> Frame:
        """The frame that centres the world box ``[low, high]`` and makes its longest side 24 cells."""
        lowest, highest = np.asarray(low, np.float64), np.asarray(high, np.float64)
        longest = float((highest - lowest).max())
        centre = (lowest + highest) / 2
        rotation = np.eye(3) if axes is None else np.asarray(axes, np.float64)
        return Frame(longest / SPAN if longest > 0 else 1.0, _triple(centre), tuple(_triple(row) for row in rotation))

    def to_world(self, points: npt.ArrayLike) -> FloatArray:
        """World positions (..., 3) of grid positions (..., 3)."""
        grid = np.asarray(points, np.float64)
        return np.asarray(self.centre) + self.scale * (grid @ np.asarray(self.axes).T)

    def to_grid(self, points: npt.ArrayLike) -> FloatArray:
        """Grid positions (..., 3) of world positions (..., 3)."""
        world = np.asarray(points, np.float64)
        return (world - np.asarray(self.centre)) @ np.asarray(self.axes) / self.scale

    def matrix(self) -> FloatArray:
        """The same map as a homogeneous matrix (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.scale * np.asarray(self.axes)
        matrix[:3, 3] = self.centre
        return matrix


def _triple(values: Sequence[float] | Array) -> tuple[float, float, float]:
    first, second, third = (float(value) for value in values)
    return (first, second, third)
