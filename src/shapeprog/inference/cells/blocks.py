"""Blocks of whole numbers, as the search moves them, as programs in the statements of the paper."""

from __future__ import annotations

import numpy as np

from shapeprog.inference.cells.block_kernels import BACK, BOX, COUNT1, COUNT2, DISC, EXTENT, FIRST, FORM, TILT
from shapeprog.inference.roles.roles import roles_of_blocks
from shapeprog.language.program import Draw, Loop, Node, Program, nest
from shapeprog.language.statement import language
from shapeprog.space import DEPTH, SIDE, FloatArray

FORMS = {BOX: "locker", BACK: "back", DISC: "support_cylinder"}  # statements of the paper that draw the forms

BOXES = {
    "seat": "top_square", "top": "top_square", "cushion": "top_square", "mattress": "top_square",
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

CENTRED = {
    "top_square": "top_rectangle", "top_rectangle": "horizontal_bar", "layer": "horizontal_bar",
    "base_square": "horizontal_bar", "support_cuboid": "leg", "sideboard": "vertical_board",
}  # fmt: skip
"""What draws the same as a statement given by its middle, which is on the grid for even numbers of cells alone."""


def to_program(blocks: FloatArray) -> Program:
    """The program of blocks (K, 16), largest part first, every part named by its role."""
    tidied = sorted(map(tidy, blocks), key=_cells, reverse=True)
    roles = roles_of_blocks(Program(tuple(map(_node, tidied))))
    return Program(tuple(map(_node, tidied, roles)))


def tidy(block: FloatArray) -> FloatArray:
    """The same cells with loops that run upwards, to the rear and to the left, the longer one inside.

    A sheared box without shear becomes a box, which may then take any name.
    """
    block = block.copy()
    if int(block[FORM]) == BACK and block[TILT] == 0:
        block[FORM] = BOX
    for loop in (COUNT1, COUNT2):
        step = block[loop + 1 : loop + 4]
        moving = np.flatnonzero(step)
        if block[loop] <= 1 or not len(moving):
            block[loop], step[:] = 1, 0
        elif step[moving[0]] < 0:
            block[FIRST : FIRST + 3] += (block[loop] - 1) * step
            step *= -1
    block += 0.0  # turns -0.0 into 0.0, which prints better
    if block[COUNT1] > 1 and block[COUNT1] >= block[COUNT2] > 1:
        block[COUNT1:] = np.roll(block[COUNT1:], COUNT2 - COUNT1)
    return block


def _cells(block: FloatArray) -> float:
    """About how many cells a block covers."""
    extents, copies = block[EXTENT : EXTENT + 3], block[COUNT1] * block[COUNT2]
    one = 3.14 * extents[0] * extents[1] ** 2 if int(block[FORM]) == DISC else extents.prod()
    return float(one * copies)


def _node(block: FloatArray, role: str = "") -> Node:
    """The statement of the paper that draws a block with a role, and its loops."""
    form, numbers = int(block[FORM]), block[FIRST:COUNT1].copy()
    name = {BOX: BOXES, DISC: DISCS}.get(form, {}).get(role, FORMS[form])
    at, size = np.split(numbers, [3, 6])[:2]
    while name in CENTRED:
        axes = [DEPTH] if name == "sideboard" else [DEPTH, SIDE]
        is_square = language()[name].size == 5  # one number for width and depth
        if (size[axes] % 2 == 0).all() and (size[DEPTH] == size[SIDE] or not is_square):
            size[axes] /= 2
            at[axes] += size[axes]
            break
        name = CENTRED[name]
    loops = (Loop("translate", tuple(block[k : k + 4].tolist()), ()) for k in (COUNT1, COUNT2) if block[k] > 1)
    return nest((*loops, Draw(name, tuple(numbers[: language()[name].size].tolist()))))
