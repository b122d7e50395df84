"""Stacks: thin parts of a solid of cells, whatever their direction, as runs of small patches from slice to slice.

A leg that leans is a stair of cells.  Slices across it show one small patch each, a little aside of the one before;
a line through their middles is the leg.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import label

from shapeprog.inference.pieces.oriented import Boxes, join
from shapeprog.inference.pieces.patches import upright
from shapeprog.space import HALF, FloatArray

WIDEST = 5
"""Cells that a patch is wide at most, either way."""

LEAST = 4
"""Slices of the shortest stack."""

STRAIGHT = 0.8
"""Distance in cells of middles from their line, at most."""

Patch = tuple[FloatArray, FloatArray]
"""The middle of a patch and its extents, in cells."""


def stacks(voxels: npt.NDArray[np.bool_]) -> Boxes:
    """Boxes around the stacks of cells (R, R, R), the longest first; the first axis is that along which each runs."""
    found = [box for axis in range(3) for run in _runs(voxels, axis) if (box := _around(run, axis)) is not None]
    found.sort(key=lambda box: -float(box.half[0, 0]))
    return join(found)


def _runs(voxels: npt.NDArray[np.bool_], axis: int) -> list[list[Patch]]:
    """Patches that continue each other along an axis; a run ends where a patch is large, or meets two or none."""
    slices = np.moveaxis(voxels, axis, 0)
    done, open_runs, before = list[list[Patch]](), dict[int, list[Patch]](), np.zeros(slices.shape[1:], np.int32)
    for place, cells in enumerate(slices):
        name, count = label(cells)
        going = dict[int, list[Patch]]()
        meets = [np.unique(before[(name == each) & (before > 0)]) for each in range(1, count + 1)]
        follows = np.bincount(np.concatenate([np.zeros(1, int), *meets]), minlength=int(before.max()) + 1)
        for each, met in enumerate(meets, 1):
            inside = np.argwhere(name == each)
            width = np.ptp(inside, axis=0) + 1
            if (width > WIDEST).any():
                continue
            middle = np.insert(inside.mean(0), axis, place) + 0.5 - HALF
            run = open_runs.pop(int(met[0]), []) if len(met) == 1 and follows[met[0]] == 1 else []
            going[each] = [*run, (middle, np.insert(width.astype(np.float64), axis, 1.0))]
        done += open_runs.values()
        open_runs, before = going, name
    return [run for run in [*done, *open_runs.values()] if len(run) >= LEAST]


def _around(run: list[Patch], axis: int) -> Boxes | None:
    """The box along the line through the middles of a run; none where they are not on one, or it leans too far."""
    middles, widths = (np.stack(each) for each in zip(*run, strict=True))
    along = middles[:, axis]
    slope = [np.polyfit(along, middles[:, other], 1)[0] for other in range(3)]
    direction = np.array(slope) / np.linalg.norm(slope)
    centre = middles.mean(0)
    off = middles - centre
    aside = off - (off @ direction)[:, None] * direction
    if np.linalg.norm(aside, axis=1).max() > STRAIGHT or np.abs(direction[axis]) < np.sqrt(0.5):
        return None
    low, high = along.min() - 0.5, along.max() + 0.5
    centre = centre + ((low + high) / 2 - centre[axis]) * direction / direction[axis]
    frame = upright(direction[None])[0][:, [2, 0, 1]]
    half = np.abs(frame).T @ np.where(np.arange(3) == axis, 0.0, widths.mean(0)) / 2
    half[0] = (high - low) / 2 / abs(direction[axis])
    return Boxes(centre[None], frame[None], half[None])
