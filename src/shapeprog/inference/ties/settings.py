"""Settings of ties."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TieSettings:
    """Numbers of ties; lengths in cells, angles in degrees, chosen on validation shapes unless a reason is given.

    Parameters
    ----------
    price, known_price
        Price of a free number as a mean squared distance; and in a program that somebody wrote (planted programs).
    known
        Weight of a squared move of a number that somebody wrote.
    far, rounds
        Farthest that relations may move a number at once; most rounds of the search for them: first contacts and parts
        on the floor, then all.
    lost, cheaper, attempts
        Largest decrease of closeness when numbers are tied; beyond that, the price of a number is divided by
        ``cheaper``.  At each price, lines that ties separate are untied.  Both are repeated at most ``attempts`` times;
        the last result is kept anyway.
    floor, centred, contact, straight, equal
        Price of the number that a relation saves, as a multiple of the usual price.  ``floor``: a part that ends just
        above the floor.  ``centred``: equal clearances on the left and right.  ``contact``: faces that meet; equal
        clearances in front and at the rear.  ``straight``: ends of a rod at equal distances, or on the middle line of a
        part that it touches; a row along one axis.  ``equal``: zeros; equal sections, equal sizes of parts of one role,
        and equal clearances, of a part at a corner or of parts at one side or at opposite sides.
    within, askew, degrees
        By how much a relation may be off; equal clearances on both sides; and angles, also those of bars about
        themselves whose sides follow those of the whole.
    at_floor, alike, rounding, section
        Share of the height of the whole up to which a part touches the floor; tolerance of equal sizes, a share of the
        larger plus a length; below which sizes along different axes may be the two sides of one section.
    separated
        Cost of anchors by which a pair of parts that touch, with a gap up to ``touch``, would be separated.
    side, reaching
        Of a copy of a part near a side of the whole that does not move with it; and of one that reaches the side.
    resized, rigid
        Of a part shorter than ``spanning`` of the whole that changes its size, times how much shorter it is; and of a
        copy of one that is longer and keeps it.
    middle
        Of an end measured from the middle, where the middle of the part is not that of the whole.
    farther
        Of an end measured from the farther of two sides, times the difference of the distances as a share of the whole.
    reach, beyond, below, spanning
        Shares of the whole: up to this a face reaches a side; parts wholly beyond this share of the half are near that
        side, and those whose top is so far below that of the whole are near the top; from this on they span.
    growth, still, off_middle, fills
        Share by which the whole grows; distance between the first and last copy of a row up to which it does not run
        along an axis; shares of the whole by which the middle of a part may miss its own, and from which a round part
        fills it.
    changes, operations
        What a name is multiplied by to see which parts it carries; most numbers that are measured from one.
    draws, steps, together, farthest
        Times that pairs of points are drawn for one curvature; steps of Gauss and Newton of a refit; weight of a
        squared gap between parts that touched; farthest that one step moves a number.
    points, near
        Points of the target, and of the program, whose closeness is compared; share of the diagonal of the target's box
        within which surfaces are near, as in the evaluation.
    negative, repeated
        Cost in operators of a size that is a difference, which may become negative when a name is changed; and of every
        use of a sum after the first, as it can be named.
    gap, divided
        Neighbours divide a box if the gap between them is at most this share of their size, which is at least
        ``divided``.
    leaning, board_off, board_wide
        Angle by which a board leans; by how much it may be off the middle, or else how wide it may be, to be written as
        a bar, which has no left and right side.
    thin
        A side of a part is its thickness if it is at most this share of the next longer one.
    """

    price: float = 3e-4
    known_price: float = 1.2e-3
    known: float = 0.1
    far: float = 2.0
    rounds: int = 3
    lost: float = 0.03
    cheaper: float = 3.0
    attempts: int = 3
    floor: float = 6.0
    centred: float = 4.0
    contact: float = 2.0
    straight: float = 1.5
    equal: float = 1.0
    within: float = 0.3
    askew: float = 1.0
    degrees: float = 2.0
    at_floor: float = 0.02
    alike: float = 0.25
    rounding: float = 0.05
    section: float = 3.0
    separated: float = 5.0
    touch: float = 0.12
    side: float = 2.0
    reaching: float = 8.0
    resized: float = 2.0
    rigid: float = 5.0
    middle: float = 2.0
    farther: float = 3.0
    reach: float = 0.02
    beyond: float = 0.3
    below: float = 0.1
    spanning: float = 0.6
    growth: float = 0.25
    still: float = 0.3
    off_middle: float = 0.02
    fills: float = 0.9
    changes: tuple[float, ...] = (0.7, 1.4)
    operations: int = 2
    draws: int = 2
    steps: int = 4
    together: float = 0.03
    farthest: float = 0.5
    points: int = 4_000
    near: float = 0.01
    negative: float = 1.5
    repeated: float = 0.3
    gap: float = 0.25
    divided: float = 2.0
    leaning: float = 1.0
    board_off: float = 0.5
    board_wide: float = 12.0
    thin: float = 0.6

    def symmetric(self, axis: int) -> float:
        """The price of equal clearances on both sides along a horizontal axis."""
        return self.centred if axis == 0 else self.contact


TIES = TieSettings()
