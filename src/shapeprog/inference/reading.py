"""Programs read as blocks of the structure search: the way back from :func:`shapeprog.inference.blocks.to_program`."""

from __future__ import annotations

import numpy as np

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
from shapeprog.language.program import Chain, Loop, Program
from shapeprog.space import FloatArray

FARTHEST = 64.0
"""Largest number of a block: twice the grid, so that drawing stays quick whatever was written."""

FORMS = {
    "top_circle": DISC, "support_cylinder": DISC, "base_circle": DISC,
    "back": BACK, "line": LINE, "base_cross": CROSS,
}  # fmt: skip
CORNERED = ("leg", "horizontal_bar", "vertical_board", "locker", "chair_beam", "back_support")
CENTRED = ("top_rectangle", "layer")
SQUARE = ("top_square", "support_cuboid", "base_square")


def from_program(program: Program) -> FloatArray:
    """Blocks (K, 20) of whole numbers with the cells of ``program.snap()``, in its order.

    Left out is what the layout has no words for: statements that users registered, more than two loops that shift,
    turns of anything but a line or a cross arm, or outside of another loop, turns of a cross arm by other than one
    quarter, and numbers beyond ``FARTHEST`` or not finite; and what draws nothing.
    """
    rows = [_row(chain) for chain in program.chains]
    kept = [row for row in rows if row is not None and np.abs(row).max() <= FARTHEST and _solid(row)]
    return np.stack(kept) if kept else np.zeros((0, WIDTH))


def _row(chain: Chain) -> FloatArray | None:
    if not all(np.isfinite(node.values).all() for node in chain):
        return None
    *loops, drawn = chain
    row = np.zeros(WIDTH)
    row[COUNT1] = row[COUNT2] = 1
    values = np.rint(drawn.values)
    row[FORM] = FORMS.get(drawn.name, BOX)
    if drawn.name in FORMS or drawn.name in CORNERED:
        row[FIRST : FIRST + len(values)] = values
    elif drawn.name in (*CENTRED, *SQUARE):
        half = values[4:6] if drawn.name in CENTRED else values[[4, 4]]
        row[FIRST:COUNT1] = [values[0], *(values[1:3] - half), values[3], *(2 * half), 0]
    elif drawn.name == "sideboard":
        row[FIRST:COUNT1] = [values[0], values[1] - values[4], *values[2:4], 2 * values[4], values[5], 0]
    else:
        return None
    for number, loop in enumerate(loops):
        assert isinstance(loop, Loop)
        innermost = number == len(loops) - 1
        if loop.name not in ("translate", "rotate") or not (_turn(row, loop, innermost) or _shift(row, loop)):
            return None
    return row


def _shift(row: FloatArray, loop: Loop) -> bool:
    """Write a loop that shifts, if there is room for it; one that changes no cell needs none."""
    if loop.name != "translate" or loop.count < 1:
        return False
    values = np.rint(loop.values)
    if loop.count == 1 or not values[1:4].any():
        return True
    for count in (COUNT1, COUNT2):
        if row[count] == 1:
            row[count : count + 4] = values
            return True
    return False


def _turn(row: FloatArray, loop: Loop, innermost: bool) -> bool:
    """Write a loop that turns, if the layout knows such a one."""
    form, count = int(row[FORM]), loop.count
    if loop.name != "rotate" or count < 1 or not innermost or form not in (LINE, CROSS):
        return False
    if form == CROSS:
        quarter = loop.values[1] % 4
        if quarter not in (1, 3):
            return False
        if quarter == 3:  # the same arms from the other end
            row[FIRST + 5] -= count - 1
    row[ROTATE] = count if count > 1 else 0
    return True


def _solid(row: FloatArray) -> bool:
    """Whether all lengths of a block are positive."""
    form = int(row[FORM])
    if form == LINE:
        return bool(row[TILT] >= 1)
    return bool((row[EXTENT : EXTENT + 3] >= 1).all() if form in (BOX, BACK) else (row[[EXTENT, RADIUS]] >= 1).all())
