"""Which of many boxes explain a surface together: a greedy first estimate."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.pieces.cover_kernels import near_boxes
from shapeprog.inference.pieces.oriented import Boxes
from shapeprog.inference.surface.cloud import Cloud
from shapeprog.space import FloatArray

COUNT = 5000
"""Largest number of surface points that are tested."""

NEAR = 0.2
"""Distance in cells from the surface of a box within which it explains a point."""

UNSEEN = 0.6
"""Price of a box's surface where no point is, against that of explained points."""

FILLED = 0.35
"""Smallest share of the surface of a solid near which there are points: the box around a chair is mostly air."""

CHOSEN = 40
"""Largest number of selected boxes."""

LEAST = 4
"""Smallest gain of another box: points that it explains, minus its price."""


class Support:
    """Points of a surface that boxes explain.

    Parameters
    ----------
    explained
        Whether each box explains each tested point (B, N).
    fill
        Share of the surface of each box (B,) near which there are points.
    filled
        Whether that share is large enough (B,) for a solid.
    value
        Number of points that each box explains, minus the price (B,) of its surface without points.
    """

    def __init__(self, cloud: Cloud, boxes: Boxes) -> None:
        every = -(-len(cloud.points) // COUNT)
        points = np.ascontiguousarray(cloud.points[::every])
        self.explained = np.zeros((len(boxes.half), len(points)), np.bool_)
        self.fill = np.zeros(len(boxes.half))
        near_boxes(points, *map(np.ascontiguousarray, boxes), max(NEAR, 2 * cloud.noise), self.explained, self.fill)
        self.filled = self.fill >= FILLED
        self.price = UNSEEN * boxes.area() * (1 - self.fill) / (cloud.spacing**2 * every)
        self.value: FloatArray = self.explained.sum(1) - self.price

    def cover(self) -> npt.NDArray[np.int64]:
        """The filled boxes that a greedy selection takes, best first."""
        remaining, selected = np.ones(self.explained.shape[1], np.bool_), list[int]()
        while len(selected) < min(CHOSEN, len(self.fill)):
            gain = np.where(self.filled, self.explained[:, remaining].sum(1) - self.price, 0)
            best = int(gain.argmax())
            if gain[best] < LEAST:
                break
            selected.append(best)
            remaining &= ~self.explained[best]
        return np.array(selected, np.int64)
