"""Statements in addition to those of the paper: solids in any direction, the mirror loop, and roles.

A solid is the shape of a part, a role its purpose: ``leg(taper(...))``, ``arm(bent_rod(...))``.
"""

from __future__ import annotations

from shapeprog.geometry.batch import Solids
from shapeprog.language import hints, shapes
from shapeprog.language.parameters import (
    Angle,
    Axis,
    Count,
    Extent,
    Length,
    Pivot,
    Place,
    Position,
    Radii,
    Radius,
    Section,
    Shift,
    Two,
)  # fmt: skip
from shapeprog.language.statement import Motion, loop, role, statement
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import SIDE


@statement("box", id=64, taught=False, hint=hints.upright_box)
def box(at: Position, size: Extent) -> Solids:
    """An upright box from its low front right corner."""
    return shapes.box(at, size)


@statement("board", id=65, taught=False, hint=hints.tilted_board)
def board(at: Position, size: Extent, tilt: Angle) -> Solids:
    """A board from the low front right corner that it has upright, then leaned to the rear by ``tilt`` degrees
    about its bottom front edge."""
    return shapes.tilted_box(at, size, tilt)


@statement("bar", id=66, taught=False, hint=hints.straight_bar)
def bar(start: Position, end: Position, section: Section, turn: Angle = 0) -> Solids:  # type: ignore[assignment]
    """A straight bar between two points: the two sides of its section lie along the grid axes that it runs along least,
    in their order, and are turned about it by ``turn`` degrees."""
    return shapes.bar_between(start, end, section, turn)


@statement("cylinder", id=67, taught=False, hint=hints.upright_cylinder)
def cylinder(at: Position, height: Length, radius: Radius) -> Solids:
    """An upright cylinder on the centre of its bottom face."""
    return shapes.disc(at, height, radius)


@statement("rod", id=68, taught=False, hint=hints.straight_rod)
def rod(start: Position, end: Position, radius: Radius) -> Solids:
    """A round rod between two points, with flat ends."""
    return shapes.bar(start, end, radius)


@statement("taper", id=69, taught=False, hint=hints.tapered_rod)
def taper(start: Position, end: Position, radius: Radii) -> Solids:
    """A round rod between two points with a radius at each of them."""
    return shapes.cone_between(start, end, radius)


@statement("bent_rod", id=70, taught=False, hint=hints.bent)
def bent_rod(start: Position, through: Position, end: Position, radius: Radius) -> Solids:
    """A round rod along the circle from one point through a second to a third."""
    return shapes.arc_through(start, through, end, radius)


@statement("cushion", id=71, taught=False, hint=hints.rounded)
def cushion(at: Position, size: Extent, edge: Radius) -> Solids:
    """A box with rounded edges, from its low front right corner; ``edge`` is the radius of the edges."""
    return shapes.rounded_box(at, size, edge)


@statement("leaning_box", id=72, taught=False, hint=hints.never)
def leaning_box(at: Position, size: Extent, lean: Shift) -> Solids:
    """A box from its low front right corner, whose top is shifted to the rear by ``lean`` (a shear)."""
    return shapes.leaning_box(at, size, lean)


@statement("beam", id=73, taught=False, hint=hints.never)
def beam(start: Position, end: Position, section: Section, axis: Axis, turn: Angle) -> Solids:
    """A bar whose section lies along the other two axes than ``axis``, which it need not run along most."""
    return shapes.bar_between(start, end, section, turn, axis.long() % 3)


@loop("rotate_about", id=81, taught=False)
def rotate_about(copy: Tensor, quarter: Tensor, count: Count, step: Angle, at: Pivot) -> Motion:
    """Repeats the body around the vertical axis through ``at``, ``step`` degrees from copy to copy."""
    return Motion(turn=copy * step / 360, pivot=torch.cat([torch.zeros_like(at[..., :1]), at], -1))


@loop("tilt_about", id=82, taught=False)
def tilt_about(copy: Tensor, quarter: Tensor, count: Count, tilt: Angle, at: Pivot) -> Motion:
    """Leans the body to the rear by ``tilt`` degrees about the left-right axis through ``at`` (up, depth)."""
    axis = torch.full_like(tilt, SIDE, dtype=torch.long)
    return Motion(rotation=shapes.about_axis(axis, tilt), pivot=torch.cat([at, torch.zeros_like(at[..., :1])], -1))


@loop("mirror", id=80, taught=False)
def mirror(copy: Tensor, quarter: Tensor, count: Two, axis: Axis, at: Place = 0) -> Motion:  # type: ignore[assignment]
    """Draws the body and its mirror image along an axis, about the plane across it that lies
    at ``at``."""
    across = shapes.unit(axis.long(), at) * copy[..., None]
    return Motion(shift=2 * at[..., None] * across, signs=1 - 2 * across)


# The statements of the paper are roles that bring their solid along.
for _name, _doc, _label in (
    ("leg", "A leg", "leg"),
    ("top_rectangle", "A rectangular top or seat", "seat"),
    ("top_square", "A square top or seat", "seat"),
    ("top_circle", "A round top or seat", "seat"),
    ("layer", "A shelf or layer", "seat"),
    ("support_cylinder", "A round central support", "leg"),
    ("support_cuboid", "A square central support", "leg"),
    ("base_circle", "A round base plate", "leg"),
    ("base_square", "A square base plate", "leg"),
    ("base_cross", "One arm of a cross base", "leg"),
    ("sideboard", "A side board", "arm"),
    ("horizontal_bar", "A horizontal bar", "leg"),
    ("vertical_board", "A vertical board", "back"),
    ("locker", "A locker, drawer or solid body", "seat"),
    ("back", "The part to lean on", "back"),
    ("chair_beam", "A beam of an arm rest or a back", "arm"),
    ("line", "A round bar", "leg"),
    ("back_support", "A support that carries a back", "back"),
    ("seat", "The part to sit on", "seat"),
    ("top", "The top of a table, desk or cabinet", "seat"),
    ("arm", "An arm rest", "arm"),
    ("arm_post", "The support of an arm rest", "arm"),
    ("headboard", "The board at the head of a bed", "back"),
    ("footboard", "The board at the foot of a bed", "leg"),
    ("mattress", "A mattress", "seat"),
    ("cushion", "A loose cushion of a seat", "seat"),
    ("pillow", "A pillow, or a loose cushion of a back", "back"),
    ("shelf", "A shelf", "leg"),
    ("drawer", "A drawer, or its front", ""),
    ("door", "A door", ""),
    ("handle", "A handle or knob", ""),
    ("side", "A side of a cabinet, shelf or bed", "leg"),
    ("panel", "A panel that closes a frame or a cabinet", "leg"),
    ("body", "A solid body", "seat"),
    ("base", "The part below all others", "leg"),
    ("foot", "A foot under a leg or a body", "leg"),
    ("rail", "A rail along the top of a back or around a bed", "back"),
    ("slat", "One of the slats or spindles of a back", "back"),
    ("post", "An upright post of a back or a frame", "back"),
    ("apron", "A beam under the edge of a seat or top", "leg"),
    ("stretcher", "A beam between legs", "leg"),
    ("brace", "A slanting beam that stiffens a frame", "leg"),
    ("pedestal", "The one column under the middle of a seat or top", "leg"),
    ("block", "A block that joins or props other parts", "leg"),
):
    role(_name, _doc, _label)
