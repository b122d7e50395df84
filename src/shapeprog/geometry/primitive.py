"""One declaration per primitive: distance, surface, mesh and size; everything else is derived from it.

A primitive lives in a local frame with its centre at the origin and its axis along local axis 0, and has up to
four sizes.  All functions are vectorised over leading batch dimensions and differentiable in the sizes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Float, Int
from torch import Tensor

from shapeprog.errors import DeclarationError

SIZES = 4
"""Slots for the sizes of one primitive."""

Mesh = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]
"""Vertices (V, 3) and faces (F, 3), counter-clockwise from outside."""

Points = Float[Tensor, "*batch 3"]
Sizes = Float[Tensor, "*batch 4"]
Scalars = Float[Tensor, "*batch"]


@dataclass(frozen=True)
class Primitive:
    """A kind of solid that statements can draw.

    Parameters
    ----------
    name
        What declarations and exports call it.
    sizes
        Names of the sizes in use, at most four.  The first ``extents`` of them are lengths that must not be negative.
    extents
        How many of the sizes are lengths.
    distance
        ``(points (..., 3), size (..., 4)) -> (...)``: exact signed Euclidean distance in the local frame, negative
        inside, with a finite gradient everywhere.
    bound
        ``size -> (..., 3)``: half extents of the local bounding box, which is centred at the origin.
    areas
        ``size -> (..., F)``: area of each of the F faces that ``sample`` knows.
    sample
        ``(size, face (...), u (..., 3)) -> unit (..., 3)``: place on a face for three uniform numbers in [0, 1), such
        that ``place(size, unit)`` is uniform by area.  Called without gradient.
    place
        ``(size, unit) -> (..., 3)``: the surface point of a unit place, with gradient to the sizes.
    normal
        ``(size, unit, face) -> (..., 3)``: outward unit normal there.
    mesh
        ``size (4,) -> Mesh``: watertight triangles.
    volume
        ``size -> (...)``: exact volume.
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
    mesh: Callable[[npt.NDArray[np.float64]], Mesh]
    volume: Callable[[Sizes], Scalars]


class Primitives:
    """The registry of primitives: a kind is the index of its declaration."""

    def __init__(self) -> None:
        self._kinds: list[Primitive] = []

    def register(self, primitive: Primitive) -> Primitive:
        """Add a primitive and return it.

        Raises
        ------
        DeclarationError
            If the name is taken, the sizes do not fit the four slots, or a function fails or returns a wrong shape.
        """
        if any(known.name == primitive.name for known in self._kinds):
            raise DeclarationError(f"primitive {primitive.name!r} is declared twice", "give one of them another name")
        if not 1 <= len(primitive.sizes) <= SIZES or not 0 <= primitive.extents <= len(primitive.sizes):
            raise DeclarationError(
                f"primitive {primitive.name!r} has {len(primitive.sizes)} sizes, {primitive.extents} of them lengths",
                f"a primitive has 1 to {SIZES} sizes",
            )
        _try(primitive)
        self._kinds.append(primitive)
        return primitive

    def shorten(self, length: int) -> None:
        """Forget the newest primitives beyond ``length``, as when the module that declares them fails."""
        del self._kinds[length:]

    def kind(self, name: str) -> int:
        """Index of the primitive called ``name``.

        Raises
        ------
        DeclarationError
            If there is none.
        """
        for index, primitive in enumerate(self._kinds):
            if primitive.name == name:
                return index
        known = ", ".join(primitive.name for primitive in self._kinds)
        raise DeclarationError(f"no primitive is called {name!r}", f"known are {known}")

    def __getitem__(self, kind: int) -> Primitive:
        return self._kinds[kind]

    def __len__(self) -> int:
        return len(self._kinds)

    def __iter__(self) -> Iterator[Primitive]:
        return iter(self._kinds)


primitives = Primitives()
"""All primitives known to this process, cuboid and cylinder first."""


def safe_norm(squared: Scalars) -> Scalars:
    """Square root whose gradient is zero, not infinite, at zero."""
    return torch.sqrt(squared.clamp(min=1e-24))


def _try(primitive: Primitive) -> None:
    """Call every function once, so that a wrong shape is refused now and not amid a run."""
    size, points, face = torch.ones(2, SIZES), torch.full((2, 3), 0.5), torch.zeros(2, dtype=torch.long)
    word = "sample"
    try:
        unit = primitive.sample(size, face, points)
        calls: dict[str, tuple[Callable[[], Tensor], tuple[int | None, ...]]] = {
            "sample": (lambda: unit, (2, 3)),
            "distance": (lambda: primitive.distance(points, size), (2,)),
            "bound": (lambda: primitive.bound(size), (2, 3)),
            "areas": (lambda: primitive.areas(size), (2, None)),
            "place": (lambda: primitive.place(size, unit), (2, 3)),
            "normal": (lambda: primitive.normal(size, unit, face), (2, 3)),
            "volume": (lambda: primitive.volume(size), (2,)),
            "mesh": (lambda: torch.as_tensor(primitive.mesh(np.ones(SIZES))[0]), (None, 3)),
        }
        for word, (call, wanted) in calls.items():
            found = tuple(call().shape)
            if len(found) != len(wanted) or any(w not in (None, f) for f, w in zip(found, wanted, strict=True)):
                raise DeclarationError(
                    f"{word} of primitive {primitive.name!r} returns shape {found}",
                    f"for 2 sizes it should be {wanted}".replace("None", "any number"),
                )
    except DeclarationError:
        raise
    except Exception as cause:
        raise DeclarationError(
            f"{word} of primitive {primitive.name!r} fails: {cause}",
            "it gets sizes (..., 4) and what else Primitive says, with any leading dimensions",
        ) from cause
