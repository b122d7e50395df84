"""Settings of the surface of a target."""

from __future__ import annotations

from dataclasses import dataclass

from shapeprog.space import SPAN


@dataclass(frozen=True)
class SurfaceSettings:
    """Numbers of the surface of a target; lengths in cells, chosen on val."""

    points: int = 6_000  # points to be explained
    surface: int = 40_000  # points of the same surface that support the surface of a program
    tolerance: float = 0.008 * SPAN  # largest distance between a clean point and a surface that explains it
    cell_tolerance: float = 0.65  # the same of a point of a cell
    # Least cosine between normals that agree.  It is low, to separate the two sides of a part only: near an edge of a
    # thin part the nearest surface is often another one, and a slope in cells is a staircase.
    agreement: float = 0.5
    scanned: float = 0.6  # the same of a scan, where noise could be mistaken for a surface otherwise
    # Depth of the surface of a program below the faces of the cells that it should touch.  The surface is anywhere
    # within the cells that it touches.  Near their middles, errors of fits change no cell.
    inset: float = 0.45
    planes: int = 16  # points of a scan to which a plane is fitted
    looking: int = 128  # cells along each side of the grid for visibility
    free: int = 64  # cells along each side of the grid of free space
    thin: float = 0.05  # side of a box below which thickness is ignored in the selection of its directions
    slender: float = 8.0  # variance along a rod as a multiple of that across it, at least
    even: float = 0.5  # smaller variance across a rod as a share of the larger one, at least
    components: int = 300  # components of a mesh that have a box, the largest
    parts: int = 64  # components that are compared with parts of programs, at most
    simple: float = 0.5  # least share of its box that such a component fills: a ball fills .52
    off_box: float = 0.01  # difference of that share from one up to which it is a box
    # Difference of the shares of their boxes that a component and a primitive on it fill, at most; if they lean,
    # ``off_box``, unless the primitive may be sheared: a splayed leg with level ends is no rod.
    off_fill: float = 0.1
    above: float = 0.01  # height above a face at which something in contact with it hides it
    nearest: int = 12  # neighbours of a point
    around: int = 20  # neighbours from which a normal is estimated
    noisy: float = 0.05  # noise above which points are projected onto planes, and normals are less reliable
    closest: float = 1e-3  # least spacing: points may coincide


SURFACE = SurfaceSettings()
