"""Whether a program holds together when it is edited: each free number made a fifth larger, and a fifth smaller.

Contacts
    Share of the pairs of primitives that touch which still do.
Symmetry
    Whether a program that is its own mirror image, left for right, still is: the share of its surface whose image lies
    on it falls by 1 % or less.
One piece
    Whether a program that is one connected solid still is.

All are means over the edits; symmetry and one piece are not a number where the program did not have them to begin with.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
import torch

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.mesh import gaps, pieces, union_mesh
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.free import free_numbers, multiplied
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import SIDE

FACTORS = (1.2, 0.8)
"""What free numbers are multiplied by."""

TOUCHING = 0.1
"""Cells between two primitives that touch, at most."""

SYMMETRIC, STRAY = 0.1, 0.01
"""How far the mirror image of a point of the surface may be from the surface, in cells; and the share of the points for
which it may be farther, and by which an edit may raise that share."""

LOOKED = 1_000
"""Points of the surface that are mirrored."""


class EditScores(NamedTuple):
    """What edits keep, each between 0 and 1; and the number of free numbers."""

    contacts: float
    symmetry: float
    one_piece: float
    free: int


def edit_scores(program: Program) -> EditScores:
    """The share of a program that survives changes of its free numbers, one at a time; see the module."""
    before = unroll(program)
    touching = _contacts(before)
    mirrored, one_solid = _mirrored(before), _one_piece(before)
    results: list[tuple[float, float, float]] = []
    free = free_numbers(program)
    for index, factor in product(range(free), FACTORS):
        try:
            after = unroll(multiplied(program, index, factor))
        except ShapeProgError:  # such as a division by zero
            results.append((0.0, 0.0, 0.0))
            continue
        results.append((
            len(touching & _contacts(after)) / len(touching) if touching else np.nan,
            float(_mirrored(after) >= mirrored - STRAY) if mirrored >= 1 - STRAY else np.nan,
            float(_one_piece(after)) if one_solid else np.nan,
        ))  # fmt: skip
    scores = np.array(results).reshape(-1, 3)
    contacts, symmetry, pieces_kept = (
        float(np.nanmean(column)) if np.isfinite(column).any() else float("nan") for column in scores.T
    )
    return EditScores(contacts, symmetry, pieces_kept, free)


def _contacts(scene: Scene) -> set[tuple[int, int]]:
    """Pairs of slots whose primitives touch."""
    try:
        return set(gaps(scene, TOUCHING))
    except ShapeProgError:  # a part lies too far away to be measured
        return set()


def _mirrored(scene: Scene) -> float:
    """The share of the surface whose mirror image lies on it."""
    try:
        points = sample_surface(scene, LOOKED, torch.Generator().manual_seed(0)).points.detach()
    except ShapeProgError:  # no primitives
        return 0.0
    image = points.clone()
    image[:, SIDE] *= -1
    return float((signed_distance(scene, image).abs() <= SYMMETRIC).double().mean())


def _one_piece(scene: Scene) -> bool:
    try:
        return pieces(*union_mesh(scene)) == 1
    except ShapeProgError:  # nothing has a volume
        return False
