"""Sliders of a page: the position of every corner as a named number of a program changes.

The page cannot draw statements, which may be a user's own.  It has the meshes for a few values of each number and
interpolates linearly between them, which is exact wherever corners depend linearly on a number.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.formats.parts import Part, part_normals, parts
from shapeprog.language.dimensions import lengths
from shapeprog.language.named import Named, names, set
from shapeprog.language.program import Program
from shapeprog.language.unit import Unit
from shapeprog.space import Array

REACH = 0.5  # farthest from a number that its slider goes, as a share of it, within the range of the name
SHARES = (1.0, 0.5)  # values that are drawn on either side, as shares of the way to the end of the slider
LEAST = 1.0  # magnitude assumed for smaller numbers, so that a zero can be dragged; for lengths in cells
STRAIGHT = 1e-3  # difference in cells below which the path of a corner is linear
MOST = 400_000  # most triangle corners of all meshes of a page; with more it has no sliders


@dataclass(frozen=True)
class Slider:
    """A number to drag.

    Parameters
    ----------
    name, value
        Its name and value.
    low, high
        Range of the slider.
    unit
        Unit of a length that is not in cells, else empty.
    places
        For some other values the corners (F, 3, 6) of the triangles of each part, positions and normals; ``None`` for
        parts that do not move.  One value suffices if all corners move linearly.
    """

    name: str
    value: float
    low: float
    high: float
    unit: str
    places: dict[float, list[Array | None]]


def sliders(program: Program, unchanged: Sequence[Part]) -> list[Slider]:
    """The free numbers of a program, except for those that change how many parts there are or how they are divided.

    Parameters
    ----------
    unchanged
        The parts of the unchanged program.
    """
    free = [named for named in names(program) if named.free]
    if len(free) * 2 * len(SHARES) * sum(3 * len(part.faces) for part in unchanged) > MOST:
        return []
    unit, measured = program.unit, lengths(program)
    result = (_slider(program, unchanged, named, unit if named.name in measured else None) for named in free)
    return [slider for slider in result if slider is not None]


def pieces(text: str, movable: Sequence[str]) -> list[tuple[str, str]] | None:
    """A line as alternating text and owner: ``width = `` has no owner, ``10`` belongs to ``width``.
    ``None`` for lines that assign a number to none of these names."""
    try:
        (line,) = ast.parse(text.strip()).body
    except (SyntaxError, ValueError):  # the head of a loop
        return None
    if not isinstance(line, ast.Assign):
        return None
    (target,) = line.targets
    named = target.elts if isinstance(target, ast.Tuple) else [target]
    values = line.value.elts if isinstance(line.value, ast.Tuple) else [line.value]
    start, last, result = len(text) - len(text.lstrip()), 0, list[tuple[str, str]]()
    for name, value in zip(named, values, strict=True):
        if isinstance(name, ast.Name) and name.id in movable:
            first, end = start + value.col_offset, start + (value.end_col_offset or 0)
            result += [(text[last:first], ""), (text[first:end], name.id)]
            last = end
    return [*result, (text[last:], "")] if result else None


def corners_of(solids: Sequence[Part]) -> list[Array]:
    """The corners of the triangles of parts (F, 3, 6): positions and normals."""
    return [
        np.concatenate([part.vertices[part.faces], normals], -1)
        for part, normals in zip(solids, part_normals(solids), strict=True)
    ]


def _slider(program: Program, unchanged: Sequence[Part], named: Named, unit: Unit | None) -> Slider | None:
    start, name, value = corners_of(unchanged), named.name, named.value
    smallest = LEAST if unit is None else LEAST * unit.per_cell
    size, (low, high) = REACH * max(abs(value), smallest), named.range or (value, value)
    ends = max(low, value - size), min(high, value + size)
    tried = [value + share * (end - value) for end in ends for share in SHARES if end != value]
    places = dict(_places(program, unchanged, start, name, tried))
    if not places or all(part is None for corners in places.values() for part in corners):
        return None
    low, high = min(*places, value), max(*places, value)
    far = max(places, key=lambda at: abs(at - value))
    straight = all(
        _straight(before, after, last, (at - value) / (far - value))
        for at, corners in places.items()
        for before, after, last in zip(start, corners, places[far], strict=True)
    )
    return Slider(name, value, low, high, unit.name if unit else "", {far: places[far]} if straight else places)


def _places(
    program: Program, unchanged: Sequence[Part], start: list[Array], name: str, numbers: Sequence[float]
) -> Iterator[tuple[float, list[Array | None]]]:
    """The corners of moving parts for each value that yields the same number of triangles."""
    for at in numbers:
        try:
            moved = parts(set(program, {name: at}))
        except ShapeProgError:
            continue
        if [part.faces.shape for part in moved] != [part.faces.shape for part in unchanged]:
            continue
        yield (
            at,
            [
                None if np.abs(after - before).max(initial=0) < STRAIGHT / 10 else after
                for before, after in zip(start, corners_of(moved), strict=True)
            ],
        )


def _straight(before: Array, after: Array | None, last: Array | None, share: float) -> bool:
    """Whether corners lie on a straight path to their last position."""
    end = before if last is None else last
    position = before if after is None else after
    return bool(np.abs(before + share * (end - before) - position).max(initial=0) < STRAIGHT)
