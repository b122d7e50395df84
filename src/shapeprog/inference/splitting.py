"""Splitting: the parts that a block was drawn in the place of, where gaps in the surface tell them apart.

Slats close to each other, or drawers in a row, are found as one board.  Where the surface has no point along a stretch
of the board in which there would be many if it went on, one part ends and the next begins.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from shapeprog.inference.candidates import alike, solid_boxes
from shapeprog.inference.evidence import Evidence
from shapeprog.inference.neighbours import drawing_of, with_drawing
from shapeprog.inference.repeating import repeated
from shapeprog.language.hints import Box
from shapeprog.language.program import Node, Program, nest
from shapeprog.space import FloatArray

NARROWEST = 0.3
"""Narrowest gap in cells."""

SURE = 12.0
"""Points that would lie in a gap, at least, if the faces went on there."""

MOST = 8
"""Most parts along one side of a box; what has more gaps is a surface with holes."""

SHORTEST = 0.3
"""Least length of a part in cells."""

FACING = 0.9
"""Least cosine between the normal of a point and that of the face it lies on."""

Span = tuple[float, float]


def split(program: Program, evidence: Evidence) -> list[Node]:
    """Parts in the place of blocks of a program, whose nodes are one block each; in runs where they are copies."""
    found: list[Node] = []
    chains = program.chains
    for chain, boxes in zip(chains, solid_boxes([chain[-1] for chain in chains]), strict=True):
        if len(boxes) == 1:
            for parts in divided(boxes[0], evidence):
                drawn = [draw for part in parts for draw in alike(drawing_of(chain), part)[:1]]
                found += [with_drawing(chain, draw) for draw in drawn]
                found += [nest((*chain[:-1], *run)) for run in Program(tuple(repeated(drawn))).chains]
    return list(dict.fromkeys(found))


def divided(box: Box, evidence: Evidence) -> Iterator[list[Box]]:
    """A box in parts along each of its axes that has gaps, and along two of them at once."""
    at = (evidence.surface - box.centre) @ box.rotation
    normals = evidence.surface_normals @ box.rotation
    cuts = [spans(box, axis, at, normals, evidence.reach) for axis in range(3)]
    several = [axis for axis in range(3) if len(cuts[axis]) > 1]
    for axes in [*itertools.combinations(several, 1), *itertools.combinations(several, 2)]:
        choices = [cuts[axis] if axis in axes else [(-box.half[axis], box.half[axis])] for axis in range(3)]
        yield [_part(box, np.array(ends)) for ends in itertools.product(*choices)]


def spans(box: Box, axis: int, at: FloatArray, normals: FloatArray, reach: float) -> list[Span]:
    """The stretches along one axis of a box between gaps in the faces beside that axis; none where these say little.

    Parameters
    ----------
    at, normals
        Points of the surface (Q, 3) and their normals (Q, 3), zero where unknown, as seen from the box.
    reach
        Distance from a face up to which points belong to it.
    """
    within = (np.abs(at) <= box.half + reach).all(1)
    at, normals = at[within], normals[within]
    unknown = (normals**2).sum(1) < 0.5
    near = np.zeros(len(at), np.bool_)
    for other in range(3):
        if other != axis:
            flat = unknown | (np.abs(normals[:, other]) >= FACING)
            near |= flat & (np.abs(np.abs(at[:, other]) - box.half[other]) <= reach)
    places = np.sort(at[near, axis])
    if not len(places):
        return []
    widest = max(NARROWEST, SURE * float(np.ptp(places)) / len(places))
    ends = np.flatnonzero(np.diff(places) >= widest)
    if not 1 <= len(ends) < MOST:
        return []
    bounds = np.concatenate(
        [[-box.half[axis]], np.stack([places[ends], places[ends + 1]], 1).ravel(), [box.half[axis]]]
    )
    found = [(float(low), float(high)) for low, high in bounds.reshape(-1, 2)]
    return found if min(high - low for low, high in found) >= SHORTEST else []


def _part(box: Box, ends: FloatArray) -> Box:
    """The part of a box between ends (3, 2) along its axes."""
    return Box(box.centre + box.rotation @ ends.mean(1), box.rotation, (ends[:, 1] - ends[:, 0]) / 2)
