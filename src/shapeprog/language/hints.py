"""How solids start from an oriented box: values of a statement whose solid about fills the box.

Each takes a :class:`Box` and yields none, one or several lists of values; what fits best is for others to find.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from shapeprog.space import DEPTH, SIDE, UP, FloatArray

STRAIGHT = 0.9986  # cosine from which a direction counts as that of an axis: three degrees
ROUND = 0.75  # least ratio of the sides of a section that may be round
SOFT = 0.5  # least radius in cells of an edge that differs visibly from a sharp one
STEEPEST = 45.0  # degrees up to which a board is tilted

AXES = np.eye(3)  # of the grid

BULGE = (0.15, 0.9)
"""Height of an arc as a share of the half length of its chord, from and to which a flat box may hold one."""


class Box(NamedTuple):
    """A box: centre (3,), axes as the columns of a proper rotation (3, 3), half extents (3,), in cells."""

    centre: FloatArray
    rotation: FloatArray
    half: FloatArray


def never(box: Box) -> Iterator[list[float]]:
    """No box: the statement is not for inference."""
    return iter(())


def upright_box(box: Box) -> Iterator[list[float]]:
    """Low corner and extents, of a box along the axes of the grid."""
    if (np.abs(box.rotation).max(0) >= STRAIGHT).all():
        half = np.abs(box.rotation) @ box.half
        yield [*(box.centre - half), *(2 * half)]


def tilted_board(box: Box) -> Iterator[list[float]]:
    """Low corner, extents and tilt, of a box turned about the left-right axis."""
    across = int(np.abs(box.rotation[SIDE]).argmax())
    sides = [axis for axis in range(3) if axis != across]
    rising = max(sides, key=lambda axis: abs(box.rotation[UP, axis]))
    flat = 3 - across - rising
    along = box.rotation[:, rising] * np.sign(box.rotation[UP, rising])
    tilt = np.degrees(np.arctan2(along[DEPTH], along[UP]))
    if abs(box.rotation[SIDE, across]) < STRAIGHT or not 180 / np.pi * 0.05 < abs(tilt) <= STEEPEST:
        return
    half = np.array([box.half[rising], box.half[flat], box.half[across]])
    back = np.array([-along[DEPTH], along[UP], 0.0])
    corner = box.centre - half[0] * along - half[1] * back - half[2] * AXES[SIDE]
    yield [*corner, *(2 * half), tilt]


def level_ends(box: Box) -> Iterator[list[float]]:
    """Low corner, extents and shift of the top, of a box turned about the left-right axis, with level ends inside."""
    for *_, length, thickness, width, tilt in tilted_board(box):
        angle = np.radians(tilt)
        depth = thickness / np.cos(angle)
        height = length * np.cos(angle) - thickness * abs(np.sin(angle))
        if height > 0:
            lean = height * np.tan(angle)
            yield [*(box.centre - np.array([height, depth + lean, width]) / 2), height, depth, width, lean]


def straight_bar(box: Box) -> Iterator[list[float]]:
    """Two ends, section and turn, of a box along its longest side."""
    yield bar_along(box, int(box.half.argmax()))


def bar_along(box: Box, long: int) -> list[float]:
    """Two ends, section and turn, of a box along one of its axes."""
    start, end = _ends(box, long)
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    main = int(np.abs(along).argmax())
    along = along * np.sign(along[main])
    first, second = (_leaned(along, main, axis) for axis in range(3) if axis != main)
    sides = [axis for axis in range(3) if axis != long]
    nearest = max(sides, key=lambda axis: abs(box.rotation[:, axis] @ first))
    far = 3 - long - nearest
    x, y = box.rotation[:, nearest] @ first, box.rotation[:, nearest] @ second
    turn = np.degrees(np.arctan2(y * np.sign(x), abs(x))) * (-1 if main == DEPTH else 1)
    return [*start, *end, 2 * box.half[nearest], 2 * box.half[far], float(turn)]


def upright_cylinder(box: Box) -> Iterator[list[float]]:
    """Centre of the bottom face, height and radius, of a box with a square section across the vertical axis."""
    rising = int(np.abs(box.rotation[UP]).argmax())
    height, radius = float(2 * box.half[rising]), _radius(box, rising)
    if abs(box.rotation[UP, rising]) >= STRAIGHT and radius:
        up, depth, side = box.centre.tolist()
        yield [up - height / 2, depth, side, height, radius]


def straight_rod(box: Box) -> Iterator[list[float]]:
    """Two ends and radius, of a long box with a square section."""
    long = int(box.half.argmax())
    radius = _radius(box, long)
    if radius:
        start, end = _ends(box, long)
        yield [*start, *end, radius]


def tapered_rod(box: Box) -> Iterator[list[float]]:
    """Two ends and a radius at each, thinner at one end, at the other or nowhere, of a long box of square section."""
    long = int(box.half.argmax())
    radius = _radius(box, long)
    if radius:
        start, end = _ends(box, long)
        yield [*start, *end, 0.6 * radius, radius]
        yield [*start, *end, radius, 0.6 * radius]


def bent(box: Box) -> Iterator[list[float]]:
    """Ends, a point between them and radius, of an arc in a flat box, bulging to either side."""
    thin, middle, long = (int(axis) for axis in np.argsort(box.half, kind="stable"))
    radius = box.half[thin]
    sagitta = 2 * (box.half[middle] - radius)
    if not BULGE[0] <= sagitta / box.half[long] <= 2 * BULGE[1] or radius > 0.5 * box.half[middle]:
        return
    start, end = _ends(box, long)
    for sign in (-1, 1):
        bulge = sign * (box.half[middle] - radius) * box.rotation[:, middle]
        yield [*(start - bulge), *(box.centre + bulge), *(end - bulge), radius]


def rounded(box: Box) -> Iterator[list[float]]:
    """Low corner, extents and radius of the edges, of a box along the axes of the grid: round all the way, and half as
    much, where that differs from a sharp edge."""
    for values in upright_box(box):
        for share in (0.5, 0.25):
            if share * min(values[3:]) >= SOFT:
                yield [*values, share * min(values[3:])]


def _leaned(along: FloatArray, main: int, axis: int) -> FloatArray:
    """A grid axis after the least rotation that brings the ``main`` one to a unit vector: as bars are leaned."""
    return AXES[axis] - along[axis] / (1 + along[main]) * (AXES[main] + along)


def _ends(box: Box, axis: int) -> tuple[FloatArray, FloatArray]:
    """Both ends of the middle line along an axis: the lower first, else that in front, else that on the left."""
    along = box.half[axis] * box.rotation[:, axis]
    sign = next((math.copysign(1, value) for value in np.round(along, 3).tolist() if value), 1.0)
    return box.centre - sign * along, box.centre + sign * along


def _radius(box: Box, axis: int) -> float:
    """Radius of the section across an axis; none where it is not nearly square."""
    small, large = sorted(box.half[across] for across in range(3) if across != axis)
    return float((small + large) / 2) if small >= ROUND * large else 0.0
