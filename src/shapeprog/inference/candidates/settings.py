"""Settings of the search for candidates."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Settings of the search for candidates; lengths in cells, chosen on val unless a reason is given.

    Parameters
    ----------
    equal_points, equal_distance
        Points of a surface by which two drawings are compared, and distance below which the surfaces are the same.
    starts, wall, counts
        Of a statement without a hint: most starts in one box; share of the least extent that is tried as a length too,
        the wall thickness of hollow solids; largest initial value of a count.
    near, points, surface_points
        Distance from a piece within which points of the surface belong to it; points by which statements are compared;
        points of the surface from which they are sampled.
    fitted, good, worth
        Pieces to which statements are fitted, and on which those without a hint are tried; misfit up to which no
        fitting is needed; largest excess over the best misfit of a statement that is fitted.
    steps, width, prior, farthest
        Gauss-Newton steps of fitting; residual whose weight is a quarter; weight of a squared move by a cell from the
        start, per point; largest change of one number in a step.
    wrong, offset
        Distance that has the same misfit as a normal at a right angle; distance from the surface at which gradients
        are evaluated, as the distance has no gradient on the surface.
    slack, better
        Largest excess over the best misfit of a statement with fewer numbers; share of its misfit below which the best
        statement is a candidate too.
    same
        Difference of positions and extents, as a share of the size, below which two candidates are the same.
    alike, level
        Differences up to which two candidates are copies: of extents, as a share of the size, and of distances.
    stray, least_step, apart
        Largest deviation of a copy from its expected position; least step, and least step in half extents of the
        repeated block: at two, copies just touch.
    least_present, present
        Least number and share of present copies in a run with gaps.
    most_alike, most_runs
        Most copies of one group that are searched for runs, the first ones; most runs of one search, the longest.
    off_size, least_row, most_row
        Largest difference of the extents of parts of one row, or a quarter, if more; fewest and most parts of a row.
    centred
        Distance within which a step is along an axis, and an axis of turns is on the middle plane of the shape.
    image_points, image_distance, supported, as_well
        Points on each candidate whose images are tested; largest distance of one on the surface; least share of its
        points on the surface, and least ratio of the share of its image to that.
    turns, axes, square, sector
        Numbers of copies around a vertical axis; most axes; largest relative difference between the horizontal extents
        of a part around one; least share of points in the sector of a copy: the arms of a star meet at its axis.
    reach, into, shortest, within
        Largest move of a face to meet another part; depth to which it enters that part; least length of a shortened
        part; share of a face, along each side, within which lines across it are followed.
    gap, off_least, off_most
        Largest gap between parts that may be merged; range of the distance from the middle plane of the shape within
        which a part may be centred.
    far, cluster_reach, cluster_points, clusters
        Distance from a program, in tolerances, from which a point is not explained; distance between points of one
        cluster, as a multiple of the square root of the area per point; points of the smallest; most clusters.
    """

    equal_points: int = 64
    equal_distance: float = 0.1
    starts: int = 192
    wall: float = 0.3
    counts: int = 6
    near: float = 0.3
    points: int = 64
    surface_points: int = 5_000
    fitted: int = 48
    good: float = 0.08
    worth: float = 0.3
    steps: int = 8
    width: float = 0.3
    prior: float = 3e-2
    farthest: float = 2.0
    wrong: float = 0.5
    offset: float = 0.01
    slack: float = 0.05
    better: float = 2 / 3
    same: float = 0.03
    alike: float = 0.06
    level: float = 0.15
    stray: float = 0.35
    least_step: float = 0.4
    apart: float = 1.6
    least_present: int = 4
    present: float = 0.75
    most_alike: int = 48
    most_runs: int = 160
    off_size: float = 0.2
    least_row: int = 3
    most_row: int = 32
    centred: float = 0.2
    image_points: int = 48
    image_distance: float = 0.4
    supported: float = 0.6
    as_well: float = 0.8
    turns: tuple[int, ...] = (8, 6, 5, 4, 3)
    axes: int = 4
    square: float = 0.1
    sector: float = 0.75
    reach: float = 4.0
    into: float = 0.05
    shortest: float = 0.2
    within: float = 0.8
    gap: float = 1.5
    off_least: float = 0.02
    off_most: float = 2.5
    far: float = 1.5
    cluster_reach: float = 2.0
    cluster_points: int = 8
    clusters: int = 24


SETTINGS = Settings()
