"""Settings of the search for pieces."""

from __future__ import annotations

from dataclasses import dataclass

from shapeprog.space import SPAN


@dataclass(frozen=True)
class Settings:
    """Settings of the search for pieces; lengths in cells, chosen on val unless a reason is given.

    Parameters
    ----------
    points, component_points, least_points
        Points sampled on a mesh; smallest number on a component, and from which a surface is estimated.
    components, slabs, sheets, limbs, pieces
        Largest numbers of pieces of these sources, and of all.
    same
        Difference in position and size below which two pieces are the same; components are never merged.
    cover_points, cover_distance
        Surface points that are tested, and distance from the surface of a box within which it explains one.
    cover_price, cover_filled
        Price of surface where no point is, against that of explained points; least share of the surface of a solid near
        which there are points: the box around a chair is mostly air.
    cover_boxes, cover_gain
        Most selected boxes, and least gain of another one: points that it explains, less its price.
    group_gap, grouped
        Distance between touching boxes, and by which a neighbour may exceed the extent of the first; most boxes that
        are grouped, the first ones.
    thin
        Side below which thickness is ignored in the selection of directions.
    slender, even
        A rod's variance along its axis is at least so many times that across it, and that across is at least so even.
    patches, patch_points
        Most patches, and points of the smallest.
    snap
        Degrees within which the normal of a patch counts as one of the world's axes.
    full, bar_full, bar_runs
        Share of a rectangle that its patch fills, below which its bars are detected as well; share that a bar fills;
        and lengths of bars, as shares of the rectangle that they lie in.
    parallel, shared
        Degrees between the normals of two patches of a pair, at most; share of the smaller that the larger one faces.
    thickness, stretch
        Least and largest distance between them; largest multiple of the middle side of their box: above, other faces
        describe it better.
    ball_points, ball_radius, ball_rounds
        Points whose inner balls are computed, radius of the largest, and rounds of shrinking one until it is empty.
    merged, merged_radius
        Distance, and difference of the logarithms of the radius, within which balls are merged.
    limb_neighbours, linear, bend, limb_points
        Neighbouring centres from which a direction is estimated; standard deviation across a line of centres, as a
        share of that along it, at most; degrees between directions of neighbours in one limb; points of the smallest.
    rods, rod_points
        Most rods, and points of the smallest.
    rod_trials, rod_walk, rod_parallel
        Pairs of points tried; longest walk from one to the other; cosine above which their normals determine no axis.
    rod_radius, rod_round, rod_dense
        Largest radius; share of the sectors around a rod with points; points, as a share of those expected on it.
    """

    points: int = 20_000
    component_points: int = 48
    least_points: int = 32
    components: int = 300
    slabs: int = 600
    sheets: int = 60
    limbs: int = 100
    pieces: int = 600
    same: float = 0.25
    cover_points: int = 5000
    cover_distance: float = 0.2
    cover_price: float = 0.6
    cover_filled: float = 0.35
    cover_boxes: int = 40
    cover_gain: float = 4.0
    group_gap: float = 0.3
    grouped: int = 120
    thin: float = 0.05
    slender: float = 8.0
    even: float = 0.5
    patches: int = 160
    patch_points: int = 16
    snap: float = 3.0
    full: float = 0.8
    bar_full: float = 0.7
    bar_runs: tuple[float, ...] = (0.6, 0.25, 0.1)
    parallel: float = 8.0
    shared: float = 0.5
    thickness: tuple[float, float] = (0.004 * SPAN, 0.35 * SPAN)
    stretch: float = 1.6
    ball_points: int = 5000
    ball_radius: float = 3.0
    ball_rounds: int = 8
    merged: float = 0.25
    merged_radius: float = 0.25
    limb_neighbours: int = 24
    linear: float = 0.3
    bend: float = 25.0
    limb_points: int = 20
    rods: int = 60
    rod_points: int = 24
    rod_trials: int = 1200
    rod_walk: int = 8
    rod_parallel: float = 0.8
    rod_radius: float = 5.0
    rod_round: float = 0.6
    rod_dense: float = 0.5


SETTINGS = Settings()
