"""Words for the bodies of declarations: solids from corners, centres, ends."""

from __future__ import annotations

from jaxtyping import Float, Int

from shapeprog.geometry.batch import Solids
from shapeprog.geometry.formulas import root as safe_norm
from shapeprog.geometry.primitive import SIZES, Primitive
from shapeprog.geometry.primitives import primitives
from shapeprog.geometry.primitives.arc import ARC
from shapeprog.geometry.primitives.cuboid import CUBOID
from shapeprog.geometry.primitives.cylinder import CYLINDER
from shapeprog.geometry.primitives.frustum import FRUSTUM
from shapeprog.geometry.primitives.rounded_box import ROUNDED_BOX
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import SIDE

Scalar = Float[Tensor, "*batch"]
Pair = Float[Tensor, "*batch 2"]
Vector = Float[Tensor, "*batch 3"]

FLAT = 1e-6  # cells below which three points are in line


def solid(
    primitive: Primitive, centre: Vector, *sizes: Scalar, rotation: Float[Tensor, "*batch 3 3"] | None = None
) -> Solids:
    """A solid of any primitive from its sizes in the order it declares them."""
    zero = torch.zeros_like(centre[..., 0])
    padded = [*sizes, *[zero] * (SIZES - len(sizes))]
    return Solids(primitives.index(primitive), torch.stack(padded, -1), centre, rotation)


def cuboid(centre: Vector, half: Vector, lean: Scalar | None = None) -> Solids:
    """A cuboid from centre and half extents (..., 3); ``lean`` shifts its top against its bottom along depth."""
    return solid(CUBOID, centre, *half.unbind(-1), *([] if lean is None else [lean]))


def box(corner: Vector, extent: Vector) -> Solids:
    """A cuboid from its low front right corner and its full extents."""
    return cuboid(corner + extent / 2, extent / 2)


def slab(at: Vector, thickness: Scalar, half_depth: Scalar, half_side: Scalar) -> Solids:
    """A cuboid from ``at``, the centre of its bottom face."""
    return cuboid(_raised(at, thickness), torch.stack([thickness / 2, half_depth, half_side], -1))


def disc(at: Vector, thickness: Scalar, radius: Scalar) -> Solids:
    """An upright cylinder from ``at``, the centre of its bottom face."""
    return solid(CYLINDER, _raised(at, thickness), thickness / 2, radius)


def bar(start: Vector, end: Vector, radius: Scalar) -> Solids:
    """A cylinder between two points, with flat caps."""
    along = end - start
    return solid(CYLINDER, (start + end) / 2, safe_norm((along**2).sum(-1)) / 2, radius, rotation=align(along))


def cone_between(start: Vector, end: Vector, radii: Pair) -> Solids:
    """A cone between two points, cut across its axis, with a radius at each of them."""
    along = end - start
    half = safe_norm((along**2).sum(-1)) / 2
    return solid(FRUSTUM, (start + end) / 2, half, *radii.unbind(-1), rotation=align(along))


def tilted_box(at: Vector, size: Vector, tilt: Scalar) -> Solids:
    """A cuboid from its low front right corner, turned to the rear by ``tilt`` degrees about the bottom front edge."""
    rotation = about_axis(torch.full_like(tilt, SIDE, dtype=torch.long), tilt)
    half = size / 2
    return solid(CUBOID, at + (rotation @ half[..., None])[..., 0], *half.unbind(-1), rotation=rotation)


def leaning_box(at: Vector, size: Vector, lean: Scalar) -> Solids:
    """A cuboid from its low front right corner, whose top is shifted to the rear by ``lean``."""
    shift = torch.stack([torch.zeros_like(lean), lean / 2, torch.zeros_like(lean)], -1)
    return cuboid(at + size / 2 + shift, size / 2, lean=lean)


def bar_between(
    start: Vector, end: Vector, section: Pair, turn: Scalar, main: Int[Tensor, "*batch"] | None = None
) -> Solids:
    """A cuboid between two points, turned about them by ``turn`` degrees.

    The sides of its section lie along the grid axes other than ``main``, in their order, and are leaned with it; the
    default of ``main`` is the axis that it runs along most.
    """
    along = end - start
    length = safe_norm((along**2).sum(-1))
    main = along.detach().abs().argmax(-1) if main is None else main
    first, second = torch.where(main == 0, 1, 0), torch.where(main == 2, 1, 2)
    half = length[..., None] * unit(main, along) + section[..., :1] * unit(first, along)
    half = (half + section[..., 1:] * unit(second, along)) / 2
    rotation = leaned(along, main) @ about_axis(main, turn)
    return solid(CUBOID, (start + end) / 2, *half.unbind(-1), rotation=rotation)


