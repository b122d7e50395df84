"""Measures of the parts of a piece of furniture: their form, and their place among the others.

Every measure is an array with a value for each primitive of a scene, so that a rule reads as one expression and holds
for all of them at once.  Lengths and distances are compared with shares of the whole, never with cells.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.primitive import primitives
from shapeprog.geometry.scene import Scene
from shapeprog.space import DEPTH, SIDE, UP, FloatArray

Mask = npt.NDArray[np.bool_]

NEAR = 0.04
"""Share of the longest side of the whole within which heights are the same."""

FLAT = 0.8
"""What lies is at most so high, as a share of the side of a square as large as its upper face."""

STOOL, BENEATH = 1.2, 0.75
"""Where nothing lies, a body is the main surface that is at most so high, as such a share, and ends at most at this
share of the height of the whole: an upholstered seat that reaches the floor."""

PLATE = 0.25
"""A plate is at most so high, as such a share."""

UPWARD = 0.75
"""Least cosine between the vertical and the axis of a lying part that is nearest to it."""

SEATLIKE = 0.5
"""The main surface covers at least this share of what the widest level covers; it is the highest that does."""

REAR = 0.15
"""The middle of the main surface is at most this share of the depth to the rear of that of the whole."""

WIDE = 0.3
"""A wide part has at least this share of the upper face of the main surface."""

SLENDER = 0.3
"""The two short sides of something slender are at most this share of its length."""

THIN = 0.3
"""A board is at most this share of its second side thick."""

BULKY = 0.3
"""A body fills at least this share of the bounding box of the whole."""

SMALL = 0.12
"""A small part, such as a foot or a handle, is at most this share of the longest side of the whole long."""

LOWEST = 0.2
"""The bottom board of a case is at most at this share of its height."""

UPRIGHT, LEVEL = 0.75, 0.35
"""Sine of the slope from which a slender part stands, and up to which it lies."""


class Parts:
    """The parts of one scene, N of them, in its frame: up, depth (positive to the rear), left-right.

    The *main* surface is what one sits on, puts things on or lies on: the highest of those that cover most of the
    floor, or the whole where nothing does.

    ======================================== =========================================================================
    ``block``, ``count``                     the block that drew each part; how many parts there are
    ``up``, ``depth``, ``side``              extents along the part's own axes that are nearest to these directions
    ``thin``, ``middle``, ``long``           the same in order of size
    ``face``, ``surface``                    area seen from above; all of it, as that of a box
    ``rise``                                 sine of the slope of the longest axis
    ``lying``, ``flat``, ``wide``            its upper face is the larger one; and it is a plate; and large
    ``squat``                                a body that may be higher than it is wide, but not by much
    ``slender``, ``upright``, ``level``      a stick; that stands; that lies
    ``facing_front``, ``facing_side``        a board by the way that it faces
    ``small``, ``bulky``                     against the whole: its length; how much of it it fills
    ``equal``                                how many parts of about its size there are
    ``low``, ``high``, ``bottom``, ``top``   bounds (N, 3), and along up
    ``main``, ``main_low``, ``main_high``    which part is the main surface; its bounds (3,)
    ``rear``, ``aside``                      from its middle to the rear, and to either side, .5 at its edges
    ``run``, ``span``                        extents along depth and left-right, as shares of those of the main surface
    ``grounded``, ``below``, ``beside``      on the floor; under the main surface; at its height
    ``rising``, ``above``                    it ends clearly above the main surface; it begins there
    ``central``, ``behind``, ``outermost``   by place along depth and left-right
    ``in_front``, ``lowest``                 at the front of the whole; the lowest plate, near the floor
    ``cased``, ``on_pedestal``, ``padded``   of the whole: it has sides or a body; one column carries the main surface;
                                             something wide lies right under the main surface
    ``size``, ``floor``, ``near``            of the whole: extents (3,), height of its lowest point, what counts as near
    ======================================== =========================================================================
    """

    def __init__(self, scene: Scene) -> None:
        here = scene.mask.numpy()
        half = np.zeros((len(here), 3))
        for kind in scene.kinds:
            of_kind = scene.mask & (scene.kind == kind)
            half[of_kind.numpy()] = primitives[kind].bound(scene.size[of_kind].double()).numpy()
        half, pose = half[here], scene.rotation.double().numpy()[here]
        self.block = scene.block.numpy()[here]
        self.count = len(half)
        self._form(half, pose)
        self._whole(scene.centre.double().numpy()[here], (np.abs(pose) @ half[..., None])[..., 0])
        self._places()

    def _form(self, half: FloatArray, pose: FloatArray) -> None:
        """What the parts look like."""
        every = np.arange(len(half))
        steep = np.abs(pose[:, UP])
        up = steep.argmax(1)
        deep = np.abs(pose[:, DEPTH])
        deep[every, up] = -1
        depth = deep.argmax(1)
        self.up, self.depth, self.side = (2 * half[every, axis] for axis in (up, depth, 3 - up - depth))
        self.thin, self.middle, self.long = 2 * np.sort(half, 1).T
        self.face = self.depth * self.side
        self.surface = 2 * (self.up * self.depth + self.depth * self.side + self.side * self.up)
        self.rise = steep[every, half.argmax(1)]
        straight, square = steep[every, up] >= UPWARD, np.sqrt(self.face)
        self.lying: Mask = (self.up <= FLAT * square) & straight
        self.squat: Mask = (self.up <= STOOL * square) & straight
        self.flat: Mask = self.up <= PLATE * square
        self.slender: Mask = self.middle <= SLENDER * self.long
        self.upright: Mask = self.slender & (self.rise >= UPRIGHT)
        self.level: Mask = self.slender & (self.rise <= LEVEL)
        board = ~self.slender & (self.thin <= THIN * self.middle)
        self.facing_front: Mask = board & (self.depth == self.thin)
        self.facing_side: Mask = board & (self.side == self.thin)

    def _whole(self, centre: FloatArray, reach: FloatArray) -> None:
        """Where the parts are, and the main surface among them."""
        self.low, self.high = centre - reach, centre + reach
        self.bottom, self.top = self.low[:, UP], self.high[:, UP]
        first, last = self.low.min(0), self.high.max(0)
        self.size = last - first
        self.near = NEAR * max(float(self.size.max()), 1e-6)  # a point has no size
        self.floor = float(first[UP])
        off = centre - (first + last) / 2
        central = (off[:, DEPTH] <= REAR * self.size[DEPTH]) & (np.abs(off[:, SIDE]) <= self.size[SIDE] / 4)
        fitting, cover = self.lying & central, self._cover()
        if not fitting.any():
            cover = self.face
            fitting = self.squat & central & (self.top <= self.floor + BENEATH * self.size[UP])
            fitting &= self.face >= SEATLIKE * self.size[DEPTH] * self.size[SIDE]
        self.main: Mask = np.zeros(self.count, bool)
        self.main_low, self.main_high = first, last
        if fitting.any():
            able = np.flatnonzero(fitting & (cover >= SEATLIKE * cover[fitting].max()))
            chosen = able[self.top[able].argmax()]
            self.main[chosen] = True
            self.main_low, self.main_high = self.low[chosen], self.high[chosen]

    def _cover(self) -> FloatArray:
        """How much is covered by what lies at about the height of each part."""
        order = np.argsort(self.top, kind="stable")
        height = self.top[order]
        total = np.concatenate([[0], np.cumsum(np.where(self.lying, self.face, 0)[order])])
        cover = np.zeros(self.count)
        below, above = np.searchsorted(height, height - self.near), np.searchsorted(height, height + self.near, "right")
        cover[order] = total[above] - total[below]
        return cover

    def _places(self) -> None:
        """Where the parts are from the main surface."""
        extent = np.maximum(self.main_high - self.main_low, self.near)
        away = ((self.low + self.high) - (self.main_low + self.main_high)) / 2 / extent
        share = (self.high - self.low) / extent
        self.rear, self.aside = away[:, DEPTH], np.abs(away[:, SIDE])
        self.run, self.span = share[:, DEPTH], share[:, SIDE]
        bottom, top = float(self.main_low[UP]), float(self.main_high[UP])
        middle = (self.bottom + self.top) / 2
        self.grounded: Mask = self.bottom <= self.floor + 1.5 * self.near
        self.wide: Mask = self.lying & (self.face >= WIDE * extent[DEPTH] * extent[SIDE])
        self.beside: Mask = (middle >= bottom) & (self.top <= top + 2 * self.near)
        self.below: Mask = ~self.main & (middle < bottom)
        self.rising: Mask = (self.top >= top + 2 * self.near) | (middle >= top)
        self.above: Mask = self.bottom >= top - 2 * self.near
        self.small: Mask = self.long <= SMALL * self.size.max()
        self.bulky: Mask = self.up * self.face >= BULKY * self.size.prod()
        self.central: Mask = (np.abs(self.rear) <= 0.15) & (self.aside <= 0.15)
        self.behind: Mask = (self.rear > 0.1) & (self.aside < 0.3)
        self.outermost: Mask = self.aside + self.span / 2 >= 0.4
        self.in_front: Mask = self.low[:, DEPTH] <= self.low[:, DEPTH].min() + 3 * self.near
        plate = self.wide & self.flat & (self.bottom <= self.floor + LOWEST * self.size[UP])
        self.lowest: Mask = plate & (self.bottom <= self.bottom[plate].min(initial=np.inf) + self.near)

        sides = self.facing_side & self.outermost & (self.up >= self.size[UP] / 2)
        carrying = self.wide & self.below & ~self.grounded & (self.top >= bottom - 1.5 * self.near)
        column = self.below & self.central & self.upright
        self.cased: Mask = np.full(self.count, sides.sum() > 1 or self.bulky.any())
        self.padded: Mask = np.full(self.count, carrying.any())
        self.on_pedestal: Mask = np.full(self.count, column.any())

        sizes = np.round(np.stack([self.thin, self.middle, self.long], 1) / self.near).astype(np.int64)
        _, kind, copies = np.unique(sizes, axis=0, return_inverse=True, return_counts=True)
        self.equal = copies[kind.reshape(-1)]
