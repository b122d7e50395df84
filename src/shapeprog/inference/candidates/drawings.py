"""Drawings of oriented boxes by statements, and equivalent blocks with fewer numbers or on another side."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import torch

from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.candidates.settings import SETTINGS
from shapeprog.language.hints import Box
from shapeprog.language.parameters import Parameter
from shapeprog.language.printer import numbers_written
from shapeprog.language.program import Draw, Loop, Node, Program, nest
from shapeprog.language.statement import END, Statement, language
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll
from shapeprog.space import HALF, Array, FloatArray


def is_unhinted(declared: Statement) -> bool:
    """Whether a drawing statement has no hint how it starts from a box; False for the statements of the paper."""
    return declared.hint is None and not declared.is_loop and declared.id > END


def drawings(box: Box, *names: str) -> list[Draw]:
    """The drawings of a box by the hints of these statements, by default of all; none by those without a hint."""
    statements = [language()[name] for name in names] or language()
    rows = [(declared.name, values) for declared in statements if declared.hint for values in declared.hint(box)]
    return [Draw(name, tuple(np.array(values, np.float32).tolist())) for name, values in rows]


def starts(declared: Statement, box: Box) -> list[Draw]:
    """Possible drawings of a box by a statement without a hint: evenly sampled combinations of parameter values."""
    options = [_options(parameter, box) for parameter in declared.parameters]
    count = math.prod(map(len, options))
    selected = np.unique(np.linspace(0, count - 1, min(count, SETTINGS.starts)).astype(np.int64))
    indices = np.unravel_index(selected, [len(values) for values in options])
    rows = np.concatenate([values[index] for values, index in zip(options, indices, strict=True)], 1)
    return [Draw(declared.name, tuple(row)) for row in rows.astype(np.float32).tolist()]


def _options(parameter: Parameter, box: Box) -> FloatArray:
    """Values (N, width) of a parameter: positions on the box, its extents or half of them; angles are zero."""
    quantity, reach = parameter.quantity, np.abs(box.rotation) @ box.half
    width, half = quantity.width, 1.0 if quantity.high == HALF else 2.0
    if parameter.default is not None:
        rows: Iterable[Array | Sequence[float]] = [[parameter.default]]
    elif quantity.kind == "position" and width == len(reach):
        along, below = box.half.max() * box.rotation[:, box.half.argmax()], reach * [1, 0, 0]
        rows = [box.centre + away for away in (np.zeros(3), -below, below, -reach, along, -along)]
    elif quantity.kind == "length" and width == len(reach):
        rows = [half * reach]
    elif quantity.kind in ("position", "length"):
        sizes = half * np.concatenate([reach, box.half, [SETTINGS.wall * box.half.min()]])
        rows = product(np.unique((box.centre if quantity.kind == "position" else sizes).round(3)), repeat=width)
    elif quantity.discrete:
        last = 3.0 if quantity.kind == "turn" else float(SETTINGS.counts)
        rows = [[float(n)] * width for n in range(max(round(quantity.low), 0), round(min(quantity.high, last)) + 1)]
    else:
        rows = [[0.0] * width]
    return np.unique(np.array(list(rows)).clip(quantity.low, quantity.high).round(3), axis=0)


def scene_of(nodes: Sequence[Node]) -> Scene:
    """The scenes (B, N) of blocks, each on its own, in double precision."""
    return unroll(encode([Program((node,)) for node in nodes], dtype=torch.float64))


def solid_boxes(nodes: Sequence[Node]) -> list[list[Box]]:
    """The boxes around all solids of each block."""
    scene = scene_of(nodes)
    centre, rotation, half = (tensor.numpy() for tensor in (scene.centre, scene.rotation, scene.bounds))
    return [
        [Box(centre[row, slot], rotation[row, slot], half[row, slot]) for slot in np.flatnonzero(mask)]
        for row, mask in enumerate(scene.mask.numpy())
    ]


def simplest(node: Node) -> Node:
    """The same block drawn by the statement with the fewest numbers, of those with a hint that draw the same solid.

    The block is unchanged if its statement has a pivot or draws several solids.
    """
    if isinstance(node, Loop):
        return Loop(node.name, node.values, tuple(simplest(inner) for inner in node.body))
    (boxes,) = solid_boxes([node])
    if len(boxes) != 1 or language()[node.name].pivot is not None:
        return node
    same = _drawing_the_same(drawings(boxes[0]), node, boxes[0], np.ones(3))
    if not same or is_unhinted(language()[node.name]):  # those of the paper are written as a solid with a role
        same.append(node)
    return min(same, key=numbers_written)


def canonical_side(node: Node) -> Node:
    """The same block, where parts mirrored about the middle of the shape are drawn on the left and at the rear.

    The block is unchanged if its statement cannot draw the mirror image, or if it has loops other than mirrors.
    """
    ((*loops, drawing),) = Program((node,)).chains
    assert isinstance(drawing, Draw)
    (boxes,) = solid_boxes([drawing])
    if len(boxes) != 1 or any(loop.name != "mirror" for loop in loops):
        return node
    (box,), signs = boxes, np.ones(3)
    for _, axis, offset in (loop.values for loop in loops):
        if offset == 0 and box.centre[int(axis)] < 0:
            signs[int(axis)] = -1
    if (signs > 0).all():
        return node
    turn = signs[:, None] * box.rotation * [1, 1, signs.prod()]  # a box is its own image along its last axis
    image = Box(signs * box.centre, turn, box.half)
    same = _drawing_the_same(drawings(image, drawing.name), drawing, image, signs)
    return nest((*loops, same[0])) if same else node


def _drawing_the_same(candidates: Sequence[Draw], node: Draw, box: Box, signs: FloatArray) -> list[Draw]:
    """The candidates that draw a node, or its mirror image by signs of the coordinates, in a box; with its role."""
    if not candidates:
        return []
    sample = sample_surface(scene_of([node]), SETTINGS.points, torch.Generator().manual_seed(0))
    points = sample.points.double() * torch.from_numpy(signs)
    limit = min(SETTINGS.equal_distance, SETTINGS.equal_share * box.half.min())
    off = signed_distance(scene_of(candidates), points.expand(len(candidates), -1, -1)).abs().amax(-1).tolist()
    return [replace(candidate, role=node.role) for candidate, far in zip(candidates, off, strict=True) if far < limit]
