"""One declaration per primitive: formulas of distance, surface and size, and a mesh; everything else is derived.

A primitive lives in a local frame with its centre at the origin and its axis along local axis 0, and has up to four
sizes.  It is its own mirror image along local axis 2, so that mirroring a scene turns its primitives only.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy.typing as npt
from jaxtyping import Float, Int

from shapeprog.geometry.formulas import Node, Number, generated, gradient
from shapeprog.kernels.compile import helper
from shapeprog.kernels.table import SIZE
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import Array, FloatArray

SIZES = 4  # slots for the sizes of one primitive
Mesh = tuple[FloatArray, npt.NDArray[Any]]  # vertices (V, 3) and faces (F, 3), counter-clockwise from outside

Points = Float[Tensor, "*batch 3"]
Sizes = Float[Tensor, "*batch 4"]
Scalars = Float[Tensor, "*batch"]
Faces = Int[Tensor, "*batch"]
Formula = Callable[..., Any]
Helper = Callable[..., Any]

_SIZES = tuple(Node(f"table[row, {SIZE + slot}]") for slot in range(SIZES))
_POINT, _UNIT, _SLOPE = (tuple(map(Node, names)) for names in (("a", "b", "c"), ("u", "v", "w"), ("da", "db", "dc")))
_FACE, _UNIFORM = Node("face"), tuple(map(Node, ("one", "two", "three")))


@helper
def tested(table: Array, row: int, square: bool, planes: Array, plane: int, low: Array, high: Array) -> bool:
    """Cells of a primitive without a special rule: those whose centre is inside."""
    return False


class Primitive:
    """A kind of solid that statements can draw.

    Its methods are vectorised over leading batch dimensions and differentiable in the sizes; its helpers for kernels
    do the same for one row of the table, see ``kernels.table``.

    Parameters
    ----------
    name, sizes, extents
        Names of the primitive and of its sizes, at most four; the first ``extents`` are lengths, never negative.
    distance
        Formula ``(size, point)``: exact signed distance in the local frame, negative inside, with a finite gradient.
    value
        Formula ``(size, point)``: the same, where that is cheaper without slopes.
    excess
        Formula ``(size, point)``: its sign is that of the distance, and it is cheaper to compute.
    bound, areas, volume
        Formulas of ``size``: half extents of the box around it, centred at the origin; areas of the faces that
        ``sample`` numbers; exact volume.
    sample
        Formula ``(size, face, uniform)``: the unit place on a face for three uniform numbers in [0, 1), such that
        ``place(size, unit)`` is uniform by area.
    place, normal
        Formulas ``(size, unit)`` and ``(size, unit, face)``: surface point of a unit place, and its outward normal.
    mesh
        ``size (4,) -> Mesh``: watertight triangles.
    cells
        Helper ``(table, row, square, planes, plane, low, high) -> bool``: where cells follow a special rule, fill them
        and return true; else the sizes in the row may be changed to those by which cells are tested.  All is in cells;
        ``square`` is whether the axes are parallel to those of the grid; ``low`` and ``high`` (3,) are scratch.
        A solid that is not convex fills all of its cells here.
    """

    def __init__(
        self,
        name: str,
        sizes: tuple[str, ...],
        extents: int,
        *,
        distance: Formula,
        excess: Formula,
        bound: Formula,
        areas: Formula,
        volume: Formula,
        sample: Formula,
        place: Formula,
        normal: Formula,
        mesh: Callable[[FloatArray], Mesh],
        value: Formula | None = None,
        cells: Helper = tested,
    ) -> None:
        self.name, self.sizes, self.extents, self.mesh = name, sizes, extents, mesh
        self._distance, self._bound, self._areas, self._volume = distance, bound, areas, volume
        self._sample, self._place, self._normal = sample, place, normal
        away, placed, triple = (value or distance)(_SIZES, _POINT), place(_SIZES, _UNIT), "return {}, {}, {}"
        slopes = gradient([distance(_SIZES, _POINT)], [1.0], [*_POINT, *_SIZES])
        self.kernels: dict[str, Helper] = {
            "cells": cells,
            "distance": generated("distance", "table, row, a, b, c", "return {}", [away]),
            "excess": generated("excess", "table, row, a, b, c", "return {}", [excess(_SIZES, _POINT)]),
            "slopes": generated("slopes", "table, row, a, b, c, out", _assigned("out[{}] = {{}}", range(7)), slopes),
            "bound": generated("bound", "table, row", triple, bound(_SIZES)),
            "sample": generated("sample", "table, row, face, one, two, three", triple, sample(_SIZES, _FACE, _UNIFORM)),
            "place": generated("place", "table, row, u, v, w", triple, placed),
            "normal": generated("normal", "table, row, face, u, v, w", triple, normal(_SIZES, _UNIT, _FACE)),
            "pull": generated(
                "pull", "table, row, u, v, w, da, db, dc, out",
                _assigned("out[row, {}] += {{}}", range(SIZE, SIZE + SIZES)), gradient(placed, _SLOPE, _SIZES),
            ),
        }  # fmt: skip

    def distance(self, points: Points, size: Sizes) -> Scalars:
        """Exact signed distance of points in the local frame."""
        return self._distance(size.unbind(-1), points.unbind(-1))

    def bound(self, size: Sizes) -> Points:
        """Half extents of the box around the solid."""
        return _join(self._bound(size.unbind(-1)), size)

    def areas(self, size: Sizes) -> Float[Tensor, "*batch faces"]:
        """Areas of its faces."""
        return _join(self._areas(size.unbind(-1)), size)

    def volume(self, size: Sizes) -> Scalars:
        """Its volume."""
        return self._volume(size.unbind(-1))

    def sample(self, size: Sizes, face: Faces, uniform: Points) -> Points:
        """Unit places on faces."""
        return _join(self._sample(size.unbind(-1), face, uniform.unbind(-1)), uniform)

    def place(self, size: Sizes, unit: Points) -> Points:
        """Surface points of unit places."""
        return _join(self._place(size.unbind(-1), unit.unbind(-1)), unit)

    def normal(self, size: Sizes, unit: Points, face: Faces) -> Points:
        """Outward unit normals at unit places."""
        return _join(self._normal(size.unbind(-1), unit.unbind(-1), face), unit)


def _assigned(line: str, slots: range) -> str:
    return "; ".join(line.format(slot) for slot in slots)


def _join(numbers: tuple[Number, ...], like: Tensor) -> Tensor:
    zero = torch.zeros_like(like[..., 0])
    return torch.stack([number if type(number) is type(zero) else zero + number for number in numbers], -1).to(like)


def __getattr__(name: str) -> Any:
    """The tuple ``primitives`` of :mod:`shapeprog.geometry.primitives`, where release 0.1.0 had it."""
    if name == "primitives":
        return import_module("shapeprog.geometry.primitives").primitives
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
