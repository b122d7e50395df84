"""Details: small boxes put onto finished shapes, as rails, posts, panels and blocks of real furniture are.

Templates are tidy; what is found in the world has more on it.  Each detail touches what is there and stays within the
box that the shape fills.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.data.synthetic.dice import Dice, Flag, Whole
from shapeprog.data.synthetic.draft import Draft
from shapeprog.data.synthetic.room import mirrored
from shapeprog.geometry.cells import Cells
from shapeprog.language.tensors import Code
from shapeprog.space import DEPTH, HALF, RESOLUTION, SIDE, UP

MOST = 4
"""Most details of one shape."""


def details(dice: Dice, canvas: Cells) -> Code:
    """Up to ``MOST`` blocks for each shape of a batch, each touching its cells.

    Parameters
    ----------
    dice
        As many rows as there are shapes.
    canvas
        What the shapes draw: packed cells (n, 32, 32).
    """
    draft = Draft(dice)
    low, high = _bounds(canvas)
    many = dice.whole(1, MOST)
    for number, cell in enumerate(_cells(dice, canvas, MOST)):
        _detail(draft, cell, low, high, number < many)
    return draft.code()


def _detail(draft: Draft, cell: Float[Tensor, "n 3"], low: Tensor, high: Tensor, here: Flag) -> None:
    dice = draft.dice
    bar, rail, post, front, side, chunk = dice.kind(0.28, 0.18, 0.17, 0.16, 0.13, 0.08)
    thin = [dice.pick(1, 2, 3, weights=(0.6, 0.3, 0.1)) for _ in range(2)]
    long, other = dice.whole(3, 14), dice.whole(3, 10)
    wanted = (
        torch.where(bar | rail, thin[0], torch.where(post, long, torch.where(chunk, dice.whole(2, 6), other))),
        torch.where(rail | side, long, torch.where(bar | post, thin[1], torch.where(chunk, dice.whole(2, 6), thin[0]))),
        torch.where(bar | front, long, torch.where(rail | post, thin[1], torch.where(chunk, other, thin[0]))),
    )
    # Furniture is alike on the left and on the right, but for a few parts.
    alike = dice.chance(0.9)
    covers = alike & ((bar | front) | (chunk & dice.chance(0.3)))
    start: list[Whole] = []
    size: list[Whole] = []
    for axis, length in enumerate(wanted):
        if axis == SIDE:
            length = torch.where(covers, 2 * torch.maximum(-cell[:, axis], cell[:, axis] + 1), length)
        length = torch.minimum(length, high[:, axis] - low[:, axis])
        place = cell[:, axis] - torch.floor(dice.uniform() * (length + 1))  # beside the cell, or over it
        if axis == SIDE:
            place = torch.where(covers, -length / 2, place)
        start.append(torch.minimum(torch.maximum(place, low[:, axis]), high[:, axis] - length))
        size.append(length)
    corner, extent = (start[UP], start[DEPTH], start[SIDE]), (size[UP], size[DEPTH], size[SIDE])
    apart = (corner[SIDE] >= 0) | (corner[SIDE] + extent[SIDE] <= 0)
    twice = mirrored(corner, extent)
    # The copy of a part on the right is on the left: loops begin there.
    left = torch.minimum(corner[SIDE], corner[SIDE] + twice[1][2])
    pair = apart & alike
    corner = (corner[UP], corner[DEPTH], torch.where(pair, left, corner[SIDE]))
    copies = (torch.where(pair, 2.0, 1.0), (0, 0, -2 * left - extent[SIDE]))
    roles = {"horizontal_bar": bar | rail, "leg": post, "vertical_board": front, "locker": chunk, "side": side}
    draft.box(roles, corner, extent, keep=here, repeat=[copies])


def _cells(dice: Dice, canvas: Cells, many: int) -> list[Float[Tensor, "n 3"]]:
    """The low corners of ``many`` drawn cells of each shape, drawn at random by rows."""
    rows = canvas.flatten(1)
    drawn = (rows != 0).cumsum(-1, dtype=torch.int32)
    key = torch.stack([dice.uniform() for _ in range(many)], -1)
    place = torch.searchsorted(drawn, (key * drawn[:, -1:]).floor().int() + 1).clamp(max=rows.shape[1] - 1)
    bits = (rows.gather(1, place)[..., None] >> torch.arange(RESOLUTION, device=rows.device)) & 1
    filled = bits.cumsum(-1)
    key = torch.stack([dice.uniform() for _ in range(many)], -1)[..., None]
    side = torch.searchsorted(filled, (key * filled[..., -1:]).floor().long() + 1)[..., 0].clamp(max=RESOLUTION - 1)
    cells = torch.stack([place // RESOLUTION, place % RESOLUTION, side], -1).float() - HALF
    return list(cells.unbind(1))


def _bounds(canvas: Cells) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]]:
    """Low and high corner of the cells of each shape."""
    bits = canvas.flatten(1)
    while bits.shape[1] > 1:  # halves are combined: torch has no reduction by "or"
        bits = bits[:, ::2] | bits[:, 1::2]
    bits = bits[:, 0]
    along_side = (bits[:, None] >> torch.arange(RESOLUTION, device=bits.device)) & 1
    lows, highs = [], []
    for drawn in ((canvas != 0).any(2), (canvas != 0).any(1), along_side.bool()):
        lows.append(drawn.int().argmax(-1))
        highs.append(RESOLUTION - drawn.flip(-1).int().argmax(-1))
    return torch.stack(lows, -1).float() - HALF, torch.stack(highs, -1).float() - HALF
