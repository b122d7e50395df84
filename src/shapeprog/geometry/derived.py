"""Primitives from formulas: one declaration, from which functions on tensors and helpers for kernels follow."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from shapeprog.geometry.formulas import Node, Number, generated, gradient
from shapeprog.geometry.primitive import SIZES, Helper, Kernels, Mesh, Primitive, tested
from shapeprog.kernels.table import SIZE
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import FloatArray

Formula = Callable[..., Any]

_SIZES = tuple(Node(f"table[row, {SIZE + slot}]") for slot in range(SIZES))
_POINT, _UNIT, _SLOPE = (tuple(map(Node, names)) for names in (("a", "b", "c"), ("u", "v", "w"), ("da", "db", "dc")))
_FACE, _UNIFORM = Node("face"), tuple(map(Node, ("one", "two", "three")))


def solid(
    name: str,
    sizes: tuple[str, ...],
    extents: int,
    *,
    distance: Formula,
    excess: Formula,
    bound: Formula,
    areas: Formula,
    sample: Formula,
    place: Formula,
    normal: Formula,
    mesh: Callable[[FloatArray], Mesh],
    volume: Formula,
    cells: Helper = tested,
) -> Primitive:
    """A primitive from formulas of its sizes, see :class:`Primitive`.

    Parameters
    ----------
    distance
        ``(size, point)``: signed distance.
    excess
        ``(size, point)``: its sign is that of the distance, and it is cheaper to compute.
    bound, areas, volume
        Of ``size``.
    sample, place, normal
        ``(size, face, uniform)``, ``(size, unit)`` and ``(size, unit, face)``.
    cells
        See :class:`Kernels`.
    """
    away, placed = distance(_SIZES, _POINT), place(_SIZES, _UNIT)
    triple = "return {}, {}, {}"
    kernels = Kernels(
        distance=generated("distance", "table, row, a, b, c", "return {}", [away]),
        slopes=generated(
            "slopes", "table, row, a, b, c, out", _assigned("out[{}] = {{}}", range(3 + SIZES)),
            gradient([away], [1.0], [*_POINT, *_SIZES]),
        ),
        bound=generated("bound", "table, row", triple, bound(_SIZES)),
        excess=generated("excess", "table, row, a, b, c", "return {}", [excess(_SIZES, _POINT)]),
        sample=generated("sample", "table, row, face, one, two, three", triple, sample(_SIZES, _FACE, _UNIFORM)),
        place=generated("place", "table, row, u, v, w", triple, placed),
        normal=generated("normal", "table, row, face, u, v, w", triple, normal(_SIZES, _UNIT, _FACE)),
        pull=generated(
            "pull", "table, row, u, v, w, da, db, dc, out",
            _assigned("out[row, {}] += {{}}", range(SIZE, SIZE + SIZES)), gradient(placed, _SLOPE, _SIZES),
        ),
        cells=cells,
    )  # fmt: skip
    return Primitive(
        name, sizes, extents,
        distance=lambda points, size: distance(_split(size), _split(points)),
        bound=_joined(bound),
        areas=_joined(areas),
        sample=lambda size, face, u: _join(sample(_split(size), face, _split(u)), u),
        place=lambda size, unit: _join(place(_split(size), _split(unit)), unit),
        normal=lambda size, unit, face: _join(normal(_split(size), _split(unit), face), unit),
        mesh=mesh,
        volume=lambda size: volume(_split(size)),
        kernels=kernels,
    )  # fmt: skip


def _assigned(line: str, slots: range) -> str:
    return "; ".join(line.format(slot) for slot in slots)


def _joined(formula: Formula) -> Callable[[Tensor], Tensor]:
    return lambda size: _join(formula(_split(size)), size)


def _split(numbers: Tensor) -> tuple[Number, ...]:
    return numbers.unbind(-1)


def _join(numbers: tuple[Number, ...], like: Tensor) -> Tensor:
    zero = torch.zeros_like(like[..., 0])
    return torch.stack([number if type(number) is type(zero) else zero + number for number in numbers], -1).to(like)
