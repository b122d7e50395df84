"""Blocks of whole numbers, as the search moves them, as programs in the statements of the paper."""

from __future__ import annotations

import numpy as np

from shapeprog.inference.cells.block_kernels import BACK, BOX, COUNT1, COUNT2, DISC, FIRST, FORM, SHIFT1, SHIFT2, TILT
from shapeprog.inference.roles.roles import roles_of_blocks
from shapeprog.language.program import Chain, Draw, Loop, Program, nest
from shapeprog.space import FloatArray

FORMS = {BOX: "locker", BACK: "back", DISC: "support_cylinder"}
"""Statements of the paper that draw the forms."""

BOXES = {
    "seat": "top_rectangle", "top": "top_rectangle", "cushion": "top_rectangle", "mattress": "top_rectangle",
    "shelf": "layer", "base": "base_square", "leg": "leg", "foot": "leg", "post": "leg", "brace": "leg",
    "pedestal": "support_cuboid",
    "back": "back", "slat": "back_support", "arm_post": "chair_beam", "arm": "chair_beam", "rail": "chair_beam",
    "side": "sideboard", "panel": "vertical_board", "door": "vertical_board", "drawer": "vertical_board",
    "headboard": "vertical_board", "footboard": "vertical_board", "apron": "horizontal_bar",
    "stretcher": "horizontal_bar", "handle": "horizontal_bar",
}  # fmt: skip
"""Statement of the paper that draws a box with each role; others are lockers, which are any box."""

DISCS = {"seat": "top_circle", "top": "top_circle", "shelf": "top_circle", "base": "base_circle", "foot": "base_circle"}
"""The same for an upright cylinder; others are supports."""

CORNER = {
    "top_rectangle": "horizontal_bar", "layer": "horizontal_bar", "base_square": "horizontal_bar",
    "support_cuboid": "leg", "sideboard": "vertical_board",
}  # fmt: skip
"""What draws the same as a statement given by its middle, which is on the grid for even numbers of cells alone."""


def to_program(blocks: FloatArray) -> Program:
    """The program of blocks (K, 16), largest part first, every part named by its role."""
    if not len(blocks):
        return Program()
    tidied = np.stack([tidy(block) for block in blocks])
    tidied = tidied[np.argsort([-_cells(block) for block in tidied], kind="stable")]
    roles = roles_of_blocks(Program(tuple(_node(block, FORMS[int(block[FORM])]) for block in tidied)))
    return Program(tuple(_node(block, _name(block, role)) for block, role in zip(tidied, roles, strict=True)))


def _name(block: FloatArray, role: str) -> str:
    """The statement of the paper that draws a block with a role."""
    form = int(block[FORM])
    table = {BOX: BOXES, DISC: DISCS}.get(form, {})
    return table.get(role, FORMS[form])


def tidy(block: FloatArray) -> FloatArray:
    """The same cells with loops that run upwards, to the rear and to the left, the longer one inside.

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
            block[shift : shift + 3] = -step
    block += 0.0  # turns -0.0 into 0.0, which prints better
    if block[COUNT1] > 1 and block[COUNT1] >= block[COUNT2] > 1:
        block[COUNT1 : COUNT1 + 8] = np.concatenate([block[COUNT2 : COUNT2 + 4], block[COUNT1 : COUNT1 + 4]])
    return block


def _cells(block: FloatArray) -> float:
    values = block[FIRST : FIRST + 7]
    copies = block[COUNT1] * block[COUNT2]
    if int(block[FORM]) in (BOX, BACK):
        return float(values[3:6].prod() * copies)
    return float(3.14 * values[3] * values[4] ** 2 * copies)


def _node(block: FloatArray, name: str) -> Draw | Loop:
    form, values = int(block[FORM]), block[FIRST : FIRST + 7]
    low, (up, depth, side) = values[:3], values[3:6]
    middle = [low[0], low[1] + depth / 2, low[2] + side / 2, up, depth / 2]
    even, square = depth % 2 == side % 2 == 0, depth == side
    if form != BOX:
        numbers = list(values[: 7 if form == BACK else 5])
    elif name == "top_rectangle" and even and square:
        name, numbers = "top_square", middle
    elif name in ("top_rectangle", "layer") and even:
        numbers = [*middle, side / 2]
    elif name in ("base_square", "support_cuboid") and even and square:
        numbers = middle
    elif name == "sideboard" and depth % 2 == 0:
        numbers = [low[0], middle[1], low[2], up, depth / 2, side]
    else:
        name = CORNER.get(name, name)
        numbers = [*low, up, depth, side, *((0.0,) if name == "back" else ())]
    chain: Chain = (*_loops(block), Draw(name, tuple(float(number) for number in numbers)))
    return nest(chain)


def _loops(block: FloatArray) -> list[Loop]:
    loops = []
    for count, shift in ((COUNT1, SHIFT1), (COUNT2, SHIFT2)):
        if block[count] > 1:
            loops.append(Loop("translate", (float(block[count]), *map(float, block[shift : shift + 3])), ()))
    return loops
