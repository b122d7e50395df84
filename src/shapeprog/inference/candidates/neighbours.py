"""Neighbours of a program: variants of its blocks, which are candidates of the next selection.

A complete program allows changes that single pieces do not: a block ends where the next begins, two halves of a board
are merged, a missing mirror image is added, and a run gets one more copy.  All changes apply to loops and to boxes
around drawings; the hints of the statements give the drawing of a changed box.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import torch
from scipy.spatial import cKDTree

from shapeprog.geometry.contacts import linked
from shapeprog.geometry.distance import signed_distance
from shapeprog.inference.candidates.drawings import drawings, solid_boxes
from shapeprog.inference.candidates.loops import images, mirror, mirrors, repeated, rows
from shapeprog.inference.candidates.settings import SETTINGS
from shapeprog.inference.fit.tunable import THINNEST
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.inference.surface.oriented import CORNERS, boxes_around
from shapeprog.language.hints import STRAIGHT, Box
from shapeprog.language.program import Chain, Loop, Node, Program, nest
from shapeprog.language.unroll import unroll
from shapeprog.space import DEPTH, SIDE, FloatArray


def neighbours(program: Program) -> list[Node]:
    """Variants of the blocks of a program, whose nodes are one block each, without duplicates and existing blocks."""
    chains = program.chains
    # What each block draws with all of its loops, without the outermost, and so on.
    inner = iter(solid_boxes([nest(chain[index:]) for chain in chains for index in range(len(chain))]))
    drawn = [[next(inner) for _ in chain] for chain in chains]
    block_boxes = [parts[0] for parts in drawn]
    boxes = [parts[-1][0] if len(parts[-1]) == 1 else None for parts in drawn]
    result: list[Node] = [*repeated([*program.draws, *program.body]), *rows(block_boxes)]
    for index, (chain, box) in enumerate(zip(chains, boxes, strict=True)):
        result += [*_unlooped(chain), *_mirrored(chain)]
        if box is not None:
            parts = [part for k, solids in enumerate(block_boxes) if k != index for part in solids]
            result += [nest((*chain[:-1], drawing)) for drawing in drawings(box)]
            edited = [box, *met(box, parts)]
            edited += [middle for candidate in edited for middle in centred(candidate)]
            result += [node for candidate in edited[1:] for node in redrawn(chain, candidate)]
            result += [*recounted(chain, [box], -1), *recounted(chain, [box], 1)]
            for level, solids in enumerate(drawn[index][:-1]):  # a board instead of a run
                result += [nest((*chain[:level], drawing)) for drawing in drawings(_around(solids[0], solids))]
    loops = [[(loop.name, loop.values[0]) for loop in chain[:-1]] for chain in chains]
    for (chain, box, around), (_, other, others) in itertools.combinations(zip(chains, boxes, loops, strict=True), 2):
        if box is not None and other is not None and around == others:
            for merged in _merged(box, other):
                result += [nest((*chain[:-1], drawing)) for drawing in drawings(merged)]
    existing = set(program.body)
    return [node for node in dict.fromkeys(result) if node not in existing]


def shorter(chain: Chain, boxes: Sequence[Box]) -> Iterator[Node]:
    """A block without one of its loops, rows of the copies that several loops draw, and the block centred from left to
    right; ``boxes`` are those around its solids."""
    yield from _unlooped(chain)
    if len(chain) > 2:
        yield from rows([[box] for box in solid_boxes([nest(chain)])[0]])
    for box in boxes if len(boxes) == 1 else ():
        for candidate in centred(box, SIDE):
            yield from redrawn(chain, candidate)


def redrawn(chain: Chain, box: Box) -> Iterator[Node]:
    """A block whose statement draws another box inside its loops; by all statements if its hint gives none."""
    for drawing in drawings(box, chain[-1].name) or drawings(box):
        yield nest((*chain[:-1], drawing))


def _unlooped(chain: Chain) -> Iterator[Node]:
    """A block without one of its loops."""
    for index in range(len(chain) - 1):
        yield nest((*chain[:index], *chain[index + 1 :]))


def _mirrored(chain: Chain) -> Iterator[Node]:
    """A block mirrored about the middle planes of the shape; and the same for the body of its first loop."""
    for axis in (SIDE, DEPTH):
        if not any(mirrors(node, axis) for node in chain):
            yield nest((mirror(axis), *chain))
            if len(chain) > 1:
                yield nest((mirror(axis), *chain[1:]))


def recounted(chain: Chain, boxes: Sequence[Box], more: int) -> Iterator[Node]:
    """A run with so many copies more, at its end or at its beginning, by all statements if its own has no hint;
    ``boxes`` are those around its solids."""
    for index, loop in enumerate(chain[:-1]):
        if isinstance(loop, Loop) and loop.name == "translate" and loop.count + more >= 2:
            values = float(loop.count + more), *loop.values[1:]
            changed = (*chain[:index], replace(loop, values=values), *chain[index + 1 :])
            yield nest(changed)
            for box in boxes[:1]:
                yield from redrawn(changed, box._replace(centre=box.centre - more * np.array(values[1:])))


def _merged(first: Box, second: Box) -> Iterator[Box]:
    """The box around two boxes that nearly touch, with the orientation of the larger."""
    first, second = sorted((first, second), key=lambda box: -float(box.half.prod()))
    apart = np.abs((second.centre - first.centre) @ first.rotation)
    if (apart <= first.half + _reach(first, second) + SETTINGS.gap).all():
        yield _around(first, [first, second])


def _around(frame: Box, parts: Sequence[Box]) -> Box:
    """The smallest box with the orientation of ``frame`` that contains all parts."""
    ends = [[part.centre @ frame.rotation + sign * _reach(frame, part) for part in parts] for sign in (-1, 1)]
    low, high = np.min(ends[0], 0), np.max(ends[1], 0)
    return Box(frame.rotation @ ((low + high) / 2), frame.rotation, (high - low) / 2)


def _reach(frame: Box, part: Box) -> FloatArray:
    """Half extents (3,) of a part along the axes of a box."""
    return np.abs(frame.rotation.T @ part.rotation) @ part.half


def met(
    box: Box, parts: Sequence[Box], within: Sequence[float] = (SETTINGS.within,), *, longer: bool = False
) -> Iterator[Box]:
    """A box with one face moved to where a line normal to the face, at its middle or near a corner, enters a part.

    ``within`` are the distances from the middle to the lines, as shares of those to the corners.  ``longer`` restricts
    the face to outward moves.
    """
    if not parts:
        return
    around = Box(*map(np.array, zip(*parts, strict=True)))  # all of them as arrays
    for axis in range(3):
        corners = CORNERS * box.half * (np.arange(3) != axis)
        offsets = np.concatenate([np.zeros((1, 3)), *(share * corners for share in within)])
        starts = box.centre + offsets @ box.rotation.T
        minimum = box.half[axis] if longer else -np.inf
        for sign in (-1.0, 1.0):
            along = sign * box.rotation[:, axis]
            ends = _crossed(starts, along, around)
            for end in sorted(ends[ends > minimum].tolist(), key=lambda end: abs(end - box.half[axis]))[:4]:
                length = (box.half[axis] + end) / 2
                if abs(end - box.half[axis]) <= SETTINGS.reach and length >= SETTINGS.shortest / 2:
                    half = np.where(np.arange(3) == axis, length, box.half)
                    yield Box(box.centre + (end - box.half[axis]) / 2 * along, box.rotation, half)


def centred(box: Box, *axes: int) -> Iterator[Box]:
    """Boxes centred on a middle plane of the shape, by default left to right or in depth, from a box that is slightly
    off it.  One of the two ends of the box stays."""
    for axis in axes or (SIDE, DEPTH):
        along = int(np.abs(box.rotation[axis]).argmax())
        off = abs(float(box.centre[axis]))
        near = SETTINGS.off_least < off < min(SETTINGS.off_most, box.half[along] / 2)
        if near and np.abs(box.rotation[axis, along]) >= STRAIGHT:
            centre = np.where(np.arange(3) == axis, 0, box.centre)
            for more in (-off, off):
                yield Box(centre, box.rotation, box.half + more * np.eye(3)[along])


def _crossed(starts: FloatArray, along: FloatArray, parts: Box) -> FloatArray:
    """Distances at which lines (L, 3) of one direction enter any of several boxes, and somewhat more for a joint."""
    at, step = (starts - parts.centre[:, None]) @ parts.rotation, (along @ parts.rotation)[:, None]
    step = np.where(np.abs(step) < 1e-9, 1e-9, step)
    half = parts.half[:, None]
    first, second = (-half - at) / step, (half - at) / step
    enters, leaves = np.minimum(first, second).max(-1), np.maximum(first, second).min(-1)
    return np.unique(np.minimum(enters + SETTINGS.into, leaves)[enters < leaves].round(2))


def residual_candidates(program: Program, evidence: Evidence) -> list[Node]:
    """Drawings of the boxes around clusters of visible points far from a program, and their mirror images."""
    tensor = torch.from_numpy(evidence.points)
    far = signed_distance(unroll(program), tensor).abs().numpy() > SETTINGS.far * evidence.tolerance
    points = evidence.points[far & (evidence.weights > evidence.weights.max() / 2)]
    reach = SETTINGS.cluster_reach * (evidence.area / len(evidence.points)) ** 0.5
    cluster = linked(cKDTree(points).query_pairs(reach, output_type="ndarray"), len(points))
    size = np.bincount(cluster)
    largest = np.argsort(-size, kind="stable")[: SETTINGS.clusters]
    around = boxes_around([points[cluster == label] for label in largest[size[largest] >= SETTINGS.cluster_points]])
    half = np.maximum(around.half, THINNEST / 2)
    nodes = [drawing for box in map(Box, around.centre, around.rotation, half) for drawing in drawings(box)]
    return [*nodes, *images(nodes, evidence.surface)]
