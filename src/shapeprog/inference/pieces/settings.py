"""Settings of the search for pieces."""

from __future__ import annotations

from dataclasses import dataclass

from shapeprog.space import SPAN


@dataclass(frozen=True)
class Settings:
    """Settings of the search for pieces; lengths in cells, angles in degrees, chosen on val."""

    points: int = 20_000  # points sampled on a mesh
    component_points: int = 48  # the same of a component, at least
    least_points: int = 32  # points from which a surface is estimated, at least
    sheets: int = 60  # pieces of each source, and of all, at most
    limbs: int = 100
    rods: int = 60
    pieces: int = 600  # slabs, and pieces of all sources
    same: float = 0.25  # difference in position and size below which pieces are the same; components never are

    # Selection of boxes that explain the points together
    tested: int = 5000  # points that are tested here, and whose inner balls are computed
    cover_distance: float = 0.2  # distance from the surface of a box within which it explains a point
    cover_price: float = 0.6  # price of surface where no point is, against that of explained points
    cover_filled: float = 0.35  # least share of the surface with points nearby: the box around a chair is mostly air
    cover_boxes: int = 40  # selected boxes, at most
    cover_gain: float = 4.0  # points that another box explains, less its price, at least

    # Groups
    group_gap: float = 0.3  # distance between touching boxes, and by which others may exceed the extent of the first
    grouped: int = 120  # boxes that are grouped, the first ones

    # Patches, and the bars that they consist of
    patches: int = 160
    patch_points: int = 16  # points of the smallest
    full: float = 0.9  # share of a rectangle that its patch fills, below which its bars are detected as well
    bar_full: float = 0.7  # share of its rectangle that a bar fills
    bar_runs: tuple[float, ...] = (0.6, 0.25, 0.1)  # lengths of bars, as shares of the rectangle that they lie in

    # Slabs between two patches
    parallel: float = 8.0  # angle between the normals, at most
    shared: float = 0.5  # share of the smaller patch that the larger one faces
    thickness: tuple[float, float] = (0.004 * SPAN, 0.35 * SPAN)  # least and largest distance between the patches
    stretch: float = 1.6  # thickness as a multiple of the middle side, at most: else other faces describe it better

    # Limbs, from the balls that fit in a solid
    ball_radius: float = 3.0  # radius of the largest
    merged: float = 0.25  # distance, and difference of the logarithms of the radii, within which balls are merged
    limb_neighbours: int = 24  # neighbouring centres from which a direction is estimated
    linear: float = 0.3  # standard deviation across a line of centres, as a share of that along it, at most
    bend: float = 25.0  # angle between directions of neighbours in one limb, at most
    limb_points: int = 20  # points of the smallest

    # Rods
    rod_points: int = 24  # points of the smallest
    rod_trials: int = 1200  # pairs of points tried
    rod_walk: int = 8  # longest walk from one to the other
    rod_parallel: float = 0.8  # cosine above which their normals determine no axis
    rod_radius: float = 5.0  # largest radius
    rod_round: float = 0.6  # share of the sectors around a rod that have points
    rod_dense: float = 0.5  # points, as a share of those expected on a rod


SETTINGS = Settings()
