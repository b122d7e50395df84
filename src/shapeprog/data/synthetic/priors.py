"""The priors by name."""

from __future__ import annotations

import torch

from shapeprog.data.synthetic import cases, compounds, lounging, narrow, seating, tables
from shapeprog.data.synthetic.furniture import FURNITURE, furniture
from shapeprog.data.synthetic.mixture import Prior
from shapeprog.errors import InputError, did_you_mean
from shapeprog.language.program import Program
from shapeprog.language.tensors import decode

WIDE = Prior(
    "wide",
    blocks=10,
    templates=(
        (seating.bench, 0.23),
        (seating.chair, 0.12),
        (seating.stool, 0.03),
        (tables.table, 0.1),
        (tables.desk, 0.05),
        (cases.cabinet, 0.2),
        (compounds.hutch, 0.04),
        (compounds.corner, 0.02),
        (compounds.pigeonholes, 0.02),
        (cases.television_stand, 0.04),
        (cases.night_stand, 0.03),
        (cases.bookshelf, 0.05),
        (lounging.sofa, 0.05),
        (lounging.bed, 0.04),
    ),
    off_centre=0.05,
    details=0.6,
    own=True,
)
"""Furniture of many kinds, wider than the published data; statements that users declare take part."""

NARROW = Prior(
    "narrow",
    blocks=8,
    templates=(
        (narrow.rectangle_on_legs, 4000),
        (narrow.square_on_legs, 4000),
        (narrow.circle_on_legs, 4000),
        (narrow.rectangle_on_legs_with_layer, 4000),
        (narrow.rectangle_on_legs_with_bars, 4000),
        (narrow.circle_on_column, 4000),
        (narrow.square_on_column, 4000),
        (narrow.circle_on_cross, 4000),
        (narrow.rectangle_on_boards, 4000),
        (narrow.rectangle_on_lockers, 4000),
        (narrow.chair_on_legs, 50000),
        (narrow.chair_on_cross, 20000),
        (narrow.chair_on_star, 5000),
        (narrow.chair_on_boards, 5000),
    ),
)
"""Tables and chairs in the mix of the published synthetic data."""

PRIORS: dict[str, Prior] = {each.name: each for each in (NARROW, WIDE)}
"""Priors that generators can learn from, by name."""


def prior(name: str) -> Prior:
    """The prior of a name, that generators can learn from.

    Raises
    ------
    InputError
        If there is none, with the nearest name, or generators cannot learn from it.
    """
    if name == FURNITURE:
        raise InputError(
            f"generators cannot learn from {name}: it draws statements that they are not taught",
            f"use {' or '.join(PRIORS)}",
        )
    if name not in PRIORS:
        raise InputError(f"there is no prior {name!r}", did_you_mean(name, [*PRIORS, FURNITURE], quoted=True))
    return PRIORS[name]


def programs(name: str, count: int, seed: int = 0) -> list[Program]:
    """Programs of a prior of any kind, the same for the same seed.

    Raises
    ------
    InputError
        If there is no prior of this name.
    """
    if name == FURNITURE:
        return [furniture(number, seed) for number in range(count)]
    return decode(prior(name)(count, torch.Generator().manual_seed(seed)))
