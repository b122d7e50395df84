"""Whether a program holds together when it is edited: each free number made a fifth larger, and a fifth smaller.

Contacts
    Share of the pairs of primitives that touch which still do.
Symmetry
    Whether a program that is its own mirror image, left for right, still is: the share of its surface whose image lies
    on it falls by 1 % or less.
One piece
    Whether a program that is one connected solid still is.
Names
    Whether a program that is one connected solid still is, and all of its parts are there, with .7 and with 1.4 of the
    value of a free name.

All are means, over the edits or over the names; symmetry, one piece and names are not a number where the program did
not have them to begin with.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace
from functools import cache
from itertools import count, product
from typing import NamedTuple

import numpy as np
import torch

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.mesh import manifold, part_meshes, pieces, union_mesh
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.ast import Function, Line, changed_lines, with_values
from shapeprog.language.dimensions import counted_names, is_count, uses
from shapeprog.language.evaluate import evaluated
from shapeprog.language.free import free_numbers, mapped
from shapeprog.language.named import names, set
from shapeprog.language.parameters import to_float32
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import SIDE

FACTORS = (1.2, 0.8)
"""What free numbers are multiplied by."""

OF_NAMES = (0.7, 1.4)
"""What free names are multiplied by."""

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
    names: float


def multiplied(program: Program, place: int, factor: float) -> Program:
    """The program with one of its free numbers multiplied; ``place`` counts them from 0.

    A ``ShapeProgError`` if that is no program, as when an expression then divides by zero.
    """
    source, counter = source_of(program), count()
    counted = counted_names(source)

    def change(number: float) -> float:
        return to_float32(number * factor) if next(counter) == place else number

    def changed(line: Line) -> Line:
        if isinstance(line, Function):
            return line
        return with_values(
            line, [use.value if is_count(use, counted) else mapped(use.value, change) for use in uses(line)]
        )

    return evaluated(replace(source, lines=changed_lines(source.lines, changed)))


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
        kept = len(touching & _contacts(after)) / max(len(touching), 1)
        results.append((kept, float(_mirrored(after) >= mirrored - STRAY), float(_one_piece(after))))
    applies = [len(touching) > 0, mirrored >= 1 - STRAY, one_solid]  # also where an edit fails
    scores = np.where(applies, np.array(results).reshape(-1, 3), np.nan)
    contacts, symmetry, pieces_kept = (
        float(np.nanmean(column)) if np.isfinite(column).any() else float("nan") for column in scores.T
    )
    names_kept = _names_kept(program, before) if one_solid else float("nan")
    return EditScores(contacts, symmetry, pieces_kept, free, names_kept)


def _names_kept(program: Program, before: Scene) -> float:
    kept = []
    for named in [named for named in names(program) if named.free]:
        try:
            values = [factor * named.value for factor in OF_NAMES]
            scenes = [unroll(set(program, {named.name: round(value) if named.whole else value})) for value in values]
        except ShapeProgError:  # such as a negative size
            kept.append(False)
            continue
        drawn = named.whole or all(scene.mask.sum() >= before.mask.sum() for scene in scenes)
        kept.append(drawn and all(map(_one_piece, scenes)))
    return float(np.mean(kept)) if kept else float("nan")


def _contacts(scene: Scene) -> Set[tuple[int, int]]:
    """Pairs of slots whose primitives touch."""
    try:
        return gaps(scene, TOUCHING).keys()
    except ShapeProgError:  # a part lies too far away to be measured
        return frozenset()


def gaps(scene: Scene, within: float) -> dict[tuple[int, int], float]:
    """The distance between primitives of one scene, for pairs of slots nearer than ``within``; 0 where they overlap."""
    parts = part_meshes(scene)
    if len(parts) < 2:
        return {}
    low, high = (np.array([corner(part.vertices, 0) for part in parts]) for corner in (np.min, np.max))
    straight = [bool(((p.vertices == a) | (p.vertices == b)).all()) for p, a, b in zip(parts, low, high, strict=True)]
    solid = cache(lambda index: manifold(parts[index].vertices, parts[index].faces))
    between = np.linalg.norm(np.maximum(low[:, None] - high, low - high[:, None]).clip(0), axis=-1)  # of the boxes
    results = {}
    for i, j in np.argwhere(np.triu(between <= within, 1)).tolist():
        gap = between[i, j] if straight[i] and straight[j] else solid(i).min_gap(solid(j), 2 * within)
        if gap < within:
            results[parts[i].slot, parts[j].slot] = float(gap)
    return results


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
