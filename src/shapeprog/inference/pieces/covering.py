"""Which of many boxes explain a surface together: a first guess, by greed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.pieces.cover_kernels import near_boxes
from shapeprog.inference.pieces.oriented import Boxes
from shapeprog.inference.surface.cloud import Cloud
from shapeprog.space import FloatArray

COUNT = 5000
"""Points of the surface that are looked at."""

NEAR = 0.2
"""Distance in cells from the surface of a box within which it explains a point."""

UNSEEN = 0.6
"""Price of a box's surface where no point is, against that of explained points."""

FILLED = 0.35
"""Share of the surface of a solid near which there are points, at least: the box around a chair is mostly air."""

CHOSEN = 40
"""Boxes chosen, at most."""

LEAST = 4
"""Points that another box must explain beyond its price."""


class Support:
    """What each of some boxes explains of a surface.

    Parameters
    ----------
    near
        Points that it explains (B, N), of those looked at.
    fill
        Share of its own surface (B,) near which there are points.
    filled
        Whether that share is large enough (B,) for a solid.
    value
        Points that it explains, less the price (B,) of the surface where none are.
    """

    def __init__(self, cloud: Cloud, boxes: Boxes) -> None:
        every = -(-len(cloud.points) // COUNT)
        points = np.ascontiguousarray(cloud.points[::every])
        self.near = np.zeros((len(boxes.half), len(points)), np.bool_)
        self.fill = np.zeros(len(boxes.half))
        near_boxes(points, *map(np.ascontiguousarray, boxes), max(NEAR, 2 * cloud.noise), self.near, self.fill)
        self.filled = self.fill >= FILLED
        self.price = UNSEEN * boxes.area() * (1 - self.fill) / (cloud.spacing**2 * every)
        self.value: FloatArray = self.near.sum(1) - self.price

    def cover(self) -> npt.NDArray[np.int64]:
        """The boxes that greed chooses among those that are filled, best first."""
        left, chosen = np.ones(self.near.shape[1], np.bool_), list[int]()
        while len(chosen) < min(CHOSEN, len(self.fill)):
            gain = np.where(self.filled, self.near[:, left].sum(1) - self.price, 0)
            best = int(gain.argmax())
            if gain[best] < LEAST:
                break
            chosen.append(best)
            left &= ~self.near[best]
        return np.array(chosen, np.int64)
