"""Settings of the search for candidates."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Settings of the search for candidates; lengths in cells, chosen on val unless a reason is given."""

    # Statements without a hint
    starts: int = 192  # most starts in one box
    wall: float = 0.3  # share of the least extent that is tried as a length too: the wall of hollow solids
    counts: int = 6  # largest initial value of a count

    # Statements on pieces
    near: float = 0.3  # distance from a piece within which points of the surface belong to it
    points: int = 64  # points by which statements are compared
    surface_points: int = 5_000  # points of the surface from which they are sampled
    fitted: int = 48  # pieces to which statements are fitted, and on which those without a hint are tried
    good: float = 0.08  # misfit up to which no fitting is needed
    worth: float = 0.3  # largest excess over the best misfit of a statement that is fitted
    steps: int = 8  # Gauss-Newton steps of fitting
    width: float = 0.3  # residual whose weight is a quarter
    prior: float = 3e-2  # weight of a squared move by a cell from the start, per point
    farthest: float = 2.0  # largest change of one number in a step
    wrong: float = 0.5  # distance that has the same misfit as a normal at a right angle
    offset: float = 0.01  # height above the surface of the points: on it, the distance has no gradient
    slack: float = 0.05  # largest excess over the best misfit of a statement with fewer numbers

    # Equal candidates
    equal_distance: float = 0.1  # distance below which their surfaces are the same,
    equal_share: float = 0.3  # and share of half of the thickness: a thin square bar is not round
    same: float = 0.03  # difference of positions and extents, as a share of the size, of equal candidates
    alike: float = 0.06  # difference of extents, as a share of the size, up to which candidates are copies
    level: float = 0.15  # the same of distances

    # Upright and leaning boards
    upright: float = 0.12  # largest distance of the ends of an upright part from its axis
    leaning: float = 1.0  # angle in degrees from which a board is written as a bar, which has no left and right side,
    board_off: float = 0.5  # if it is off the middle by no more than this
    board_wide: float = 12.0  # or is no wider than this

    # Runs of copies
    stray: float = 0.35  # largest deviation of a copy from its expected position
    least_step: float = 0.4
    apart: float = 1.6  # least step in half extents of the repeated block: at two, copies just touch
    least_present: int = 4  # least number of present copies in a run with gaps
    present: float = 0.75  # least share of them
    most_alike: int = 48  # most copies of one group that are searched for runs, the first ones
    most_runs: int = 160  # most runs of one search, the longest
    off_size: float = 0.2  # largest difference of the extents of parts of one row, or a quarter, if more
    least_row: int = 3  # fewest parts of a row
    most_row: int = 32  # most parts of a row
    centred: float = 0.2  # distance within which a step is along an axis, and an axis of turns in the middle

    # Mirror images and turned copies
    image_points: int = 48  # points on each candidate whose images are tested
    image_distance: float = 0.4  # largest distance of a point on the surface
    supported: float = 0.6  # least share of the points of a candidate on the surface
    as_well: float = 0.8  # least ratio of the share of its image to that
    turns: tuple[int, ...] = (8, 6, 5, 4, 3)  # numbers of copies around a vertical axis
    axes: int = 4  # most axes
    square: float = 0.1  # largest relative difference between the horizontal extents of a part around one
    sector: float = 0.75  # least share of points in the sector of a copy: the arms of a star meet at its axis

    # Changed boxes
    reach: float = 4.0  # largest move of a face to meet another part
    into: float = 0.05  # depth to which it enters that part
    shortest: float = 0.2  # least length of a shortened part
    within: float = 0.8  # share of a face, along each side, within which lines across it are followed
    gap: float = 1.5  # largest gap between parts that may be merged
    off_least: float = 0.02  # least and largest distance from the middle plane of a part that may be centred
    off_most: float = 2.5

    # Boxes around unexplained points
    far: float = 1.5  # distance from a program, in tolerances, from which a point is not explained
    cluster_reach: float = 2.0  # distance in one cluster, as a multiple of the square root of the area per point
    cluster_points: int = 8  # points of the smallest
    clusters: int = 24  # most clusters


SETTINGS = Settings()
