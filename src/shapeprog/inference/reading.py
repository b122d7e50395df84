"""Programs read as blocks of the structure search: the way back from :func:`shapeprog.inference.blocks.to_program`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch

from shapeprog.inference.block_layout import (
    BACK,
    BOX,
    COUNT1,
    COUNT2,
    CROSS,
    DISC,
    EXTENT,
    FIRST,
    FORM,
    LINE,
    RADIUS,
    ROTATE,
    TILT,
    WIDTH,
)
from shapeprog.language.program import Program
from shapeprog.language.statement import EMPTY, END, language
from shapeprog.language.tensors import Code, encode
from shapeprog.space import FloatArray

Words = npt.NDArray[np.int64]

FARTHEST = 64.0
"""Largest number of a block: twice the grid, so that drawing stays quick whatever was written."""

FORMS = {
    BOX: ("leg", "horizontal_bar", "vertical_board", "locker", "chair_beam", "back_support", "top_rectangle", "layer",
          "top_square", "support_cuboid", "base_square", "sideboard"),
    DISC: ("top_circle", "support_cylinder", "base_circle"),
    BACK: ("back",),
    LINE: ("line",),
    CROSS: ("base_cross",),
}  # fmt: skip

HALVES = {
    "top_rectangle": (4, 5), "layer": (4, 5), "top_square": (4, 4), "support_cuboid": (4, 4), "base_square": (4, 4),
    "sideboard": (4, None),
}  # fmt: skip
"""Slots of the half extents in depth and to the side, of boxes that are placed by their centre along that axis."""


def from_program(program: Program) -> FloatArray:
    """Blocks (K, 20) of whole numbers with the cells of ``program.snap()``; see :func:`from_code`."""
    return from_code(encode(program, dtype=torch.float64))


def from_code(code: Code) -> FloatArray:
    """Blocks (M, 20) of whole numbers with the cells of rounded blocks (..., K, J), in their order.

    Left out is what the layout has no words for: statements that users registered, more than two loops that shift,
    turns of anything but a line or a cross arm, or outside of another loop, turns of a cross arm by other than one
    quarter, and numbers beyond ``FARTHEST`` or not finite; and what draws nothing.
    """
    ids = code.ids.detach().cpu().reshape(-1, code.ids.shape[-1]).numpy()
    said = code.parameters.detach().cpu().double().reshape(*ids.shape, code.parameters.shape[-1]).numpy()
    finite = np.isfinite(said).all((1, 2))
    numbers = np.rint(np.where(finite[:, None, None], said, 0.0))
    rows = np.zeros((len(ids), WIDTH))
    rows[:, COUNT1] = rows[:, COUNT2] = 1
    turns, quarter = np.zeros(len(ids)), np.ones(len(ids))
    open_, sound = np.ones(len(ids), np.bool_), finite
    known = {each.name: each.id for each in language()}
    for j in range(ids.shape[1]):
        word, values = ids[:, j], numbers[:, j]
        sound &= open_ | (word == EMPTY) | (word == END)
        drawn = open_ & _write(rows, word, values, open_, known)
        shifts = open_ & (word == known.get("translate"))
        rotates = open_ & (word == known.get("rotate"))
        sound &= ~open_ | drawn | ((shifts | rotates) & (values[:, 0] >= 1) & (turns == 0))
        turns[rotates], quarter[rotates] = values[rotates, 0], values[rotates, 1] % 4
        moving = shifts & (values[:, 0] > 1) & values[:, 1:4].any(1)
        for count in (COUNT1, COUNT2):
            here = moving & (rows[:, count] == 1)
            rows[here, count : count + 4] = values[here, :4]
            moving &= ~here
        sound &= ~moving
        open_ &= ~drawn
    form = rows[:, FORM]
    sound &= ~open_ & _fits(form, turns, quarter) & _solid(rows) & (np.abs(rows).max(1, initial=0) <= FARTHEST)
    rows[:, ROTATE] = np.where(turns > 1, turns, 0)
    backwards = (form == CROSS) & (quarter == 3)  # the same arms from the other end
    rows[backwards, FIRST + 5] -= (turns - 1)[backwards]
    return rows[sound]


def _write(
    rows: FloatArray, word: Words, values: FloatArray, where: npt.NDArray[np.bool_], known: dict[str, int]
) -> npt.NDArray[np.bool_]:
    """Write form and numbers of the drawing statements; says which blocks hold one."""
    written = np.zeros(len(rows), np.bool_)
    for form, names in FORMS.items():
        for name in names:
            here = where & (word == known.get(name))
            if not here.any():
                continue
            mine = values[here]
            for axis, slot in zip((1, 2), HALVES.get(name, ()), strict=False):
                if slot is not None:
                    half = values[here, slot]
                    mine[:, axis] -= half
                    mine[:, 3 + axis] = 2 * half
            used = 6 if form == BOX else language()[name].size
            rows[here, FORM] = form
            rows[here, FIRST : FIRST + used] = mine[:, :used]
            written |= here
    return written


def _fits(form: FloatArray, turns: FloatArray, quarter: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether there is no turn, or the layout knows such a one."""
    known: npt.NDArray[np.bool_] = (form == LINE) | ((form == CROSS) & ((quarter == 1) | (quarter == 3)))
    return known | (turns == 0)


def _solid(rows: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether all lengths of each block are positive."""
    form = rows[:, FORM]
    box = (rows[:, EXTENT : EXTENT + 3] >= 1).all(1) & ((form == BOX) | (form == BACK))
    line = (rows[:, TILT] >= 1) & (form == LINE)
    disc = (rows[:, [EXTENT, RADIUS]] >= 1).all(1) & ((form == DISC) | (form == CROSS))
    solid: npt.NDArray[np.bool_] = box | line | disc
    return solid
