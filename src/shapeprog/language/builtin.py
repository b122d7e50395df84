"""The 18 drawing statements and two loops of Tian et al. (ICLR 2019), ids and parameter order as published."""

from __future__ import annotations

import torch
from torch import Tensor

from shapeprog.geometry.batch import Solids
from shapeprog.language.parameters import Count, Extent, Half, Length, Position, Radius, Shift, Shift3, Turn
from shapeprog.language.shapes import bar, box, cuboid, disc, slab
from shapeprog.language.statement import Motion, loop, statement

CELL_CENTRE = 0.5
"""Ends of a line name cells, not boundaries: the centre of cell c lies half a cell above its boundary."""

ARM_HALF_WIDTH = 1.0
"""Half width in cells of one arm of a cross base, which is always two cells wide."""


@statement("leg", id=1, paper=("Leg", "Cub"))
def leg(at: Position, size: Extent) -> Solids:
    """A leg: a post from its low corner and its full extents."""
    return box(at, size)


@statement("top_rectangle", id=2, paper=("Top", "Rec"))
def top_rectangle(at: Position, thickness: Length, half: Half) -> Solids:
    """A rectangular top or seat on the centre of its bottom face."""
    return slab(at, thickness, half[..., 0], half[..., 1])


@statement("top_square", id=3, paper=("Top", "Square"))
def top_square(at: Position, thickness: Length, half: Radius) -> Solids:
    """A square top or seat on the centre of its bottom face."""
    return slab(at, thickness, half, half)


@statement("top_circle", id=4, paper=("Top", "Circle"))
def top_circle(at: Position, thickness: Length, radius: Radius) -> Solids:
    """A round top or seat on the centre of its bottom face."""
    return disc(at, thickness, radius)


@statement("layer", id=5, paper=("Layer", "Rec"))
def layer(at: Position, thickness: Length, half: Half) -> Solids:
    """A rectangular shelf or layer on the centre of its bottom face."""
    return slab(at, thickness, half[..., 0], half[..., 1])


@statement("support_cylinder", id=6, paper=("Sup", "Cylinder"))
def support_cylinder(at: Position, height: Length, radius: Radius) -> Solids:
    """A round central support on the centre of its bottom face."""
    return disc(at, height, radius)


@statement("support_cuboid", id=7, paper=("Sup", "Cub"))
def support_cuboid(at: Position, height: Length, half: Radius) -> Solids:
    """A square central support on the centre of its bottom face."""
    return slab(at, height, half, half)


@statement("base_circle", id=8, paper=("Base", "Circle"))
def base_circle(at: Position, thickness: Length, radius: Radius) -> Solids:
    """A round base plate on the centre of its bottom face."""
    return disc(at, thickness, radius)


@statement("base_square", id=9, paper=("Base", "Square"))
def base_square(at: Position, thickness: Length, half: Radius) -> Solids:
    """A square base plate on the centre of its bottom face."""
    return slab(at, thickness, half, half)


@statement("base_cross", id=10, paper=("Base", "Line"), pivot=lambda at, **_: at, quarter=True)
def base_cross(at: Position, thickness: Length, length: Length, turn: Turn) -> Solids:
    """One arm of a cross base, two cells wide, from the hub in the direction of its quarter turn."""
    quarter = turn.long() % 4
    depth = torch.tensor([0, 1, 0, -1], device=at.device).to(at)[quarter]
    side = torch.tensor([-1, 0, 1, 0], device=at.device).to(at)[quarter]
    reach = torch.stack([thickness / 2, depth * length / 2, side * length / 2], -1)
    half_depth = depth.abs() * length / 2 + side.abs() * ARM_HALF_WIDTH
    half_side = side.abs() * length / 2 + depth.abs() * ARM_HALF_WIDTH
    return cuboid(at + reach, torch.stack([thickness / 2, half_depth, half_side], -1))


@statement("sideboard", id=11, paper=("Sideboard", "Cub"))
def sideboard(at: Position, height: Length, half_depth: Length, width: Length) -> Solids:
    """A side board: centred in depth, from its left face to the right."""
    centre = torch.stack([at[..., 0] + height / 2, at[..., 1], at[..., 2] + width / 2], -1)
    return cuboid(centre, torch.stack([height / 2, half_depth, width / 2], -1))


@statement("horizontal_bar", id=12, paper=("Hori_Bar", "Cub"))
def horizontal_bar(at: Position, size: Extent) -> Solids:
    """A horizontal bar from its low corner and its full extents."""
    return box(at, size)


@statement("vertical_board", id=13, paper=("Vert_Board", "Cub"))
def vertical_board(at: Position, size: Extent) -> Solids:
    """A vertical board from its low corner and its full extents."""
    return box(at, size)


@statement("locker", id=14, paper=("Locker", "Cub"))
def locker(at: Position, size: Extent) -> Solids:
    """A locker, drawer or solid body from its low corner and its full extents."""
    return box(at, size)


@statement("back", id=15, paper=("Back", "Cub"))
def back(at: Position, size: Extent, tilt: Shift) -> Solids:
    """A back: a board whose top is shifted to the rear by ``tilt`` cells (a shear, not a rotation)."""
    shift = torch.stack([torch.zeros_like(tilt), tilt / 2, torch.zeros_like(tilt)], -1)
    return cuboid(at + size / 2 + shift, size / 2, lean=tilt)


@statement("chair_beam", id=16, paper=("Chair_Beam", "Cub"))
def chair_beam(at: Position, size: Extent) -> Solids:
    """A beam of an arm rest or a back from its low corner and its full extents."""
    return box(at, size)


@statement("line", id=17, paper=("Connect", "Line"), pivot=lambda start, **_: start + CELL_CENTRE)
def line(start: Position, end: Position, radius: Radius) -> Solids:
    """A round bar between the centres of two cells, with flat caps."""
    return bar(start + CELL_CENTRE, end + CELL_CENTRE, radius)


@statement("back_support", id=18, paper=("Back_sup", "Cub"))
def back_support(at: Position, size: Extent) -> Solids:
    """A support that carries a back, from its low corner and its full extents."""
    return box(at, size)


@loop("translate", id=19, paper=("Trans", "u"))
def translate(copy: Tensor, quarter: Tensor, count: Count, by: Shift3) -> Motion:
    """Repeats what is inside ``count`` times, copy i moved by i times ``by``."""
    return Motion(shift=copy[..., None] * by)


@loop("rotate", id=20, paper=("Rot", "step"))
def rotate(copy: Tensor, quarter: Tensor, count: Count, step: Turn) -> Motion:
    """Repeats what is inside ``count`` times around a vertical axis: a line about its start, a cross arm about its hub
    in quarter turns of ``step``, everything else about the axis of the grid, spread evenly over the circle."""
    return Motion(turn=torch.where(quarter, copy * step / 4, copy / count.clamp(min=1)))