def arc_through(start: Vector, through: Vector, end: Vector, radius: Scalar) -> Solids:
    """A round rod along the circle from one point through a second to a third."""
    chord, middle = end - start, (start + end) / 2
    frame = align(chord)
    half = safe_norm((chord**2).sum(-1)) / 2
    along = ((through - middle) * frame[..., 0]).sum(-1)
    away = through - middle - along[..., None] * frame[..., 0]
    height = safe_norm((away**2).sum(-1))
    bulge = torch.where((height > FLAT)[..., None], away / height[..., None], frame[..., 1])
    # The height of the circle over its chord; nothing cancels where the three points are nearly in line.
    difference = half**2 - along**2 - height**2
    root = safe_norm(4 * height**2 * half**2 + difference**2)
    sagitta = 2 * height * half**2 / (root + difference).clamp(min=1e-9)
    rotation = torch.stack([frame[..., 0], bulge, torch.linalg.cross(frame[..., 0], bulge)], -1)
    return solid(ARC, middle + bulge * sagitta[..., None] / 2, half, radius, sagitta, rotation=rotation)


def rounded_box(at: Vector, size: Vector, edge: Scalar) -> Solids:
    """A box from its low front right corner, with edges rounded to the radius ``edge``."""
    return solid(ROUNDED_BOX, at + size / 2, *(size / 2).unbind(-1), edge)


def align(direction: Vector) -> Float[Tensor, "*batch 3 3"]:
    """A rotation whose first column points along ``direction``; up for a zero vector.

    The other two columns come from the grid axis that is about farthest from the direction, so the gradient is finite.
    Near an axis of the grid, and for legs that lean as much sideways as backwards, it is the same one, so differences
    are those of one frame.
    """
    length = safe_norm((direction**2).sum(-1, keepdim=True))
    up = torch.zeros_like(direction)
    up[..., 0] = 1
    first = torch.where(length > 1e-9, direction / length, up)
    away = first.detach().abs().clamp(min=1e-3) * torch.tensor([1.0, 1.1, 1.2]).to(first)
    helper = unit(away.argmin(-1), direction)
    second = torch.linalg.cross(first, helper)
    second = second / safe_norm((second**2).sum(-1, keepdim=True))
    return torch.stack([first, second, torch.linalg.cross(first, second)], -1)


def leaned(direction: Vector, axis: Int[Tensor, "*batch"]) -> Float[Tensor, "*batch 3 3"]:
    """The least rotation that brings a grid axis onto the line along ``direction``; none for a zero vector.

    The other two columns are the other grid axes, leaned as little as can be.
    """
    length = safe_norm((direction**2).sum(-1, keepdim=True))
    main = unit(axis, direction)
    along = torch.where(length > 1e-9, direction / length, main)
    along = along * torch.where((along * main).sum(-1, keepdim=True) < 0, -1.0, 1.0).to(along)
    cross = _cross(torch.linalg.cross(main, along))
    cos = (along * main).sum(-1)[..., None, None]
    return torch.eye(3, device=main.device).to(main) + cross + cross @ cross / (1 + cos)


def about_axis(axis: Int[Tensor, "*batch"], degrees: Scalar) -> Float[Tensor, "*batch 3 3"]:
    """Rotation about a grid axis, counter-clockwise seen from its end."""
    angle = torch.deg2rad(degrees)[..., None, None]
    cross = _cross(unit(axis, angle))
    return torch.eye(3, device=angle.device).to(angle) + angle.sin() * cross + (1 - angle.cos()) * cross @ cross


def unit(axis: Int[Tensor, "*batch"], like: Tensor) -> Vector:
    """The unit vector along a grid axis, in the type of another tensor."""
    return torch.nn.functional.one_hot(axis, 3).to(like)


def _cross(vector: Vector) -> Float[Tensor, "*batch 3 3"]:
    """The matrix that takes the cross product with ``vector`` from the left."""
    (a, b, c), zero = vector.unbind(-1), torch.zeros_like(vector[..., 0])
    return torch.stack([zero, -c, b, c, zero, -a, -b, a, zero], -1).unflatten(-1, (3, 3))


def _raised(at: Vector, thickness: Scalar) -> Vector:
    return torch.stack([at[..., 0] + thickness / 2, at[..., 1], at[..., 2]], -1)
