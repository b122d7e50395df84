"""Leaning boards as bars between the middles of their ends.

A board is given by its lower edge and its angle; its upper edge is not linear in these numbers, so nothing could be
tied to it.  A bar gives both ends.
"""

from __future__ import annotations

import math
from dataclasses import replace

from shapeprog.inference.ties.settings import TIES
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Draw, Loop, Node, Program


def between_ends(program: Program) -> Program:
    """The same parts, those that lean about the left-right axis as bars."""
    return Program(tuple(_between_ends(node) for node in program.body))


def _between_ends(node: Node) -> Node:
    if isinstance(node, Loop):
        return replace(node, body=tuple(_between_ends(inner) for inner in node.body))
    if node.name != "board" or abs(node.values[-1]) < TIES.leaning:
        return node
    up, depth, side, high, deep, wide, tilt = node.values
    if abs(side + wide / 2) > TIES.board_off and wide > TIES.board_wide:
        return node
    sin, cos = math.sin(math.radians(tilt)), math.cos(math.radians(tilt))
    upwards, backwards = (cos, sin), (-sin, cos)
    along, across, length, thick = (
        (upwards, backwards, high, deep) if high >= deep else (backwards, upwards, deep, high)
    )
    start = [coordinate + way * thick / 2 for coordinate, way in zip((up, depth), across, strict=True)]
    end = [coordinate + way * length for coordinate, way in zip(start, along, strict=True)]
    middle = side + wide / 2
    values = (*start, middle, *end, middle, thick, wide, 0.0)
    return Draw("bar", tuple(to_float32(value) for value in values), node.role)
