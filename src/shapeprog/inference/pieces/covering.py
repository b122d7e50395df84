"""Which of many boxes explain a surface together: a greedy first estimate."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.pieces.cover_kernels import near_boxes
from shapeprog.inference.pieces.oriented import Boxes
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.surface.cloud import Cloud
from shapeprog.space import FloatArray


class Support:
    """Points of a surface that boxes explain.

    Attributes
    ----------
    explained
        Whether each box explains each tested point (B, N).
    fill
        Share of the surface of each box (B,) near which there are points.
    filled
        Whether that share is large enough (B,) for a solid.
    price
        Price of the surface of each box without points (B,), in points.
    value
        Number of points that each box explains, minus its price (B,).
    """

    def __init__(self, cloud: Cloud, boxes: Boxes) -> None:
        every = -(-len(cloud.points) // SETTINGS.cover_points)
        points = np.ascontiguousarray(cloud.points[::every])
        self.explained = np.zeros((len(boxes.half), len(points)), np.bool_)
        self.fill = np.zeros(len(boxes.half))
        near_boxes(
            points,
            *map(np.ascontiguousarray, boxes),
            max(SETTINGS.cover_distance, 2 * cloud.noise),
            self.explained,
            self.fill,
        )
        self.filled = self.fill >= SETTINGS.cover_filled
        self.price = SETTINGS.cover_price * boxes.area() * (1 - self.fill) / (cloud.spacing**2 * every)
        self.value: FloatArray = self.explained.sum(1) - self.price

    def cover(self) -> npt.NDArray[np.int64]:
        """The filled boxes that a greedy selection takes, best first."""
        remaining, selected = np.ones(self.explained.shape[1], np.bool_), list[int]()
        counts = self.explained.sum(1)
        while len(selected) < min(SETTINGS.cover_boxes, len(self.fill)):
            gain = np.where(self.filled, counts - self.price, 0)
            best = int(gain.argmax())
            if gain[best] < SETTINGS.cover_gain:
                break
            selected.append(best)
            counts -= self.explained[:, remaining & self.explained[best]].sum(1)
            remaining &= ~self.explained[best]
        return np.array(selected, np.int64)
