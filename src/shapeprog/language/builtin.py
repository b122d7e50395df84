"""The 18 drawing statements and two loops of Tian et al. (ICLR 2019), ids and parameter order as published."""

from __future__ import annotations

from shapeprog.geometry.batch import Solids
from shapeprog.language.parameters import Count, Extent, Half, Length, Position, Radius, Shift, Shift3, Turn
from shapeprog.language.shapes import bar, box, cuboid, disc, leaning_box, slab
from shapeprog.language.statement import Motion, loop, statement
from shapeprog.lazy_torch import Tensor, torch

CELL_CENTRE = 0.5  # ends of a line name cells, not boundaries: the centre lies half a cell above the boundary
ARM_HALF_WIDTH = 1.0  # in cells, of one arm of a cross base, which is always two cells wide


def _box(at: Position, size: Extent) -> Solids:
    """from its low corner and its full extents."""
    return box(at, size)


def _rectangle(at: Position, thickness: Length, half: Half) -> Solids:
    """on the centre of its bottom face."""
    return slab(at, thickness, half[..., 0], half[..., 1])


def _square(at: Position, thickness: Length, half: Radius) -> Solids:
    """on the centre of its bottom face."""
    return slab(at, thickness, half, half)


def _round(at: Position, thickness: Length, radius: Radius) -> Solids:
    """on the centre of its bottom face."""
    return disc(at, thickness, radius)


# statements that differ in their name alone; the docstring of the function gives their position
for _id, _name, _draw, _what in (
    (1, "leg", _box, "A leg: a post"),
    (2, "top_rectangle", _rectangle, "A rectangular top or seat"),
    (3, "top_square", _square, "A square top or seat"),
    (4, "top_circle", _round, "A round top or seat"),
    (5, "layer", _rectangle, "A rectangular shelf or layer"),
    (8, "base_circle", _round, "A round base plate"),
    (9, "base_square", _square, "A square base plate"),
    (12, "horizontal_bar", _box, "A horizontal bar"),
    (13, "vertical_board", _box, "A vertical board"),
    (14, "locker", _box, "A locker, drawer or solid body"),
    (16, "chair_beam", _box, "A beam of an arm rest or a back"),
    (18, "back_support", _box, "A support that carries a back,"),
):
    statement(_name, id=_id, doc=f"{_what} {_draw.__doc__}")(_draw)


@statement("support_cylinder", id=6)
def support_cylinder(at: Position, height: Length, radius: Radius) -> Solids:
    """A round central support on the centre of its bottom face."""
    return disc(at, height, radius)


@statement("support_cuboid", id=7)
def support_cuboid(at: Position, height: Length, half: Radius) -> Solids:
    """A square central support on the centre of its bottom face."""
    return slab(at, height, half, half)


@statement("base_cross", id=10, pivot=lambda at, **_: at, quarter=True)
def base_cross(at: Position, thickness: Length, length: Length, turn: Turn) -> Solids:
    """One arm of a cross base, two cells wide, from the hub in the direction of its quarter turn."""
    quarter = turn.long() % 4
    depth = torch.tensor([0, 1, 0, -1], device=at.device).to(at)[quarter]
    side = torch.tensor([-1, 0, 1, 0], device=at.device).to(at)[quarter]
    reach = torch.stack([thickness / 2, depth * length / 2, side * length / 2], -1)
    half_depth = depth.abs() * length / 2 + side.abs() * ARM_HALF_WIDTH
    half_side = side.abs() * length / 2 + depth.abs() * ARM_HALF_WIDTH
    return cuboid(at + reach, torch.stack([thickness / 2, half_depth, half_side], -1))


@statement("sideboard", id=11)
def sideboard(at: Position, height: Length, half_depth: Length, width: Length) -> Solids:
    """A side board: centred in depth, from its left face to the right."""
    centre = torch.stack([at[..., 0] + height / 2, at[..., 1], at[..., 2] + width / 2], -1)
    return cuboid(centre, torch.stack([height / 2, half_depth, width / 2], -1))


@statement("back", id=15)
def back(at: Position, size: Extent, tilt: Shift) -> Solids:
    """A back: a board whose top is shifted to the rear by ``tilt`` cells (a shear, not a rotation)."""
    return leaning_box(at, size, tilt)


@statement("line", id=17, pivot=lambda start, **_: start + CELL_CENTRE)
def line(start: Position, end: Position, radius: Radius) -> Solids:
    """A round bar between the centres of two cells, with flat caps."""
    return bar(start + CELL_CENTRE, end + CELL_CENTRE, radius)


@loop("translate", id=19)
def translate(copy: Tensor, quarter: Tensor, count: Count, by: Shift3) -> Motion:
    """Repeats the body ``count`` times, copy i moved by i times ``by``."""
    return Motion(shift=copy[..., None] * by)


@loop("rotate", id=20)
def rotate(copy: Tensor, quarter: Tensor, count: Count, step: Turn) -> Motion:
    """Repeats the body ``count`` times around a vertical axis: a line about its start, a cross arm about its hub
    in quarter turns of ``step``, everything else about the axis of the grid, spread evenly over the circle."""
    return Motion(turn=torch.where(quarter, copy * step / 4, copy / count.clamp(min=1)))
