"""Settings of the surface of a target."""

from __future__ import annotations

from dataclasses import dataclass

from shapeprog.space import SPAN


@dataclass(frozen=True)
class SurfaceSettings:
    """Numbers of the surface of a target; lengths in cells, chosen on val.

    Parameters
    ----------
    points, surface
        Points to be explained, and points of the same surface that support the surface of a program.
    tolerance, cell_tolerance
        Largest distance between a clean point, or one of a cell, and a surface that explains it; the first is .8 % of
        the longest side.
    agreement, scanned
        Least cosine between normals that agree; and for scans, where noise could be mistaken for a surface otherwise.
        The bound is wide, to separate the two sides of a part only: near an edge of a thin part the nearest surface is
        often another one, and a slope in cells is a staircase.
    inset
        Depth of the surface of a program below the faces of the cells that it should touch.  The surface is anywhere
        within the cells that it touches.  Near their middles, errors of fits change no cell.
    depth
        Mean depth of a surface below the faces of the cells that it touches.
    planes
        Points of a scan to which a plane is fitted.
    looking, free
        Cells along each side of the grid for visibility, and of the grid of free space.
    nearest, around
        Neighbours of a point, and those from which a normal is estimated.
    noisy
        Noise above which points are projected onto planes, and normals are less reliable.
    closest
        Least spacing: points may coincide.
    """

    points: int = 6_000
    surface: int = 40_000
    tolerance: float = 0.008 * SPAN
    cell_tolerance: float = 0.65
    agreement: float = 0.5
    scanned: float = 0.6
    inset: float = 0.45
    depth: float = 0.65
    planes: int = 16
    looking: int = 128
    free: int = 64
    nearest: int = 12
    around: int = 20
    noisy: float = 0.05
    closest: float = 1e-3


SURFACE = SurfaceSettings()
