"""Drawings of oriented boxes by statements, and blocks that draw nearly the same with fewer or other numbers."""

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
from shapeprog.language.hints import Box, bar_along
from shapeprog.language.parameters import Parameter, to_float32
from shapeprog.language.printer import numbers_written
from shapeprog.language.program import Draw, Node, Program, nest
from shapeprog.language.statement import END, Statement, language
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll
from shapeprog.space import HALF, SIDE, UP, Array, FloatArray


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
    fields = [tensor.numpy() for tensor in (scene.centre, scene.rotation, scene.bounds)]
    return [list(map(Box, *(field[row, mask] for field in fields))) for row, mask in enumerate(scene.mask.numpy())]


def simplest(program: Program) -> Program:
    """The program, of one node for each block, drawn by the statements with the fewest numbers, of those with a hint
    that draw the same solid; blocks whose statement has a pivot or does not draw exactly one solid are unchanged."""
    plain = []
    for draw, solids in zip(program.draws, solid_boxes(program.draws), strict=True):
        declared = language()[draw.name]
        same = [] if len(solids) != 1 or declared.pivot is not None else _drawing_the_same(draw, drawings(solids[0]))
        if not same or is_unhinted(declared):  # those of the paper are written as a solid with a role
            same.append(draw)
        plain.append(min(same, key=numbers_written))
    return redrawn_by(program, plain)


def canonical_side(program: Program) -> Program:
    """The program, of one node for each block, where parts whose only loops are mirrors about the middle of the shape
    are drawn on the left and at the rear, if their statement can."""
    draws = program.draws
    for index, ((*loops, _), solids) in enumerate(zip(program.chains, solid_boxes(draws), strict=True)):
        if len(solids) != 1 or any(loop.name != "mirror" for loop in loops):
            continue
        (box,), sign = solids, np.ones(3)
        for _, axis, offset in (loop.values for loop in loops):
            if offset == 0 and box.centre[int(axis)] < 0:
                sign[int(axis)] = -1
        if (sign < 0).any():
            turn = sign[:, None] * box.rotation * [1, 1, sign.prod()]  # a box is its own image along its last axis
            images = drawings(Box(sign * box.centre, turn, box.half), draws[index].name)
            draws[index] = next(iter(_drawing_the_same(draws[index], images, sign.tolist())), draws[index])
    return redrawn_by(program, draws)


def between_ends(program: Program) -> Program:
    """The program, of one node for each block, with boxes for boards and bars that are nearly upright, and bars between
    the middles of their ends for boards that lean.

    A board is given by its lower edge and its angle; its upper edge is not linear in these numbers, so nothing could be
    tied to it.  A panel that leans sideways is a bar upwards, without a turn about itself.
    """
    return redrawn_by(program, map(_between_ends, program.draws))


def _between_ends(draw: Draw) -> Draw:
    if draw.name not in ("board", "bar"):
        return draw
    name, values = draw.name, [*draw.values]
    ((box,),) = solid_boxes([draw])
    main = np.abs(box.rotation).argmax(0)  # the axes of the grid that its own run along most
    off = box.half * np.linalg.norm(np.where(main == np.arange(3)[:, None], 0.0, box.rotation), axis=0)
    rising, side = (int(np.abs(box.rotation[axis]).argmax()) for axis in (UP, SIDE))
    if off.max() < SETTINGS.upright and len({*main}) == 3:
        half = box.half[np.argsort(main)]
        name, values = "box", [*(box.centre - half), *(2 * half)]
    elif abs(values[-1]) < SETTINGS.leaning:
        return draw
    elif name == "bar":
        upwards = bar_along(box, rising)
        if box.half[rising] > box.half.min() and abs(upwards[-1]) < SETTINGS.leaning:
            values = [*upwards[:-1], 0.0]
    elif abs(box.centre[SIDE]) <= SETTINGS.board_off or 2 * box.half[side] <= SETTINGS.board_wide:
        long = int(np.where(np.arange(3) == side, 0.0, box.half).argmax())
        name, values = "bar", [*bar_along(box, long)[:-1], 0.0]
    return Draw(name, tuple(map(to_float32, values)), draw.role)


def redrawn_by(program: Program, draws: Iterable[Draw]) -> Program:
    """The program, one node for each block, with other drawing statements inside its loops."""
    return Program(tuple(nest((*chain[:-1], draw)) for chain, draw in zip(program.chains, draws, strict=True)))


def _drawing_the_same(draw: Draw, options: Sequence[Draw], sign: Sequence[float] = (1, 1, 1)) -> list[Draw]:
    """Those options that draw the same solid as a statement, or its mirror image by signs of the coordinates; with its
    role."""
    (scene,) = scene_of([draw])
    sample = sample_surface(scene, SETTINGS.points, torch.Generator().manual_seed(0))
    limit = min(SETTINGS.equal_distance, SETTINGS.equal_share * float(scene.bounds[scene.mask].min()))
    off = signed_distance(scene_of(options), sample.points * torch.tensor(sign)).abs().amax(-1)
    return [replace(option, role=draw.role) for option, far in zip(options, off.tolist(), strict=True) if far < limit]
