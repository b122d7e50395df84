"""Relations between what a program names: gaps, radii and thicknesses that are as wide as others.

Sides that are flush and lengths that are equal are looked for among all measures.  A gap lies between any two sides,
and most of their differences are like some other by chance; so these are compared only once a program is written with
few names, and only those that agree more often than chance explains.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from shapeprog.inference.ties.basis import Basis, Measure
from shapeprog.inference.ties.following import Following
from shapeprog.inference.ties.relations import THIN, Relation, Worth
from shapeprog.space import FloatArray

ALIKE: dict[tuple[str, str], float] = {
    ("inset", "radius"): 0.15, ("offset", "radius"): 0.15, ("length", "radius"): 0.1, ("inset", "inset"): 0.1,
    ("inset", "length"): 0.05, ("offset", "offset"): 0.05,
}  # fmt: skip
"""Cells by which measures may differ that are alike, by what they measure: within these, pairs are up to three times as
frequent as a little further apart (IKEA, benches and cabinets, val); of others they are not."""


def alike(basis: Basis, following: Following | None, worth: Worth) -> Iterator[Relation]:
    """Relations by which two measures of a program become one, where a change of that parts nothing that touches and
    would not be parted by changes of the two."""
    parts = [_parting(following, basis.factors[:, z], value) for z, value in enumerate(basis.values)]
    for one, two in combinations(range(len(basis.chosen)), 2):
        values = basis.values[[one, two]]
        if (
            values.min() <= 0
            or values.max() > THIN
            or np.ptp(values) > _within(basis.chosen[one][0], basis.chosen[two][0])
        ):
            continue
        merged = _parting(following, basis.factors[:, one] + basis.factors[:, two], values.mean())
        if merged <= parts[one] + parts[two]:
            yield Relation(basis.chosen[one][0].row - basis.chosen[two][0].row, worth.likely)


def _within(one: Measure, two: Measure) -> float:
    """By how much two measures may differ; insets along one axis lie flush or do not."""
    if one.word == two.word == "inset" and one.feature.axis == two.feature.axis:
        return 0.0
    return ALIKE.get((min(one.word, two.word), max(one.word, two.word)), 0.0)


def _parting(following: Following | None, factors: FloatArray, value: float) -> float:
    """What share of the contacts a change of a measure parts, from which numbers and extents (V,) follow by factors."""
    if following is None:
        return 0.0
    return float(following.lost(factors[None, :-3, None], np.array([[value]]))[0])
