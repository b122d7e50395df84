"""Blocks of whole numbers, as the structure search moves them, and the programs they stand for."""

from __future__ import annotations

import numpy as np

from shapeprog.inference.block_layout import (
    BACK,
    BOX,
    COUNT1,
    COUNT2,
    CROSS,
    EXTENT,
    FIRST,
    FORM,
    LINE,
    ROTATE,
    SHIFT1,
    SHIFT2,
    TILT,
)  # fmt: skip
from shapeprog.inference.naming import look_around, name_of
from shapeprog.language.program import Chain, Draw, Loop, Program, nest
from shapeprog.space import FloatArray

CENTRED = ("top_rectangle", "layer")
CENTRED_SQUARE = ("top_square", "support_cuboid", "base_square")
CORNER = {"support_cuboid": "leg", "sideboard": "vertical_board"}
"""Statements for parts whose width in cells is odd: those with a centre can only be even on the grid.

Tops, layers and bases, which lie, become horizontal bars.
"""


def to_program(blocks: FloatArray) -> Program:
    """The program of blocks (K, 20), largest part first, every part named by what it does."""
    if not len(blocks):
        return Program()
    tidied = np.stack([tidy(block) for block in blocks])
    around = look_around(tidied)
    volume = [-_cells(block) for block in tidied]
    return Program(tuple(_node(tidied[k], name_of(tidied[k], around)) for k in np.argsort(volume, kind="stable")))


def tidy(block: FloatArray) -> FloatArray:
    """The same cells with loops that run upwards, to the rear and to the right, the longer one inside.

    A sheared box without shear becomes a box, which may then take any name.
    """
    block = block.copy()
    if int(block[FORM]) == BACK and block[TILT] == 0:
        block[FORM] = BOX
    for count, shift in ((COUNT1, SHIFT1), (COUNT2, SHIFT2)):
        step = block[shift : shift + 3]
        moving = np.flatnonzero(step)
        if block[count] <= 1 or not len(moving):
            block[count], block[shift : shift + 3] = 1, 0
        elif step[moving[0]] < 0:
            reach = (block[count] - 1) * step
            block[FIRST : FIRST + 3] += reach
            if int(block[FORM]) == LINE:
                block[EXTENT : EXTENT + 3] += reach
            block[shift : shift + 3] = -step
    block += 0.0  # turns -0.0 into 0.0, which prints better
    if block[COUNT1] > 1 and block[COUNT1] >= block[COUNT2] > 1:
        block[COUNT1 : COUNT1 + 8] = np.concatenate([block[COUNT2 : COUNT2 + 4], block[COUNT1 : COUNT1 + 4]])
    return block


def _cells(block: FloatArray) -> float:
    values = block[FIRST : FIRST + 7]
    copies = block[COUNT1] * block[COUNT2] * max(block[ROTATE], 1)
    if int(block[FORM]) in (BOX, BACK):
        return float(values[3:6].prod() * copies)
    if int(block[FORM]) == LINE:
        return float(3 * np.linalg.norm(values[3:6] - values[:3]) * values[6] ** 2 * copies)
    if int(block[FORM]) == CROSS:
        return float(2 * values[3] * values[4] * copies)
    return float(3.14 * values[3] * values[4] ** 2 * copies)


def _node(block: FloatArray, name: str) -> Draw | Loop:
    values = block[FIRST : FIRST + 7]
    low, (up, depth, side) = values[:3], values[3:6]
    even_depth, even_side = depth % 2 == 0, side % 2 == 0
    if int(block[FORM]) != BOX:
        length = {"line": 7, "back": 7, "base_cross": 6}.get(name, 5)
        numbers = list(values[:length])
    elif name in CENTRED and even_depth and even_side:
        numbers = [low[0], low[1] + depth / 2, low[2] + side / 2, up, depth / 2, side / 2]
    elif name in CENTRED_SQUARE and depth == side and even_depth:
        numbers = [low[0], low[1] + depth / 2, low[2] + side / 2, up, depth / 2]
    elif name == "sideboard" and even_depth:
        numbers = [low[0], low[1] + depth / 2, low[2], up, depth / 2, side]
    elif name == "back":
        numbers = [*low, up, depth, side, 0.0]
    else:
        if name in (*CENTRED, *CENTRED_SQUARE, "sideboard"):
            name = CORNER.get(name, "horizontal_bar")
        numbers = [*low, up, depth, side]
    chain: Chain = (*_loops(block), Draw(name, tuple(float(number) for number in numbers)))
    return nest(chain)


def _loops(block: FloatArray) -> list[Loop]:
    found = []
    for count, shift in ((COUNT1, SHIFT1), (COUNT2, SHIFT2)):
        if block[count] > 1:
            found.append(Loop("translate", (float(block[count]), *map(float, block[shift : shift + 3])), ()))
    if block[ROTATE] > 1:
        found.append(Loop("rotate", (float(block[ROTATE]), 1.0), ()))
    return found
