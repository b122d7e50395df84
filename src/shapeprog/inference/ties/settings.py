"""Settings of ties."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TieSettings:
    """Numbers of ties; lengths in cells, angles in degrees, chosen on validation shapes unless a reason is given."""

    # Layout
    gap: float = 0.25  # neighbours divide a box if the gap between them is at most this share of their size

    # Search
    price: float = 3e-4  # of a free number, as a mean squared distance
    known_price: float = 1.2e-3  # the same in a program that somebody wrote (planted programs), and of exact numbers
    known: float = 0.1  # weight of a squared move of a number that somebody wrote
    extent: float = 0.3  # weight of a squared move of the width, depth or height of a mesh
    exact: float = 1.0  # weight of a squared move of a number in an exact program

    # A program is exact if of the relations that hold up to ``nearly`` this share holds up to ``exactly``, and this
    # share of its parts lies within ``component`` of a component of the mesh
    nearly: float = 0.1
    exactly: float = 0.005
    exact_share: float = 0.45
    component: float = 0.02
    component_share: float = 0.25

    # Rounds
    rounds: int = 3  # most searches for relations: first parts on the floor and those priced like contacts, then all
    lost: float = 0.03  # largest decrease of closeness when numbers are tied
    cheaper: float = 3.0  # divides the price of a number where more is lost
    attempts: int = 3  # most prices
    repeats: int = 6  # most times at one price that parts are tied which come apart,
    heavier: float = 10.0  # each time with so many times the weight of their joints

    # Price of the number that a relation saves, as a multiple of the usual price.  All others have the usual price:
    # zeros, equal sections, equal sizes of parts of one role, and equal clearances (of a part at a corner, of parts at
    # one side or at opposite sides); faces of one side that touch have half of it.
    floor: float = 6.0  # a part that ends just above the floor
    # Equal clearances on the left and right, in front and at the rear, above and below
    symmetric: tuple[float, float, float] = (4.0, 2.0, 2.0)
    contact: float = 2.0  # faces that meet, and equal clearances of a row
    straight: float = 1.5  # ends of a rod at equal distances, or on the middle line of a part that it touches

    # By how much a relation may be off
    within: float = 0.3  # lengths
    plane: float = 0.1  # planes of mirrors off the middle
    degrees: float = 6.0  # angles; also of bars about themselves whose sides follow those of the whole
    alike: float = 0.25  # equal sizes, as a share of the larger
    rounding: float = 0.05  # which is added to that
    section: float = 3.0  # sizes below this along different axes may be the two sides of one section

    # Costs of anchors
    separated: float = 5.0  # of a pair of parts that touch and would be separated
    touch: float = 0.12  # gap up to which they touch
    side: float = 2.0  # of a copy of a part near a side of the whole that does not move with it
    resized: float = 2.0  # of a short part that changes its size, times how much it is below ``spanning``
    thicker: float = 6.0  # of a board that changes its thickness
    rigid: float = 5.0  # of a copy of a long part that keeps its size
    middle: float = 2.0  # of an end measured from the middle, where the middle of the part is not that of the whole
    farther: float = 3.0  # of an end measured from the farther of two sides, times how much farther, as a share
    outside: float = 2.0  # of a height above the whole when that is as low as the least of ``changes`` makes it
    from_top: float = 0.25  # of a height measured from the top by a part that is not near it: people expect the floor

    # Shares of the whole
    reach: float = 0.02  # up to this a face reaches a side, or a part the floor
    off_middle: float = 0.02  # by which the middle of a part may miss that of the whole
    beyond: float = 0.3  # parts wholly beyond this share of the half are near that side
    below: float = 0.1  # parts whose top is so far below that of the whole are near the top
    board: float = 0.4  # the thickness of a board is at most this share of its next longer side
    spanning: float = 0.6  # from this on parts are long
    growth: float = 0.25  # by which the whole grows to see what is separated
    fills: float = 0.9  # from this on a round part fills the whole

    # Numbers that carry parts
    changes: tuple[float, ...] = (0.7, 1.4)  # what a name is multiplied by to see which parts it separates
    changed: int = 64  # most changed programs that are drawn at once

    # Fit
    draws: int = 2  # times that pairs of points are drawn for one curvature
    steps: int = 4  # of Gauss and Newton in a refit
    together: float = 0.03  # weight of a squared gap between parts that touched
    farthest: float = 0.5  # that one step moves a number

    # Text
    zero: float = 0.015  # numbers up to this are zero, and parts with a gap up to this touch
    negative: float = 1.5  # operators that a size is worth which may become negative: a difference
    repeated: float = 0.1  # operators that every use of a sum after the first is worth, as it can be named
    thin: float = 0.6  # the thickness of a part is at most this share of its next longer side


TIES = TieSettings()
