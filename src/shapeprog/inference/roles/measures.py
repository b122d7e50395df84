"""Measures of the parts of a piece of furniture: their form, and their place among the others.

Every measure is an array with a value for each primitive of a scene, so that a rule reads as one expression and holds
for all of them at once.  Lengths and distances are compared with shares of the whole, never with cells.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.primitives import primitives
from shapeprog.geometry.primitives.arc import ARC
from shapeprog.geometry.scene import Scene
from shapeprog.space import DEPTH, SIDE, UP, FloatArray

Mask = npt.NDArray[np.bool_]


class Parts:
    """The parts of one scene, N of them, in its frame: up, depth (positive to the rear), left-right.

    The frame may be turned by so many quarters about up, for furniture that faces another way.

    The *main* surface is the seat, the table top or the mattress: the highest that covers at least half of what the
    widest level covers, or the whole where nothing does.  It may be several parts, as in a corner sofa.  A body is the
    main surface only where nothing lies.
    """

    def __init__(self, scene: Scene, turns: int = 0) -> None:
        self.turns, scene = turns, scene[scene.mask]
        half = scene.bounds.double().numpy()
        quarter = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # from depth to side
        turn = np.linalg.matrix_power(quarter, turns)
        centre, pose = scene.centre.double().numpy() @ turn.T, turn @ scene.rotation.double().numpy()
        self.block = scene.block.numpy()  # the block that drew each part
        self.count = len(half)
        reach = (np.abs(pose) @ half[..., None])[..., 0]
        self.low, self.high = centre - reach, centre + reach  # bounds (N, 3)
        self.bottom, self.top = self.low[:, UP], self.high[:, UP]
        self.size = self.high.max(0) - self.low.min(0)  # extents of the whole (3,)
        self.near = 0.04 * max(float(self.size.max()), 1e-6)  # what counts as near; a point has no size
        self.floor = float(self.bottom.min())  # height of the lowest point
        self._form(half, pose, (scene.kind == primitives.index(ARC)).numpy())
        self._main_surface()
        self._places()
        self._case()

    def _form(self, half: FloatArray, pose: FloatArray, bent: Mask) -> None:
        """Form of the parts; bent rods, whose boxes are nearly empty, are sticks and no plates."""
        every = np.arange(len(half))
        steep = np.abs(pose[:, UP])
        up = steep.argmax(1)
        deep = np.abs(pose[:, DEPTH])
        deep[every, up] = -1
        depth = deep.argmax(1)
        # Extents along the own axes that are nearest to these directions, and in order of size.
        self.up, self.depth, self.side = (2 * half[every, axis] for axis in (up, depth, 3 - up - depth))
        self.thin, self.middle, self.long = 2 * np.sort(half, 1).T
        self.face = self.depth * self.side  # area seen from above
        self.surface = 2 * (self.up * self.depth + self.depth * self.side + self.side * self.up)  # as that of a box
        self.rise = steep[every, half.argmax(1)]  # sine of the slope of the longest axis
        straight, square = steep[every, up] >= 0.75, np.sqrt(self.face)
        self.lying: Mask = (self.up <= 0.8 * square) & straight & ~bent  # the upper face is the larger one
        self.squat: Mask = (self.up <= 1.2 * square) & straight & ~bent  # a body not much higher than wide
        self.flat: Mask = (self.up <= 0.25 * square) & ~bent
        self.slender: Mask = (self.middle <= 0.3 * self.long) | bent
        self.upright: Mask = self.slender & (self.rise >= 0.75)
        self.level: Mask = self.slender & (self.rise <= 0.35)
        self.board: Mask = (self.thin <= 0.3 * self.middle) & ~bent
        self.frontal: Mask = self.board & (self.depth == self.thin)
        self.small: Mask = self.long <= 0.12 * self.size.max()
        self.tiny: Mask = self.up * self.side <= 0.012 * self.size[UP] * self.size[SIDE]  # seen from the front
        self.tiny &= self.depth <= self.size[DEPTH] / 4
        stubby = (self.depth <= self.size[DEPTH] / 4) & (self.side <= self.size[SIDE] / 4)
        self.stubby: Mask = stubby & (self.up >= np.maximum(self.depth, self.side))
        self.bulky: Mask = self.up * self.face >= 0.3 * max(float(self.size.prod()), 1e-9)
        sizes = np.round(np.stack([self.up, self.depth, self.side], 1) / self.near).astype(np.int64)
        _, kind, copies = np.unique(sizes, axis=0, return_inverse=True, return_counts=True)
        self.equal = copies[kind.reshape(-1)]  # how many parts have about the same extents

    def _main_surface(self) -> None:
        """Which parts are the main surface, and its bounds (3,)."""
        first, last = self.low.min(0), self.high.max(0)
        alike = np.abs(self.top[:, None] - self.top) <= self.near
        area = np.where(self.lying, self.face, 0)
        cover = alike @ area  # how much is covered by what lies at about the height of each part
        middle = (self.low + self.high - first - last) / 2
        central, together = (
            (off[:, DEPTH] <= 0.15 * self.size[DEPTH]) & (np.abs(off[:, SIDE]) <= self.size[SIDE] / 4)
            for off in (middle, alike @ (area[:, None] * middle) / np.maximum(cover, 1e-9)[:, None])
        )
        fitting = self.lying & central
        if not fitting.any():  # the seat of a corner sofa is several parts
            fitting = self.lying & together
        if not fitting.any():  # an upholstered seat that reaches the floor
            cover = self.face
            fitting = self.squat & central & (self.top <= self.floor + 0.75 * self.size[UP])
            fitting &= self.face >= self.size[DEPTH] * self.size[SIDE] / 2
        plate = fitting & (self.bottom <= self.floor + self.near)
        raised = fitting & ~plate
        if self.face[raised].max(initial=0) >= 0.2 * self.face[plate].max(initial=0):
            fitting = raised  # the plate under a column is no seat
        self.main: Mask = np.zeros(self.count, bool)
        self.main_low, self.main_high = first, last
        if fitting.any():
            able = fitting & (cover >= cover[fitting].max() / 2)
            level = (self.lying | fitting) & (np.abs(self.top - self.top[able].max()) <= self.near)
            self.main = level & (self.face >= 0.3 * self.face[level].max())  # with all slats of a seat
            self.main_low, self.main_high = self.low[self.main].min(0), self.high[self.main].max(0)

    def _places(self) -> None:
        """Where the parts are from the main surface."""
        extent = np.maximum(self.main_high - self.main_low, self.near)
        away = ((self.low + self.high) - (self.main_low + self.main_high)) / 2 / extent
        share = (self.high - self.low) / extent
        # From its middle to the rear, and to either side: .5 at its edges.
        self.rear, self.aside = away[:, DEPTH], np.abs(away[:, SIDE])
        self.run, self.span = share[:, DEPTH], share[:, SIDE]  # extents as shares of those of the main surface
        bottom, top = float(self.main_low[UP]), float(self.main_high[UP])
        middle = (self.bottom + self.top) / 2
        self.grounded: Mask = self.bottom <= self.floor + 1.5 * self.near
        self.wide: Mask = self.lying & (self.face >= 0.3 * extent[DEPTH] * extent[SIDE])
        self.alongside: Mask = (middle >= bottom) & (self.top <= top + 2 * self.near)
        self.below: Mask = ~self.main & (middle < bottom)
        self.rising: Mask = (self.top >= top + 2 * self.near) | (middle >= top)  # it ends clearly above
        self.highest: Mask = self.top >= self.floor + self.size[UP] - self.near
        self.central: Mask = (np.abs(self.rear) <= 0.15) & (self.aside <= 0.15)
        self.behind: Mask = (self.rear > 0.1) & (self.aside < 0.3)
        across = (self.frontal & ~self.slender) | (self.level & (self.up > 2 * self.depth))
        self.head_or_foot: Mask = across & (self.span >= 0.5)  # a board across the head or foot of a bed
        self.outermost: Mask = self.aside + self.span / 2 >= 0.4
        self.in_front: Mask = self.low[:, DEPTH] <= self.low[:, DEPTH].min() + 3 * self.near
        # Of the whole: something wide lies right under the main surface.
        self.padded = (self.wide & self.below & ~self.grounded & (self.top >= bottom - 1.5 * self.near)).any()

    def _case(self) -> None:
        """The sides and fronts of a case."""
        plate = self.wide & self.flat & (self.bottom <= self.floor + 0.2 * self.size[UP])
        self.lowest: Mask = plate & (self.bottom <= self.bottom[plate].min(initial=np.inf) + self.near)
        # Walls and fronts are boards by the way that they face; slender ones stand, and are half as wide or deep as the
        # whole.
        broad_sideways = ~self.slender | (self.upright & (self.depth >= self.size[DEPTH] / 2))
        self.wall: Mask = self.board & (self.side == self.thin) & broad_sideways
        sides = self.wall & self.outermost & (self.up >= self.size[UP] / 2)
        # Of the whole: its sides reach the floor; it has sides, or a body.
        self.walled = (sides & self.grounded).sum() > 1
        self.cased = np.bool_(sides.sum() > 1 or self.bulky.any())
        # In a case, or before a deep part that covers most of it (a drawer on a pedestal), or before such a front (its
        # handle)
        right_behind = np.abs(self.high[:, None, DEPTH] - self.low[:, DEPTH]) <= self.near / 2
        shared = np.minimum(self.high[:, None], self.high) - np.maximum(self.low[:, None], self.low)
        right_behind &= shared[..., UP].clip(0) * shared[..., SIDE].clip(0) >= 0.8 * (self.up * self.side)[:, None]
        deep = ~self.board & ~self.slender & (self.depth >= self.size[DEPTH] / 2)
        on_body = right_behind[:, deep].any(1)
        self.backed: Mask = self.cased | on_body | right_behind[:, on_body].any(1)
        broad_frontways = ~self.slender | (self.upright & (self.side >= self.size[SIDE] / 2))
        large = (self.up >= 0.1 * self.size[UP]) & (self.side >= 0.12 * self.size[SIDE]) & self.cased
        self.front: Mask = self.frontal & (broad_frontways | large)
