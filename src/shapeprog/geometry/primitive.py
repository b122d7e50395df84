"""One declaration per primitive: distance, surface, mesh and size; everything else is derived from it.

A primitive lives in a local frame with its centre at the origin and its axis along local axis 0, and has up to
four sizes.  It is its own mirror image along local axis 2, so that mirroring a scene turns its primitives only.  All
functions are vectorised over leading batch dimensions and differentiable in the sizes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from jaxtyping import Float, Int

from shapeprog.errors import DeclarationError
from shapeprog.kernels.compile import helper
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import Array, FloatArray

SIZES = 4  # slots for the sizes of one primitive
Mesh = tuple[FloatArray, npt.NDArray[np.int64]]  # vertices (V, 3) and faces (F, 3), counter-clockwise from outside

Points = Float[Tensor, "*batch 3"]
Sizes = Float[Tensor, "*batch 4"]
Scalars = Float[Tensor, "*batch"]
Helper = Callable[..., Any]
Triple = tuple[float, float, float]


@helper
def tested(table: Array, row: int, square: bool, planes: Array, plane: int, low: Array, high: Array) -> bool:
    """Cells of a primitive without a special rule: those whose centre is inside."""
    return False


@dataclass(frozen=True)
class Kernels:
    """Twins of the functions of a primitive: helpers that take ``(table, row, ...)``, see ``kernels.table``.

    Parameters
    ----------
    distance, slopes
        ``(..., a, b, c)``: signed distance of a local point; with ``out`` (7,) to fill with its derivatives by a, b, c
        and the four sizes.
    bound
        ``(...)``: three half extents of the local bounding box.
    excess
        ``(..., a, b, c)``: negative inside, zero on the surface, positive outside; need not be a distance.
    sample, place, normal
        ``(..., face, one, two, three)`` to a unit place; ``(..., u, v, w)`` to a local point; ``(..., face, u, v, w)``
        to a local normal.
    pull
        ``(..., u, v, w, da, db, dc, out)``: add to out (rows, WIDTH) the gradient by the sizes of a placed point,
        given that by its local coordinates.
    cells
        ``(..., square, planes, plane, low, high) -> bool``: where cells follow a special rule, fill them and return
        true; else the sizes in the row may be changed to those by which cells are tested.  All is in cells; ``square``
        is whether the axes are parallel to those of the grid; ``low`` and ``high`` (3,) are scratch.  A solid that is
        not convex fills all of its cells here.
    """

    distance: Helper
    slopes: Helper
    bound: Helper
    excess: Helper
    sample: Helper
    place: Helper
    normal: Helper
    pull: Helper
    cells: Helper = tested


@dataclass(frozen=True)
class Primitive:
    """A kind of solid that statements can draw.

    Parameters
    ----------
    name, sizes, extents
        Names of the primitive and of its sizes, at most four; the first ``extents`` are lengths, never negative.
    distance
        ``(points (..., 3), size (..., 4)) -> (...)``: exact signed distance in the local frame, negative inside, with a
        finite gradient everywhere.
    bound, areas, volume
        Of a size: half extents (..., 3) of the box around it, centred at the origin; areas (..., F) of the faces that
        ``sample`` numbers; exact volume (...).
    sample
        ``(size, face (...), u (..., 3)) -> unit (..., 3)``: place on a face for three uniform numbers in [0, 1), such
        that ``place(size, unit)`` is uniform by area.  Called without gradient.
    place, normal
        ``(size, unit) -> (..., 3)``: surface point of a unit place, with gradient to the sizes; ``(size, unit, face)``
        to the outward unit normal there.
    mesh
        ``size (4,) -> Mesh``: watertight triangles.
    kernels
        Its twins for kernels; without them the functions above are used everywhere, which is slower.
    """

    name: str
    sizes: tuple[str, ...]
    extents: int
    distance: Callable[[Points, Sizes], Scalars]
    bound: Callable[[Sizes], Points]
    areas: Callable[[Sizes], Float[Tensor, "*batch faces"]]
    sample: Callable[[Sizes, Int[Tensor, "*batch"], Points], Points]
    place: Callable[[Sizes, Points], Points]
    normal: Callable[[Sizes, Points, Int[Tensor, "*batch"]], Points]
    mesh: Callable[[FloatArray], Mesh]
    volume: Callable[[Sizes], Scalars]
    kernels: Kernels | None = None


class Primitives:
    """The registry: the kind of a primitive is its number in this process, which no other ever gets.

    Names are those of the language in force; a scene may hold primitives that the language does not name.
    """

    def __init__(self) -> None:
        self._kinds: list[Primitive] = []
        self._names: ContextVar[dict[str, int]] = ContextVar("names", default={})  # noqa: B039

    def register(self, primitive: Primitive) -> Primitive:
        """Add a primitive and return it.

        A ``DeclarationError`` if its name is taken, or its sizes or what its functions return do not fit.
        """
        message = f"primitive {primitive.name!r}"
        if primitive.name in self.names:
            raise DeclarationError(f"{message} is declared twice", "give one of them another name")
        if not 1 <= len(primitive.sizes) <= SIZES or not 0 <= primitive.extents <= len(primitive.sizes):
            message += f" has {len(primitive.sizes)} sizes, {primitive.extents} of them lengths"
            raise DeclarationError(message, f"a primitive has 1 to {SIZES} sizes")
        if not all(ships(value) for value in vars(primitive).values() if callable(value)):
            _try(primitive)
        self._kinds.append(primitive)
        self.names[primitive.name] = len(self._kinds) - 1
        return primitive

    @property
    def names(self) -> dict[str, int]:
        """Kinds by the names in force."""
        return self._names.get()

    @contextmanager
    def using(self, names: dict[str, int]) -> Iterator[None]:
        """Put other names in force for a while; primitives registered meanwhile are added to them."""
        token = self._names.set(names)
        try:
            yield
        finally:
            self._names.reset(token)

    def kind(self, name: str) -> int:
        """Number of the primitive called ``name``; a ``DeclarationError`` if there is none."""
        if name not in self.names:
            raise DeclarationError(f"unknown primitive {name!r}", f"known: {', '.join(self.names)}")
        return self.names[name]

    def number(self, primitive: Primitive) -> int:
        """The kind of a registered primitive, whatever language is in force."""
        return next(kind for kind, registered in enumerate(self._kinds) if registered is primitive)

    def __getitem__(self, kind: int) -> Primitive:
        return self._kinds[kind]

    def __len__(self) -> int:
        return len(self._kinds)

    def __iter__(self) -> Iterator[Primitive]:
        return iter(self._kinds)


primitives = Primitives()
"""All primitives known to this process; the built-in ones are those of :mod:`shapeprog.geometry.primitives`."""


def ships(function: Callable[..., Any]) -> bool:
    """Whether a function of a declaration comes with the package, whose tests try all of those."""
    return function.__module__.startswith("shapeprog.")


def safe_norm(squared: Scalars) -> Scalars:
    """Square root whose gradient is zero, not infinite, at zero."""
    return torch.sqrt(squared.clamp(min=1e-24))


def _try(primitive: Primitive) -> None:
    """Call every function once, so that a wrong shape is refused now and not amid a run."""
    size, points, face = torch.ones(2, SIZES), torch.full((2, 3), 0.5), torch.zeros(2, dtype=torch.long)
    calls: dict[str, tuple[tuple[Any, ...], tuple[int | None, ...]]] = {
        "sample": ((size, face, points), (2, 3)),
        "distance": ((points, size), (2,)),
        "bound": ((size,), (2, 3)),
        "areas": ((size,), (2, None)),
        "place": ((size, points), (2, 3)),
        "normal": ((size, points, face), (2, 3)),
        "volume": ((size,), (2,)),
        "mesh": ((np.ones(SIZES),), (None, 3)),
    }
    for word, (arguments, expected) in calls.items():
        try:
            result = getattr(primitive, word)(*arguments)
            shape = tuple((result[0] if word == "mesh" else result).shape)
        except Exception as cause:
            message = f"{word} of primitive {primitive.name!r} fails: {cause}"
            hint = "it gets sizes (..., 4) and the other arguments of Primitive, with any leading dimensions"
            raise DeclarationError(message, hint) from cause
        if len(shape) != len(expected) or any(w not in (None, f) for f, w in zip(shape, expected, strict=True)):
            message = f"{word} of primitive {primitive.name!r} returns shape {shape}"
            raise DeclarationError(message, f"for 2 sizes it should be {expected}".replace("None", "any number"))
    sample_points = torch.tensor([[0.9, 0.7, 0.8], [-0.6, 1.3, 0.4], [0.3, -0.5, 1.1], [-1.2, -0.2, 0.6]])
    mirrored = sample_points * torch.tensor([1.0, 1.0, -1.0])
    sizes = torch.tensor([1.0, 0.8, 0.6, 0.4]).expand(4, SIZES)
    if not torch.allclose(primitive.distance(sample_points, sizes), primitive.distance(mirrored, sizes), atol=1e-5):
        message = f"primitive {primitive.name!r} is not its own mirror image along its local axis 2"
        raise DeclarationError(message, "turn its local frame: one of its planes of symmetry must lie across that axis")
