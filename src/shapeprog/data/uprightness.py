"""Which way up a piece of furniture stands, from its cells: one of the six directions of its axes.

Furniture stands stably on a wide footprint, is a mirror image of itself from side to side but not from top to bottom,
and keeps large level faces where hands reach (Fu, Cohen-Or, Dror and Sheffer 2008).  Each direction is scored by a
weighted sum of such measures; the weights are those of a conditional logit (McFadden 1974), fitted to training shapes
by ``python -m benchmarks.uprightness``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.space import FloatArray, axis_name

WEIGHTS = {
    "height": 1.82,
    "bottom_area": -4.51,
    "bottom_span": 4.91,
    "balance": 2.81,
    "top_area": 2.25,
    "top_span": 2.45,
    "top_balance": -4.04,
    "seen_from_above": -3.87,
    "shown_above": -2.56,
    "seen_from_below": 5.68,
    "shown_below": -2.56,
    "level_below": 2.79,
    "mirrored": -2.60,
    "mirrored_beside": 2.12,
    "mirrored_across": 1.67,
}
"""Weights of the measures in the logarithm of the odds of a direction."""

USUAL = 0.5
"""Probability that the usual up of a format is right, before any measure."""

Cells = npt.NDArray[np.bool_]


class Upright(NamedTuple):
    """The axis of the world that is up, such as ``-z``, and its probability."""

    up: str
    probability: float


def find_up(
    cells: Cells, axes: FloatArray | None = None, *, usual: str | None = None, front: str | None = None
) -> Upright:
    """The likeliest up axis of a shape given as cells (R, R, R), not all empty.

    Parameters
    ----------
    axes
        World directions of the axes of the cells, as columns (3, 3); x, y and z by default.
    usual
        Up axis by convention, if there is one.
    front
        Where the front is, if that is known: up is along another axis.
    """
    turn = np.eye(3) if axes is None else axes
    names = [axis_name(sign * turn[:, axis]) for axis in range(3) for sign in (1, -1)]
    score = measures(cells) @ np.array(list(WEIGHTS.values()))
    if usual is not None:
        score += np.log([USUAL if name == usual else (1 - USUAL) / (len(names) - 1) for name in names])
    if front is not None:
        score[[name[-1] == front.strip()[-1:].lower() for name in names]] = -np.inf
    share = np.exp(score - score.max())
    best = int(share.argmax())
    return Upright(names[best], float(share[best] / share.sum()))


def measures(cells: Cells) -> FloatArray:
    """The measures of each of the six directions (6, M), in the order of ``WEIGHTS``: both ways along each axis."""
    occupied = np.argwhere(cells)
    low, high = occupied.min(0), occupied.max(0) + 1
    tight = cells[tuple(slice(a, b) for a, b in zip(low, high, strict=True))]
    mirrored = [float((tight & np.flip(tight, axis)).sum() / (tight | np.flip(tight, axis)).sum()) for axis in range(3)]
    rows = []
    for axis in range(3):
        symmetries = [mirrored[other] for other in range(3) if other != axis]
        for sign in (1, -1):
            standing = _standing(np.moveaxis(tight, axis, 0)[::sign])
            rows.append([*standing, mirrored[axis], max(symmetries), min(symmetries)])
    return np.array(rows)


def _standing(cells: Cells) -> list[float]:
    """Measures of cells (H, W, D) whose first layer is at the bottom."""
    area, middle = cells[0].size, np.argwhere(cells).mean(0)[1:] + 0.5
    values = [len(cells) / max(cells.shape)]
    for end in (cells[0], cells[-1]):
        touching = np.argwhere(end)
        first, last = touching.min(0), touching.max(0) + 1
        inside = np.minimum(middle - first, last - middle) / np.array(end.shape)
        values += [len(touching) / area, float((last - first).prod()) / area, float(inside.min())]
    padded = np.pad(cells, ((1, 1), (0, 0), (0, 0)))
    above = np.logical_or.accumulate(padded[2:][::-1], 0)[::-1]
    below = np.logical_or.accumulate(padded[:-2], 0)
    height = np.arange(0.5, len(cells))[:, None, None] / len(cells)
    for faces, hidden in ((cells & ~padded[2:], above), (cells & ~padded[:-2], below)):
        visible = faces & ~hidden
        values += [float((visible * height).sum() / visible.sum()), float(visible.sum() / faces.sum())]
    values.append(float((cells & ~padded[:-2]).sum((1, 2)).max()) / area)
    return values
