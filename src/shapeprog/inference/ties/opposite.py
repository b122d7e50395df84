"""Pairs that lie opposite each other about a middle plane, as mirror images: they stay so whatever is changed."""

from __future__ import annotations

from dataclasses import replace

import torch

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.ties.features import axis_of
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Draw, Loop, Node, Program
from shapeprog.language.statement import language
from shapeprog.language.unroll import unroll
from shapeprog.space import DEPTH, SIDE

NEAR = 0.1
"""Cells by which the surface of a pair may move."""

LOOKED = 256
"""Points of the surface that are compared."""


def as_images(program: Program) -> Program:
    """The same parts within ``NEAR`` cells, two copies that are mirror images about a middle plane as a mirror."""
    return Program(tuple(_as_images(node) for node in program.body))


def _as_images(node: Node) -> Node:
    if isinstance(node, Draw):
        return node
    loop = replace(node, body=tuple(_as_images(inner) for inner in node.body))
    along = [axis for axis, shift in enumerate(loop.values[1:]) if shift] if loop.name == "translate" else []
    if loop.count != 2 or len(loop.body) != 1 or along not in ([DEPTH], [SIDE]):
        return loop
    (axis,) = along
    try:
        scene = unroll(Program((loop,)))
        plane = float(scene.centre[:, axis].mean())
        moved = _moved(loop.body[0], axis, max(loop.values[1 + axis], 0.0) - plane)
        if abs(plane) > NEAR or moved is None:
            return loop
        found = Loop("mirror", (2.0, float(axis), 0.0), (moved,))
        points = sample_surface(scene, LOOKED, torch.Generator().manual_seed(0)).points
        away = float(signed_distance(unroll(Program((found,))), points).abs().max())
    except ShapeProgError:  # nothing is drawn, or too far away
        return loop
    return found if away <= NEAR else loop


def _moved(node: Node, axis: int, by: float) -> Node | None:
    """A part elsewhere along an axis; none where a loop around it does not let it move freely."""
    if isinstance(node, Loop):
        free = node.name == "translate" or (node.name == "mirror" and node.values[1] != axis)
        inner = [_moved(each, axis, by) for each in node.body] if free else [None]
        return None if None in inner else replace(node, body=tuple(inner))  # type: ignore[arg-type]
    values = list(node.values)
    for slot, quantity in enumerate(language()[node.name].quantities):
        if quantity.kind == "position" and axis_of(node, slot) == axis:
            values[slot] = to_float32(values[slot] + by)
    return replace(node, values=tuple(values))
