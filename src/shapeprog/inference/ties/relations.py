"""Relations that may hold between the measures of a program: equal, opposite, centred, in contact, part of a whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from shapeprog.inference.ties.features import Feature
from shapeprog.space import DEPTH, SIDE, UP, FloatArray

WITHIN, JOINED = 0.3, 1.5
"""Cells by which a relation may be off that is worth a thought; and one between the sides of parts that touch, or about
the middle: parts end inside each other, where nobody sees how far they reach."""

DEGREES = 2.0
"""The same for angles, in degrees."""

THIN = 3.0
"""Cells below which lengths along different axes may well be the two sides of one section; others are equal by chance:
a leg as high as the seat is deep."""


class Worth(NamedTuple):
    """What the number that a relation saves is worth to it.

    Parameters
    ----------
    centred, even
        For parts that are their own mirror image, left and right; and for those that lie in the middle of the depth.
    holding
        For relations that hold touching parts together when a number is changed.
    sure, likely, possible
        For such as furniture is built by, are common, and are possible.
    ratio
        For lengths that are a simple multiple of others along an axis.
    buried, inside
        For relations of parts that are their own mirror image, and for those that hold touching parts together, where
        they are off by so much that only hidden surfaces can be meant; others are worth nothing there.
    """

    centred: float
    even: float
    holding: float
    sure: float
    likely: float
    possible: float
    ratio: float
    buried: float
    inside: float


INFERRED = Worth(
    centred=4.0, even=4.0, holding=1.2, sure=1.0, likely=1.0, possible=0.4, ratio=0.25, buried=1.3, inside=0.03
)
"""In programs that inference found, whose numbers may be off by as much as nobody sees; chosen on val."""

WRITTEN = Worth(
    centred=4.0, even=4.0, holding=0.9, sure=0.8, likely=0.25, possible=0.25, ratio=0.1, buried=1.3, inside=0.03
)
"""In programs that somebody wrote: numbers that are known are rarely off by much; chosen on planted programs."""

RATIOS = (2, 3)
"""How many times as long one part may be as another along an axis by design: where parts have many lengths, some are
nearly twice others by chance."""

SIMPLE = 4
"""Factors of a relation beyond which it is worth less, in proportion: it takes a long sum to write."""


Ends = dict[tuple[int, bool, int, str], float]
"""Where sides are, by node, whether all copies are meant, axis and kind."""


class Relation(NamedTuple):
    """That a row of factors (F + 3,) times the numbers of a program and the extents of the whole is zero.

    Parameters
    ----------
    row
        The factors, the first that is not zero being positive.
    trust
        What the number that it saves is worth to it, from 0 to 1.
    """

    row: FloatArray
    trust: float


def relations(
    known: list[Feature], numbers: FloatArray, touching: set[tuple[int, int]], worth: Worth
) -> list[Relation]:
    """Relations that nearly hold, each once, with the highest trust that any of its readings has.

    Parameters
    ----------
    numbers
        Where the numbers of the program and the extents are (F + 3,).
    touching
        Pairs of nodes, the smaller first, whose parts touch.
    worth
        What relations are worth in such a program.
    """
    offered = [(row, kind) for row, kind in _candidates(known, numbers, touching) if row.any()]
    if not offered:
        return []
    rows, kinds = np.stack([row for row, _ in offered]), np.array([kind for _, kind in offered])
    trust = np.array([getattr(worth, kind) for _, kind in offered])
    used = rows != 0
    tidy = rows / np.take_along_axis(rows, used.argmax(1)[:, None], 1)
    off = np.abs(tidy @ numbers) / np.abs(tidy).max(1)
    angles = np.any([each.row != 0 for each in known if each.kind == "angle"] or np.zeros((1, len(numbers)), bool), 0)
    near = off < np.where(used[:, angles].any(1), DEGREES, WITHIN)
    hidden = ~near & ~used[:, angles].any(1) & (off < JOINED)
    for kind, buried in (("centred", worth.buried), ("holding", worth.inside)):
        here = hidden & (kinds == kind)
        trust[here], near[here] = buried, True
    trust *= np.minimum(1.0, SIMPLE / used.sum(1))
    found: dict[bytes, Relation] = {}
    for k in np.flatnonzero(near).tolist():
        key = np.round(tidy[k], 6).tobytes()
        if key not in found or found[key].trust < trust[k]:
            found[key] = Relation(tidy[k], float(trust[k]))
    return list(found.values())


def _candidates(
    known: list[Feature], numbers: FloatArray, touching: set[tuple[int, int]]
) -> Iterator[tuple[FloatArray, str]]:
    """Rows that may be relations, and what each would be: the name of its worth."""
    whole = {each.axis: each for each in known if each.kind == "extent"}
    places = [each for each in known if each.kind in ("low", "high", "middle", "place")]
    ends: Ends = {(each.node, each.all, each.axis, each.kind): each.at(numbers) for each in places}
    across = _across(places, numbers)
    for axis in range(3):
        here = [each for each in places if each.axis == axis]
        for one in here:
            level = one.kind == "middle"
            if axis in (DEPTH, SIDE):
                yield one.row, ("centred" if axis == SIDE else "even") if level else "possible"
            if not level:
                yield one.row - whole[axis].row / 2, "sure"
                yield one.row + whole[axis].row / 2, "holding" if axis == UP else "sure"
        for one, two, flush, mirrored in _near(here, numbers):
            middles = (one.kind == "middle") + (two.kind == "middle")
            if one.kind == two.kind == "place" and one.node == two.node:  # the ends of one part
                if flush:
                    yield one.row - two.row, "centred" if axis != SIDE and one.node in across else "sure"
                if mirrored and axis in (DEPTH, SIDE):
                    yield one.row + two.row, "centred" if axis == SIDE else "likely"
                continue
            if middles == 1 or (one.node == two.node and one.all == two.all):
                continue
            pair = (min(one.node, two.node), max(one.node, two.node))
            if flush and (one.kind == two.kind or not _edge(one, two, ends, mirror=False)):
                yield one.row - two.row, "holding" if pair in touching and not middles else "likely"
            if mirrored and axis in (DEPTH, SIDE) and not (one.kind == two.kind and _edge(one, two, ends, mirror=True)):
                yield one.row + two.row, "likely" if middles == 0 else "possible"
    for run in known:  # the gap between the run and a part is that between its copies
        facing = {"before": "high", "behind": "low"}.get(run.kind)
        for side in places:
            if side.kind == facing and side.axis == run.axis and side.node != run.node:
                yield run.row - side.row, "likely"
    for each in known:
        if each.kind == "shift":  # copies lie in line
            yield each.row, "sure"
    for kind in ("length", "radius", "shift", "angle"):
        alike = [each for each in known if each.kind == kind]
        for one, two, same, opposite in _near(alike, numbers):
            thin = kind == "length" and max(abs(one.at(numbers)), abs(two.at(numbers))) < THIN
            if same and (one.axis == two.axis or thin):
                yield one.row - two.row, "likely"
            if opposite and kind in ("shift", "angle"):
                yield one.row + two.row, "possible"
    lengths = [(each, each.at(numbers)) for each in known if each.kind in ("length", "extent") and each.axis >= 0]
    for (one, far), (two, near) in permutations(lengths, 2):
        if one.axis == two.axis and near > THIN and (times := round(far / near)) in RATIOS:
            yield one.row - times * two.row, "ratio"


def _across(places: Sequence[Feature], numbers: FloatArray) -> set[int]:
    """Nodes of parts whose ends are as far to the left of the middle as to the right: bars and rods that lie across."""
    ends = [each for each in places if each.kind == "place" and each.axis == SIDE]
    return {
        one.node
        for one, two in combinations(ends, 2)
        if one.node == two.node and abs(one.at(numbers) + two.at(numbers)) < WITHIN < abs(one.at(numbers))
    }


def _near(alike: Sequence[Feature], numbers: FloatArray) -> Iterator[tuple[Feature, Feature, bool, bool]]:
    """Pairs of features that may be related, and whether they may be equal, and opposite: others are too far apart."""
    at = [each.at(numbers) for each in alike]
    reach = [max(JOINED, DEGREES) * float(np.abs(each.row).max()) for each in alike]
    for one, two in combinations(range(len(alike)), 2):
        far = reach[one] + reach[two]
        equal, opposite = abs(at[one] - at[two]) < far, abs(at[one] + at[two]) < far
        if equal or opposite:
            yield alike[one], alike[two], equal, opposite


def _edge(one: Feature, two: Feature, ends: Ends, *, mirror: bool) -> bool:
    """Whether two parts, or one and the mirror image of the other, would meet along an edge at best if these sides met:
    they hold together by others."""
    overlaps = []
    for axis in range(3):
        sides = [ends.get((each.node, each.all, axis, kind)) for each in (one, two) for kind in ("low", "high")]
        if any(side is None for side in sides):
            return False
        low1, high1, low2, high2 = (float(side) for side in sides if side is not None)
        if mirror and axis == one.axis:
            low2, high2 = -high2, -low2
        overlaps.append(min(high1, high2) - max(low1, low2))
    others = [overlap for axis, overlap in enumerate(overlaps) if axis != one.axis]
    return min(others) < min(WITHIN, overlaps[one.axis])
